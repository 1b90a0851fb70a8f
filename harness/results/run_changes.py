"""Two runs held against each other, or two versions of an engine in one: what changed of each subject on each system, and whether it
became worse.

Verdicts and messages are compared as they are, messages without their numbers. A median or a 99 % quantile changed where the two differ
by more than their samples can, as ``harness.results.change_points`` has it for all cells together. Times of two runs do not compare: a
cost is told where it moved against the costs of all others. Times of one run do.
"""

from __future__ import annotations

import math
import re
import statistics
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

from harness.results.change_points import Chart
from harness.results.records import Record, Run
from harness.results.table import Cell as TableCell
from harness.results.table import Column, TableOf
from harness.results.trend import readings_of_records
from harness.results.trend_numbers import WORST
from harness.verdict import SEVERITY

VERDICT, MESSAGE, TIME, CAME, WENT = "verdict", "message", "time per state", "came", "went"
READING, TERMS = "reading", "terms"
# A cost against those of all others, as a factor: less is the noise of a machine.
LEAST_COST_RATIO = 2.0
_NUMBER = re.compile(r"[-+]?\d[\d,.]*(?:e[-+]?\d+)?%?")
Key = tuple[str, str]


@dataclass(frozen=True, kw_only=True)
class RunChange:
    """One thing that is otherwise.

    Attributes:
        system, subject: of the record, the subject with the quantity where it is not the usual one.
        what: "verdict", "message", "came", "went", "time per state" or the name of a backward error; of two versions of an engine also
            "reading", of a file, and "terms" of the equations. before, now: as text.
        is_worse: whether it counts against the second run. A cost and a worst error alone do not, nor does what was not asked.
    """

    system: Annotated[str, Column("system")]
    subject: Annotated[str, Column("subject")]
    what: str
    before: Annotated[str, Column("before")]
    now: Annotated[str, Column("now")]
    is_worse: bool = False

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


def _change(key: Key, what: str, before: str, now: str, is_worse: bool = False) -> RunChange:
    return RunChange(system=key[0], subject=key[1], what=what, before=before, now=now, is_worse=is_worse)


def _of_record(key: Key, before: Record, now: Record) -> Iterator[RunChange]:
    """The verdict, or that it is no longer the expected one, and the message."""
    if (before.verdict, before.as_expected) != (now.verdict, now.as_expected):
        is_worse = SEVERITY[now.verdict] > SEVERITY[before.verdict] or (before.as_expected and not now.as_expected)
        yield _change(key, VERDICT, _verdict(before), _verdict(now), is_worse)
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
        first, second = old[cell], new[cell]
        by = second.value - first.value
        if abs(by) > chart.limit * math.hypot(first.noise, second.noise):
            yield _change(cell[:2], cell[2], f"{first.measured:.3g}", f"{second.measured:.3g}", by > 0 and cell[2] != WORST)


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
