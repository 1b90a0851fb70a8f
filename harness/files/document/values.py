"""Rules for one attribute of a model file: numbers that pass a check, a word, or any text.

Numbers are decimal and finite: what strtod reads beyond that (hexadecimal, nan, inf) engines take in
silence and answer with NaN.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable
from dataclasses import dataclass

from harness.files.document.xml import shorten
from harness.library import nearest

UNIT_TOLERANCE = 1e-6
_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_SPACE = re.compile(r"[ \t\r\n]+")

Check = Callable[[tuple[float, ...]], str | None]


def not_negative(values: tuple[float, ...]) -> str | None:
    """A check: zero or more."""
    return "is negative; expected zero or more" if min(values) < 0 else None


def positive(values: tuple[float, ...]) -> str | None:
    """A check: more than zero."""
    return "is not positive; expected more than zero" if min(values) <= 0 else None


def whole(values: tuple[float, ...]) -> str | None:
    """A check: a number of times, which is 1 or more."""
    return None if values[0] >= 1 and values[0].is_integer() else "is no number of times; expected 1, 2, 3, ..."


def not_zero(values: tuple[float, ...]) -> str | None:
    """A check: a direction or a rotation needs a length."""
    return None if any(values) else "is zero; expected a direction or rotation"


def one_sign(values: tuple[float, ...]) -> str | None:
    """A check: all positive or none, which says which of two meanings a pair has."""
    return "mixes signs; expected both positive, or none" if len({value > 0 for value in values}) > 1 else None


def unit(values: tuple[float, ...]) -> str | None:
    """A check: a vector of length one."""
    length = math.hypot(*values)
    if length == 0:
        return "is zero; expected a unit vector"
    return None if abs(length - 1) <= UNIT_TOLERANCE else f"has length {length:.6g}; expected a unit vector"


def no_dry_friction(values: tuple[float, ...]) -> str | None:
    """A check: none but zero."""
    return "is dry friction, which the smooth equations of motion cannot hold; remove it" if any(values) else None


@dataclass(frozen=True)
class Numbers:
    """A list of ``fewest`` to ``most`` (default: ``fewest``) finite numbers that passes ``check``."""

    fewest: int = 1
    most: int | None = None
    check: Check | None = None
    required: bool = False

    # A diagnosis reads a file a thousand times with one number changed.
    @functools.lru_cache(maxsize=4096)  # noqa: B019  (rules live as long as the process)
    def read(self, text: str) -> tuple[float, ...]:
        """The numbers in ``text``; ValueError says what is wrong and what was expected."""
        words = _SPACE.split(text.strip(" \t\r\n")) if text.strip(" \t\r\n") else []
        values = []
        for word in words:
            value = float(word) if _NUMBER.fullmatch(word) else math.nan
            if not math.isfinite(value):
                raise ValueError(f"contains {shorten(word)!r}; expected a finite decimal number")
            values.append(value)
        most = self.fewest if self.most is None else self.most
        if not self.fewest <= len(values) <= most:
            expected = f"{self.fewest}" if most == self.fewest else f"{self.fewest} to {most}"
            raise ValueError(f"holds {len(values)} numbers; expected {expected}")
        complaint = self.check(tuple(values)) if self.check else None
        if complaint:
            raise ValueError(complaint)
        return tuple(values)


@dataclass(frozen=True)
class Choice:
    """One word out of ``options``."""

    options: tuple[str, ...]
    required: bool = False

    def read(self, text: str) -> str:
        """``text`` itself; ValueError names the nearest option."""
        if text not in self.options:
            raise ValueError(f"is unknown; {nearest(shorten(text), self.options)}")
        return text


@dataclass(frozen=True)
class Text:
    """Anything: a name, or what only people read."""

    required: bool = False

    def read(self, text: str) -> str:
        """``text`` itself."""
        return text


Rule = Numbers | Choice | Text
