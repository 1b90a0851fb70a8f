"""Units under way beside each other, as one stream of tasks."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TypeVar

from harness.errors import InvalidInput, InvalidRequest
from harness.night.answered import Answered
from harness.night.stage import Steps, UnitFound
from harness.results.run import StudyResult
from harness.study import Part, sentence
from harness.workers import Outcome, Task, Workers

_Made = TypeVar("_Made")


def attempted(make: Callable[[], _Made], unit: str, kind: type[StudyResult]) -> _Made | UnitFound:
    """Result of ``make``; where it raises, nothing but the reason: a file that has to be mended, or a fault of the harness.

    Raises:
        InvalidRequest, OSError, MemoryError: the cluster is gone, or the system refuses something; that ends the night, which can go on.
    """
    try:
        return make()
    except (InvalidRequest, OSError, MemoryError):
        raise
    except InvalidInput as error:
        return UnitFound(result=kind(), problems=[error])
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(place.filename).name}:{place.lineno}"
        return UnitFound(result=kind(), faults=[f"{unit}: {sentence(error)} ({where})"])


def _tasks_of(steps: Steps) -> Generator[Sequence[Task], Outcome, UnitFound]:
    """Tasks of a unit: those of its first study, then those that each outcome leads to; ends with what the unit came to."""
    while True:
        try:
            study = next(steps)
        except StopIteration as end:
            found: UnitFound = end.value
            return found
        tasks = study.tasks()
        out = len(tasks)
        while out:
            outcome = yield tasks
            for _ in study.take(outcome):
                pass
            tasks = study.tasks()
            out += len(tasks) - 1


@dataclass
class _Open:
    """A unit under way: what is left of it, how many tasks it has given out, the places of those that are out, and what it came to.

    ``answers``: how many outcomes it has had.
    """

    course: Generator[Sequence[Task], Outcome, UnitFound]
    given: int = 0
    out: set[int] = field(default_factory=set)
    answers: int = 0
    found: UnitFound | None = None

    def send(self, outcome: Outcome | None) -> Sequence[Task] | UnitFound:
        try:
            return self.course.send(outcome) if outcome else next(self.course)
        except StopIteration as end:
            found: UnitFound = end.value
            return found


class Together:
    """Units of a stage, so many at once that workers have enough to do and a kill costs few.

    Args:
        units: name to what begins it. most: how many may be under way by now. kind: of their results.
        answered: where their outcomes are kept while they are under way; those that are there are not asked for again. None for nowhere.
    """

    def __init__(
        self,
        units: Mapping[str, Callable[[], Steps]],
        most: Callable[[], int],
        kind: type[StudyResult],
        answered: Answered | None = None,
    ) -> None:
        self._waiting = dict(units)
        self._most = most
        self._kind = kind
        self._answered = answered
        self._open: dict[str, _Open] = {}
        # By unit and place among its tasks.
        self._next: dict[tuple[str, int], Task] = {}
        self._complete: list[Part] = []

    def run(self, workers: Workers) -> Iterator[Part]:
        """Each unit as soon as it is complete, its value a ``UnitFound``."""
        for outcome in workers.run(self._tasks(), self._tasks):
            name, place, task = outcome.task.key
            if self._answered is not None:
                self._answered.keep(name, self._open[name].answers, place, outcome)
            self._take(name, place, replace(outcome, task=task))
            yield from self._completed()
        yield from self._completed()

    def _tasks(self) -> Sequence[Task]:
        while self._waiting and len(self._open) < max(1, self._most()):
            self._begin(next(iter(self._waiting)))
        work, self._next = self._next, {}
        return [replace(task, key=(name, place, task)) for (name, place), task in work.items()]

    def _begin(self, name: str) -> None:
        """Begin a unit, or bring it to where it was when the night was killed."""
        self._open[name] = _Open(_tasks_of(self._waiting.pop(name)()))
        self._go_on(name, None)
        for place, outcome in self._answered.read(name) if self._answered is not None else ():
            # Answers to other questions are of no use.
            if (task := self._next.pop((name, place), None)) is None:
                return
            self._take(name, place, replace(outcome, task=task))

    def _completed(self) -> Iterator[Part]:
        complete, self._complete = self._complete, []
        yield from complete

    def _take(self, name: str, place: int, outcome: Outcome) -> None:
        unit = self._open[name]
        unit.out.remove(place)
        unit.answers += 1
        self._go_on(name, outcome)

    def _go_on(self, name: str, outcome: Outcome | None) -> None:
        """Give out what a unit asks next; one that is complete, or has failed, ends as soon as its tasks have come back."""
        unit = self._open[name]
        if unit.found is None:
            given = attempted(partial(unit.send, outcome), name, self._kind)
            if isinstance(given, UnitFound):
                unit.found = given
            else:
                places = range(unit.given, unit.given + len(given))
                unit.given += len(given)
                unit.out.update(places)
                self._next |= {(name, place): task for place, task in zip(places, given, strict=True)}
        if unit.found is not None and not unit.out:
            del self._open[name]
            self._complete.append(Part(name, unit.found))
