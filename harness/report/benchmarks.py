"""A benchmark arranged for a reader, before it is HTML or Markdown: names, fronts, tables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import attrgetter
from typing import TypeVar

from harness.report.summary import ChangedValue, changed_versions
from harness.results.benchmark import AccelerationCost, Benchmark, Cheapest, Drift, MotionCost, Order, Stationarity
from harness.results.pareto import cost_of, front, way_of, with_cheapest
from harness.results.records import Run

_Cell = TypeVar("_Cell")


@dataclass(frozen=True)
class OrderRemark:
    """The reason why orders of convergence are not those of theory, and their places."""

    text: str
    places: list[str]


class BenchmarkSummary:
    """Measurements arranged for a reader.

    Attributes:
        run: versions, machine and settings of the benchmark.
        benchmark: its measurements, with ``cheapest``.
        systems: sorted names of every system whose accelerations or motion were measured.
        methods, integrators: sorted names; a method has its number of threads in the name where it is not 1.
        problems: sentences on what could not be measured.
        unexpected: sentences on what is not as theory or text has it and is not explained.
    """

    def __init__(self, run: Run, benchmark: Benchmark) -> None:
        self.run = run
        self.benchmark = benchmark = with_cheapest(benchmark)
        self.systems = sorted({*(cost.system for cost in benchmark.accelerations), *(cost.system for cost in benchmark.motion)})
        self.methods = sorted({way_of(cost) for cost in benchmark.accelerations})
        moved = [cost.integrator for cost in benchmark.motion]
        judged = [order.integrator for order in benchmark.orders] + [drift.integrator for drift in benchmark.drifts]
        self.integrators = sorted({*moved, *judged})
        self.problems = benchmark.problems
        self.unexpected = list(unexpected(benchmark))

    def accelerations(self, system: str) -> list[AccelerationCost]:
        """The methods on ``system``, cheapest first, those without a time last."""
        return _by_cost(cost for cost in self.benchmark.accelerations if cost.system == system)

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

    def drift_table(self) -> tuple[list[str], list[tuple[str, list[Drift | None]]]]:
        """Integrators for the columns, and (system, long runs) for the rows, None where there is none."""
        return _table({(drift.system, drift.integrator): drift for drift in self.drifts()})

    def paths(self, system: str) -> list[Stationarity]:
        """Stationary action on ``system``, by path and from coarse to fine."""
        chosen = [entry for entry in self.benchmark.stationarity if entry.system == system]
        return sorted(chosen, key=lambda entry: (entry.path, -entry.step))

    def path_table(self) -> tuple[list[str], list[tuple[str, list[Stationarity | None]]]]:
        """Paths for the columns, and (system, that path with its finest step) for the rows, None where there is none."""
        finest = sorted(self.benchmark.stationarity, key=lambda entry: -entry.step)
        return _table({(entry.system, entry.path): entry for entry in finest})

    def order_table(self) -> tuple[list[tuple[str, float | None]], list[tuple[str, list[Order | None]]]]:
        """(integrator, expected order) for the columns, and (system, orders) for the rows, None where there is none."""
        orders = self.benchmark.orders
        columns = sorted({(order.integrator, order.expected) for order in orders}, key=lambda column: (column[0], column[1] or 0.0))
        cells = {(order.system, order.integrator, order.expected): order for order in orders}
        systems = sorted({order.system for order in orders})
        return columns, [(system, [cells.get((system, *column)) for column in columns]) for system in systems]

    def explanations(self, verdicts: Sequence[str]) -> list[OrderRemark]:
        """The reasons why orders have one of ``verdicts``, each once."""
        places: dict[str, list[str]] = {}
        for order in sorted(self.benchmark.orders, key=lambda order: (order.integrator, order.system)):
            if order.explanation and order.verdict in verdicts:
                places.setdefault(order.explanation, []).append(f"{order.integrator} on {order.system}")
        return [OrderRemark(text, where) for text, where in places.items()]

    def changed_versions(self, run: Run) -> list[ChangedValue]:
        """Versions that the benchmark had and ``run`` has not."""
        return changed_versions(self.run.versions, run.versions)


def acceleration_front(costs: Sequence[AccelerationCost]) -> list[AccelerationCost]:
    """Those no other beats in both cost and worst backward error, cheapest first."""
    timed = [(cost, cost.seconds_per_state, cost.backward_error) for cost in costs]
    known = [(cost, seconds, error) for cost, seconds, error in timed if seconds is not None and error is not None]
    return [known[index][0] for index in front([(seconds, error) for _, seconds, error in known])]


def motion_front(costs: Sequence[MotionCost], by: str) -> list[MotionCost]:
    """Those no other beats in both ``by``, which is "seconds" or "evaluations", and error of the end state.

    One that misses by as much as the whole motion is on no front.
    """
    known = [(cost, float(getattr(cost, by)), cost.state_error) for cost in costs]
    reached = [(cost, spent, error) for cost, spent, error in known if error is not None and error < 1.0]
    return [reached[index][0] for index in front([(spent, error) for _, spent, error in reached])]


def unexpected(benchmark: Benchmark) -> Iterator[str]:
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


def _table(cells: Mapping[tuple[str, str], _Cell]) -> tuple[list[str], list[tuple[str, list[_Cell | None]]]]:
    columns = sorted({column for _, column in cells})
    return columns, [(row, [cells.get((row, column)) for column in columns]) for row in sorted({row for row, _ in cells})]


def _by_cost(costs: Iterable[AccelerationCost]) -> list[AccelerationCost]:
    return sorted(costs, key=lambda cost: ((spent := cost_of(cost)) is None, spent or 0.0, cost.method))


def _number(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.2f}"
