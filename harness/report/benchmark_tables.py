"""The tables of a benchmark; each medium shows all of their columns or some."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from itertools import groupby
from operator import attrgetter
from typing import TypeVar

from harness.report.benchmarks import BenchmarkSummary
from harness.report.sparkline import NO_TREND, Sparkline
from harness.results.benchmark import (
    AccelerationCost,
    Cheapest,
    DerivativeCost,
    Drift,
    Figure,
    MotionCost,
    Order,
    QuantityCost,
    Stationarity,
)
from harness.results.pareto import cost_of, error_of, way_of
from harness.results.table import Cell, Column, Table, counted, error_text, seconds_text
from harness.results.trend import Trend

_Entry = TypeVar("_Entry")
KINDS = {"accelerations": "per state", "motion": "per second of motion"}
_CAPTIONS = {"accelerations": "Accelerations: worst relative error over the states", "motion": "Motion: relative error of the end state"}


_COSTS_AND_ERRORS: Mapping[str | Column, str | Callable[[AccelerationCost], object]] = {
    Column("time per state", "seconds"): "seconds_per_state",
    Column("fastest", "seconds"): "fastest",
    Column("slowest", "seconds"): "slowest",
    Column("timed", "plain"): lambda cost: counted(cost.repetitions, "time"),
    Column("worst backward error", "error"): "backward_error",
    Column("median backward error", "error"): "median_backward_error",
    Column("worst relative error", "relative"): "relative_error",
}


def accelerations(costs: Iterable[AccelerationCost], trends: Iterable[Trend] = ()) -> Table:
    """One row per way of computing accelerations; with the trend of its cost where ``trends`` are given."""
    lines = {(trend.system, trend.subject): Sparkline.of(trend) for trend in trends}
    return Table.of(
        costs,
        {
            "system": "system",
            "method": "method",
            Column("threads", "count"): "threads",
            "loop over states": "loop",
            **_COSTS_AND_ERRORS,
            Column("distance from rigid", "relative"): "from_rigid",
            Column("states", "count"): "states",
            **({"trend of the cost": lambda cost: lines.get((cost.system, way_of(cost)), NO_TREND)} if lines else {}),
            "remark": "note",
        },
        "Accelerations: cost and error of each method",
    )


def quantities(costs: Iterable[QuantityCost]) -> Table:
    """One row per quantity beyond accelerations, subject and number of states at once."""
    return Table.of(
        costs,
        {
            "system": "system",
            "quantity": "quantity",
            "subject": "method",
            Column("states at once", "count"): "states",
            **_COSTS_AND_ERRORS,
            "remark": "note",
        },
        "Other quantities: cost and error of each subject",
    )


def derivatives(costs: Iterable[DerivativeCost]) -> Table:
    """One row per way of computing derivatives by q and v."""
    return Table.of(
        costs,
        {
            "system": "system",
            "of": "of",
            "method": "method",
            "loop over states": "loop",
            Column("best step", "given"): "best_step",
            Column("relative error there", "relative"): "error",
            Column("time of one state", "seconds"): lambda cost: next(iter(cost.seconds_per_state), None),
            Column("time per state of most", "seconds"): lambda cost: next(reversed(cost.seconds_per_state), None),
            Column("most states at once", "count"): lambda cost: max(cost.states, default=0),
            "remark": "note",
        },
        "Derivatives by q and v: cost, and error at the best step",
    )


def findings(summary: BenchmarkSummary) -> Table:
    """One row per way of asking an engine whose answers are wrong."""
    return Table.of(
        summary.benchmark.findings,
        {
            "system": "system",
            "method": "method",
            "finding": "statement",
        },
        "What engines get wrong",
    )


def growth(summary: BenchmarkSummary) -> Table:
    """One row per method on a family of sizes."""
    return Table.of(
        summary.benchmark.growth,
        {
            "family": "family",
            "method": "method",
            "bodies": lambda found: ", ".join(map(str, found.sizes)),
            Column("exponent", "rounded"): "exponent",
            Column("expected", "plain"): lambda found: found.expected or None,
        },
        "Growth of the cost with the number of bodies",
    )


def truths(summary: BenchmarkSummary) -> Table:
    """One row per reference motion."""
    return Table.of(
        summary.benchmark.truths,
        {
            "system": "system",
            Column("length", "given", "s"): "horizon",
            Column("trusted", "figure", "s"): "trusted",
            Column("error", "error"): "error",
            "the two runs": "precision",
            Column("cost", "seconds"): "seconds",
            "start": lambda truth: "; ".join(f"{name} = [{', '.join(map('{:.4g}'.format, part))}]" for name, part in truth.start.items()),
        },
        "Reference motions",
    )


def motions(costs: Iterable[MotionCost]) -> Table:
    """One row per integrator with one step or tolerance."""
    return Table.of(
        costs,
        {
            "integrator": "integrator",
            Column("step or tolerance", "plain"): _setting,
            Column("steps", "count"): "steps",
            Column("evaluations", "count"): "evaluations",
            Column("time", "seconds"): "seconds",
            Column("time per second of motion", "seconds"): cost_of,
            Column("error of the end state", "relative"): "state_error",
            Column("error of the energy balance", "relative"): "energy_error",
            Column("constraints open by", "error"): "gap",
            "remark": "note",
        },
        "Motion: cost and error of each integrator",
    )


def best_motions(summary: BenchmarkSummary) -> Table:
    """One row per system and integrator: its order, and its smallest error."""
    orders = {(order.system, order.integrator): order for order in summary.benchmark.orders}
    rows: list[list[object]] = []
    for system in summary.systems:
        for integrator, costs in groupby(summary.motion(system), key=attrgetter("integrator")):
            known = [(error, cost) for cost in costs if (error := error_of(cost)) is not None]
            error, best = min(known, key=lambda entry: entry[0], default=(None, None))
            order = orders.get((system, integrator))
            about = [order.measured, order.expected, order.verdict] if order else [None, None, ""]
            rows.append([system, integrator, *about, error, best and best.gap, cost_of(best) if best else None])
    orders_shown = Column("order", "rounded"), Column("expected", "rounded"), "verdict"
    costs_shown = (
        Column("smallest error", "relative"),
        Column("constraints open by", "error"),
        Column("time per second of motion", "seconds"),
    )
    return Table(["system", "integrator", *orders_shown, *costs_shown], rows, "Order and smallest error of each integrator")


def orders(summary: BenchmarkSummary, cell: Callable[[Order], Cell] | None = None) -> Table:
    """System by integrator: the measured order of convergence, and a mark where it differs from theory; or another ``cell``."""
    orders = [(order, "any" if order.expected is None else f"{order.expected:g}") for order in summary.benchmark.orders]
    entries = {(order.system, f"{order.integrator} (order {expected})"): order for order, expected in orders}
    return _matrix(entries, cell or _order_cell, "Measured order of convergence")


def drifts(found: Iterable[Drift]) -> Table:
    """One row per long run."""
    return Table.of(
        found,
        {
            "system": "system",
            "integrator": "integrator",
            Column("step", "given", "s"): "step",
            Column("steps", "count"): "steps",
            Column("largest error", "relative"): "largest",
            Column("constraints open by", "error"): "gap",
            Column("grows as time to the", "rounded"): "growth",
            "energy is": lambda drift: Cell(drift.verdict, tone="" if drift.as_expected else "disagrees"),
            "expected": lambda drift: drift.expected or "-",
            Column("time", "seconds"): "seconds",
        },
        "Energy over long runs",
    )


def drift_matrix(summary: BenchmarkSummary) -> Table:
    """System by integrator: how energy wanders."""
    entries = {(drift.system, drift.integrator): drift for drift in summary.drifts()}
    return _matrix(entries, _drift_cell, "How energy wanders over a long run")


def paths(found: Iterable[Stationarity]) -> Table:
    """One row per path and step."""
    return Table.of(
        found,
        {
            "system": "system",
            "path": "path",
            Column("step", "given", "s"): "step",
            Column("residual of the discrete Euler-Lagrange equations", "error"): "residual",
            Column("S changes as ε to the", "rounded"): "slope",
            Column("first variation", "error"): "first_variation",
        },
        "Stationary action along computed paths",
    )


def path_matrix(summary: BenchmarkSummary) -> Table:
    """System by path: the power of ε as which the action changes, at the finest step."""
    coarse_to_fine = sorted(summary.benchmark.stationarity, key=lambda entry: -entry.step)
    finest = {(entry.system, entry.path): entry for entry in coarse_to_fine}
    return _matrix(finest, _path_cell, "Power of ε as which the action changes")


def figures(summary: BenchmarkSummary) -> Table:
    """One row per number that a text prints."""
    return Table.of(
        summary.benchmark.figures,
        {
            "system": "system",
            "what": "what",
            Column("printed", "given"): "printed",
            Column("computed", "figure"): "computed",
            Column("true motion", "figure"): "truth",
            "unit": "unit",
            "reproduced": _reproduced,
            "remark": "remark",
        },
        "Numbers that a text prints, computed again",
    )


def cheapest(summary: BenchmarkSummary, kind: str, pages: Mapping[str, str] | None = None) -> Table:
    """System by error asked for: the fastest way whose error is small enough, and its cost. ``pages``: of systems, from this page."""
    found = summary.cheapest(kind)
    heads = [f"error at most {entry.error:g}" for entry in found[0][1]] if found else []
    rows = [
        [Cell(system, link=pages[system] if pages else "")]
        + [Cell(e.way, [f"{seconds_text(e.cost)} {KINDS[kind]}{_fastest(e)}"]) if e.way else Cell("none reaches it") for e in entries]
        for system, entries in found
    ]
    return Table(["system", *heads], rows, caption=_CAPTIONS[kind])


def _fastest(way: Cheapest) -> str:
    return f", fastest {seconds_text(way.fastest)}" if way.fastest is not None else ""


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


def _reproduced(figure: Figure) -> Cell:
    if figure.reproduced:
        return Cell("yes", tone="agrees")
    return Cell("no", tone="unstable" if figure.remark else "disagrees")


def _setting(cost: MotionCost) -> str | None:
    if cost.step is not None:
        return f"{cost.step:g} s"
    return None if cost.tolerance is None else f"{cost.tolerance:.0e}"
