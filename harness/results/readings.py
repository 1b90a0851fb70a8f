"""Readings that engines' readers make of a file, each with its lines and its effect, as plain data."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from harness.results.detail import Detail, telling
from harness.results.table import counted, counted_nouns

# The least relative change of accelerations that is one: less is rounding.
FELT = 1e-12
# Of a part that is left out, where all is told, and of a reading in a row; the JSON has all lines.
MOST_LINES, FEW_LINES = 8, 3
# Readings that are named in a cell of a table.
MOST_IN_CELL = 2


@dataclass(frozen=True, kw_only=True)
class Effect:
    """A reading that applies to a file.

    Attributes:
        lines: of the elements concerned. alone: largest change of qdd over the states when the engine reads nothing else otherwise,
            relative in the energy norm; infinite where that takes a joint away, None where the tree that it gives has no certified truth.
        beside: the same beside all other readings, where it moves nothing alone; None where it does, or where there is no other.
        remedy: what the engine's user can do about it, an imperative.
        count: number of the elements concerned, of which several may have one line; 0 in records that do not tell.
        is_misread: whether the reader accepts what it does not read as the format says, and no documentation of the engine tells.
        included: those of the elements that stand in included files, as "common.xml:12".
        page: its name in the documentation, below ``findings/``.
        departs: whether the engine's program does what its own documentation says otherwise.
        quantity: the one that changes so; "" for qdd.
    """

    name: str
    sentence: str
    concerns: str
    lines: tuple[int, ...]
    alone: float | None
    source: str
    beside: float | None = None
    remedy: str = ""
    count: int = 0
    is_misread: bool = False
    included: tuple[str, ...] = ()
    page: str = ""
    departs: bool = False
    quantity: str = ""

    @property
    def size(self) -> float | None:
        """Its effect: alone, or beside the others where it moves nothing alone."""
        return self.beside if self.beside is not None and (self.alone or 0.0) <= FELT else self.alone

    def concerned(self, most_lines: int = MOST_LINES) -> str:
        """The elements that it concerns: "9 joints, lines 48, 74, 100 and 6 more"."""
        number = self.count or len(self.lines) + len(self.included)
        return f"{counted_nouns(number, self.concerns)}, {', '.join(self._places(most_lines))}"

    def _places(self, most: int) -> list[str]:
        """Lines of the file, and places in files that it includes."""
        more = len(self.included) - most
        others = [*self.included[:most], *([f"{more} more"] if more > 0 else [])]
        return [*([lines_text(self.lines, most)] if self.lines or not others else []), *others]

    @property
    def statement(self) -> str:
        """Sentence, number and lines of the elements concerned, and effect."""
        return f"{self.sentence}: {self.concerned()}; {share_of(share_text(self.size), self.quantity or 'qdd')}"


def page_of(engine: str, name: str) -> str:
    """The name of the page of a reading or finding: "pinocchio-joint-damping"."""
    return "-".join(re.findall(r"[a-z0-9]+", f"{engine} {name}".lower()))


def share_text(change: float | None) -> str:
    """A relative change of accelerations: "47 %", "1.1e-05 %", "38 times", "joints lost"."""
    if change is None:
        return "unknown"
    if change == math.inf:
        return "joints lost"
    if change >= 10:
        return f"{change:.0f} times" if change < 1e3 else f"{change:.0e} times"
    if change >= 1:
        return f"{100 * change:.0f} %"
    return f"{100 * change:.2g} %"


def felt_text(change: float | None) -> str:
    """``share_text`` of a change of accelerations, and "nothing" for what is rounding."""
    return "nothing" if change is not None and change <= FELT else share_text(change)


def share_of_qdd(share: str) -> str:
    """ "47 % of qdd", "38 times qdd", "joints lost", of ``share_text``."""
    return share_of(share, "qdd")


def share_of(share: str, what: str) -> str:
    """The same of another quantity."""
    return f"{share} of {what}" if share.endswith("%") else f"{share} {what}" if share[:1].isdigit() else share


def are_misread(readings: Iterable[Effect]) -> bool:
    """True where one of the readings that explain an answer is a misreading that moves something."""
    return any(one.is_misread and (one.size is None or one.size > FELT) for one in readings)


def do_depart(readings: Iterable[Effect]) -> bool:
    """True where what explains an answer is that the engine departs from its own documentation."""
    return any(one.departs for one in readings)


def by_effect(readings: Iterable[Effect]) -> list[Effect]:
    """Readings, the one that moves the accelerations most first."""
    return sorted(readings, key=lambda one: -(one.size or 0.0))


def names_of(readings: Iterable[Effect]) -> list[str]:
    """The names of the readings that move accelerations, the largest first."""
    return [one.name for one in by_effect(readings) if one.size is None or one.size > FELT]


def explanation(readings: Iterable[Effect], most: int | None = None) -> str:
    """The readings that move accelerations, the largest first: "joint damping 47 %, mimic joints 14 %".

    Those that matter less are counted, and those beyond ``most``.
    """
    felt = [one for one in by_effect(readings) if one.size is None or one.size > FELT]
    kept = telling(felt, lambda one: one.size)[0][:most]
    more = [f"{len(felt) - len(kept)} more"] if len(felt) > len(kept) else []
    sizes = ("(effect unknown)" if one.size is None else share_text(one.size) for one in kept)
    return ", ".join([*(f"{one.name} {size}" for one, size in zip(kept, sizes, strict=True)), *more])


def reading_lines(readings: Iterable[Effect], detail: Detail = Detail.BRIEF) -> list[str]:
    """A line on each reading that matters, with what its user can do, the one that moves the accelerations most first.

    The last ones count the others.
    """
    ordered = by_effect(readings)
    felt = [one for one in ordered if detail > Detail.BRIEF or one.size is None or one.size > FELT]
    kept, others = telling(felt, lambda one: one.size, detail)
    unfelt = f"{counted(len(ordered) - len(felt), 'reading')} without an effect (--all)" if len(ordered) > len(felt) else ""
    return [*map(reading_line, kept), *filter(None, [others, unfelt])]


def reading_line(reading: Effect, most_lines: int = FEW_LINES) -> str:
    """Line on a reading: its effect, what it is, the elements that it concerns, and what its user can do."""
    size = felt_text(reading.size)
    beside = "; beside the other readings alone" if reading.size != reading.alone else ""
    return f"{size:>6}  {reading.sentence} ({reading.concerned(most_lines)}{beside}): {reading.remedy}".removesuffix(": ")


def lines_text(lines: Sequence[int], most: int = MOST_LINES) -> str:
    """ "line 3", "lines 3, 5 and 10 more"."""
    shown = sorted(dict.fromkeys(lines))
    if not shown:
        return "no line of the file"
    if len(shown) <= most:
        return f"line{'s' if len(shown) > 1 else ''} {', '.join(map(str, shown))}"
    return f"lines {', '.join(map(str, shown[:most]))} and {len(shown) - most} more"
