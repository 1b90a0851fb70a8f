"""A benchmark arranged for a reader: names and fronts, and tables, of which a medium shows all columns or some."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from itertools import groupby
from operator import attrgetter
from pathlib import PurePath
from typing import Any, TypeVar

from harness.report.sparkline import NO_TREND, Sparkline
from harness.results.benchmark import AccelerationCost, Benchmark, DerivativeCost, EngineFinding, Growth, QuantityCost, SolverCost
from harness.results.motion_benchmark import Drift, Figure, MotionCost, MotionTruth, Order, Stationarity
from harness.results.pareto import error_of, way_of, with_cheapest
from harness.results.run import Run
from harness.results.table import Cell, Column, Table, TableOf, counted, error_text, grouped, plural, relative_text, seconds_text
from harness.results.trend import Trend, comparable, readings_of_costs, trends

_Measured = TypeVar("_Measured", AccelerationCost, DerivativeCost, MotionCost, Drift, Stationarity)


class BenchmarkSummary:
    """Measurements arranged for a reader.

    Attributes:
        run: versions, machine and settings of the benchmark.
        nights: the benchmarks over which costs have trends, oldest first, this one last.
        benchmark: its measurements, with ``cheapest``.
        systems: sorted names of every system whose accelerations, other quantities or motion were measured.
        methods, integrators: sorted names; a method has its number of threads in the name where it is not 1.
        accelerations: by system, cheapest first, those without a time last. derivatives: most exact first, those that could not last.
        motion: by integrator and from coarse to fine. drifts: long runs by integrator. paths: stationary action by path, coarse to fine.
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
        self.problems, self.unexpected = benchmark.problems, benchmark.unexpected
        self.accelerations = _by_system(
            benchmark.accelerations, lambda cost: (cost.seconds_per_state is None, cost.seconds_per_state or 0.0, cost.method)
        )
        self.derivatives = _by_system(benchmark.derivatives, lambda cost: (cost.of, cost.error is None, cost.error or 0.0, cost.method))
        self.motion = _by_system(benchmark.motion, lambda cost: (cost.integrator, -(cost.step or cost.tolerance or 0.0)))
        self.drifts = _by_system(benchmark.drifts, attrgetter("integrator"))
        self.paths = _by_system(benchmark.stationarity, lambda entry: (entry.path, -entry.step))

    @property
    def is_good(self) -> bool:
        """True where something was measured, and all of it is as theory and text have it."""
        return self._has_measurements and not self.problems and not self.unexpected

    @property
    def _has_measurements(self) -> bool:
        found = self.benchmark
        costs = [cost.seconds_per_state for part in (found.accelerations, found.quantities) for cost in part]
        along = (found.orders, found.growth, found.truths, found.motion, found.drifts, found.stationarity)
        further = (found.derivatives, found.figures, [one for one in found.solvers if one.states], *along)
        return any(cost is not None for cost in costs) or any(further)

    @property
    def sentence(self) -> str:
        """The answer to which way is fast and exact; of several systems, which way is so on most of them."""
        if not self._has_measurements:
            return "Nothing was measured: no way that was asked for answers here; name other methods, quantities or mechanisms."
        parts = [*filter(None, map(self._cheapest, KINDS)), *self._solvers()] or [f"{counted(len(self.systems), 'system')} measured"]
        wrong = len(self.unexpected) + len(self.problems)
        parts += [f"{wrong} {plural(wrong, 'finding is', 'findings are')} not as expected"] if wrong else []
        return f"{'; '.join(parts)}."

    def _cheapest(self, kind: str) -> str:
        """The cheapest way to the smallest error that any way reaches."""
        known = [one for one in self.benchmark.cheapest if one.kind == kind and one.way is not None]
        if not known:
            return ""
        error = min(one.error for one in known)
        chosen = [one for one in known if one.error == error]
        ways = grouped((one.way, one) for one in chosen)
        way, own = max(ways.items(), key=lambda each: len(each[1]))
        head = f"{PurePath(chosen[0].system).name}: t" if len(self.systems) == 1 else f"On {len(own)} of {len(chosen)} systems t"
        times = sorted(one.cost for one in own if one.cost is not None)
        span = " to ".join(dict.fromkeys(seconds_text(time) for time in (times[0], times[-1])))
        return f"{head}he cheapest {kind} with an error up to {error:.0e} are those of {way} ({span} {KINDS[kind]})"

    def _solvers(self) -> list[str]:
        """Distance to which each file's own solver goes, and the solvers that reach the last digit with their iterations."""
        found = []
        for (system, engine), costs in grouped(((one.system, one.engine), one) for one in self.benchmark.solvers if one.states).items():
            own, tried = costs[0], grouped((one.method, one) for one in costs if one.method)
            ends = [
                f"{method} {'within' if last.is_right else 'not within'} {counted(last.iterations or 0, 'iteration')}"
                for method, (*_, last) in tried.items()
            ]
            left = "nowhere off" if own.is_right else f"up to {relative_text(own.relative_error)} of the acceleration off"
            found.append(
                f"{PurePath(system).name}: as the file sets it {engine}'s solver is {left} the optimum that it documents, "
                f"whose last digit is reached by {', '.join(ends)}"
            )
        return found

    @cached_property
    def trends(self) -> list[Trend]:
        """Trends of the cost of every method, in units of the reference computation beside it."""
        return trends([readings_of_costs(found) for _, found in self.nights])

    def quantities(self, system: str) -> dict[str, list[QuantityCost]]:
        """The costs of quantities beyond accelerations on ``system``, by quantity, each by subject and from few states at once to many."""
        shown = [cost for cost in self.benchmark.quantities if cost.system == system]
        return grouped((cost.quantity, cost) for cost in sorted(shown, key=attrgetter("quantity", "method", "states")))

    def explanations(self, verdicts: Sequence[str]) -> dict[str, list[str]]:
        """The reasons why orders of convergence have one of ``verdicts``, each with the places where it holds."""
        orders = sorted(self.benchmark.orders, key=attrgetter("integrator", "system"))
        chosen = [order for order in orders if order.explanation and order.verdict in verdicts]
        return grouped((order.explanation, f"{order.integrator} on {order.system}") for order in chosen)


def _by_system(measured: Iterable[_Measured], key: Callable[[_Measured], Any]) -> dict[str, list[_Measured]]:
    """Measurements on each system, in the order of ``key``; nothing on any other."""
    systems = grouped((one.system, one) for one in measured)
    return defaultdict(list, {system: sorted(own, key=key) for system, own in systems.items()})


_Entry = TypeVar("_Entry")
KINDS = {"accelerations": "per state", "motion": "per second of motion"}
_CAPTIONS = {"accelerations": "Accelerations: worst relative error over the states", "motion": "Motion: relative error of the end state"}


_COSTS_AND_ERRORS = "seconds_per_state fastest slowest timed backward_error median_backward_error relative_error"
_accelerations = TableOf(
    AccelerationCost,
    f"system method threads loop {_COSTS_AND_ERRORS} from_rigid states note",
    "Accelerations: cost and error of each method",
)
quantities = TableOf(
    QuantityCost, f"system quantity method states {_COSTS_AND_ERRORS} note", "Other quantities: cost and error of each subject"
)
derivatives = TableOf(
    DerivativeCost,
    "system of method loop best_step error first_seconds last_seconds most_states note",
    "Derivatives by q and v: cost, and error at the best step",
)
solvers = TableOf(
    SolverCost,
    "system engine solver seconds_per_state states touching right median_relative_error relative_error "
    "median_backward_error backward_error note",
    "Solvers of constraints: distance from the optimum that the engine documents, over iterations",
)
findings = TableOf(EngineFinding, "system method statement", "What engines get wrong")
growth = TableOf(Growth, "family method bodies exponent theory", "Growth of the cost with the number of bodies")
truths = TableOf(MotionTruth, "system horizon trusted error precision seconds begins", "Reference motions")
motions = TableOf(
    MotionCost,
    "integrator setting steps evaluations seconds cost state_error energy_error gap note",
    "Motion: cost and error of each integrator",
)
drifts = TableOf(Drift, "system integrator step steps largest gap growth energy theory seconds", "Energy over long runs")
paths = TableOf(Stationarity, "system path step residual slope first_variation", "Stationary action along computed paths")
figures = TableOf(Figure, "system what printed computed truth unit verdict remark", "Numbers that a text prints, computed again")


def accelerations(costs: Sequence[AccelerationCost], trends: Iterable[Trend] = ()) -> Table:
    """One row per way of computing accelerations; with the trend of its cost where ``trends`` are given."""
    lines = {(trend.system, trend.subject): Sparkline.of(trend) for trend in trends}
    table = _accelerations(costs)
    shown = [lines.get((cost.system, way_of(cost)), NO_TREND) for cost in costs]
    return table.with_column("trend of the cost", shown, "remark") if lines else table


def best_motions(summary: BenchmarkSummary) -> Table:
    """One row per system and integrator: its order, and its smallest error."""
    orders = {(order.system, order.integrator): order for order in summary.benchmark.orders}
    rows: list[list[object]] = []
    for system in summary.systems:
        for integrator, costs in groupby(summary.motion[system], key=attrgetter("integrator")):
            known = [(error, cost) for cost in costs if (error := error_of(cost)) is not None]
            error, best = min(known, key=lambda entry: entry[0], default=(None, None))
            order = orders.get((system, integrator))
            about = [order.measured, order.expected, order.verdict] if order else [None, None, ""]
            rows.append([system, integrator, *about, error, best and best.gap, best and best.cost])
    orders_shown = Column("order", "rounded"), Column("expected", "rounded"), "verdict"
    costs_shown = (
        Column("smallest error", "relative"),
        Column("constraints open by", "error"),
        Column("time per second of motion", "seconds"),
    )
    return Table(["system", "integrator", *orders_shown, *costs_shown], rows, "Order and smallest error of each integrator")


def orders(summary: BenchmarkSummary) -> Table:
    """System by integrator: the measured order of convergence, and a mark where it differs from theory."""
    orders = [(order, "any" if order.expected is None else f"{order.expected:g}") for order in summary.benchmark.orders]
    entries = {(order.system, f"{order.integrator} (order {expected})"): order for order, expected in orders}
    return _matrix(entries, _order_cell, "Measured order of convergence")


def drift_matrix(summary: BenchmarkSummary) -> Table:
    """System by integrator: how energy wanders."""
    entries = {(drift.system, drift.integrator): drift for drift in summary.benchmark.drifts}
    return _matrix(entries, _drift_cell, "How energy wanders over a long run")


def path_matrix(summary: BenchmarkSummary) -> Table:
    """System by path: the power of ε as which the action changes, at the finest step."""
    coarse_to_fine = sorted(summary.benchmark.stationarity, key=lambda entry: -entry.step)
    finest = {(entry.system, entry.path): entry for entry in coarse_to_fine}
    return _matrix(finest, _path_cell, "Power of ε as which the action changes")


def cheapest(summary: BenchmarkSummary, kind: str, pages: Mapping[str, str] | None = None) -> Table:
    """System by error asked for: the fastest way whose error is small enough, and its cost. ``pages``: of systems, from this page."""
    chosen = [entry for entry in summary.benchmark.cheapest if entry.kind == kind]
    rows: list[list[object]] = []
    for system, entries in grouped((entry.system, entry) for entry in chosen).items():
        rows.append([Cell(system, link=pages[system] if pages else "")])
        for one in entries:
            fastest = f", fastest {seconds_text(one.fastest)}" if one.fastest is not None else ""
            rows[-1].append(Cell(one.way, [f"{seconds_text(one.cost)} {KINDS[kind]}{fastest}"]) if one.way else "none reaches it")
    heads = [f"error at most {error:g}" for error in dict.fromkeys(entry.error for entry in chosen)]
    return Table(["system", *heads], rows, caption=_CAPTIONS[kind])


def _matrix(entries: Mapping[tuple[str, str], _Entry], cell: Callable[[_Entry], Cell], caption: str) -> Table:
    """System by column, of entries by both."""
    columns, empty = sorted({column for _, column in entries}), Cell(None, tone="empty", fills=True)
    cells = {place: cell(entry) for place, entry in entries.items()}
    rows = [[system, *(cells.get((system, column), empty) for column in columns)] for system in sorted({system for system, _ in entries})]
    return Table(["system", *(Column(column, "rounded") for column in columns)], rows, caption, "matrix numbers")


def _order_cell(order: Order) -> Cell:
    marks = ["✗"] if not order.as_expected else ["explained"] if order.verdict == "differs" else []
    tone = "empty" if order.measured is None else "disagrees" if not order.as_expected else "unstable" if marks else "agrees"
    return Cell(order.measured, marks, tone, fills=True, hint=order.explanation)


def _drift_cell(drift: Drift) -> Cell:
    tone = "disagrees" if not drift.as_expected else "agrees" if drift.verdict == "bounded" else "plain"
    return Cell(f"{drift.verdict}{'' if drift.as_expected else ' ✗'}", [error_text(drift.largest)], tone, fills=True)


def _path_cell(entry: Stationarity) -> Cell:
    return Cell(entry.slope, [f"step {entry.step:.1g} s"], "plain", fills=True)
