"""A benchmark arranged for a reader, before it is HTML or Markdown: names, fronts, tables."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import groupby
from operator import attrgetter
from typing import TypeVar

from harness.results.benchmark import AccelerationCost, Benchmark, Cheapest, DerivativeCost, Drift, MotionCost, QuantityCost, Stationarity
from harness.results.pareto import front, way_of, with_cheapest
from harness.results.records import Run
from harness.results.trend import Trend, comparable, readings_of_costs, trends

_Answered = TypeVar("_Answered", AccelerationCost, QuantityCost)
_Cost = TypeVar("_Cost", AccelerationCost, QuantityCost, MotionCost)


class BenchmarkSummary:
    """Measurements arranged for a reader.

    Attributes:
        run: versions, machine and settings of the benchmark.
        nights: the benchmarks over which costs have trends, oldest first, this one last.
        benchmark: its measurements, with ``cheapest``.
        systems: sorted names of every system whose accelerations, other quantities or motion were measured.
        methods, integrators: sorted names; a method has its number of threads in the name where it is not 1.
        problems: sentences on what could not be measured.
        unexpected: sentences on what is not as theory or text has it and is not explained.
    """

    def __init__(self, run: Run, benchmark: Benchmark, earlier: Sequence[tuple[Run, Benchmark]] = ()) -> None:
        self.run = run
        self.nights = [*comparable(run.states, sorted(earlier, key=lambda entry: entry[0].started)), (run, benchmark)]
        self.benchmark = benchmark = with_cheapest(benchmark)
        costs = benchmark.accelerations, benchmark.quantities, benchmark.derivatives, benchmark.motion
        self.systems = sorted({cost.system for part in costs for cost in part})
        self.methods = sorted({way_of(cost) for cost in benchmark.accelerations})
        self.integrators = sorted({one.integrator for part in (benchmark.motion, benchmark.orders, benchmark.drifts) for one in part})
        self.problems = benchmark.problems
        self.unexpected = self.unexpected_of(benchmark)

    @staticmethod
    def unexpected_of(benchmark: Benchmark) -> list[str]:
        """The attribute ``unexpected`` of a benchmark."""
        return list(_unexpected(benchmark))

    @cached_property
    def trends(self) -> list[Trend]:
        """Of the cost of every method, in units of the reference computation beside it."""
        return trends([readings_of_costs(found) for _, found in self.nights])

    def accelerations(self, system: str) -> list[AccelerationCost]:
        """The methods on ``system``, cheapest first, those without a time last."""
        shown = [cost for cost in self.benchmark.accelerations if cost.system == system]
        return sorted(shown, key=lambda cost: (cost.seconds_per_state is None, cost.seconds_per_state or 0.0, cost.method))

    def quantities(self, system: str) -> dict[str, list[QuantityCost]]:
        """The costs of quantities beyond accelerations on ``system``, by quantity, each by subject and from few states at once to many."""
        shown = [cost for cost in self.benchmark.quantities if cost.system == system]
        ordered = sorted(shown, key=attrgetter("quantity", "method", "states"))
        return {quantity: list(costs) for quantity, costs in groupby(ordered, key=attrgetter("quantity"))}

    def derivatives(self, system: str) -> list[DerivativeCost]:
        """The ways of computing derivatives on ``system``, most exact first, those that could not last."""
        shown = [cost for cost in self.benchmark.derivatives if cost.system == system]
        return sorted(shown, key=lambda cost: (cost.of, cost.error is None, cost.error or 0.0, cost.method))

    def motion(self, system: str) -> list[MotionCost]:
        """The integrators on ``system``, by name and from coarse to fine."""
        shown = [cost for cost in self.benchmark.motion if cost.system == system]
        return sorted(shown, key=lambda cost: (cost.integrator, -(cost.step or cost.tolerance or 0.0)))

    def cheapest(self, kind: str) -> list[tuple[str, list[Cheapest]]]:
        """System and its cheapest ways, one for each error asked for, largest error first."""
        chosen = [entry for entry in self.benchmark.cheapest if entry.kind == kind]
        return [(system, list(entries)) for system, entries in groupby(chosen, key=attrgetter("system"))]

    def drifts(self, system: str | None = None) -> list[Drift]:
        """Long runs by system and integrator, of one system or of all."""
        chosen = [drift for drift in self.benchmark.drifts if system in (None, drift.system)]
        return sorted(chosen, key=attrgetter("system", "integrator"))

    def paths(self, system: str) -> list[Stationarity]:
        """Stationary action on ``system``, by path and from coarse to fine."""
        chosen = [entry for entry in self.benchmark.stationarity if entry.system == system]
        return sorted(chosen, key=lambda entry: (entry.path, -entry.step))

    def explanations(self, verdicts: Sequence[str]) -> dict[str, list[str]]:
        """The reasons why orders of convergence have one of ``verdicts``, each with the places where it holds."""
        places: dict[str, list[str]] = {}
        for order in sorted(self.benchmark.orders, key=lambda order: (order.integrator, order.system)):
            if order.explanation and order.verdict in verdicts:
                places.setdefault(order.explanation, []).append(f"{order.integrator} on {order.system}")
        return places


def acceleration_front(costs: Sequence[_Answered]) -> list[_Answered]:
    """Those no other beats in both cost and worst backward error, cheapest first."""
    return _front(costs, "seconds_per_state", "backward_error", math.inf)


def motion_front(costs: Sequence[MotionCost], by: str) -> list[MotionCost]:
    """Those no other beats in both ``by``, which is "seconds" or "evaluations", and error of the end state.

    One that misses by as much as the whole motion is on no front.
    """
    return _front(costs, by, "state_error", 1.0)


def _front(costs: Sequence[_Cost], spent: str, error: str, below: float) -> list[_Cost]:
    points = [(getattr(cost, spent), getattr(cost, error)) for cost in costs]
    known = [place for place, point in enumerate(points) if None not in point and point[1] < below]
    return [costs[known[place]] for place in front([points[place] for place in known])]


def _unexpected(benchmark: Benchmark) -> Iterator[str]:
    """A sentence for each measurement that contradicts theory or text without an explanation."""
    for order in benchmark.orders:
        if not order.as_expected:
            orders = f"{_number(order.measured)}, expected {_number(order.expected)}"
            yield f"{order.integrator} on {order.system}: order of convergence {orders}"
    for drift in benchmark.drifts:
        if not drift.as_expected:
            yield f"{drift.integrator} on {drift.system}: energy over a long run is {drift.verdict}, expected {drift.expected}"
    for figure in benchmark.figures:
        if not figure.as_expected:
            yield f"{figure.system}, {figure.what}: printed {figure.printed:g} {figure.unit}, computed {figure.computed:g} {figure.unit}"


def _number(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.2f}"
