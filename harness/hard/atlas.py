"""The atlas: each subject along each family of hard points, against the certified truth.

``measure`` is one (case, subject) as a task for ``harness.workers``, so that a crash costs that row alone;
``AtlasStudy`` runs many, and the motions beside them.

A model an engine refuses is ``unsupported`` at that point, in the engine's words; a state that cannot be certified
is ``undecided``, with the reason; an answer that is not finite is an ``error``. None of them is agreement.

Source: Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., sections 1.5 and 1.6 (forward and backward
error).
"""

from __future__ import annotations

import functools
import json
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from typing import Any

import numpy as np

from harness.certify.compare import Comparison, compare
from harness.certify.reference import CERTIFIED_RADIUS, PRECISIONS, UNIT_ROUNDOFF, Reference
from harness.crosscheck.tasks import Note, reference_kernel
from harness.engines import EQUATIONS, Subject, accelerations, engine_files, linear_velocity_in_body, load_engine, select_subjects
from harness.equations.derivation import load_mechanism
from harness.equations.mechanism import Mechanism
from harness.equations.states import States
from harness.errors import InvalidModel, InvalidRequest
from harness.hard.cases import HardCase, Theory, hard_cases, library_of
from harness.hard.expected import PATH, judged, load_hard_expectations
from harness.hard.motions import OSCILLATOR, STABILITY_LIMITS, hard_motions, partings, stable_steps
from harness.library import Library, nearest
from harness.models.model_file import ModelFile, read_model
from harness.results.atlas import Atlas, HardPoint, HardRow
from harness.study import Part, Rounds
from harness.verdict import Verdict, gravest
from harness.workers import Crash, Outcome, Task

# Slopes are fitted to backward errors above this floor, which every stable algorithm stays below.
FLOOR = 16.0
# A forward relative error beyond this has no digit left that could grow.
NO_DIGITS_LEFT = 0.1
FEWEST_POINTS_FITTED = 4

# What is certified at one point, its states, and the mechanism with the parameters it has there.
Truth = tuple[Reference, States, Mechanism]


def measure(case_name: str, subject: Subject, engines: Library, note: Note) -> HardRow:
    """One subject along one family; ``engines`` is the library whose engines are meant."""
    started = time.perf_counter()
    case = hard_cases()[case_name]
    truths = _truth(case_name, linear_velocity_in_body(load_engine(engines, subject.engine)))
    points: list[HardPoint] = []
    for value, truth in zip(case.values, truths, strict=True):
        note(json.dumps({"knob": value, "system": truth[2].name}))
        points.append(_point(case, value, truth, subject, engines))
    return _row(
        case,
        subject,
        points,
        growth=_slope([(p.knob, p.backward_error) for p in points if (p.backward_error or 0) > FLOOR and _has_digits(p)]),
        digits_growth=_slope([(p.knob, 10**p.digits_lost) for p in points if p.digits_lost and _has_digits(p)]),
        seconds=time.perf_counter() - started,
    )


def _row(case: HardCase, subject: Subject, points: list[HardPoint], **measured: Any) -> HardRow:
    """The row of some points, with what the case and theory say of it."""
    theory = case.theory.get(str(subject), Theory())
    return HardRow(
        case=case.name,
        title=case.title,
        subject=str(subject),
        knob=case.knob[0],
        unit=case.knob[1],
        points=points,
        verdict=gravest(point.verdict for point in points),
        theory_verdict=theory.verdict,
        theory_growth=theory.growth,
        theory_digits_growth=theory.digits_growth,
        source=case.source,
        remedy=case.remedy,
        **measured,
    )


@functools.lru_cache(maxsize=4)
def _truth(case_name: str, in_body: bool) -> list[Truth]:
    """The truth at each point; a system along the knob is compiled once."""
    case = hard_cases()[case_name]
    found: list[Truth] = []
    for name, group in groupby(enumerate(case.values), key=lambda point: case.system_at(point[1])):
        mechanism = load_mechanism(library_of(case), name)
        points = list(group)
        batches = [case.states(mechanism, value, place) for place, value in points]
        changed = [case.mechanism_at(mechanism, value) for _, value in points]
        parameters = np.repeat([one.parameter_values for one in changed], [len(batch) for batch in batches], axis=0)
        reference = reference_kernel(mechanism, in_body).evaluate(States.concatenate(batches), parameters)
        start = 0
        for batch, one in zip(batches, changed, strict=True):
            found.append((reference[start : start + len(batch)], batch, one))
            start += len(batch)
    return found


@functools.lru_cache(maxsize=64)
def _model_file(case_name: str, system: str, model_format: str) -> ModelFile | None:
    if model_format == EQUATIONS:
        return None
    return read_model(library_of(hard_cases()[case_name]).model_path(system, model_format), model_format)


def _point(case: HardCase, value: float, truth: Truth, subject: Subject, engines: Library) -> HardPoint:
    reference, states, mechanism = truth
    model = _model_file(case.name, mechanism.name, subject.format)
    about = _about(value, mechanism.name, reference)
    try:
        source = mechanism if model is None else case.model_at(model, mechanism, value)
    except InvalidModel as error:
        # The case itself is wrong where its model is not physical.
        return replace(about, verdict=Verdict.ERROR.value, reason=str(error))
    try:
        loaded = load_engine(engines, subject.engine).load(source, mechanism.joints, mechanism.gravity)
    except ValueError as error:
        return replace(about, verdict=Verdict.UNSUPPORTED.value, reason=f"{subject.engine} refuses the model: {error}")
    try:
        answers = accelerations(loaded, states)
    except Exception as error:
        return replace(about, verdict=Verdict.ERROR.value, reason=f"{type(error).__name__}: {error}")
    return _judged(about, states, reference, compare(reference, answers))


def _about(value: float, system: str, reference: Reference) -> HardPoint:
    """A point before any engine answers."""
    condition = reference.condition
    finite = condition[np.isfinite(condition)]
    return HardPoint(
        knob=value,
        system=system,
        verdict=Verdict.UNDECIDED.value,
        condition=float(finite.max()) if len(finite) else None,
        certified=int(reference.certified.sum()),
        states=len(reference),
        bits=int(reference.bits.max(initial=0)),
        reason="; ".join(dict.fromkeys(why_undecided(reference))),
    )


def _judged(about: HardPoint, states: States, reference: Reference, comparison: Comparison) -> HardPoint:
    backward, relative = (max(comparison.known(name).tolist(), default=None) for name in ("backward_error", "relative_error"))
    worst = comparison.worst
    with np.errstate(all="ignore"):
        bound = float(reference.instability[worst] / reference.sensitivity[worst])
    remarks = [about.reason]
    not_finite = int((comparison.verdicts == Verdict.ERROR.value).sum())
    if not_finite:
        remarks.append(f"{not_finite} of {len(states)} answers are not finite")
    return replace(
        about,
        verdict=gravest(comparison.verdicts.tolist()),
        backward_error=backward,
        digits_lost=None if relative is None else max(0.0, math.log10(max(relative, UNIT_ROUNDOFF) / UNIT_ROUNDOFF)),
        unstable_bound=bound if math.isfinite(bound) else None,
        reason="; ".join(filter(None, remarks)),
        state=states.as_json(worst),
    )


def why_undecided(reference: Reference) -> Iterator[str]:
    """For each state that is not certified, why."""
    condition = reference.condition
    for index in np.flatnonzero(~reference.certified):
        if not np.isfinite(reference.high[index]).all():
            yield f"M is singular, or not certainly regular at {PRECISIONS[-1]} bits"
        elif not np.isfinite(condition[index]):
            yield "M is not certainly positive definite, so that data roundoff has no energy norm"
        elif not np.isfinite(reference.sensitivity[index]):
            yield "a derivative of the equations is not finite in float64, so that data roundoff is not known"
        else:
            share = float(reference.radius[index] / reference.sensitivity[index]) if reference.sensitivity[index] else math.inf
            yield f"the radius is {share:.1e} of the sensitivity at {int(reference.bits[index])} bits; {CERTIFIED_RADIUS:.1e} is needed"


def _has_digits(point: HardPoint) -> bool:
    return point.digits_lost is not None and 10**point.digits_lost * UNIT_ROUNDOFF < NO_DIGITS_LEFT


def _slope(pairs: Sequence[tuple[float, float | None]]) -> float | None:
    """Least-squares slope of log error over log knob; None for fewer than ``FEWEST_POINTS_FITTED`` different knobs."""
    usable = [(abs(knob), error) for knob, error in pairs if knob and error and math.isfinite(error)]
    if len({knob for knob, _ in usable}) < FEWEST_POINTS_FITTED:
        return None
    x, y = np.log(np.array(usable)).T
    return float(np.polyfit(x, y, 1)[0])


def failed(case: HardCase, subject: Subject, reason: str, crash: Crash | None) -> HardRow:
    """The row of a task that gave none; its last note says at which point it died."""
    at = json.loads(crash.note) if crash and crash.note else {"knob": case.values[0], "system": case.system_at(case.values[0])}
    return _row(case, subject, [HardPoint(verdict=Verdict.ERROR.value, reason=reason, **at)], crashed=crash is not None)


class AtlasStudy(Rounds):
    """One run along the hard cases; a ``harness.study.Study`` of ``Atlas`` parts.

    ``library`` is the one whose engines are meant; the cases are the harness's own, all for none. Without ``subjects`` every
    native one is asked whose engine is installed, as the cases try engines, not readers. ``motion`` measures partings and stable
    steps too.

    Raises:
        InvalidInput: an engine or the file of expected verdicts cannot be used.
        InvalidRequest: a case or subject that does not exist, or one by name whose engine is not installed.
    """

    title = "atlas"

    def __init__(self, library: Library, cases: Sequence[str] = (), subjects: Sequence[str] = (), motion: bool = False) -> None:
        super().__init__()
        self._measured = Atlas()
        self._expected = load_hard_expectations(PATH, list(hard_cases()), [str(one) for one in select_subjects(library, ())])
        for name in cases:
            if name not in hard_cases():
                raise InvalidRequest(f"no hard case is called {name!r}; {nearest(name, hard_cases())}")
        asked, names = _installed(library, subjects), list(dict.fromkeys(cases)) or list(hard_cases())
        for subject in [subject for subject in asked if engine_files(library)[subject.engine].outcome.value is None]:
            asked.remove(subject)
            self._next.append(Task((self._refused, subject), _say, (self.failure(engine_files(library)[subject.engine].outcome),)))
        self._next += [Task((self._rated, name, subject), measure, (name, subject, library)) for name in names for subject in asked]
        if motion:
            values = hard_cases()[OSCILLATOR].values
            self._next += [Task((self._moved, "partings", name), partings, (name, library)) for name in hard_motions()]
            self._next += [Task((self._moved, "stable_steps", name), stable_steps, (name, values)) for name in STABILITY_LIMITS]
        self.steps = len(self._next)

    def result(self) -> Atlas:
        return self._measured

    def _rated(self, outcome: Outcome, name: str, subject: Subject) -> Iterator[Part]:
        failure = self.failure(outcome)
        row: HardRow = failed(hard_cases()[name], subject, failure, outcome.crash) if failure else outcome.value
        yield self._part(f"{name} {subject}", Atlas(rows=[judged(row, self._expected)]))

    def _refused(self, outcome: Outcome, subject: Subject) -> Iterator[Part]:
        yield self._part(str(subject), Atlas(problems=[f"{subject}: {outcome.value}"]))

    def _moved(self, outcome: Outcome, part: str, name: str) -> Iterator[Part]:
        if failure := self.failure(outcome):
            noted = f" ({outcome.crash.note})" if outcome.crash is not None and outcome.crash.note else ""
            yield self._part(name, Atlas(problems=[f"{name}{noted}: {failure}"]))
        else:
            yield self._part(name, Atlas(**{part: outcome.value}))

    def _part(self, label: str, found: Atlas) -> Part:
        self._measured.extend(found)
        return Part(label, found)


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
            raise InvalidRequest(f"{subject} cannot be measured: {file.requires[1]} is not installed")
    if not chosen:
        raise InvalidRequest("no engine is installed")
    return chosen
