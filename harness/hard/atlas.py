"""The atlas: each subject along each family of hard points, and the motions beside them.

One (case, subject) is one task, so that a crash costs that row alone; ``harness.hard.measurement`` measures it.

Verdicts that are expected to be other than ``agrees`` stand in one file, each with its reason.
``expected.toml`` beside this module holds ``[[expected]]`` tables with ``case``, ``subject``, ``verdict``, ``reason`` (the step
of the algorithm that loses the digits), ``remedy`` (what a user can do) and ``link``; where answers are compared
also ``backward_error``, the largest that the reason explains, and for ``unstable`` ``median_backward_error`` over those
points and ``share``, how many of all points they are. An entry with a ``quantity`` is about that. One without is about
accelerations, and where it is ``unsupported`` about every quantity. A family has one entry for each verdict that occurs
along it; an entry whose verdict occurs nowhere fails.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from harness.crosscheck.expected import Entry, Text, of_quantity, read_entries
from harness.engines import NotOffered, Subject, engine_files, select_subjects
from harness.errors import InvalidRequest, not_installed
from harness.hard.cases import hard_cases
from harness.hard.measurement import failed, measure
from harness.hard.motions import OSCILLATOR, STABILITY_LIMITS, hard_motions, partings, stable_steps
from harness.library import Library
from harness.registry import select
from harness.results.atlas import Atlas, HardReason, HardRow
from harness.results.records import ACCELERATIONS
from harness.study import Inquiry, Note, Study, ask
from harness.truth.quantities import find_quantities, select_quantities
from harness.verdict import SEVERITY, Verdict

# What is measured beside the families.
MOTION, CONTACT = "motion", "contact"
PATH = Path(__file__).with_name("expected.toml")
# Case, subject and verdict.
Key = tuple[str, ...]


class AtlasStudy(Study):
    """One run along the hard cases; a ``harness.study.Study`` of ``Atlas`` parts.

    ``library`` is the one whose engines are meant; the cases are the harness's own, all for none. Without ``subjects`` every
    native one is asked whose engine is installed, as the cases try engines, not readers. ``quantities`` are what they are asked for;
    what one does not offer has no row. ``beside``: ``MOTION`` measures partings and stable steps too, ``CONTACT`` distances from rigid
    contact; without ``families`` nothing else.

    Raises:
        InvalidInput: an engine or the file of expected verdicts cannot be used.
        InvalidRequest: a case, subject or quantity that does not exist, or a subject by name whose engine is not installed.
    """

    title = "atlas"

    def __init__(
        self,
        library: Library,
        cases: Sequence[str] = (),
        subjects: Sequence[str] = (),
        beside: Collection[str] = (),
        families: bool = True,
        quantities: Sequence[str] = (),
    ) -> None:
        super().__init__(Atlas())
        known, chosen = [str(one) for one in select_subjects(library, ())], select_quantities(quantities)
        self._expected = {name: load_hard_expectations(known, name) for name in chosen}
        chosen_cases = select(cases, hard_cases(), "hard case")
        asked = _installed(library, subjects) if families else []
        broken = [subject for subject in asked if engine_files(library)[subject.engine].outcome.value is None]
        self._inquiries = [self._refused(subject, self.failure(engine_files(library)[subject.engine].outcome)) for subject in broken]
        self._inquiries += [
            self._rated(case.name, subject, quantity, library)
            for case in chosen_cases
            for quantity in chosen
            for subject in asked
            if subject not in broken and (not case.subjects or str(subject) in case.subjects)
        ]
        if MOTION in beside:
            values = hard_cases()[OSCILLATOR].values
            self._inquiries += [self._moved("partings", name, partings, library) for name in hard_motions()]
            self._inquiries += [self._moved("stable_steps", name, stable_steps, values) for name in STABILITY_LIMITS]
        if CONTACT in beside:
            # Derived with SymPy, which an atlas without contacts does without.
            from harness.hard.touching import rigid_cases, rigid_distances

            self._inquiries += [self._moved("distances", name, rigid_distances, library) for name in rigid_cases()]
        self.steps = len(self._inquiries)

    def inquiries(self) -> Iterator[Iterable[Inquiry[None]]]:
        yield self._inquiries

    def _rated(self, name: str, subject: Subject, quantity: str, library: Library) -> Inquiry[None]:
        outcome = yield from ask(measure, name, subject, quantity, library)
        if isinstance(outcome.exception, NotOffered):
            yield self.kept(f"{name} {subject}", Atlas())
            return
        failure = self.failure(outcome)
        row: HardRow = failed(hard_cases()[name], subject, quantity, failure, outcome.crash) if failure else outcome.value
        yield self.kept(f"{name} {subject}", Atlas(rows=[judged(row, self._expected[quantity])]))

    def _refused(self, subject: Subject, failure: str) -> Inquiry[None]:
        outcome = yield from ask(_say, failure)
        yield self.kept(str(subject), Atlas(problems=[f"{subject}: {outcome.value}"]))

    def _moved(self, part: str, name: str, measured: Callable[..., Any], given: Any) -> Inquiry[None]:
        outcome = yield from ask(measured, name, given)
        if failure := self.failure(outcome):
            noted = f" ({outcome.crash.note})" if outcome.crash is not None and outcome.crash.note else ""
            yield self.kept(name, Atlas(problems=[f"{name}{noted}: {failure}"]))
        else:
            yield self.kept(name, Atlas(**{part: outcome.value}))


def _say(failure: str, note: Note) -> str:
    """Why an engine file cannot be loaded, which is a part of the atlas as what a task finds."""
    return failure


def _installed(library: Library, names: Sequence[str]) -> list[Subject]:
    """The native subjects asked for, without those whose engine is not installed where none was named; some may not load."""
    chosen = []
    for subject in select_subjects(library, names, native_only=True):
        file = engine_files(library)[subject.engine]
        if file.version is not None or file.outcome.value is None:
            chosen.append(subject)
        elif names:
            raise InvalidRequest(f"{subject} cannot be measured: {not_installed(file.requires[1])}")
    if not chosen:
        raise InvalidRequest("no engine is installed")
    return chosen


_COMPARED = (Verdict.UNSTABLE.value, Verdict.DISAGREES.value)
_NOT_COMPARED = (Verdict.UNDECIDED, Verdict.UNSUPPORTED, Verdict.ERROR)


class HardExpectation(Entry, frozen=True, kw_only=True):
    """One entry of the file; it holds up to its backward error, so that a fault still shows beside it."""

    KEY = ("case", "subject", "quantity", "verdict")
    case: Text
    remedy: Text


def load_hard_expectations(subjects: Collection[str], quantity: str = ACCELERATIONS, path: Path = PATH) -> Mapping[Key, HardExpectation]:
    """Expectations of a quantity by case, subject and verdict.

    Raises:
        InvalidInput: the file is malformed, or an entry names a case or subject that does not exist any more.
    """
    verdicts = [verdict for verdict in SEVERITY if verdict != Verdict.AGREES]
    known = {"case": hard_cases(), "subject": subjects, "verdict": verdicts, "quantity": ["", *find_quantities()]}
    chosen = of_quantity(read_entries(path, HardExpectation, known, _COMPARED), quantity)
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
