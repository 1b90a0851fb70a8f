"""Units under way beside each other, as one stream of tasks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from harness.night.stage import Found, Steps
from harness.study import Part, Study
from harness.workers import Outcome, Task, Workers


@dataclass
class _Open:
    """A unit under way: what is left of it, the study that runs, and how many of its tasks are out."""

    steps: Steps
    study: Study
    out: int = 0


class Together:
    """Units of a stage, so many at once that workers have enough to do and a kill costs few.

    Args:
        units: name to what begins it. most: how many may be under way by now.
    """

    def __init__(self, units: Mapping[str, Callable[[], Steps]], most: Callable[[], int]) -> None:
        self._waiting = dict(units)
        self._most = most
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
        for _ in unit.study.take(replace(outcome, task=task)):
            pass
        self._give_out(name, unit)
        if not unit.out:
            del self._open[name]
            self._follow(name, unit.steps)

    def _follow(self, name: str, steps: Steps) -> None:
        """Begin the next study of a unit that has any tasks; without one the unit is complete."""
        while True:
            try:
                unit = _Open(steps, next(steps))
            except StopIteration as end:
                found: Found = end.value
                self._complete.append(Part(name, found))
                return
            self._give_out(name, unit)
            if unit.out:
                self._open[name] = unit
                return

    def _give_out(self, name: str, unit: _Open) -> None:
        tasks = list(unit.study.tasks())
        unit.out += len(tasks)
        self._next += [replace(task, key=(name, task)) for task in tasks]
