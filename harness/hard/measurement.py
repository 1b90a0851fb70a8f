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
from collections.abc import Hashable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.crosscheck.assignment import Assignment
from harness.engines import EQUATIONS, NotOffered, Subject, Unsupported, load_engine
from harness.errors import InvalidModel
from harness.explain.columns import Whitening, parameter_derivatives
from harness.explain.fit import Projection, explaining_directions
from harness.hard.cases import HardCase, Theory, hard_cases
from harness.hard.truths import TruePoint, plain_points, true_points
from harness.library import MODEL_SUFFIXES, Library
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.states import States
from harness.results.atlas import HardPoint, HardRow
from harness.results.records import ACCELERATIONS, quantity_words
from harness.study import Note
from harness.truth.compare import Certified, Comparison, compare, farthest_block
from harness.truth.quantities import Truth, find_quantities
from harness.truth.quantities.accelerations import AccelerationTruth, reference_kernel
from harness.truth.reference import ReferenceKernel
from harness.verdict import Verdict, gravest
from harness.workers import Crash

# Slopes are fitted to backward errors above this floor, which every stable algorithm stays below.
FLOOR = 16.0
# A forward relative error beyond this has no digit left that could grow.
NO_DIGITS_LEFT = 0.1
FEWEST_POINTS_FITTED = 4

# A point, and the answers there if there are any.
Answered = tuple[HardPoint, Array | None]


def measure(case_name: str, subject: Subject, quantity: str, engines: Library, note: Note) -> HardRow:
    """One subject along one family in one quantity; ``engines`` is the library whose engines are meant.

    Raises:
        harness.engines.NotOffered: the engine does not offer the quantity, or the case's mechanism has nothing of the kind.
    """
    started = time.perf_counter()
    case = hard_cases()[case_name]
    is_default = find_quantities()[quantity].is_default
    truths = iter(true_points(case_name, subject, engines)) if is_default else plain_points(case)
    taken: list[TruePoint] = []
    answered: list[Answered] = []
    for value in case.values:
        note(json.dumps({"knob": value, "system": case.system_at(value)}))
        truth = next(truths)
        taken.append(truth)
        answered.append(point_of(case, value, truth, subject, engines, quantity))
    points = [point for point, _ in answered]
    if any(point.verdict == Verdict.UNSTABLE for point in points):
        points = explained(taken, answered, load_engine(engines, subject.engine).linear_velocity_in_body)
    return row_of(
        case,
        subject,
        points,
        quantity,
        growth=_slope([(p.knob, p.backward_error) for p in points if (p.backward_error or 0) > FLOOR and _has_digits(p)]),
        digits_growth=_slope([(p.knob, 10**p.digits_lost) for p in points if p.digits_lost and _has_digits(p)]),
        seconds=time.perf_counter() - started,
    )


def row_of(case: HardCase, subject: Subject, points: list[HardPoint], quantity: str = ACCELERATIONS, **measured: Any) -> HardRow:
    """The row of some points, with what the case says of it, and theory, which is about accelerations."""
    theory = Theory() if quantity_words(quantity) else case.theory.get(str(subject), Theory())
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
        quantity=quantity,
        **measured,
    )


def point_of(case: HardCase, value: float, point: TruePoint, subject: Subject, engines: Library, quantity: str = ACCELERATIONS) -> Answered:
    """One point of a family.

    The truth of a quantity of files is that of the numbers which one of the case's model files has there; where these are not what the
    energies say, as where a file must hold an inertia that its mechanism has not, the point is ``undecided``.

    Raises:
        harness.engines.NotOffered: as ``measure``.
    """
    engine, states, mechanism = load_engine(engines, subject.engine), point.states, point.mechanism
    about = _about(HardPoint(knob=value, system=mechanism.name, verdict=Verdict.UNDECIDED.value, states=len(states)), point.reference)
    is_of_file = find_quantities()[quantity].is_of_file
    try:
        read = None if subject.format == EQUATIONS else case.model_at(value, subject.format)
        formats = [one for one in MODEL_SUFFIXES if is_of_file and case.library.has_model(mechanism.name, one)]
        declared = case.model_at(value, formats[0]) if formats else None
    except InvalidModel as error:
        # The case itself is wrong where its model is not physical.
        return replace(about, verdict=Verdict.ERROR.value, reason=str(error)), None
    if is_of_file and declared is None:
        raise NotOffered(f"{mechanism.name} has no model file")
    try:
        loaded = engine.load(mechanism if read is None else read, mechanism.joints, mechanism.gravity)
    except (ValueError, Unsupported) as error:
        return replace(about, verdict=Verdict.UNSUPPORTED.value, reason=f"{subject.engine} refuses the model: {error}"), None
    if case.configured is not None:
        loaded = case.configured(loaded, value)
    try:
        truth, certified = _truth_at(point, Assignment(engines, subject, mechanism, read, quantity=quantity, declared=declared))
    except InvalidModel as error:
        return replace(about, reason=str(error)), None
    about = _about(about, certified, f"the {quantity} of {{}} states is not certified")
    try:
        answers = truth.answers(loaded, states)
    except NotOffered:
        raise
    except Exception as error:
        return replace(about, verdict=Verdict.ERROR.value, reason=f"{type(error).__name__}: {error}"), None
    comparison = compare(certified, answers, truth.may_lose_digits(loaded))
    found = judged_point(about, states, comparison)
    if found.verdict == Verdict.DISAGREES and truth.blocks:
        remark = f"farthest off is the {truth.blocks[farthest_block(certified, answers)]}"
        found = replace(found, reason="; ".join(filter(None, [found.reason, remark])))
    return replace(found, unstable_bound=_unstable_bound(certified, comparison.worst)), answers


def _truth_at(point: TruePoint, assignment: Assignment) -> tuple[Truth, Certified]:
    if point.reference is None:
        return assignment.truth, assignment.truth.evaluate(point.states)
    engine = load_engine(assignment.library, assignment.subject.engine)
    return AccelerationTruth(point.mechanism, factorises=engine.factorises_mass_matrix), point.reference


def _unstable_bound(certified: Certified, index: int) -> float | None:
    """Data roundoffs that a factorisation of M may lose at one state; None where that is not known."""
    if not certified.instability[index]:
        return None
    with np.errstate(all="ignore"):
        bound = float(certified.instability[index] / certified.sensitivity[index])
    return bound if math.isfinite(bound) else None


def explained(truths: Sequence[TruePoint], answered: Sequence[Answered], in_body: bool) -> list[HardPoint]:
    """The points; where another value of one parameter explains the errors along the family, they are no lost digits."""
    points, parts, names = [found for found, _ in answered], [], []
    kernels: dict[Hashable, ReferenceKernel] = {}
    for point, (_, answers) in zip(truths, answered, strict=True):
        reference, states, mechanism = point.reference, point.states, point.mechanism
        if answers is None or reference is None:
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


def _about(point: HardPoint, certified: Certified | None, otherwise: str = "") -> HardPoint:
    """A point before any engine answers, with what is known of its truth; ``otherwise`` says of how many states it is not."""
    if certified is None:
        return point
    finite = certified.condition[np.isfinite(certified.condition)]
    missing = len(certified) - int(certified.certified.sum())
    return replace(
        point,
        condition=float(finite.max()) if len(finite) else None,
        certified=len(certified) - missing,
        bits=int(certified.bits.max(initial=0)),
        in_balls=int(certified.in_balls.sum()),
        reason="; ".join(dict.fromkeys(certified.why_undecided())) or (otherwise.format(missing) if missing else ""),
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


def _has_digits(point: HardPoint) -> bool:
    return point.digits_lost is not None and 10**point.digits_lost * UNIT_ROUNDOFF < NO_DIGITS_LEFT


def _slope(pairs: Sequence[tuple[float, float | None]]) -> float | None:
    """Least-squares slope of log error over log knob; None for fewer than ``FEWEST_POINTS_FITTED`` different knobs."""
    usable = [(abs(knob), error) for knob, error in pairs if knob and error and math.isfinite(error)]
    if len({knob for knob, _ in usable}) < FEWEST_POINTS_FITTED:
        return None
    x, y = np.log(np.array(usable)).T
    return float(np.polyfit(x, y, 1)[0])


def failed(case: HardCase, subject: Subject, quantity: str, reason: str, crash: Crash | None) -> HardRow:
    """The row of a task that gave none; its last note says at which point it died."""
    at = json.loads(crash.note) if crash and crash.note else {"knob": case.values[0], "system": case.system_at(case.values[0])}
    return row_of(case, subject, [HardPoint(verdict=Verdict.ERROR.value, reason=reason, **at)], quantity, crashed=crash is not None)
