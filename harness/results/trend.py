"""The trend of each cell over the nights: a number of a subject on a system, and the nights at which it changed.

A number is a backward error (median, 99 % or worst) of a cross-check, or the cost of a method of a benchmark in units of a reference
computation that was timed beside it. ``harness.results.change_points`` has the method. No trend changes a verdict.

Two runs, or two versions of an engine in one, are held against each other too: what changed of each subject on each system, and whether
it became worse. Verdicts and messages are compared as they are, messages without their numbers. A median or a 99 % quantile changed
where the two differ by more than their samples can, for all cells together. Times of two runs do not compare: a cost is told where it
moved against the costs of all others. Times of one run do.
"""

from __future__ import annotations

import math
import re
import statistics
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, TypeVar

from harness.results.benchmark import Benchmark
from harness.results.change_points import Chart, NightValue
from harness.results.pareto import way_of
from harness.results.quantiles import BOUNDS_AT
from harness.results.records import Record
from harness.results.run import Run
from harness.results.table import Cell as TableCell
from harness.results.table import Column, Table, TableOf, grouped
from harness.results.trend_numbers import COST, MEDIAN, PERCENTILE_99, WORST, logarithm_of, number_of
from harness.verdict import SEVERITY, Verdict

# Least noise of the logarithm that is assumed of a number: of quantiles, of largest values, and of costs.
QUANTILE_NOISE, WORST_NOISE, COST_NOISE = 0.05, 0.25, 0.1
# Nights in a row that show another cost.
COST_RUN = 5
# Nights that a trend looks back.
MOST_NIGHTS = 60
# A system, a subject or method, and the name of a number.
Cell = tuple[str, str, str]
_Found = TypeVar("_Found")
VERDICT, MESSAGE, TIME, CAME, WENT = "verdict", "message", "time per state", "came", "went"
# A cost against those of all others, as a factor: less is the noise of a machine.
LEAST_COST_RATIO = 2.0
_NUMBER = re.compile(r"[-+]?\d[\d,.]*(?:e[-+]?\d+)?%?")
Key = tuple[str, str]


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
            found[record.system, record.series, WORST] = NightValue(logarithm_of(error, WORST), WORST_NOISE, WORST, measured=error)
    return found


def readings_of_costs(benchmark: Benchmark) -> dict[Cell, NightValue]:
    """Costs of one benchmark for each cell: the fastest call over the fastest of the reference computation beside it."""
    yardsticks = {one.system: one.seconds for one in benchmark.yardsticks}
    found = {}
    for cost in benchmark.accelerations:
        if cost.fastest and (yardstick := yardsticks.get(cost.system)):
            ratio = cost.fastest / yardstick
            found[cost.system, way_of(cost), COST] = NightValue(logarithm_of(ratio, COST), COST_NOISE, COST, COST_RUN, ratio)
    return found


def comparable(states: int, runs: Iterable[tuple[Run, _Found]]) -> list[tuple[Run, _Found]]:
    """Runs whose numbers have one trend: the largest of more states is larger."""
    return [(run, found) for run, found in runs if run.states == states]


def trends(nights: Sequence[Mapping[Cell, NightValue]], chart: Chart | None = None) -> list[Trend]:
    """The trend of every cell with the changes in it, by cell; a night without a number of a cell is passed over for it."""
    series = grouped((cell, (place, reading)) for place, night in enumerate(nights) for cell, reading in night.items())
    chart = chart or Chart(len(nights[-1]) if nights else 0)
    changes_of = chart.changes(series)
    found = []
    for cell, own in sorted(series.items()):
        system, subject, number = cell
        changes = [
            ChangedCell(
                system=system,
                subject=subject,
                number=number,
                before=number_of(change.before, number),
                now=number_of(change.now, number),
                by=change.now - change.before,
                nights=change.nights,
                place=change.place,
                found_by=change.found_by,
                run=own[-1][1].run,
            )
            for change in changes_of[cell]
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


@dataclass(frozen=True, kw_only=True)
class RunChange:
    """One thing that is otherwise.

    Attributes:
        system, subject: of the record, the subject with the quantity where it is not the usual one.
        what: "verdict", "message", "came", "went", "time per state" or the name of a backward error; of two versions of an engine also
            one of ``harness.results.upgrade``. before, now: as text.
        is_worse: whether it counts against the second run. A cost and a worst error alone do not, nor does what was not asked.
        is_better: whether it counts for the second run. size: of the change where it has one, relative.
    """

    system: Annotated[str, Column("system")]
    subject: Annotated[str, Column("subject")]
    what: str
    before: Annotated[str, Column("before")]
    now: Annotated[str, Column("now")]
    is_worse: bool = False
    is_better: bool = False
    size: float | None = None

    @property
    def marked(self) -> Annotated[TableCell, Column("what")]:
        """``what``, marked where it is worse."""
        return TableCell(self.what, tone="surprise" if self.is_worse else "")

    @property
    def worse(self) -> Annotated[str, Column("worse")]:
        """ "worse" or nothing."""
        return "worse" if self.is_worse else ""


@dataclass(frozen=True, kw_only=True)
class ComparedRun:
    """A run of the history by its number."""

    number: int
    run: Run
    records: Sequence[Record]


def run_changes(before: Iterable[Record], now: Iterable[Record], in_one_run: bool = False) -> list[RunChange]:
    """Changes from the first run to the second, by system and subject, the verdict first; ``in_one_run`` where both were timed in one."""
    old, new = ({(record.system, record.series): record for record in records} for records in (before, now))
    found: list[RunChange] = []
    for key in sorted(old.keys() | new.keys()):
        if key not in old:
            found.append(_change(key, CAME, "", new[key].verdict, not new[key].as_expected))
        elif key not in new:
            found.append(_change(key, WENT, old[key].verdict, ""))
        else:
            found += _of_record(key, old[key], new[key])
    numbers = [*_errors(old, new), *_costs(old, new, in_one_run)]
    return sorted([*found, *numbers], key=lambda one: (one.system, one.subject))


changes_between = TableOf(RunChange, "system subject marked before now worse", "Changes")


def _change(key: Key, what: str, before: str, now: str, is_worse: bool = False, is_better: bool = False) -> RunChange:
    return RunChange(system=key[0], subject=key[1], what=what, before=before, now=now, is_worse=is_worse, is_better=is_better)


def _of_record(key: Key, before: Record, now: Record) -> Iterator[RunChange]:
    """The verdict, or that it is no longer the expected one, and the message."""
    if (before.verdict, before.as_expected) != (now.verdict, now.as_expected):
        by = SEVERITY[now.verdict] - SEVERITY[before.verdict]
        is_worse = by > 0 or (before.as_expected and not now.as_expected)
        yield _change(key, VERDICT, _verdict(before), _verdict(now), is_worse, by < 0 and not is_worse)
    if _NUMBER.sub("#", before.message) != _NUMBER.sub("#", now.message):
        yield _change(key, MESSAGE, before.message, now.message)


def _verdict(record: Record) -> str:
    if record.as_expected:
        return record.verdict
    return f"{record.verdict} ({'; '.join(record.beyond) or f'expected {record.expected}'})"


def _errors(before: Mapping[Key, Record], now: Mapping[Key, Record]) -> Iterator[RunChange]:
    old, new = readings_of_records(before.values()), readings_of_records(now.values())
    chart = Chart(len(old.keys() & new.keys()))
    for cell in sorted(old.keys() & new.keys()):
        verdicts = {before[cell[:2]].verdict, now[cell[:2]].verdict}
        if len(verdicts) > 1 and Verdict.EXPLAINED in verdicts:
            # The errors are those of answers to different questions: what is read of the file, and the file.
            continue
        first, second = old[cell], new[cell]
        by = second.value - first.value
        if abs(by) > chart.limit() * math.hypot(first.noise, second.noise):
            counts = cell[2] != WORST
            yield _change(cell[:2], cell[2], f"{first.measured:.3g}", f"{second.measured:.3g}", by > 0 and counts, by < 0 and counts)


def _costs(before: Mapping[Key, Record], now: Mapping[Key, Record], in_one_run: bool) -> Iterator[RunChange]:
    times = {}
    for key in before.keys() & now.keys():
        old, new = before[key].fastest_seconds_per_state, now[key].fastest_seconds_per_state
        if old and new:
            times[key] = math.log(new / old)
    machine = 0.0 if in_one_run or not times else statistics.median(times.values())
    for key, by in times.items():
        if abs(by - machine) > math.log(LEAST_COST_RATIO):
            yield _change(key, TIME, "1", f"{math.exp(by - machine):.2g} times{'' if in_one_run else ', against all others'}")
