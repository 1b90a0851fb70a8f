"""The JSON of a run: its versions, records and whatever else a command found, as one document.

JSON has no infinities: wherever a number is not finite, the document holds the string "inf", "-inf" or "nan" instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from harness.results.plain_json import GrowingJson
from harness.results.records import Record, Run, SystemCard


class JsonDocument:
    """The JSON of a run that is written while it goes on: what stayed as it was is not made text again."""

    def __init__(self, run: Run) -> None:
        about = asdict(run)
        self._head = {"harness": about.pop("versions"), "run": about}
        self._text = GrowingJson(_with_outcome)

    def text(self, records: Sequence[Record] = (), cards: Sequence[SystemCard] = (), **parts: Any) -> str:
        """As ``to_json``; no element of a list may change between two calls."""
        return self._text.dumps(self._head | {"records": records, "systems": cards} | parts) + "\n"


def to_json(run: Run, records: Sequence[Record], cards: Sequence[SystemCard] = (), **parts: Any) -> str:
    """{"harness": versions, "run", "records", "systems"} and ``parts``, which are plain data, as strictly valid JSON, ASCII only.

    Every record holds the fields of ``Record`` and "as_expected". Numbers that are not finite are the strings "inf", "-inf" and
    "nan".
    """
    return JsonDocument(run).text(records, cards, **parts)


def _with_outcome(item: Any) -> Any:
    return asdict(item) | {"as_expected": item.as_expected} if isinstance(item, Record) else item
