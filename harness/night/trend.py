"""The trend of a night: what the history says of its cells, and which of them changed this night."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from harness.night.course import Course
from harness.night.stage import Stage
from harness.results.benchmark import Benchmark
from harness.results.change_points import Reading
from harness.results.cross_check import CrossCheckResult
from harness.results.trend import MOST_NIGHTS, Cell, ChangedCell, changes_of_the_last, readings_of_costs, readings_of_records


def changes_of(course: Course, stages: Sequence[Stage]) -> list[ChangedCell]:
    """What changed this night, of all stages that have numbers."""
    return [one for stage in stages for one in changes_of_the_last(nights_of(course, stage))]


def nights_of(course: Course, stage: Stage) -> list[Mapping[Cell, Reading]]:
    """The readings of each night of a stage's profile and number of states, oldest first, this one last."""
    earlier = [found for run, found in course.earlier(stage, MOST_NIGHTS - 1) if run.states == stage.states(course.choice)]
    return [_readings(found) for found in (*reversed(earlier), course.found(stage))]


def _readings(found: object) -> Mapping[Cell, Reading]:
    if isinstance(found, CrossCheckResult):
        return readings_of_records(found.records)
    return readings_of_costs(found) if isinstance(found, Benchmark) else {}
