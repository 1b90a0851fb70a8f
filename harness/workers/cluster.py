"""Tasks on a Dask cluster, for when one machine is not enough.

Each task runs in a local worker process of the machine it comes to. A crash of an engine costs no worker of the cluster,
and is described as it is locally. Who can reach the scheduler can run code as the user of its workers.
"""

from __future__ import annotations

import contextlib
import logging
import secrets
import threading
import time
from collections.abc import Callable, Hashable, Iterable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from harness.errors import InvalidRequest
from harness.workers.local import POLL_SECONDS, LocalPool
from harness.workers.tasks import Crash, Outcome, Task, TaskQueue

if TYPE_CHECKING:
    from harness.workers import Scheduler

# After as long without any worker, none will come.
PATIENCE_SECONDS = 120.0
CONNECT_SECONDS = 10.0
# A thread of a worker of the cluster: the worker's address, and a number.
Seat = tuple[str, int]


class Cluster:
    """A connection to a scheduler, and a local process for each thread of its workers.

    Raises:
        InvalidRequest: no scheduler answers, or it does not accept the certificates.
    """

    def __init__(self, scheduler: Scheduler, time_limit: float) -> None:
        from distributed import Client
        from distributed.security import Security

        self._time_limit = time_limit
        self._session = secrets.token_hex(16)
        self._owners: dict[Hashable, Seat] = {}
        with contextlib.ExitStack() as stack:
            # Dask logs what is part of an outcome or of an error here.
            logger = logging.getLogger("distributed")
            stack.callback(setattr, logger, "propagate", logger.propagate)
            logger.propagate = False
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
        with self._open:
            self._client.run(_end_session, self._session, on_error="ignore")

    @property
    def seats(self) -> int:
        """How many tasks can run at once by now."""
        return len(self._seats())

    def run(self, tasks: Iterable[Task], further: Callable[[], Iterable[Task]] = tuple) -> Iterator[Outcome]:
        """Outcomes as the tasks end; tasks that no worker comes for are reported as crashed."""
        from distributed import wait

        queue = TaskQueue(tasks)
        running: dict[Seat, tuple[Task, Any]] = {}
        last_seen = time.monotonic()
        try:
            while queue or running:
                seats = self._seats()
                self._owners = {affinity: seat for affinity, seat in self._owners.items() if seat in seats}
                idle = sorted(seats - set(running), key=lambda seat: (not queue.owned_by(seat, self._owners), seat))
                for seat in idle:
                    if (task := queue.take(seat, self._owners)) is not None:
                        running[seat] = task, self._submit(task, seat)
                if seats:
                    last_seen = time.monotonic()
                elif not running and time.monotonic() - last_seen > PATIENCE_SECONDS:
                    reason = f"the cluster has had no worker for {PATIENCE_SECONDS:g} s; start workers or drop --scheduler"
                    while (task := queue.take(None, {})) is not None:
                        yield Outcome(task, crash=Crash(reason, "", ""))
                    return
                if running:
                    with contextlib.suppress(TimeoutError):
                        wait([future for _, future in running.values()], timeout=POLL_SECONDS, return_when="FIRST_COMPLETED")
                else:
                    time.sleep(POLL_SECONDS)
                for seat, (task, future) in list(running.items()):
                    if future.done() or seat not in seats:
                        del running[seat]
                        yield self._outcome(task, future)
                        queue.add(further())
        finally:
            for _, future in running.values():
                future.cancel()

    def _seats(self) -> set[Seat]:
        return {(address, number) for address, threads in self._client.nthreads().items() for number in range(threads)}

    def _submit(self, task: Task, seat: Seat) -> Any:
        if task.affinity is not None:
            self._owners[task.affinity] = seat
        # The key is the caller's own, and need not be picklable.
        call = (self._session, seat[1], self._time_limit, replace(task, key=None))
        return self._client.submit(_run_here, *call, workers=[seat[0]], pure=False, retries=0, allow_other_workers=False)

    def _outcome(self, task: Task, future: Any) -> Outcome:
        if future.status == "finished":
            value, exception, crash = future.result()
            return Outcome(task, value, exception, crash)
        if future.status == "error":
            return Outcome(task, exception=future.exception())
        future.cancel()
        return Outcome(task, crash=Crash("lost its worker of the cluster", "", ""))


# On a worker of the cluster: the pools that are idle, by session and number, and sessions that have ended.
_idle: dict[tuple[str, int], LocalPool] = {}
_ended: set[str] = set()
_lock = threading.Lock()


def _run_here(session: str, number: int, time_limit: float, task: Task) -> tuple[Any, BaseException | None, Crash | None]:
    """On a worker of the cluster: run the task in the process of this session and number."""
    with _lock:
        pool = _idle.pop((session, number), None) or LocalPool(1, time_limit)
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
