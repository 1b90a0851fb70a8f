"""The course of a night: it begins or goes on, stage by stage and unit by unit, and each unit is stored as soon as it is complete."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice
from typing import Any

from harness.errors import InvalidRequest
from harness.night.stage import NightChoice, Stage, UnitFound
from harness.night.together import Together, attempted
from harness.results.change_points import NightValue
from harness.results.history import History
from harness.results.night import BegunStage, Case, DoneUnit, Night, NightSettings
from harness.results.records import Run
from harness.results.trend import MOST_NIGHTS, Cell, ChangedCell, changes_of_the_last, comparable
from harness.study import Part
from harness.workers import Workers

# The mark of what follows from all units of a stage.
_CLOSING = "(closing)"
# Units under way for each process: of one system the tasks run in one process, one after the other.
_UNITS_PER_SEAT = 2


def unfinished(history: History, library: str) -> int | None:
    """The number of the latest night of a library, if it has not ended; None without one."""
    for number in history.studies(Night, library):
        night = history.read(number, Night)
        # One that was killed before it said what it was asked has found nothing either.
        if night.settings:
            return None if night.ended else number
    return None


@dataclass
class Course:
    """A night in the history; made by ``begin`` or ``resume``.

    Attributes:
        number: of the night in the history. run: as it began. night: what is complete of it.
        resumed: how many units were complete when it went on.
    """

    history: History
    number: int
    run: Run
    choice: NightChoice
    night: Night = field(default_factory=Night)
    resumed: int = 0

    @classmethod
    def begin(cls, history: History, run: Run, choice: NightChoice) -> Course:
        """A night that starts now."""
        number, night = history.begin(run, Night), Night(settings=[choice.settings])
        history.append(number, night)
        return cls(history, number, run, choice, night)

    @classmethod
    def resume(cls, history: History, run: Run, choice: NightChoice) -> Course:
        """The latest night of the library where it has not ended; else one that starts now.

        Raises:
            InvalidRequest: it was asked otherwise, or of other versions or files; the message says what differs.
        """
        number = unfinished(history, run.library)
        if number is None:
            return cls.begin(history, run, choice)
        night = history.read(number, Night)
        [settings] = night.settings
        if different := settings.differences(choice.settings):
            begun = history.studies(Night, run.library)[number].started
            remedy = "repeat its command, or leave --resume out to begin another night"
            raise InvalidRequest(f"the night that began at {begun} cannot go on: {'; '.join(different)}; {remedy}")
        return cls(history, number, history.studies(Night, run.library)[number], choice, night, len(night.done))

    def left(self, stage: Stage) -> list[str]:
        """The units of a stage that are not complete."""
        done = self.night.units_of(stage.name)
        return [unit for unit in stage.units(self.choice) if unit not in done]

    def steps(self, stage: Stage) -> int:
        """Number of parts that ``complete`` has yet to give."""
        done = self.night.units_of(stage.name)
        return len(self.left(stage)) + (stage.closing is not None and _CLOSING not in done)

    def complete(self, stage: Stage, workers: Workers) -> Iterator[Part]:
        """Run what is left of a stage, and store each unit with the mark that it is complete, in one transaction."""
        study = self._study_of(stage)
        units = {unit: partial(stage.steps, self.choice, unit) for unit in self.left(stage)}
        most = (lambda: 1) if stage.is_timed else (lambda: _UNITS_PER_SEAT * workers.seats)
        for part in Together(units, most, stage.kind).run(workers):
            self._store(study, stage, part.label, part.value)
            yield part
        if stage.closing is not None and _CLOSING not in self.night.units_of(stage.name):
            closing, found = stage.closing, self.found(stage)
            closed = attempted(lambda: UnitFound(result=closing(self.choice, found, workers)), _CLOSING, stage.kind)
            self._store(study, stage, _CLOSING, closed)
            yield Part("what follows from all", closed)

    def end(self, sentence: str) -> None:
        """Store that the night has ended, and with what; it does not go on afterwards."""
        ended = Night(ended=[sentence])
        self.history.append(self.number, ended)
        self.night.extend(ended)

    def found(self, stage: Stage) -> Any:
        """All that a stage has found by now."""
        return found_by(self.history, self.night, stage)

    def earlier(self, stage: Stage, most: int, part: str = "%") -> list[tuple[Run, Any]]:
        """The studies of the stage's profile before this one, newest first, that found anything; all of each, or one part."""
        return list(islice(self.history.earlier(self._study_of(stage), stage.kind, part), most))

    def night_before(self, stages: Sequence[Stage]) -> list[Case] | None:
        """The cases of the latest night before this one that has ended, for the stages of this one; None where there is none."""
        for number in self.history.studies(Night, self.run.library):
            night = self.history.read(number, Night) if number < self.number else Night()
            if night.ended:
                return [case for stage in stages if night.study_of(stage.name) for case in cases_of(self.history, night, stage)]
        return None

    def _study_of(self, stage: Stage) -> int:
        """The number under which the history keeps what the stage finds; a new one where it has not begun."""
        known = self.night.study_of(stage.name)
        if known is not None:
            return known
        run = replace(self.run, profile=stage.profile(self.choice), states=stage.states(self.choice))
        study = self.history.begin(run, stage.kind)
        begun = Night(begun=[BegunStage(stage=stage.name, study=study)])
        self.history.append(self.number, begun)
        self.night.extend(begun)
        return study

    def _store(self, study: int, stage: Stage, unit: str, found: UnitFound) -> None:
        mark = DoneUnit(
            stage=stage.name, unit=unit, problems=[str(one) for one in found.problems], faults=list(found.faults), crashed=found.crashed
        )
        done = Night(done=[mark])
        self.history.append_together((study, found.result), (self.number, done))
        self.night.extend(done)


def found_by(history: History, night: Night, stage: Stage) -> Any:
    """All that a stage of a night has found; an empty result where it has not begun."""
    study = night.study_of(stage.name)
    return stage.kind() if study is None else history.read(study, stage.kind)


def cases_of(history: History, night: Night, stage: Stage) -> list[Case]:
    """Findings of a stage of a night as cases, by group and name."""
    return sorted(stage.cases(found_by(history, night, stage)), key=lambda case: case.key)


def settings_of(choice: NightChoice, stages: Sequence[Stage]) -> NightSettings:
    """The settings of a choice with the stages that have something to do."""
    return replace(choice.settings, stages=[stage.name for stage in stages if stage.units(choice)])


def changes_of(course: Course, stages: Sequence[Stage]) -> list[ChangedCell]:
    """Changes of this night in all stages that have numbers."""
    return [one for stage in stages for one in changes_of_the_last(nights_of(course, stage))]


def nights_of(course: Course, stage: Stage) -> list[Mapping[Cell, NightValue]]:
    """The readings of each night of a stage's profile and number of states, oldest first, this one last; none without numbers."""
    if stage.numbers is None:
        return []
    states, read = stage.states(course.choice), stage.numbers.readings
    earlier = comparable(states, course.earlier(stage, MOST_NIGHTS - 1, stage.numbers.part))
    return [*(read(found) for _, found in reversed(earlier)), read(course.found(stage))]
