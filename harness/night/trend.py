"""The trend of a night: what the history says of its cells, and which of them changed this night."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from harness.night.course import Course
from harness.night.stage import Stage
from harness.results.change_points import NightValue
from harness.results.trend import MOST_NIGHTS, Cell, ChangedCell, changes_of_the_last, comparable


def changes_of(course: Course, stages: Sequence[Stage]) -> list[ChangedCell]:
    """What changed this night, of all stages that have numbers."""
    return [one for stage in stages for one in changes_of_the_last(nights_of(course, stage))]


def nights_of(course: Course, stage: Stage) -> list[Mapping[Cell, NightValue]]:
    """The readings of each night of a stage's profile and number of states, oldest first, this one last; none without numbers."""
    if stage.numbers is None:
        return []
    states, read = stage.states(course.choice), stage.numbers.readings
    earlier = comparable(states, course.earlier(stage, MOST_NIGHTS - 1, stage.numbers.part))
    return [*(read(found) for _, found in reversed(earlier)), read(course.found(stage))]
