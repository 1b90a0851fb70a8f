"""The choices among measured ways: the Pareto front of cost against error, and the cheapest way to a given error.

Source: a way is on the front where no other is both cheaper and more exact (V. Pareto, 1906).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from operator import itemgetter
from typing import TypeVar

from harness.results.benchmark import AccelerationCost, Benchmark, Cheapest, QuantityCost
from harness.results.motion_benchmark import MotionCost
from harness.results.table import counted

_Item = TypeVar("_Item")
_Answered = TypeVar("_Answered", AccelerationCost, QuantityCost)
ERRORS = (1e-3, 1e-6, 1e-9)


def front(items: Iterable[_Item], point: Callable[[_Item], tuple[float | None, float | None]], below: float = math.inf) -> list[_Item]:
    """Items on the Pareto front of (cost, error), cheapest first.

    One whose cost or error is not known, or is NaN, or whose error is not less than ``below``, is on none.
    """
    known = [(cost, error, item) for item in items for cost, error in [point(item)] if cost is not None and error is not None]
    chosen: list[_Item] = []
    best = below
    for cost, error, item in sorted(known, key=itemgetter(0, 1)):
        if not math.isnan(cost) and error < best:
            chosen.append(item)
            best = error
    return chosen


def acceleration_front(costs: Iterable[_Answered]) -> list[_Answered]:
    """Measurements that no other beats in both cost and worst backward error, cheapest first."""
    return front(costs, lambda cost: (cost.seconds_per_state, cost.backward_error))


def motion_front(costs: Iterable[MotionCost], by: str) -> list[MotionCost]:
    """Measurements that no other beats in both ``by``, which is "seconds" or "evaluations", and error of the end state.

    One that misses by as much as the whole motion is on no front.
    """
    return front(costs, lambda cost: (getattr(cost, by), cost.state_error), 1.0)


def way_of(measured: AccelerationCost | MotionCost) -> str:
    """The name under which a measurement can be repeated.

    As "pinocchio abaInParallel, 2 threads", "mujoco/mjcf, 10 states at once" or "mujoco RK4, step 0.001 s".
    """
    if isinstance(measured, QuantityCost):
        return f"{measured.method}, {counted(measured.states, 'state')} at once"
    if isinstance(measured, AccelerationCost):
        return measured.method if measured.threads == 1 else f"{measured.method}, {measured.threads} threads"
    if measured.step is not None:
        return f"{measured.integrator}, step {measured.step:g} s"
    return measured.integrator if measured.tolerance is None else f"{measured.integrator}, tolerance {measured.tolerance:.0e}"


def cost_of(measured: AccelerationCost | MotionCost) -> float | None:
    """Seconds per state, or per second of motion; None where nothing was timed."""
    if isinstance(measured, AccelerationCost):
        return measured.seconds_per_state
    return measured.cost


def error_of(measured: AccelerationCost | MotionCost) -> float | None:
    """The relative error: the worst of the states, or that of the end state; None where there is none."""
    return measured.relative_error if isinstance(measured, AccelerationCost) else measured.state_error


def cheapest(benchmark: Benchmark) -> list[Cheapest]:
    """For each system, kind and error of ``ERRORS``, the cheapest way that stays within the error.

    A system without any measurement of a kind has no entry of that kind.
    """
    found: list[Cheapest] = []
    kinds: dict[str, Sequence[AccelerationCost | MotionCost]] = {"accelerations": benchmark.accelerations, "motion": benchmark.motion}
    for kind, measurements in kinds.items():
        for system in sorted({measured.system for measured in measurements}):
            known = [(cost_of(m), error_of(m), way_of(m), m) for m in measurements if m.system == system]
            for asked in ERRORS:
                reaching = [(cost, way, m) for cost, error, way, m in known if cost is not None and error is not None and error <= asked]
                cost, way, m = min(reaching, key=lambda one: one[:2], default=(None, None, None))
                fastest = m.fastest if isinstance(m, AccelerationCost) else None
                found.append(Cheapest(system=system, kind=kind, error=asked, way=way, cost=cost, fastest=fastest))
    return found


def with_cheapest(benchmark: Benchmark) -> Benchmark:
    """The same measurements with what follows from them."""
    return replace(benchmark, cheapest=cheapest(benchmark))
