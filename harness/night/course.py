"""The course of a night: it begins or goes on, stage by stage and unit by unit, and each unit is stored as soon as it is complete.

Of a unit that is not complete the cache has what was answered.

A night that goes on tells what was changed in between by digests of all that it reads.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

from harness.comparison.collection import find_files
from harness.engines import select_subjects, subjects
from harness.errors import InvalidRequest
from harness.library import MODEL_SUFFIXES, Library, nearest
from harness.night.answered import Answered
from harness.night.stage import NightChoice, Stage, UnitFound
from harness.night.together import Together, attempted
from harness.results.change_points import NightValue
from harness.results.history import History
from harness.results.night import BegunStage, Case, DoneUnit, Night
from harness.results.run import Run
from harness.results.trend import MOST_NIGHTS, Cell, ChangedCell, changes_of_the_last, comparable
from harness.storage import sources_digest
from harness.study import Part
from harness.workers import Workers

# The mark of what follows from all units of a stage.
_CLOSING = "(closing)"
# Units under way for each process: of one system the tasks run in one process, one after the other.
_UNITS_PER_SEAT = 2
_DIGITS = 16


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
        course = cls(history, history.begin(run, Night), run, choice)
        # Another night of this library does not go on any more.
        course.answered.forget_all()
        course._append(Night(settings=[choice.settings]))
        return course

    @classmethod
    def resume(cls, history: History, run: Run, choice: NightChoice) -> Course:
        """The latest night of the library where it has not ended; else one that starts now.

        Raises:
            InvalidRequest: it was asked otherwise, or of other versions or files; the message says what differs.
        """
        number = unfinished(history, run.library)
        if number is None:
            return cls.begin(history, run, choice)
        night, began = history.read(number, Night), history.studies(Night, run.library)[number]
        [settings] = night.settings
        if different := settings.differences(choice.settings):
            remedy = "repeat its command, or leave --resume out to begin another night"
            raise InvalidRequest(f"the night that began at {began.started} cannot go on: {'; '.join(different)}; {remedy}")
        return cls(history, number, began, choice, night, len(night.done))

    @property
    def answered(self) -> Answered:
        """The outcomes of the units under way."""
        return Answered.of(self.history.path, self.run.library, self.run.started)

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
        study = self.study_of(stage)
        units = {unit: partial(stage.steps, self.choice, unit) for unit in self.left(stage)}
        most = (lambda: 1) if stage.is_timed else (lambda: _UNITS_PER_SEAT * workers.seats)
        answered = self.answered.of_stage(stage.name)
        for part in Together(units, most, stage.kind, answered).run(workers):
            self._store(study, stage, part.label, part.value)
            answered.forget(part.label)
            yield part
        if stage.closing is not None and _CLOSING not in self.night.units_of(stage.name):
            closing, found = stage.closing, self.found(stage)
            closed = attempted(lambda: UnitFound(result=closing(self.choice, found, workers)), _CLOSING, stage.kind)
            self._store(study, stage, _CLOSING, closed)
            yield Part("what follows from all", closed)

    def end(self, sentence: str) -> None:
        """Store that the night has ended, and with what; it does not go on afterwards."""
        self._append(Night(ended=[sentence]))
        self.answered.forget_all()

    def found(self, stage: Stage) -> Any:
        """All that a stage has found by now."""
        return found_by(self.history, self.night, stage)

    def night_before(self, stages: Sequence[Stage]) -> list[Case] | None:
        """The cases of the latest night before this one that has ended, for the stages of this one; None where there is none."""
        for number in self.history.studies(Night, self.run.library):
            night = self.history.read(number, Night) if number < self.number else Night()
            if night.ended:
                return [case for stage in stages if night.study_of(stage.name) for case in cases_of(self.history, night, stage)]
        return None

    def study_of(self, stage: Stage) -> int:
        """The number under which the history keeps what the stage finds; a new one where it has not begun."""
        known = self.night.study_of(stage.name)
        if known is not None:
            return known
        run = replace(self.run, profile=stage.profile(self.choice), states=stage.states(self.choice))
        study = self.history.begin(run, stage.kind)
        self._append(Night(begun=[BegunStage(stage=stage.name, study=study)]))
        return study

    def _append(self, found: Night) -> None:
        self.history.append(self.number, found)
        self.night.extend(found)

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


def changes_of(course: Course, stages: Sequence[Stage]) -> list[ChangedCell]:
    """Changes of this night in all stages that have numbers."""
    return [one for stage in stages for one in changes_of_the_last(nights_of(course, stage))]


def nights_of(course: Course, stage: Stage) -> list[Mapping[Cell, NightValue]]:
    """The readings of each night of a stage's profile and number of states, oldest first, this one last; none without numbers."""
    if stage.numbers is None:
        return []
    before = course.history.earlier(course.study_of(stage), stage.kind, stage.numbers.part)
    earlier = comparable(stage.states(course.choice), list(islice(before, MOST_NIGHTS - 1)))
    return [stage.numbers.readings(found) for found in (*(found for _, found in reversed(earlier)), course.found(stage))]


def digests(library: Library, survey: Sequence[str]) -> dict[str, str]:
    """Name of a file to a digest of its content, and "harness" to that of the program.

    Raises:
        InvalidInput: a place to survey holds no robot.
    """
    package = Path(__file__).resolve().parents[1]
    rooms = sorted(path.name for path in package.iterdir() if path.is_dir() and any(path.glob("*.py")))
    found = {"harness": sources_digest(*rooms).hex()[:_DIGITS]}
    found |= {name: _digest(path) for name, path in _files(library)}
    return found | {str(path): _digest(path) for path in (find_files(survey) if survey else [])}


def _files(library: Library) -> Iterator[tuple[str, Path]]:
    """Name and path of every file of the library; its name tells no place of this machine."""
    folders = [
        ("systems", library.systems, "*.py"),
        ("engines", library.engines, "**/*.py"),
        ("hard_states", library.hard_states, "*.json"),
    ]
    folders += [(name, library.models / name, pattern) for name, suffix in MODEL_SUFFIXES.items() for pattern in (f"*{suffix}", "*.py")]
    for name, folder, pattern in folders:
        yield from ((f"{name}/{path.relative_to(folder)}", path) for path in sorted(folder.glob(pattern)))
    if library.expected_verdicts.is_file():
        yield library.expected_verdicts.name, library.expected_verdicts


def _digest(path: Path) -> str:
    # Of what cannot be read a survey says so, whatever it holds.
    with contextlib.suppress(OSError):
        if path.is_file():
            with path.open("rb") as file:
                return hashlib.file_digest(file, "sha256").hexdigest()[:_DIGITS]
    return "cannot be read"


def subjects_of(library: Library, engines: Sequence[str]) -> list[str]:
    """Names of the subjects; none, which means all, where no engine was asked for.

    Raises:
        InvalidRequest: no subject is of such an engine.
    """
    if not engines:
        return []
    chosen = [str(subject) for subject in select_subjects(library, ())]
    known = [str(subject) for subject in subjects(library)]
    for engine in engines:
        own = [name for name in known if name.partition("/")[0] == engine]
        if not own:
            names = sorted({name.partition("/")[0] for name in known})
            raise InvalidRequest(f"no engine is called {engine!r}; {nearest(engine, names)}; harness list has those that are there")
        chosen += own
    return list(dict.fromkeys(chosen))
