"""The tables of a benchmark; each medium shows all of their columns or some."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
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
    EngineFinding,
    Figure,
    Growth,
    MotionCost,
    MotionTruth,
    Order,
    QuantityCost,
    Stationarity,
)
from harness.results.pareto import error_of, way_of
from harness.results.table import Cell, Column, Table, TableOf, error_text, seconds_text
from harness.results.trend import Trend

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
        for integrator, costs in groupby(summary.motion(system), key=attrgetter("integrator")):
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


def orders(summary: BenchmarkSummary, cell: Callable[[Order], Cell] | None = None) -> Table:
    """System by integrator: the measured order of convergence, and a mark where it differs from theory; or another ``cell``."""
    orders = [(order, "any" if order.expected is None else f"{order.expected:g}") for order in summary.benchmark.orders]
    entries = {(order.system, f"{order.integrator} (order {expected})"): order for order, expected in orders}
    return _matrix(entries, cell or _order_cell, "Measured order of convergence")


def drift_matrix(summary: BenchmarkSummary) -> Table:
    """System by integrator: how energy wanders."""
    entries = {(drift.system, drift.integrator): drift for drift in summary.drifts()}
    return _matrix(entries, _drift_cell, "How energy wanders over a long run")


def path_matrix(summary: BenchmarkSummary) -> Table:
    """System by path: the power of ε as which the action changes, at the finest step."""
    coarse_to_fine = sorted(summary.benchmark.stationarity, key=lambda entry: -entry.step)
    finest = {(entry.system, entry.path): entry for entry in coarse_to_fine}
    return _matrix(finest, _path_cell, "Power of ε as which the action changes")


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
