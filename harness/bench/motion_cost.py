"""Speed against error of motions: what integrators cost and how far they are from the truth.

Three measurements, each a task for a worker process: work and precision over a range of steps with the order of
convergence, and the energy over a long run without dampers. The truth has a horizon of its own, longer than that
of the sweep.

The order is the slope of log error over log step where steps are halved until slopes no longer change; errors near
rounding, and steps whose error is not small, do not count.

Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., section II.4 (numerical
experiments, work-precision diagrams); Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., chapter IX.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from harness.arrays import Array
from harness.crosscheck.scene import Scene
from harness.engines import Unsupported
from harness.motion.integrators import Advance, Integrator
from harness.motion.taylor import Path
from harness.motion.trajectories import HORIZON, Metric, Start, TrueMotion, drift, reference_motion
from harness.programs.mechanisms.kernel import EnergyKernel
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.results.motion_benchmark import MotionCost, MotionTruth, Order
from harness.study import Note

TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12, 1e-15)
# Of the runs by which an integrator explains itself [s].
EXPLAINING_STEP = 1e-3
# States kept for the energy balance; runs of fewer steps than FEWEST_STEPS are timed apart from keeping them.
KEPT, FEWEST_STEPS, REPETITIONS = 1000, 20000, 3
# The order is measured from the largest step with such an error, by halving it.
SMALL_ERROR, MOST_HALVINGS, MOST_ORDER_STEPS = 2e-2, 8, 64000
# A slope does not change any more where its last change is no larger than this, and the one before no more than
# twice as large: two slopes alone meet by chance, where the leading error changes its sign.
STABLE_SLOPE = 0.05
# A slope that differs from theory by more is another order.
ORDER_TOLERANCE = 0.1
# Roundings of a motion add up like a random walk, and each is some roundings of an evaluation.
ROUNDINGS_PER_STEP = 64
WORK_SPLINE_DEGREE = 7


class MotionJudge:
    """The truth of one scene, and the errors of computed motions against it."""

    def __init__(self, scene: Scene, horizon: float) -> None:
        mechanism = scene.mechanism
        self.scene, self._horizon, self._metric = scene, max(HORIZON, horizon), Metric(mechanism)
        start = Start.of(mechanism, self._horizon)
        self.reference = reference_motion(mechanism, start)
        self.start = replace(start, horizon=min(horizon, self.reference.trusted))
        within = self.reference.path[self.reference.path.times <= self.start.horizon * (1 + 1e-12)]
        self._scales, self._end = self._metric.scales(within), within[-1:]
        # Of a robot's file there are none.
        self._energies = EnergyKernel(mechanism) if mechanism.energy_programs else None
        kinetic = self._energies.along(within.q, within.v, within.times).kinetic if self._energies else np.zeros(1)
        self._largest_kinetic = float(kinetic.max()) or 1.0

    def state_error(self, path: Path) -> float | None:
        """Relative error of the end state; None where the motion broke down."""
        if abs(path.times[-1] - self.start.horizon) > 1e-9 * self.start.horizon:
            raise ValueError(f"the motion ends at {path.times[-1]} s; expected {self.start.horizon} s")
        error = float(self._metric.errors(self._end, path.q[-1:], path.v[-1:], self._scales)[0])
        return error if math.isfinite(error) else None

    def energy_error(self, path: Path) -> float | None:
        """Largest |E(t) - E0 - work of the non-conservative forces|, relative to the largest kinetic energy; None without energies."""
        if self._energies is None or not (np.isfinite(path.q).all() and np.isfinite(path.v).all()):
            return None
        found = self._energies.along(path.q, path.v, path.times)
        balance = found.energy - found.energy[0] - work_along(path, found.power)
        error = float(np.abs(balance).max()) / self._largest_kinetic
        return error if math.isfinite(error) else None

    def truth(self) -> MotionTruth:
        reference = self.reference
        return MotionTruth(
            system=self.scene.mechanism.name,
            start={"q": reference.path.q[0].tolist(), "v": reference.path.v[0].tolist()},
            horizon=self._horizon,
            trusted=reference.trusted,
            error=reference.error,
            precision=reference.precision,
            seconds=reference.path.seconds,
        )


def work_along(path: Path, power: Array) -> Array:
    """(k + 1,) work [J] of the non-conservative forces from the start, by a spline through their power (k + 1,) [W]."""
    if path.work is not None:
        return path.work
    if not power.any() or len(power) < 2:
        return np.zeros_like(power)
    from scipy.interpolate import make_interp_spline

    degree = min(WORK_SPLINE_DEGREE, (len(power) - 2) // 2 * 2 + 1)
    integral = make_interp_spline(path.times, power, k=degree).antiderivative()
    return np.asarray(integral(path.times) - integral(path.times[0]))


def motion_costs(
    scene: Scene, chosen: Sequence[Integrator], steps: Sequence[float], horizon: float, seconds: float, note: Note
) -> tuple[MotionTruth, list[MotionCost], list[Order]]:
    """Truth, work and precision, and orders of convergence of the integrators that are ``chosen``.

    ``steps`` [s] for integrators that take one, over ``horizon`` [s] or as far as the truth is trusted; a run of more evaluations than
    take ``seconds`` by ``Integrator.nominal_seconds`` is left out with a note. An integrator that lacks its model, or cannot express
    the mechanism, has one entry that says so.
    """
    name = scene.mechanism.name
    note(f"{name}: truth")
    judge = MotionJudge(scene, horizon)
    costs: list[MotionCost] = []
    orders: list[Order] = []
    for integrator in chosen:
        note(f"{name}: {integrator.name}")
        try:
            advance = integrator.prepare(scene)
        except Unsupported as reason:
            costs.append(_nothing(name, integrator, None, f"unsupported: {reason}"))
            continue
        found = _sweep(integrator, advance, judge, steps, seconds)
        costs += found
        if integrator.order is not None:
            orders.append(measured_order(integrator, advance, judge, found, seconds))
    return judge.truth(), costs, orders


def _sweep(integrator: Integrator, advance: Advance, judge: MotionJudge, steps: Sequence[float], seconds: float) -> list[MotionCost]:
    found: list[MotionCost] = []
    mechanism = judge.scene.mechanism
    most, per_step = seconds / integrator.nominal_seconds(mechanism), 0.0
    for size in TOLERANCES if integrator.adaptive else sorted(steps, reverse=True):
        count = KEPT if integrator.adaptive else max(1, round(judge.start.horizon / size))
        entry = _nothing(mechanism.name, integrator, size, "")
        if not integrator.adaptive and per_step * count > most:
            left_out = f"left out: about {per_step * count:,.0f} evaluations; the budget of this profile is {most:,.0f}"
            found.append(replace(entry, note=left_out))
            continue
        path, elapsed = _run(integrator, advance, judge.start, size, count)
        per_step, state_error = path.evaluations / count, judge.state_error(path)
        found.append(
            replace(
                entry,
                note="broke down" if state_error is None else "",
                step=None if integrator.adaptive else judge.start.horizon / count,
                steps=path.evaluations if integrator.adaptive else count,
                evaluations=path.evaluations,
                seconds=elapsed,
                state_error=state_error,
                energy_error=judge.energy_error(path),
                gap=drift(mechanism, path),
                duration=judge.start.horizon,
            )
        )
    return found


def _run(integrator: Integrator, advance: Advance, start: Start, size: float, count: int) -> tuple[Path, float]:
    """A path with states kept along it, and the wall time of the motion when they are not."""
    size = size if integrator.adaptive else start.horizon / count
    if count > FEWEST_STEPS:
        path = integrator.run(advance, start, size, count, KEPT)
        return path, path.seconds
    elapsed = min(integrator.run(advance, start, size, count, 1).seconds for _ in range(REPETITIONS))
    return integrator.run(advance, start, size, count, KEPT), elapsed


def _nothing(system: str, integrator: Integrator, size: float | None, reason: str) -> MotionCost:
    step, tolerance = (None, size) if integrator.adaptive else (size, None)
    return MotionCost(system=system, integrator=integrator.name, step=step, tolerance=tolerance, note=reason)


def measured_order(integrator: Integrator, advance: Advance, judge: MotionJudge, sweep: Sequence[MotionCost], seconds: float) -> Order:
    """The order of convergence of an integrator with fixed steps, by halving them from where the error is small."""
    about = Order(system=judge.scene.mechanism.name, integrator=integrator.name, expected=integrator.order, verdict="no asymptotic range")
    small = [cost for cost in sweep if cost.state_error is not None and cost.state_error <= SMALL_ERROR]
    explanation = (
        integrator.explain(judge.scene, judge.start, min(EXPLAINING_STEP, judge.start.horizon / KEPT)) if integrator.explain else ""
    )
    if not small:
        return replace(about, explanation=f"no step has an error below {SMALL_ERROR:g}")
    first = min(small, key=lambda cost: cost.steps)
    sizes, errors, slopes = [first.step or 0.0], [first.state_error or 0.0], []
    count, per_step = first.steps, first.evaluations / first.steps
    most = seconds / integrator.nominal_seconds(judge.scene.mechanism)
    for _ in range(MOST_HALVINGS):
        count *= 2
        if count > MOST_ORDER_STEPS or per_step * count > most:
            break
        path = advance(judge.start, judge.start.horizon / count, count, count)
        error = judge.state_error(path)
        if error is None or error < rounding(count, judge.reference):
            break
        sizes.append(judge.start.horizon / count)
        errors.append(error)
        slopes.append(math.log(errors[-2] / errors[-1]) / math.log(2))
        if _is_stable(slopes):
            break
    printed = ", ".join(f"{slope:.2f}" for slope in slopes)
    if not _is_stable(slopes):
        reason = f"slopes {printed or 'none'} still change where rounding or the budget of evaluations ends the range"
        return replace(about, explanation="; ".join(filter(None, [reason, explanation])), steps=sizes)
    order = float(np.polyfit(np.log(sizes[-3:]), np.log(errors[-3:]), 1)[0])
    assert integrator.order is not None
    if abs(order - integrator.order) > ORDER_TOLERANCE:
        verdict, explanation = "differs", f"slopes {printed}; {explanation}" if explanation else ""
    else:
        verdict = "as expected"
    return replace(about, measured=order, verdict=verdict, explanation=explanation, steps=sizes[-3:])


def _is_stable(slopes: Sequence[float]) -> bool:
    if len(slopes) < 3:
        return False
    before, last = np.abs(np.diff(slopes[-3:]))
    return bool(last <= STABLE_SLOPE and before <= 2 * STABLE_SLOPE)


def rounding(steps: int, reference: TrueMotion) -> float:
    """Relative error of a motion that rounding alone explains."""
    return max(ROUNDINGS_PER_STEP * UNIT_ROUNDOFF * math.sqrt(steps), 10 * reference.error)
