"""Studies: everything the harness computes on worker processes, and the one loop that runs them.

A cross-check, an atlas, a benchmark, a search, a diagnosis and a fault campaign are each a ``Study``. What is asked next
depends on what was answered: ``tasks`` gives what can run by now, ``take`` the parts that an outcome completes, ``result`` all
of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from harness.errors import InvalidInput
from harness.workers import Outcome, Task, Workers
from harness.workers.tasks import MORE_MEMORY


@dataclass(frozen=True)
class Part:
    """A completed part of a study: ``label`` for a progress bar, ``value`` for the history and the JSON file."""

    label: str
    value: Any


class Study(Protocol):
    """Work for worker processes.

    Attributes:
        title: of the progress bar. steps: how many parts there will be, as far as it is known.
        problems: what its user has to mend. crashed: whether a process died or ran out of time.
    """

    title: str
    problems: list[Exception]
    crashed: bool

    @property
    def steps(self) -> int: ...

    def tasks(self) -> Sequence[Task]:
        """The tasks that can run by now and were not given out before."""

    def take(self, outcome: Outcome) -> Iterable[Part]:
        """The parts that the outcome of one of ``tasks`` completes."""

    def result(self) -> Any:
        """Everything that is complete so far."""


def run_study(study: Study, workers: Workers) -> Iterator[Part]:
    """Run to the end on workers whose context the caller has entered; each part as soon as it is complete."""
    for outcome in workers.run(study.tasks(), study.tasks):
        yield from study.take(outcome)


class Rounds:
    """The bookkeeping that studies share: their tasks, each with the method that takes its outcome, and what failed.

    A task's key is (method, where...); ``take`` calls ``method(outcome, *where)``. Tasks that a method puts into ``_next`` run
    at once; those of a round run when all before are done.
    """

    def __init__(self) -> None:
        self.problems: list[Exception] = []
        self.crashed = False
        self._next: list[Task] = []
        self._under_way = 0
        self._rounds = self.rounds()

    def rounds(self) -> Iterator[Sequence[Task]]:
        """The rounds in order, each made when the one before is complete."""
        yield from ()

    def tasks(self) -> Sequence[Task]:
        work, self._next = self._next, []
        if not work and not self._under_way:
            work = list(next((coming for coming in self._rounds if coming), ()))
        self._under_way += len(work)
        return work

    def take(self, outcome: Outcome) -> Iterable[Part]:
        self._under_way -= 1
        method, *where = outcome.task.key
        return method(outcome, *where) or ()

    def failure(self, outcome: Outcome) -> str:
        """Why a task gave no value, "" where it did; invalid input is added to ``problems``, a death is remembered."""
        if outcome.crash is not None:
            self.crashed = True
            return str(outcome.crash)
        if isinstance(outcome.exception, InvalidInput):
            self.report(outcome.exception)
            return str(outcome.exception)
        return "" if outcome.exception is None else sentence(outcome.exception)

    def report(self, problem: Exception) -> None:
        """Add a problem that is not known yet."""
        if str(problem) not in map(str, self.problems):
            self.problems.append(problem)


def is_out_of_memory(exception: BaseException | None) -> bool:
    """True where there is no memory left, be it for a library that is imported late."""
    # Of a library that Python imports it is an ImportError, of one that ctypes loads an OSError without a number, of which llvmlite
    # makes another that does not say why.
    if isinstance(exception, ImportError | OSError):
        return any(words in str(exception) for words in ("failed to map segment", "bad_alloc", "Could not find/load shared object file"))
    return isinstance(exception, MemoryError)


def sentence(exception: BaseException) -> str:
    """An exception as a sentence: kind and message, and what leaves more memory where that ran out."""
    remedy = MORE_MEMORY if is_out_of_memory(exception) else ""
    return f"{type(exception).__name__}: {'; '.join(filter(None, [str(exception), remedy]))}"
