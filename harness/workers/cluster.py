"""Tasks on a Dask cluster, for when one machine is not enough.

Each task runs in a local worker process of the machine it comes to. A crash of an engine costs no worker of the cluster,
and is described as it is locally. Who can reach the scheduler can run code as the user of its workers.

A worker of the cluster that is lost is not its task's fault at first: the task is asked again, once.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import logging
import os
import secrets
import threading
import time
from collections.abc import Callable, Hashable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from harness.errors import InvalidRequest, require
from harness.workers.local import POLL_SECONDS, LocalPool
from harness.workers.tasks import Crash, Outcome, SchedulerLost, Task, TaskQueue

if TYPE_CHECKING:
    from harness.workers import Scheduler

    _Answer = tuple[Any, BaseException | None, Crash | None]

# After as long without any worker, none will come.
PATIENCE_SECONDS = 120.0
CONNECT_SECONDS = 10.0
# A thread of a worker of the cluster: the worker's address, and a number.
Seat = tuple[str, int]
LOST = "lost its worker of the cluster, and another one when it was asked again"


@dataclass(frozen=True)
class _Attempt:
    """A task on its way: Dask's future to cancel it by, and what comes of it once it has been brought here."""

    task: Task
    future: Any
    arrival: concurrent.futures.Future[_Answer]


class Cluster:
    """A connection to a scheduler, and a local process for each thread of its workers.

    Raises:
        InvalidRequest: no scheduler answers, it does not accept the certificates, or Dask is not installed.
    """

    def __init__(self, scheduler: Scheduler, time_limit: float, memory_limit: int | None = None) -> None:
        require("--scheduler asks for a Dask cluster", "distributed")
        from distributed import Client
        from distributed.security import Security

        self._limits = time_limit, memory_limit
        self._address = scheduler.address
        self._session = secrets.token_hex(16)
        self._owners: dict[Hashable, Seat] = {}
        with contextlib.ExitStack() as stack:
            # Dask logs, with a traceback where a message was under way, what is part of an outcome or of an error here. Both have handlers.
            for logger in map(logging.getLogger, ("distributed", "distributed.client")):
                for attribute, silent in {"propagate": False, "handlers": [logging.NullHandler()]}.items():
                    stack.callback(setattr, logger, attribute, getattr(logger, attribute))
                    setattr(logger, attribute, silent)
            files = {"tls_ca_file": scheduler.ca_file, "tls_client_cert": scheduler.certificate, "tls_client_key": scheduler.key}
            try:
                security = Security(**files, require_encryption=True) if any(files.values()) else None
                self._client = stack.enter_context(Client(scheduler.address, timeout=CONNECT_SECONDS, security=security))
            except (OSError, TypeError, ValueError, RuntimeError) as error:
                remedy = "start one or drop --scheduler"
                if scheduler.address.startswith("tls://") and not all(files.values()):
                    remedy = "name its certificates with --tls-ca-file, --tls-cert and --tls-key"
                raise InvalidRequest(f"no cluster at {scheduler.address}: {error}; {remedy}") from error
            self._open = stack.pop_all()

    def close(self) -> None:
        """End the processes of this session on the cluster's machines; its workers stay."""
        # Without a scheduler nobody reaches its workers, which end by themselves.
        with self._open, contextlib.suppress(OSError, SchedulerLost):
            if self._is_reached():
                self._client.run(_end_session, self._session, on_error="ignore")

    @property
    def seats(self) -> int:
        """Number of tasks that can run at once by now."""
        return len(self._seats())

    @property
    def under_way(self) -> list[str]:
        """See ``harness.workers.Workers``."""
        return []

    def run(self, tasks: Iterable[Task], further: Callable[[], Iterable[Task]] = tuple) -> Iterator[Outcome]:
        """Outcomes as the tasks end.

        A task whose worker is lost is asked again before those that wait, and reported as crashed if that worker is lost too.
        A worker has one such task at a time, so that where one kills its workers the other is not taken for the culprit.
        Tasks that no worker comes for are reported as crashed.

        Raises:
            SchedulerLost: the scheduler has ended, and none is at its address again within ``CONNECT_SECONDS``.
        """
        run = _ClusterRun(tasks)
        run.seats = self._seats()
        last_seen = last_asked = time.monotonic()
        try:
            while run.queue or run.running:
                # One question to the scheduler for each answer would take it longer than the answer.
                if time.monotonic() - last_asked > POLL_SECONDS:
                    run.seats, last_asked = self._seats(), time.monotonic()
                outcomes = list(run.collect(self._is_reached()))
                # A task that is yet to be put back goes before the others of its affinity.
                known = run.seats | set(run.running)
                self._owners = {affinity: seat for affinity, seat in self._owners.items() if seat in known}
                if run.seats:
                    last_seen = time.monotonic()
                elif not run.running and time.monotonic() - last_seen > PATIENCE_SECONDS:
                    reason = f"the cluster has had no worker for {PATIENCE_SECONDS:g} s; start workers or drop --scheduler"
                    while (task := run.queue.take(None, {})) is not None:
                        outcomes.append(Outcome(task, crash=Crash(reason, "", "")))
                for outcome in outcomes:
                    yield outcome
                    run.queue.add(further())
                self._give_out(run)
                run.wait()
        finally:
            for attempt in run.running.values():
                attempt.future.cancel()

    def _is_reached(self) -> bool:
        """False while the scheduler's connection is gone.

        Raises:
            SchedulerLost: for good.
        """
        if self._client.status == "closed":
            raise SchedulerLost(f"the scheduler at {self._address} is gone")
        return bool(self._client.status == "running")

    def _seats(self) -> set[Seat]:
        """Places where tasks may run by now; none while the scheduler does not answer. Raises as ``_is_reached``."""
        threads: dict[str, int] = {}
        with contextlib.suppress(OSError):
            threads = self._client.nthreads() if self._is_reached() else {}
        return {(address, number) for address, count in threads.items() for number in range(count)}

    def _give_out(self, run: _ClusterRun) -> None:
        suspected = {seat[0] for seat, attempt in run.running.items() if attempt.task in run.asked_again}
        for seat in sorted(run.seats - set(run.running), key=lambda seat: (not run.queue.owned_by(seat, self._owners), seat)):
            barred = run.asked_again if seat[0] in suspected else frozenset[Task]()
            if (task := run.queue.take(seat, self._owners, barred)) is not None:
                run.running[seat] = self._submit(task, seat)
                suspected |= {seat[0]} if task in run.asked_again else set()

    def _submit(self, task: Task, seat: Seat) -> _Attempt:
        if task.affinity is not None:
            self._owners[task.affinity] = seat
        # The key is the caller's own, and need not be picklable.
        call = (self._session, seat[1], self._limits, replace(task, key=None))
        future = self._client.submit(_run_here, *call, workers=[seat[0]], pure=False, retries=0, allow_other_workers=False)

        async def arrive() -> _Answer:
            answer: _Answer = await future
            return answer

        # An answer stays with its worker until it is asked for. Whoever waits for one whose worker is gone waits forever.
        return _Attempt(task, future, asyncio.run_coroutine_threadsafe(arrive(), self._client.loop.asyncio_loop))


class _ClusterRun:
    """One call of ``Cluster.run``: where tasks may run, those that wait, that run, and that wait or run for the second time."""

    def __init__(self, tasks: Iterable[Task]) -> None:
        self.seats: set[Seat] = set()
        self.queue = TaskQueue(tasks)
        self.running: dict[Seat, _Attempt] = {}
        self.asked_again: set[Task] = set()

    def collect(self, is_reached: bool) -> Iterator[Outcome]:
        """Outcomes of the attempts that have ended; tasks that lost their worker for the first time are put back.

        So are those whose scheduler is not reached, which is not their fault.
        """
        if not is_reached:
            self.seats = set()
        for seat, attempt in list(self.running.items()):
            if not attempt.arrival.done() and seat in self.seats:
                continue
            del self.running[seat]
            outcome = _outcome(attempt)
            if outcome is None:
                # Nothing more goes there until the scheduler names it again.
                self.seats = {other for other in self.seats if other[0] != seat[0]}
            if outcome is None and not (is_reached and attempt.task in self.asked_again):
                self.asked_again.update([attempt.task] if is_reached else [])
                self.queue.put_back(attempt.task)
            else:
                self.asked_again.discard(attempt.task)
                yield outcome or Outcome(attempt.task, crash=Crash(LOST, "", ""))

    def wait(self) -> None:
        """Until an attempt has ended, or for a moment."""
        if self.running:
            arrivals = [attempt.arrival for attempt in self.running.values()]
            concurrent.futures.wait(arrivals, timeout=POLL_SECONDS, return_when=concurrent.futures.FIRST_COMPLETED)
        elif self.queue:
            time.sleep(POLL_SECONDS)


def _outcome(attempt: _Attempt) -> Outcome | None:
    """The outcome of an attempt that has arrived; None where its worker was lost, which ends the attempt."""
    from distributed import KilledWorker

    if not attempt.arrival.done():
        attempt.future.cancel()
        return None
    try:
        return Outcome(attempt.task, *attempt.arrival.result())
    # The scheduler has started anew, or its limit of workers that a task may lose is lower.
    except (concurrent.futures.CancelledError, asyncio.CancelledError, KilledWorker):
        return None
    except Exception as error:
        return Outcome(attempt.task, exception=error)


# On a worker of the cluster: the pools that are idle, by session and number, and sessions that have ended.
_idle: dict[tuple[str, int], LocalPool] = {}
_ended: set[str] = set()
_lock = threading.Lock()


def _run_here(session: str, number: int, limits: tuple[float, int | None], task: Task) -> _Answer:
    """On a worker of the cluster: run the task in the process of this session and number."""
    with _lock:
        pool = _idle.pop((session, number), None) or LocalPool(1, *limits, sharers=os.cpu_count() or 1)
    [outcome] = pool.run([task])
    with _lock:
        # Two runs that are under way at once may use one number.
        if session in _ended or _idle.setdefault((session, number), pool) is not pool:
            pool.close()
    return outcome.value, outcome.exception, outcome.crash


def _end_session(session: str) -> None:
    with _lock:
        _ended.add(session)
        for key in [key for key in _idle if key[0] == session]:
            _idle.pop(key).close()
