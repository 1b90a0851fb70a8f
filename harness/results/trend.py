"""The trend of each cell over the nights: a number of a subject on a system, and the nights at which it changed.

A number is a backward error (median, 99 % or worst) of a cross-check, or the cost of a method of a benchmark in units of a reference
computation that was timed beside it. ``harness.results.change_points`` has the method. No trend changes a verdict.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from harness.results.benchmark import Benchmark
from harness.results.change_points import Chart, Reading
from harness.results.quantiles import BOUNDS_AT
from harness.results.records import Record

# A change of an error by less than so many data roundoffs is none: half an ulp of an input moves the answer by one.
LEAST_ERROR, LARGEST_ERROR = 0.1, 1e16
# Least noise of the logarithm that is assumed of a number: of quantiles, of largest values, and of costs.
QUANTILE_NOISE, WORST_NOISE, COST_NOISE = 0.05, 0.25, 0.1
# Nights in a row that show another cost.
COST_RUN = 5
# Nights that a trend looks back.
MOST_NIGHTS = 60
MEDIAN, PERCENTILE_99, WORST, COST = "median backward error", "99 % backward error", "worst backward error", "cost"
# A system, a subject or method, and the name of a number.
Cell = tuple[str, str, str]


@dataclass(frozen=True, kw_only=True)
class ChangedCell:
    """A number of a subject that changed.

    Attributes:
        system, subject, number: which. before: its geometric mean over the nights since the last change; now: of the night of the change.
        by: logarithm of the ratio. nights: how many there were before. place: of the night, 0 for the oldest. found_by: "jump" or "drift".
    """

    system: str
    subject: str
    number: str
    before: float
    now: float
    by: float
    nights: int
    place: int
    found_by: str


def readings_of_records(records: Iterable[Record]) -> dict[Cell, Reading]:
    """What one cross-check says of each cell; a quantile whose bounds are not known has none."""
    found: dict[Cell, Reading] = {}
    for record in records:
        subject = record.title.removeprefix(record.system).strip()
        for name, value, bounds in (
            (MEDIAN, record.median_backward_error, record.median_bounds),
            (PERCENTILE_99, record.percentile_99_backward_error, record.percentile_99_bounds),
        ):
            if value is not None and bounds:
                noise = (_logarithm(bounds[1]) - _logarithm(bounds[0])) / (2 * BOUNDS_AT)
                found[record.system, subject, name] = Reading(_logarithm(value), max(QUANTILE_NOISE, noise))
        if record.backward_error is not None:
            reading = Reading(_logarithm(record.backward_error), WORST_NOISE, is_known=False, is_skewed=True)
            found[record.system, subject, WORST] = reading
    return found


def readings_of_costs(benchmark: Benchmark) -> dict[Cell, Reading]:
    """What one benchmark says of each cell: the fastest call over the fastest of the reference computation beside it."""
    yardsticks = {one.system: one.seconds for one in benchmark.yardsticks}
    return {
        (cost.system, cost.method, COST): Reading(math.log(cost.fastest / yardsticks[cost.system]), COST_NOISE, False, True, COST_RUN)
        for cost in benchmark.accelerations
        if cost.fastest and yardsticks.get(cost.system)
    }


def changes(nights: Sequence[Mapping[Cell, Reading]], chart: Chart | None = None) -> list[ChangedCell]:
    """Every change in the nights, oldest first, by cell; a night without a number of a cell is passed over for it."""
    series: dict[Cell, list[tuple[int, Reading]]] = defaultdict(list)
    for place, night in enumerate(nights):
        for cell, reading in night.items():
            series[cell].append((place, reading))
    chart = chart or Chart(len(nights[-1]) if nights else 0)
    return [
        ChangedCell(
            system=cell[0],
            subject=cell[1],
            number=cell[2],
            before=_plain(change.before, cell[2]),
            now=_plain(change.now, cell[2]),
            by=change.now - change.before,
            nights=change.nights,
            place=own[change.place][0],
            found_by=change.found_by,
        )
        for cell, own in sorted(series.items())
        for change in chart.changes([reading for _, reading in own])
    ]


def changes_of_the_last(nights: Sequence[Mapping[Cell, Reading]]) -> list[ChangedCell]:
    """The changes that the last of the nights shows."""
    return [one for one in changes(nights) if one.place == len(nights) - 1]


def _logarithm(error: float) -> float:
    return math.log(min(error, LARGEST_ERROR) + LEAST_ERROR) if not math.isnan(error) else math.log(LARGEST_ERROR)


def _plain(logarithm: float, number: str) -> float:
    value = math.exp(logarithm)
    return value if number == COST else max(0.0, value - LEAST_ERROR)
