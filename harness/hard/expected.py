"""Verdicts along hard cases that are expected to be other than ``agrees``: one file, each entry with its reason.

``expected.toml`` beside this module holds ``[[expected]]`` tables with ``case``, ``subject``, ``verdict``, ``reason`` (the step
of the algorithm that loses the digits), ``remedy`` (what a user can do) and ``link``; where answers are compared
also ``backward_error``, the largest that the reason explains, and for ``unstable`` ``median_backward_error`` over those
points and ``share``, how many of all points they are. An entry with a ``quantity`` is about that. One without is about
accelerations, and where it is ``unsupported`` about every quantity. A family has one entry for each verdict that occurs
along it; an entry whose verdict occurs nowhere fails.
"""

from __future__ import annotations

import statistics
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path

from harness.crosscheck.expected import Entry, Text, read_entries
from harness.results.atlas import HardReason, HardRow
from harness.results.records import ACCELERATIONS, quantity_words
from harness.truth.quantities import find_quantities
from harness.verdict import SEVERITY, Verdict

PATH = Path(__file__).with_suffix(".toml")
# Case, subject and verdict.
Key = tuple[str, ...]

_COMPARED = (Verdict.UNSTABLE.value, Verdict.DISAGREES.value)
_NOT_COMPARED = (Verdict.UNDECIDED, Verdict.UNSUPPORTED, Verdict.ERROR)


class HardExpectation(Entry, frozen=True, kw_only=True):
    """One entry of the file; it holds up to its backward error, so that a fault still shows beside it."""

    case: Text
    remedy: Text
    quantity: Text = ACCELERATIONS


def load_hard_expectations(
    path: Path, cases: Collection[str], subjects: Collection[str], quantity: str = ACCELERATIONS
) -> Mapping[Key, HardExpectation]:
    """Expectations of a quantity by case, subject and verdict.

    Raises:
        InvalidInput: the file is malformed, or an entry names a case or subject that does not exist any more.
    """
    verdicts = [verdict for verdict in SEVERITY if verdict != Verdict.AGREES]
    known = {"case": cases, "subject": subjects, "verdict": verdicts, "quantity": find_quantities()}
    entries = read_entries(path, HardExpectation, known, ("case", "subject", "quantity", "verdict"), _COMPARED)
    everywhere = [entry for entry in entries.values() if entry.verdict == Verdict.UNSUPPORTED and not quantity_words(entry.quantity)]
    chosen = [*everywhere, *(entry for entry in entries.values() if entry.quantity == quantity)]
    return {(entry.case, entry.subject, entry.verdict): entry for entry in chosen}


def judged(row: HardRow, expected: Mapping[Key, HardExpectation]) -> HardRow:
    """The row with its unexpected points as problems, and the reasons of the expected ones."""
    problems: list[str] = []
    met = {verdict for verdict in row.verdicts if verdict != Verdict.AGREES}
    foreseen = {verdict for case, subject, verdict in expected if (case, subject) == (row.case, row.subject)}
    problems += [f"{verdict} at {row.verdicts[verdict]} points, which no entry expects" for verdict in sorted(met - foreseen)]
    problems += [f"the entry for {verdict} holds at no point any more" for verdict in sorted(foreseen - met)]
    for verdict in sorted(met & foreseen):
        errors = [point.backward_error for point in row.points if point.verdict == verdict and point.backward_error is not None]
        entry, share = expected[row.case, row.subject, verdict], row.verdicts[verdict] / len(row.points)
        if errors and max(errors) > entry.limit:
            problems.append(f"{verdict} with backward error {max(errors):.3g}; the entry explains {entry.limit:.3g}")
        if errors and (median := statistics.median(errors)) > entry.median_limit:
            problems.append(f"{verdict} with median backward error {median:.3g}; the entry explains {entry.median_limit:.3g}")
        if share > entry.share_limit:
            problems.append(f"{verdict} at {share:.0%} of the points; the entry explains {entry.share_limit:.0%}")
    silent = [point for point in row.points if point.verdict in _NOT_COMPARED and not point.reason]
    problems += [f"{point.verdict} at {row.knob} = {point.knob:g} without a reason" for point in silent]
    entries = [(verdict, expected[row.case, row.subject, verdict]) for verdict in sorted(foreseen, key=SEVERITY.__getitem__)]
    reasons = [HardReason(verdict=verdict, reason=entry.reason, remedy=entry.remedy, link=entry.link) for verdict, entry in entries]
    return replace(row, problems=problems, reasons=reasons)
