"""The trend of each cell over the nights: a number of a subject on a system, and the nights at which it changed.

A number is a backward error (median, 99 % or worst) of a cross-check, or the cost of a method of a benchmark in units of a reference
computation that was timed beside it. ``harness.results.change_points`` has the method. No trend changes a verdict.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, TypeVar

from harness.results.benchmark import Benchmark
from harness.results.change_points import Chart, NightValue
from harness.results.pareto import way_of
from harness.results.quantiles import BOUNDS_AT
from harness.results.records import Record, Run
from harness.results.table import Column, Table, TableOf, grouped
from harness.results.trend_numbers import COST, MEDIAN, PERCENTILE_99, WORST, logarithm_of, number_of

# Least noise of the logarithm that is assumed of a number: of quantiles, of largest values, and of costs.
QUANTILE_NOISE, WORST_NOISE, COST_NOISE = 0.05, 0.25, 0.1
# Nights in a row that show another cost.
COST_RUN = 5
# Nights that a trend looks back.
MOST_NIGHTS = 60
# A system, a subject or method, and the name of a number.
Cell = tuple[str, str, str]
_Found = TypeVar("_Found")


@dataclass(frozen=True, kw_only=True)
class ChangedCell:
    """A number of a subject that changed.

    Attributes:
        system, subject, number: which. before: its geometric mean over the nights since the last change; now: of the night of the change,
            or of the mildest night of a run that shows it.
        by: logarithm of the ratio. nights: how many there were before. place: of the night, 0 for the oldest. found_by: "jump" or "drift".
        run: how many nights in a row had to show it.
    """

    system: Annotated[str, Column("system")]
    subject: Annotated[str, Column("subject")]
    number: Annotated[str, Column("number")]
    before: Annotated[float, Column("before", "error")]
    now: Annotated[float, Column("now", "error")]
    by: float
    nights: Annotated[int, Column("nights before", "count")]
    place: int
    found_by: Annotated[str, Column("found by")]
    run: int = 1


_changes_table = TableOf(ChangedCell, "system subject number before now nights found_by", "Changed in the trend")


def trend_changes_table(changes: Iterable[ChangedCell]) -> Table:
    """A row for each change of a trend, the largest first."""
    return _changes_table(sorted(changes, key=lambda one: -abs(one.by)))


@dataclass(frozen=True, kw_only=True)
class Trend:
    """A number of a subject over the nights.

    Attributes:
        system, subject, number: which. values: one for each night, oldest first; None for a night without the number.
        changes: oldest first.
    """

    system: str
    subject: str
    number: str
    values: Sequence[float | None]
    changes: Sequence[ChangedCell]


def readings_of_records(records: Iterable[Record]) -> dict[Cell, NightValue]:
    """Values of one cross-check for each cell; a quantile whose bounds are not known has none."""
    found: dict[Cell, NightValue] = {}
    for record in records:
        for name, value, bounds in (
            (MEDIAN, record.median_backward_error, record.median_bounds),
            (PERCENTILE_99, record.percentile_99_backward_error, record.percentile_99_bounds),
        ):
            if value is not None and bounds:
                low, high = (logarithm_of(bound, name) for bound in bounds)
                noise = (high - low) / (2 * BOUNDS_AT)
                found[record.system, record.series, name] = NightValue(
                    logarithm_of(value, name), max(QUANTILE_NOISE, noise), measured=value
                )
        if record.backward_error is not None:
            error = record.backward_error
            found[record.system, record.series, WORST] = NightValue(
                logarithm_of(error, WORST), WORST_NOISE, is_known=False, is_skewed=True, measured=error
            )
    return found


def readings_of_costs(benchmark: Benchmark) -> dict[Cell, NightValue]:
    """Costs of one benchmark for each cell: the fastest call over the fastest of the reference computation beside it."""
    yardsticks = {one.system: one.seconds for one in benchmark.yardsticks}
    found = {}
    for cost in benchmark.accelerations:
        if cost.fastest and (yardstick := yardsticks.get(cost.system)):
            ratio = cost.fastest / yardstick
            found[cost.system, way_of(cost), COST] = NightValue(logarithm_of(ratio, COST), COST_NOISE, False, True, COST_RUN, ratio)
    return found


def comparable(states: int, runs: Iterable[tuple[Run, _Found]]) -> list[tuple[Run, _Found]]:
    """Runs whose numbers have one trend: the largest of more states is larger."""
    return [(run, found) for run, found in runs if run.states == states]


def trends(nights: Sequence[Mapping[Cell, NightValue]], chart: Chart | None = None) -> list[Trend]:
    """The trend of every cell with the changes in it, by cell; a night without a number of a cell is passed over for it."""
    series = grouped((cell, (place, reading)) for place, night in enumerate(nights) for cell, reading in night.items())
    chart = chart or Chart(len(nights[-1]) if nights else 0)
    found = []
    for (system, subject, number), own in sorted(series.items()):
        changes = [
            ChangedCell(
                system=system,
                subject=subject,
                number=number,
                before=number_of(change.before, number),
                now=number_of(change.now, number),
                by=change.now - change.before,
                nights=change.nights,
                place=own[change.place][0],
                found_by=change.found_by,
                run=own[change.place][1].run,
            )
            for change in chart.changes([reading for _, reading in own])
        ]
        measured = {place: reading.measured for place, reading in own}
        values = [measured.get(place) for place in range(len(nights))]
        found.append(Trend(system=system, subject=subject, number=number, values=values, changes=changes))
    return found


def changes(nights: Sequence[Mapping[Cell, NightValue]], chart: Chart | None = None) -> list[ChangedCell]:
    """Every change in the nights, by cell and then oldest first; see ``trends``."""
    return [one for trend in trends(nights, chart) for one in trend.changes]


def changes_of_the_last(nights: Sequence[Mapping[Cell, NightValue]]) -> list[ChangedCell]:
    """The changes that the last of the nights shows."""
    return [one for one in changes(nights) if one.place == len(nights) - 1]
