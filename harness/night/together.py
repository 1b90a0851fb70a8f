"""Units under way beside each other, as one stream of tasks."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TypeVar

from harness.errors import InvalidInput, InvalidRequest
from harness.night.stage import Steps, UnitFound
from harness.results.records import StudyResult
from harness.study import Part, Study, sentence
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


@dataclass
class _Open:
    """A unit under way: what is left of it, the study that runs, how many of its tasks are out, and what it came to if it failed."""

    steps: Steps
    study: Study
    out: int = 0
    failed: UnitFound | None = None


class Together:
    """Units of a stage, so many at once that workers have enough to do and a kill costs few.

    Args:
        units: name to what begins it. most: how many may be under way by now. kind: of their results.
    """

    def __init__(self, units: Mapping[str, Callable[[], Steps]], most: Callable[[], int], kind: type[StudyResult]) -> None:
        self._waiting = dict(units)
        self._most = most
        self._kind = kind
        self._open: dict[str, _Open] = {}
        self._next: list[Task] = []
        self._complete: list[Part] = []

    def run(self, workers: Workers) -> Iterator[Part]:
        """Each unit as soon as it is complete, its value a ``Found``."""
        for outcome in workers.run(self._tasks(), self._tasks):
            self._take(outcome)
            yield from self._completed()
        yield from self._completed()

    def _tasks(self) -> Sequence[Task]:
        while self._waiting and len(self._open) < max(1, self._most()):
            name = next(iter(self._waiting))
            steps = self._waiting.pop(name)()
            self._follow(name, steps)
        work, self._next = self._next, []
        return work

    def _completed(self) -> Iterator[Part]:
        complete, self._complete = self._complete, []
        yield from complete

    def _take(self, outcome: Outcome) -> None:
        name, task = outcome.task.key
        unit = self._open[name]
        unit.out -= 1
        if unit.failed is None:
            self._guarded(name, unit, partial(self._taken, name, unit, replace(outcome, task=task)))
        if not unit.out:
            del self._open[name]
            if unit.failed is None:
                self._follow(name, unit.steps)
            else:
                self._complete.append(Part(name, unit.failed))

    def _taken(self, name: str, unit: _Open, outcome: Outcome) -> None:
        for _ in unit.study.take(outcome):
            pass
        self._give_out(name, unit)

    def _guarded(self, name: str, unit: _Open, action: Callable[[], None]) -> None:
        """Do something for a unit; where that raises, the unit ends as soon as its tasks have come back."""

        def act() -> UnitFound | None:
            action()
            return None

        unit.failed = attempted(act, name, self._kind)

    def _follow(self, name: str, steps: Steps) -> None:
        """Begin the next study of a unit that has any tasks; without one the unit is complete."""
        while True:
            found = attempted(partial(_next_of, steps), name, self._kind)
            if isinstance(found, UnitFound):
                self._complete.append(Part(name, found))
                return
            unit = _Open(steps, found)
            self._guarded(name, unit, partial(self._give_out, name, unit))
            if unit.failed is not None:
                self._complete.append(Part(name, unit.failed))
                return
            if unit.out:
                self._open[name] = unit
                return

    def _give_out(self, name: str, unit: _Open) -> None:
        tasks = list(unit.study.tasks())
        unit.out += len(tasks)
        self._next += [replace(task, key=(name, task)) for task in tasks]


def _next_of(steps: Steps) -> Study | UnitFound:
    """The next study of a unit, or what it came to."""
    try:
        return next(steps)
    except StopIteration as end:
        found: UnitFound = end.value
        return found
