"""Worker processes on this machine, one task at a time in each, so that a process that dies names its culprit.

No library does this. Pebble and ``concurrent.futures`` start processes by ``multiprocessing``, whose spawn runs the
user's script again, and give a task to any process; execnet hides the exit status and standard error of a process. None
kills what an engine has forked.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import re
import secrets
import selectors
import signal
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import Callable, Hashable, Iterable, Iterator
from pathlib import Path

from harness.errors import leaves_process_unsound
from harness.workers import memory, program
from harness.workers.tasks import MORE_MEMORY, MORE_TIME, Crash, Outcome, Task, TaskQueue

POLL_SECONDS = 0.2
# Allowed beside the task itself, to start a process and to import the task's function on a busy machine.
START_SECONDS = 60.0
# Of what a process wrote before it died, from its end.
MOST_CHARACTERS = 2000


class LocalPool:
    """At most ``count`` processes; one more starts when a task waits that no idle one may take.

    ``memory_limit`` as of ``harness.workers.Workers``; ``sharers``: processes that share the machine's memory with these, for its default.
    """

    def __init__(self, count: int, time_limit: float, memory_limit: int | None = None, sharers: int = 0) -> None:
        # Number of tasks that can run at once.
        self.seats = count
        self._time_limit = time_limit
        self._memory_limit = memory_limit or memory.default_limit(max(count, sharers))
        self._processes: list[_Process] = []
        self._owners: dict[Hashable, _Process] = {}

    def close(self) -> None:
        """Kill the processes; nothing runs afterwards."""
        self.seats = 0
        for process in list(self._processes):
            self._remove(process)

    @property
    def under_way(self) -> list[str]:
        """See ``harness.workers.Workers``."""
        running = [process.task.affinity for process in [*self._processes] if process.run is not None]
        return list(dict.fromkeys(str(name) for name in running if isinstance(name, str | Path)))

    def run(self, tasks: Iterable[Task], further: Callable[[], Iterable[Task]] = tuple) -> Iterator[Outcome]:
        """Outcomes as the tasks end. Several runs may be under way; a run goes on while it is asked for outcomes."""
        run = _LocalRun(tasks)
        try:
            while run.queue or run.done or any(process.run is run for process in self._processes):
                if run.queue and not self.seats:
                    raise RuntimeError("the context of these workers has ended")
                self._give_out(run)
                if not run.done:
                    self._collect()
                while run.done:
                    yield run.done.popleft()
                    run.queue.add(further())
        finally:
            for process in [process for process in self._processes if process.run is run]:
                self._remove(process)

    def _give_out(self, run: _LocalRun) -> None:
        for process in [process for process in self._processes if process.run is None and not process.alive]:
            self._remove(process)
        idle = [process for process in self._processes if process.run is None]
        for process in sorted(idle, key=lambda process: not run.queue.owned_by(process, self._owners)):
            self._start(run, process)
        while len(self._processes) < self.seats and self._start(run, None):
            pass

    def _start(self, run: _LocalRun, process: _Process | None) -> bool:
        """Give the next task to ``process``, or to a new one; False where no task may be given to it."""
        task = run.queue.take(process, self._owners)
        if task is None:
            return False
        try:
            content = pickle.dumps(sys.path) + pickle.dumps((task.function, task.arguments), protocol=5)
        except Exception as error:
            run.done.append(Outcome(task, exception=error))
            return True
        if process is None:
            try:
                process = _Process(self._memory_limit)
            except OSError:
                if not self._processes:
                    raise
                # The system has no room for more; those that run do the work.
                self.seats = len(self._processes)
                run.queue.add([task])
                return False
            self._processes.append(process)
        if task.affinity is not None:
            self._owners[task.affinity] = process
        process.start(run, task, content, self._time_limit)
        return True

    def _collect(self) -> None:
        """Wait until a process has something to say, or for a moment; give each outcome to its run."""
        busy = [process for process in self._processes if process.run is not None]
        with selectors.DefaultSelector() as selector:
            for process in busy:
                selector.register(process.signs, selectors.EVENT_READ)
            selector.select(min([POLL_SECONDS, *(max(0.0, process.deadline - process.clock()) for process in busy)]))
        for process in busy:
            run, outcome = process.run, process.outcome(self._time_limit)
            if run is not None and outcome is not None:
                run.done.append(outcome)
                process.run = None
                if outcome.crash is not None or leaves_process_unsound(outcome.exception):
                    self._remove(process)

    def _remove(self, process: _Process) -> None:
        process.close()
        self._processes.remove(process)
        self._owners = {affinity: owner for affinity, owner in self._owners.items() if owner is not process}


class _LocalRun:
    """One call of ``LocalPool.run``: the tasks that wait, and the outcomes that its caller has not taken yet."""

    def __init__(self, tasks: Iterable[Task]) -> None:
        self.queue = TaskQueue(tasks)
        self.done: deque[Outcome] = deque()


class _Process:
    """One process, and the run that its task belongs to while it is busy."""

    def __init__(self, memory_limit: int) -> None:
        self.run: _LocalRun | None = None
        self.deadline = self._looked = 0.0
        self._memory_limit = memory_limit
        self._waited: dict[int, float] = {}
        self._mark = os.environ.get(program.MARK, "") + secrets.token_hex(16)
        with contextlib.ExitStack() as ours, contextlib.ExitStack() as theirs:
            self._mail, self._notes, self._errors = (ours.enter_context(tempfile.TemporaryFile(buffering=0)).fileno() for _ in range(3))
            wake, self._wake = _pipe(reader=theirs, writer=ours)
            self.signs, signs = _pipe(reader=ours, writer=theirs)
            lifeline, _ = _pipe(reader=theirs, writer=ours)
            os.set_blocking(self.signs, False)
            descriptors = (self._mail, self._notes, wake, signs, lifeline)
            self._popen = subprocess.Popen(
                [sys.executable, "-P", program.__file__, *map(str, descriptors)],
                stdin=subprocess.DEVNULL,
                stdout=self._errors,
                stderr=self._errors,
                pass_fds=descriptors,
                # A process group to be killed at once, which the interrupt of a terminal does not reach.
                start_new_session=True,
                env={**program.VARIABLES, **os.environ, program.MARK: self._mark, memory.VARIABLE: str(memory_limit)},
            )
            self._open = ours.pop_all()

    @property
    def alive(self) -> bool:
        return self._popen.poll() is None

    def clock(self) -> float:
        """Seconds of this process, computing or idle; those it waited for a processor count only where /proc does not tell them.

        What its children waited does not count either: an engine in an interpreter of its own is one.
        """
        for process in (self._popen.pid, *_children(self._popen.pid)):
            # A child that is gone by now has waited all the same.
            self._waited[process] = max(self._waited.get(process, 0.0), _seconds_without_processor(process))
        return time.monotonic() - sum(self._waited.values())

    def start(self, run: _LocalRun, task: Task, content: bytes, time_limit: float) -> None:
        self.run, self.task = run, task
        self.deadline = self.clock() + START_SECONDS + time_limit
        for descriptor in (self._errors, self._notes):
            program.replace_content(descriptor)
        program.replace_content(self._mail, content)
        with contextlib.suppress(BrokenPipeError):
            os.write(self._wake, b"!")

    def outcome(self, time_limit: float) -> Outcome | None:
        """The outcome of the task, None while it runs; after a crash the process is of no more use and to be closed."""
        # Asked before the pipe is read: an answer may be the last that a process gave.
        alive = self.alive
        try:
            signs = os.read(self.signs, 2)
        except BlockingIOError:
            signs = None
        if signs and signs.endswith(program.ANSWERED):
            return self._answer()
        if signs:
            self.deadline = self.clock() + time_limit
        elif signs is not None or not alive:
            return self._crash(self._cause_of_death())
        elif self.clock() > self.deadline:
            return self._crash(f"exceeded its time limit of {time_limit:g} s; {MORE_TIME}")
        elif time.monotonic() - self._looked > memory.LOOK_SECONDS:
            self._looked = time.monotonic()
            if memory.resident(self._popen.pid) > self._memory_limit:
                return self._crash(f"needs more than {memory.in_words(self._memory_limit)} of memory; {MORE_MEMORY}")
        return None

    def _answer(self) -> Outcome:
        try:
            with program.open_at_start(self._mail) as stream:
                answer = pickle.load(stream)
        except Exception as error:
            return Outcome(self.task, exception=error)
        if len(answer) == 1:
            return Outcome(self.task, value=answer[0])
        pickled, name, text = answer
        with contextlib.suppress(Exception):
            return Outcome(self.task, exception=pickle.loads(pickled))
        # A class that cannot be had here, or whose pickles cannot be read, is stood in for by one of its name.
        return Outcome(self.task, exception=type(name, (Exception,), {})(text))

    def _crash(self, reason: str) -> Outcome:
        # What the interpreter adds is not the engine's.
        message = re.split(r"^Fatal Python error:", _text(self._errors), maxsplit=1, flags=re.MULTILINE)[0].strip()
        if len(message) > MOST_CHARACTERS:
            message = f"[...] {message[-MOST_CHARACTERS:]}"
        return Outcome(self.task, crash=Crash(reason, _text(self._notes), message))

    def _cause_of_death(self) -> str:
        try:
            status = self._popen.wait(2.0)
        except subprocess.TimeoutExpired:
            return "closed its pipe to the harness"
        if status >= 0:
            return f"ended its process with status {status}"
        names = {number.value: f" ({number.name})" for number in signal.Signals}
        # Nobody else is likely to kill it: the kernel does so where memory runs out.
        remedy = f"; if memory ran out, {MORE_MEMORY}" if status == -signal.SIGKILL else ""
        return f"crashed by signal {-status}{names.get(-status, '')}{remedy}"

    def close(self) -> None:
        """Kill the process and all that was forked in it, also what left its process group where /proc shows it."""
        # Its descendants are known by it while it lives, and it starts no more; later by its mark, or by what they write to.
        self._popen.send_signal(signal.SIGSTOP)
        killed: set[int] = set()
        while left := (_descendants(self._popen) | set(_left(f"{program.MARK}={self._mark}".encode(), self._errors))) - killed:
            for process in left - {self._popen.pid}:
                with contextlib.suppress(ProcessLookupError, PermissionError):
                    os.kill(process, signal.SIGKILL)
            killed |= left
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._popen.pid, signal.SIGKILL)
        self._popen.wait()
        self._open.close()


def _pipe(reader: contextlib.ExitStack, writer: contextlib.ExitStack) -> tuple[int, int]:
    """A pipe's two ends, each to be closed with its stack."""
    ends = os.pipe()
    reader.callback(os.close, ends[0])
    writer.callback(os.close, ends[1])
    return ends


def _seconds_without_processor(process: int) -> float:
    """Seconds in which the main thread of a process could have run and others ran (proc(5), schedstat); 0 where that is not known."""
    try:
        return int(Path(f"/proc/{process}/schedstat").read_bytes().split()[1]) * 1e-9
    except (OSError, IndexError):
        return 0.0


def _children(process: int) -> list[int]:
    """Children of the main thread of a process that are alive; nothing where /proc does not tell it."""
    try:
        return list(map(int, Path(f"/proc/{process}/task/{process}/children").read_bytes().split()))
    except (OSError, ValueError):
        return []


def _descendants(process: subprocess.Popen[bytes]) -> set[int]:
    """Processes that a living one has started, and those that these have; nothing on a system without /proc."""
    parents: dict[int, int] = {}
    for status in Path("/proc").glob("[0-9]*/stat") if process.poll() is None else ():
        with contextlib.suppress(OSError):
            # The name, in parentheses, may hold anything.
            parents[int(status.parent.name)] = int(status.read_bytes().rpartition(b")")[2].split()[1])
    found = {process.pid}
    while more := {child for child, parent in parents.items() if parent in found} - found:
        found |= more
    return found - {process.pid}


def _left(mark: bytes, errors: int) -> Iterator[int]:
    """Processes started with ``mark`` in their environment or with the file ``errors`` as standard error; none without /proc."""
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if mark in (process / "environ").read_bytes() or os.path.samestat((process / "fd" / "2").stat(), os.fstat(errors)):
                yield int(process.name)


def _text(descriptor: int) -> str:
    with program.open_at_start(descriptor) as stream:
        return stream.read().decode("utf-8", errors="replace")
