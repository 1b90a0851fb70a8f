"""The answer of a diagnosis in a sentence: who is at fault, which line, and what to write there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from harness.errors import shown_path
from harness.results.conclusion import reasons_text
from harness.results.cross_check import Cause
from harness.results.readings import by_effect
from harness.results.records import Record


def conclude_diagnosis(name: str, records: Sequence[Record], causes: Sequence[Cause], inference: str, held: Sequence[str] = ()) -> str:
    """Who is at fault of a mechanism or a file, and what to do.

    ``inference`` is what the verdicts of all its subjects say together, ``held`` what these do not hold alike.
    """
    if not causes:
        largest = [by_effect(record.readings)[0] for record in records if record.readings]
        return f"{name}: {'. '.join([inference, *reasons_text(largest)])}."
    told = next((cause for cause in causes if not cause.is_shared), causes[0])
    mended = _mended(told.found["model"]) if told.found and "model" in told.found else ""
    others = len({cause.inference for cause in causes}) - 1
    more = f" {others} more cause{'s' * (others > 1)} below." if others else ""
    said = mended or (told.first_line if told.first_line != told.inference else "; ".join(held))
    return f"{name}: {told.inference}.{f' {said}.' if said else ''}{more}"


def _mended(side: dict[str, Any] | None) -> str:
    """The number to write and its place, of a diagnosis on the side of the file that one number explains; "" without one."""
    first = side and side.get("first")
    if not side or not first or not first["explains"] or not first["shown"]:
        return ""
    others = {(one["line"], one["element"], one["attribute"]) for one in side["explaining"]}
    several = f"; so does a change at {len(others) - 1} other places" if len(others) > 1 else ""
    return f"Write {first['shown']} in {first['tag']}, {shown_path(side['file'])}:{first['line']}: that explains every answer{several}"
