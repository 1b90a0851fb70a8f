"""Verdicts along hard cases that are expected to be other than ``agrees``: one file, each entry with its reason.

``expected_hard_cases.toml`` holds ``[[expected]]`` tables with ``case``, ``subject``, ``verdict``, ``reason`` (the step
of the algorithm that loses the digits), ``remedy`` (what a user can do) and ``link``; where answers are compared
also ``backward_error``, the largest that the reason explains. A family has one entry for each verdict that occurs
along it; an entry whose verdict occurs nowhere fails.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from harness.errors import InvalidInput
from harness.library import nearest
from harness.results.atlas import HardPoint, HardReason, HardRow
from harness.verdict import SEVERITY, Verdict

PATH = Path(__file__).with_suffix(".toml")
# Case, subject and verdict.
Key = tuple[str, str, str]

_TEXTS = ("case", "subject", "verdict", "reason", "remedy", "link")
_COMPARED = (Verdict.UNSTABLE.value, Verdict.DISAGREES.value)


@dataclass(frozen=True)
class HardExpectation:
    """One entry of the file; it holds up to ``backward_error``, so that a fault still shows beside it."""

    reason: str
    remedy: str
    link: str
    backward_error: float = math.inf


def load_hard_expectations(path: Path, cases: Collection[str], subjects: Collection[str]) -> Mapping[Key, HardExpectation]:
    """Expectations by case, subject and verdict.

    Raises:
        InvalidInput: the file is malformed, or an entry names a case or subject that does not exist any more.
    """
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InvalidInput(path, None, f"cannot be read as TOML: {error}") from error
    entries = data.pop("expected", [])
    if data or not isinstance(entries, list):
        raise InvalidInput(path, None, "holds something other than [[expected]] tables")
    expectations: dict[Key, HardExpectation] = {}
    for number, entry in enumerate(entries, start=1):
        where = f"[[expected]] number {number}"
        texts = [entry.get(key) for key in _TEXTS] if isinstance(entry, dict) else []
        if not (texts and all(isinstance(text, str) and text for text in texts)):
            raise InvalidInput(path, None, f"{where} must have the texts {', '.join(_TEXTS)}, none of them empty")
        verdicts = [verdict for verdict in SEVERITY if verdict != Verdict.AGREES]
        for key, known in (("case", cases), ("subject", subjects), ("verdict", verdicts)):
            if entry[key] not in known:
                raise InvalidInput(path, None, f"{where} names {key} {entry[key]!r}, which does not exist; {nearest(entry[key], known)}")
        compared = entry["verdict"] in _COMPARED
        most = entry.get("backward_error") if compared else math.inf
        if set(entry) != {*_TEXTS, *(["backward_error"] if compared else [])} or type(most) not in (int, float):
            rest = "the number backward_error" if compared else "nothing else"
            raise InvalidInput(path, None, f"{where} must have exactly the texts {', '.join(_TEXTS)} and {rest}")
        triple = entry["case"], entry["subject"], entry["verdict"]
        if triple in expectations:
            raise InvalidInput(path, None, f"{where} repeats {', '.join(triple)}")
        expectations[triple] = HardExpectation(entry["reason"], entry["remedy"], entry["link"], float(most))
    return expectations


def judged(row: HardRow, expected: Mapping[Key, HardExpectation]) -> HardRow:
    """The row with what is not as expected of it, and why the rest is."""
    problems: list[str] = []
    met = {verdict for verdict in row.verdicts if verdict != Verdict.AGREES}
    foreseen = {verdict for case, subject, verdict in expected if (case, subject) == (row.case, row.subject)}
    problems += [f"{verdict} at {row.verdicts[verdict]} points, which no entry expects" for verdict in sorted(met - foreseen)]
    problems += [f"the entry for {verdict} holds at no point any more" for verdict in sorted(foreseen - met)]
    for verdict in sorted(met & foreseen):
        most = expected[row.case, row.subject, verdict].backward_error
        errors = [point.backward_error for point in row.points if point.verdict == verdict and point.backward_error is not None]
        if errors and max(errors) > most:
            problems.append(f"{verdict} with backward error {max(errors):.3g}; the entry explains {most:.3g}")
    problems += [f"{point.verdict} at {row.knob} = {point.knob:g} without a reason" for point in row.points if _silent(point)]
    entries = [(verdict, expected[row.case, row.subject, verdict]) for verdict in sorted(foreseen, key=SEVERITY.__getitem__)]
    reasons = [HardReason(verdict=verdict, reason=entry.reason, remedy=entry.remedy, link=entry.link) for verdict, entry in entries]
    return replace(row, problems=problems, reasons=reasons)


def _silent(point: HardPoint) -> bool:
    return point.verdict in (Verdict.UNDECIDED, Verdict.UNSUPPORTED, Verdict.ERROR) and not point.reason
