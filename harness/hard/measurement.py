"""One subject along one family of hard points, against the certified truth.

A model an engine refuses is ``unsupported`` at that point, in the engine's words; a state that cannot be certified
is ``undecided``, with the reason; an answer that is not finite is an ``error``. None of them is agreement.

Source: Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., sections 1.5 and 1.6 (forward and backward
error).
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.certify.certified import CERTIFIED_RADIUS
from harness.certify.compare import Comparison, compare
from harness.certify.numbers import UNIT_ROUNDOFF
from harness.certify.quantities.accelerations import reference_kernel
from harness.certify.reference import PRECISIONS, Reference, ReferenceKernel
from harness.crosscheck.tasks import Note
from harness.engines import (
    Engine,
    Subject,
    Unsupported,
    accelerations,
    factorises_mass_matrix,
    linear_velocity_in_body,
    load_engine,
)
from harness.equations.states import States
from harness.errors import InvalidModel
from harness.explain.columns import Whitening, parameter_derivatives
from harness.explain.one_number import Projection, explaining_directions
from harness.hard.cases import HardCase, Theory, hard_cases
from harness.hard.truths import TruePoint, model_file, true_points
from harness.library import Library
from harness.results.atlas import HardPoint, HardRow
from harness.verdict import Verdict, gravest
from harness.workers import Crash

# Slopes are fitted to backward errors above this floor, which every stable algorithm stays below.
FLOOR = 16.0
# A forward relative error beyond this has no digit left that could grow.
NO_DIGITS_LEFT = 0.1
FEWEST_POINTS_FITTED = 4

# A point, and the answers there if there are any.
Answered = tuple[HardPoint, Array | None]


def measure(case_name: str, subject: Subject, engines: Library, note: Note) -> HardRow:
    """One subject along one family; ``engines`` is the library whose engines are meant."""
    started = time.perf_counter()
    case = hard_cases()[case_name]
    engine = load_engine(engines, subject.engine)
    truths = true_points(case_name, subject, engines)
    answered: list[Answered] = []
    for value, truth in zip(case.values, truths, strict=True):
        note(json.dumps({"knob": value, "system": truth[2].name}))
        answered.append(point_of(case, value, truth, subject, engine))
    points = [point for point, _ in answered]
    if any(point.verdict == Verdict.UNSTABLE for point in points):
        points = explained(truths, answered, linear_velocity_in_body(engine))
    return measured_row(case, subject, points, started)


def measured_row(case: HardCase, subject: Subject, points: list[HardPoint], started: float) -> HardRow:
    """The row of points that were measured since ``started`` on the clock ``time.perf_counter`` [s], with the growth along them."""
    return row_of(
        case,
        subject,
        points,
        growth=_slope([(p.knob, p.backward_error) for p in points if (p.backward_error or 0) > FLOOR and _has_digits(p)]),
        digits_growth=_slope([(p.knob, 10**p.digits_lost) for p in points if p.digits_lost and _has_digits(p)]),
        seconds=time.perf_counter() - started,
    )


def row_of(case: HardCase, subject: Subject, points: list[HardPoint], **measured: Any) -> HardRow:
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


def point_of(case: HardCase, value: float, truth: TruePoint, subject: Subject, engine: Engine) -> Answered:
    reference, states, mechanism = truth
    model = model_file(case.name, mechanism.name, subject.format)
    about = _about(value, mechanism.name, reference)
    try:
        source = mechanism if model is None else case.model_at(model, mechanism, value)
    except InvalidModel as error:
        # The case itself is wrong where its model is not physical.
        return replace(about, verdict=Verdict.ERROR.value, reason=str(error)), None
    try:
        loaded = engine.load(source, mechanism.joints, mechanism.gravity)
    except (ValueError, Unsupported) as error:
        return replace(about, verdict=Verdict.UNSUPPORTED.value, reason=f"{subject.engine} refuses the model: {error}"), None
    if case.configured is not None:
        loaded = case.configured(loaded, value)
    may_lose_digits = factorises_mass_matrix(engine) or factorises_mass_matrix(loaded)
    try:
        answers = accelerations(loaded, states)
    except Exception as error:
        return replace(about, verdict=Verdict.ERROR.value, reason=f"{type(error).__name__}: {error}"), None
    comparison = compare(reference, answers, may_lose_digits)
    with np.errstate(all="ignore"):
        bound = float((reference.instability / reference.sensitivity)[comparison.worst])
    return replace(judged_point(about, states, comparison), unstable_bound=bound if math.isfinite(bound) else None), answers


def explained(truths: Sequence[TruePoint], answered: Sequence[Answered], in_body: bool) -> list[HardPoint]:
    """The points; where another value of one parameter explains the errors along the family, they are no lost digits."""
    points, parts, names = [point for point, _ in answered], [], []
    kernels: dict[Hashable, ReferenceKernel] = {}
    for (reference, states, mechanism), (_, answers) in zip(truths, answered, strict=True):
        if answers is None:
            continue
        # The parameters of one point are not those of the next, and its equations are.
        if mechanism.program.key not in kernels:
            kernels[mechanism.program.key] = reference_kernel(mechanism, in_body)
        kernel = kernels[mechanism.program.key]
        whitening, values = Whitening(reference), np.array(mechanism.parameter_values)
        # Relative changes, for the knob turns the values.
        slopes = parameter_derivatives(kernel, states, reference, values.tolist()) * values[:, None, None]
        parts.append(Projection.of(reference, whitening.residual(answers), [np.nan_to_num(whitening.change(slope)) for slope in slopes]))
        names = [name for name, _, _ in mechanism.parameters]
    for strongest in explaining_directions(parts)[:1]:
        reason = f"{names[strongest.index]} off by {strongest.change:.3g} of itself explains the errors of all points"
        wrong = Verdict.DISAGREES.value
        points = [replace(point, verdict=wrong, reason=reason) if point.verdict == Verdict.UNSTABLE else point for point in points]
    return points


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
        in_balls=int(reference.in_balls.sum()),
        reason="; ".join(dict.fromkeys(why_undecided(reference))),
    )


def judged_point(about: HardPoint, states: States, comparison: Comparison) -> HardPoint:
    """A point with the judgement of the answers at its states."""
    backward, relative = (max(comparison.known(name).tolist(), default=None) for name in ("backward_error", "relative_error"))
    remarks = [about.reason]
    not_finite = int((comparison.verdicts == Verdict.ERROR.value).sum())
    if not_finite:
        remarks.append(f"{not_finite} of {len(states)} answers are not finite")
    return replace(
        about,
        verdict=gravest(comparison.verdicts.tolist()),
        backward_error=backward,
        digits_lost=None if relative is None else max(0.0, math.log10(max(relative, UNIT_ROUNDOFF) / UNIT_ROUNDOFF)),
        reason="; ".join(filter(None, remarks)),
        state=states.as_json(comparison.worst),
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
            yield f"the equations have no derivative there that {PRECISIONS[-1]} bits would show, so that data roundoff is not known"
        elif reference.radius[index] <= CERTIFIED_RADIUS * reference.sensitivity[index]:
            yield "the state does not close the constraints: the branch of the assembly is lost on the way there"
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
    return row_of(case, subject, [HardPoint(verdict=Verdict.ERROR.value, reason=reason, **at)], crashed=crash is not None)
