"""Processes that run tasks and survive an engine which aborts, hangs or exhausts memory.

``Workers`` is all that callers need. May use ``errors`` and what is beside it; the standard library, and Dask, which is
an extra, where a scheduler is named.

Start with ``tasks``. ``local`` starts processes on this machine and talks to them through pipes and unlinked files,
``program`` is what such a process runs, ``memory`` says how much each may hold, ``cluster`` hands tasks to a Dask cluster.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from harness.workers.local import LocalPool
from harness.workers.tasks import Crash, Outcome, SchedulerLost, Task

if TYPE_CHECKING:
    from harness.workers.cluster import Cluster

__all__ = ["Crash", "Outcome", "Scheduler", "SchedulerLost", "Task", "Workers"]


@dataclass(frozen=True)
class Scheduler:
    """Address of a Dask scheduler, and PEM files for ``tls://``: the authority's certificate, one's own, and its key."""

    address: str
    ca_file: str | None = None
    certificate: str | None = None
    key: str | None = None


@dataclass
class Workers:
    """Worker processes for as long as the context lasts.

    Attributes:
        count: largest number of local processes; None for one per CPU. They start as tasks need them.
        scheduler: an existing cluster to use instead. time_limit: seconds a task may take.
        memory_limit: bytes that each of the processes may hold, and each process of an engine; None for ``memory.default_limit``.
    """

    count: int | None = None
    scheduler: Scheduler | None = None
    time_limit: float = 60.0
    memory_limit: int | None = None
    _pool: LocalPool | Cluster | None = field(default=None, init=False, repr=False)

    def __enter__(self) -> Workers:
        """Raises ``InvalidRequest`` where the scheduler does not answer, or Dask is not installed."""
        if self.scheduler is None:
            self._pool = LocalPool(self.count or os.cpu_count() or 1, self.time_limit, self.memory_limit)
        else:
            from harness.workers.cluster import Cluster

            self._pool = Cluster(self.scheduler, self.time_limit, self.memory_limit)
        return self

    def __exit__(self, *exception: object) -> None:
        if self._pool is not None:
            self._pool.close()

    @property
    def seats(self) -> int:
        """Number of tasks that can run at once by now; 1 outside of the context."""
        return 1 if self._pool is None else self._pool.seats

    @property
    def under_way(self) -> list[str]:
        """Affinities that are names or paths, of the tasks that run by now; none of a cluster, and outside of the context."""
        return [] if self._pool is None else self._pool.under_way

    def run(self, tasks: Iterable[Task], further: Callable[[], Iterable[Task]] = tuple) -> Iterator[Outcome]:
        """Outcomes in the order in which the tasks end; every task has exactly one.

        ``further`` is asked after each outcome for the tasks that it made possible.

        Raises:
            SchedulerLost: the scheduler of the cluster has ended.
        """
        assert self._pool is not None, "enter the context first"
        return self._pool.run(tasks, further)
