"""Strict JSON of plain data, and of a run: its versions, records and whatever else a command found, as one document.

JSON has no infinities: a number that is not finite is the string "inf", "-inf" or "nan".
"""

from __future__ import annotations

import json
import math
import numbers
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields, is_dataclass
from typing import Any

from harness.results.records import Record
from harness.results.run import Run


def dumps(value: Any, indent: int | None = None) -> str:
    """Strict JSON of plain data and dataclasses of it; numbers that are not finite become "inf", "-inf" or "nan"."""
    return json.dumps(_plain(value), indent=indent, allow_nan=False)


class JsonDocument:
    """The JSON of a run whose lists grow while it goes on, so that every state of it can be written.

    What is in a list is made text once, for as long as it stays there; it must not change.
    """

    def __init__(self, run: Run) -> None:
        about = asdict(run)
        self._head = {"harness": about.pop("versions"), "run": about}
        # By identity; the object is kept, so that no other one takes its number.
        self._texts: dict[int, tuple[Any, str]] = {}

    def text(self, records: Sequence[Record] = (), cards: Sequence[Any] = (), **parts: Any) -> str:
        """As ``to_json``; no element of a list may change between two calls."""
        texts: dict[int, tuple[Any, str]] = {}
        document = self._head | {"records": records, "systems": cards} | parts
        lines = [f"{json.dumps(name)}: {self._text_of(value, texts)}" for name, value in document.items()]
        self._texts = texts
        return f"{{\n  {_joined(lines, 2)}\n}}\n"

    def _text_of(self, value: Any, texts: dict[int, tuple[Any, str]]) -> str:
        if not isinstance(value, Sequence) or isinstance(value, str):
            return _indented(dumps(value, indent=2), 2)
        if not value:
            return "[]"
        for item in value:
            texts[id(item)] = self._texts.get(id(item)) or (item, _indented(dumps(_with_outcome(item), indent=2), 4))
        return f"[\n    {_joined([texts[id(item)][1] for item in value], 4)}\n  ]"


def _joined(parts: list[str], indent: int) -> str:
    return f",\n{' ' * indent}".join(parts)


def _indented(text: str, indent: int) -> str:
    """All lines but the first further in; there are no line breaks within strings."""
    return text.replace("\n", "\n" + " " * indent)


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return {part.name: _plain(getattr(value, part.name)) for part in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, bool | str) or value is None:
        return value
    if isinstance(value, numbers.Integral):
        return int(value)
    if isinstance(value, numbers.Real):
        number = float(value)
        return number if math.isfinite(number) else str(number)
    raise TypeError(f"{value!r} is of type {type(value).__name__}, which has no place in a record")


def to_json(run: Run, records: Sequence[Record], cards: Sequence[Any] = (), **parts: Any) -> str:
    """{"harness": versions, "run", "records", "systems"} and ``parts``, which are plain data, as strictly valid JSON, ASCII only.

    Every record holds the fields of ``Record`` and "as_expected". Numbers that are not finite are the strings "inf", "-inf" and
    "nan".
    """
    return JsonDocument(run).text(records, cards, **parts)


def _with_outcome(item: Any) -> Any:
    return asdict(item) | {"as_expected": item.as_expected} if isinstance(item, Record) else item
