"""A task, its outcome, and the order in which tasks are given out."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable, Collection, Hashable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from harness.errors import InvalidRequest

# Ways out for the user of a task that ended too early.
MORE_TIME = "--time-limit (pytest: --harness-time-limit) allows more"
MORE_MEMORY = "--memory-limit (pytest: --harness-memory-limit) allows more, and fewer --workers leave each of them more"


class SchedulerLost(InvalidRequest):
    """The scheduler of a cluster has ended while tasks were under way: exit status 3."""


@dataclass(frozen=True, eq=False)
class Task:
    """One call ``function(*arguments, note)``; ``key`` is the caller's own, to tell results apart.

    ``function`` is importable by the name of its module; arguments and value can be pickled. ``note`` is a function the
    task may call with text that survives a crash of the process. Tasks of one ``affinity`` run one after the other in
    one process, which keeps what they load and compile.
    """

    key: Any
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    affinity: Hashable | None = None


@dataclass(frozen=True)
class Crash:
    """A task whose process died: the reason, its last note, and what it wrote to standard output and error."""

    reason: str
    note: str
    standard_error: str

    def __str__(self) -> str:
        return f"{self.reason}; it wrote: {self.standard_error}" if self.standard_error else self.reason


@dataclass(frozen=True)
class Outcome:
    """The end of a task: a value, an exception it raised, or a crash."""

    task: Task
    value: Any = None
    exception: BaseException | None = None
    crash: Crash | None = None


_OWN, _UNOWNED, _UNTOUCHED, _NOT_FOR_IT = range(4)


class TaskQueue:
    """Tasks that wait, by affinity; tasks without one wait under None."""

    def __init__(self, tasks: Iterable[Task]) -> None:
        self._waiting: dict[Hashable | None, deque[tuple[int, Task]]] = {}
        self._begun: set[Hashable] = set()
        self._count = itertools.count()
        self.add(tasks)

    def add(self, tasks: Iterable[Task]) -> None:
        """Let more tasks wait, behind those that do."""
        for task in tasks:
            self._waiting.setdefault(task.affinity, deque()).append((next(self._count), task))

    def put_back(self, task: Task) -> None:
        """Let a task that was taken wait again, before all others."""
        self._waiting.setdefault(task.affinity, deque()).appendleft((-next(self._count), task))

    def __bool__(self) -> bool:
        return bool(self._waiting)

    def owned_by(self, worker: object, owners: Mapping[Hashable, object]) -> bool:
        """True where a task waits whose affinity belongs to ``worker``."""
        return any(owners.get(affinity) == worker for affinity in self._waiting)

    def take(self, worker: object | None, owners: Mapping[Hashable, object], barred: Collection[Task] = ()) -> Task | None:
        """The first task that an idle ``worker`` may run, or None; ``worker`` is None for one that is yet to be started.

        Its own affinities go first. Tasks without affinity, or of an affinity that nobody owns, come next. An affinity
        that another worker owns is taken over only while none of its tasks has been given out. A task that is ``barred`` waits,
        and those of its affinity behind it.
        """
        ranked = (
            (self._kind(affinity, worker, owners), waiting[0][0], affinity)
            for affinity, waiting in self._waiting.items()
            if waiting[0][1] not in barred
        )
        kind, _, affinity = min(ranked, default=(_NOT_FOR_IT, 0, None))
        if kind == _NOT_FOR_IT:
            return None
        _, task = self._waiting[affinity].popleft()
        if not self._waiting[affinity]:
            del self._waiting[affinity]
        self._begun.add(affinity)
        return task

    def _kind(self, affinity: Hashable | None, worker: object | None, owners: Mapping[Hashable, object]) -> int:
        owner = owners.get(affinity)
        if owner is None:
            return _UNOWNED
        if owner == worker:
            return _OWN
        return _NOT_FOR_IT if affinity in self._begun else _UNTOUCHED
