"""The atlas: each subject along each family of hard points, against the certified truth.

``measure`` is one (case, subject) as a task for ``harness.workers``, so that a crash costs that row alone;
``rows`` runs many, and ``table`` is what to print of them.

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
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from typing import Any

import numpy as np

from harness.certify.compare import Comparison, compare
from harness.certify.reference import CERTIFIED_RADIUS, PRECISIONS, UNIT_ROUNDOFF, Reference
from harness.crosscheck.tasks import Note, reference_kernel
from harness.engines import EQUATIONS, Subject, linear_velocity_in_body, load_engine, subjects
from harness.equations.derivation import load_mechanism
from harness.equations.mechanism import Mechanism
from harness.equations.states import States
from harness.errors import InvalidModel
from harness.hard.cases import HardCase, hard_cases, library_of
from harness.hard.expected import PATH, HardExpectation, Key, load_hard_expectations
from harness.library import Library
from harness.models.model_file import ModelFile, read_model
from harness.results.atlas import HardPoint, HardRow
from harness.verdict import Verdict, gravest
from harness.workers import Crash

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
    theory = case.theory_of(str(subject))
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


def expectations(engines: Library) -> Mapping[Key, HardExpectation]:
    """The expected verdicts along the harness's own hard cases, for subjects of ``engines``.

    Raises:
        harness.errors.InvalidInput: the file of expectations is malformed or names what does not exist.
    """
    return load_hard_expectations(PATH, list(hard_cases()), [str(subject) for subject in subjects(engines)])


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
        answers = loaded.forward_dynamics(states.q, states.v, states.tau)
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
