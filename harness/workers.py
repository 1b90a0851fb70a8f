"""Worker processes that survive an engine which aborts, hangs or exhausts memory.

Tasks run on a ``distributed`` cluster, one at a time in each worker process, so that a process that
dies names its culprit. A task that overruns its time limit ends its process by a watchdog that needs
no interpreter lock; the cluster's nanny starts a new one.
"""

from __future__ import annotations

import contextlib
import faulthandler
import logging
import os
import re
import shutil
import signal
import tempfile
import time
from collections import deque
from collections.abc import Callable, Hashable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

POLL_SECONDS = 0.2
# A busy machine takes this long to start a process; after as long again, none will come.
RESTART_SECONDS = 60.0
_TIMEOUT_MARK = "Timeout ("


@dataclass(frozen=True, eq=False)
class Task:
    """One call ``function(*arguments, note)``; ``key`` is the caller's own, to tell results apart.

    ``note`` is a function the task may call with text that survives a crash of the process.
    """

    key: Any
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    affinity: Hashable | None = None


@dataclass(frozen=True)
class Crash:
    """A task whose process died: why, what it had noted last, and what it wrote to standard error."""

    reason: str
    note: str
    standard_error: str

    def __str__(self) -> str:
        return f"{self.reason}; it wrote: {self.standard_error}" if self.standard_error else self.reason


@dataclass(frozen=True)
class Outcome:
    """What became of a task: a value, an exception it raised, or a crash."""

    task: Task
    value: Any = None
    exception: BaseException | None = None
    crash: Crash | None = None


@dataclass
class Workers:
    """A cluster for as long as the context lasts.

    Attributes:
        count: number of local worker processes; None for one per CPU.
        scheduler: address of an existing cluster to use instead of a local one.
        time_limit: seconds a task may take.
    """

    count: int | None = None
    scheduler: str | None = None
    time_limit: float = 60.0
    _exit: contextlib.ExitStack = field(default_factory=contextlib.ExitStack)
    _client: Any = None
    _spool: Path = Path()

    def __enter__(self) -> Workers:
        import dask.config
        from distributed import Client, LocalCluster

        # The cluster logs every start and stop of a worker; here they are part of an outcome.
        logger = logging.getLogger("distributed")
        self._exit.callback(setattr, logger, "propagate", logger.propagate)
        logger.propagate = False
        self._spool = Path(tempfile.mkdtemp(prefix="harness-"))
        self._exit.callback(shutil.rmtree, self._spool, ignore_errors=True)
        if self.scheduler is None:
            self._exit.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": 0}))
            # Without an address the scheduler's own server fights for one port with every other cluster.
            quiet = {"dashboard": False, "dashboard_address": "127.0.0.1:0"}
            cluster = LocalCluster(
                n_workers=self._processes,
                threads_per_worker=1,
                processes=True,
                dashboard_address=None,
                silence_logs=50,
                scheduler_kwargs=quiet,
            )
            self._exit.enter_context(cluster)
            self._client = self._exit.enter_context(Client(cluster))
        else:
            self._client = self._exit.enter_context(Client(self.scheduler, timeout=10))
        return self

    def __exit__(self, *exception: object) -> None:
        self._exit.close()

    @property
    def _processes(self) -> int:
        return self.count or os.cpu_count() or 1

    def __len__(self) -> int:
        return max(1, len(self._client.nthreads()))

    def run(self, tasks: Iterable[Task]) -> Iterator[Outcome]:
        """Outcomes in the order in which the tasks end; every task has exactly one.

        Where the cluster loses its workers for good, the tasks left are told as crashed.
        """
        from distributed import wait

        waiting = deque(tasks)
        running: dict[str, tuple[Task, Any, Path]] = {}
        without_workers_since: float | None = None
        while waiting or running:
            alive = set(self._client.nthreads())
            for worker in sorted(alive - set(running)):
                if waiting:
                    running[worker] = self._submit(waiting.popleft(), worker)
            if not running:
                without_workers_since = without_workers_since or time.monotonic()
                waited = time.monotonic() - without_workers_since
                if waited > 2 * RESTART_SECONDS:
                    reason = f"the cluster has had no worker for {waited:.0f} s; start workers or drop --scheduler"
                    yield from (Outcome(task, crash=Crash(reason, "", "")) for task in waiting)
                    return
                if waited > RESTART_SECONDS and self.scheduler is None:
                    # A nanny that fails to start its worker in time gives up; asked for their number, the cluster makes new ones.
                    self._client.cluster.scale(self._processes)
                time.sleep(POLL_SECONDS)
                continue
            without_workers_since = None
            with contextlib.suppress(TimeoutError):
                wait([future for _, future, _ in running.values()], timeout=POLL_SECONDS, return_when="FIRST_COMPLETED")
            alive = set(self._client.nthreads())
            for worker, (task, future, spool) in list(running.items()):
                if future.done() or worker not in alive:
                    del running[worker]
                    yield self._outcome(task, future, spool)

    def _submit(self, task: Task, worker: str) -> tuple[Task, Any, Path]:
        spool = Path(tempfile.mkdtemp(dir=self._spool))
        future = self._client.submit(
            _guarded,
            task.function,
            task.arguments,
            self.time_limit,
            spool,
            workers=[worker],
            pure=False,
            retries=0,
            allow_other_workers=False,
        )
        return task, future, spool

    def _outcome(self, task: Task, future: Any, spool: Path) -> Outcome:
        from distributed.scheduler import KilledWorker

        if future.status == "finished":
            return Outcome(task, value=future.result())
        exception = future.exception(timeout=POLL_SECONDS) if future.done() else None
        if exception is None or isinstance(exception, KilledWorker) or future.cancelled():
            future.cancel()
            return Outcome(task, crash=self._crash(spool))
        return Outcome(task, exception=exception)

    def _crash(self, spool: Path) -> Crash:
        written = _read(spool / "stderr")
        timed_out = _TIMEOUT_MARK in written
        message = re.split(r"^(?:Timeout \(|Fatal Python error:)", written, maxsplit=1, flags=re.MULTILINE)[0].strip()
        reason = f"exceeded its time limit of {self.time_limit:g} s" if timed_out else self._cause_of_death(_read(spool / "pid"))
        return Crash(reason, _read(spool / "note"), message)

    def _cause_of_death(self, pid: str) -> str:
        """What the nanny saw of process ``pid``; it writes this a moment after the scheduler notices."""
        deadline = time.monotonic() + 2.0
        while pid and time.monotonic() < deadline:
            logs = self._client.get_worker_logs(nanny=True)
            text = "\n".join(str(entry) for entries in logs.values() for entry in entries)
            by_signal = re.search(rf"process {pid} was killed by signal (\d+)", text)
            if by_signal:
                number = int(by_signal[1])
                return f"crashed by signal {number} ({signal.Signals(number).name})"
            by_status = re.search(rf"process {pid} exited with status (\d+)", text)
            if by_status:
                return f"ended its process with status {by_status[1]}"
            time.sleep(POLL_SECONDS)
        return "ended its process without a word"


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


def _guarded(function: Callable[..., Any], arguments: tuple[Any, ...], time_limit: float, spool: Path) -> Any:
    """Run in the worker: watchdog on, file descriptor 2 into the spool where the spool can be reached."""
    with contextlib.ExitStack() as stack:
        note: Callable[[str], None] = lambda text: None  # noqa: E731
        if spool.is_dir():
            (spool / "pid").write_text(str(os.getpid()))
            errors = stack.enter_context((spool / "stderr").open("wb", buffering=0))
            notes = stack.enter_context((spool / "note").open("wb", buffering=0))
            saved = os.dup(2)
            stack.callback(os.close, saved)
            os.dup2(errors.fileno(), 2)
            stack.callback(os.dup2, saved, 2)

            def note(text: str) -> None:
                os.pwrite(notes.fileno(), text.encode(), 0)
                os.ftruncate(notes.fileno(), len(text.encode()))

        faulthandler.dump_traceback_later(time_limit, exit=True, file=2)
        stack.callback(faulthandler.cancel_dump_traceback_later)
        return function(*arguments, note)
