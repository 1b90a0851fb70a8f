"""The program of one local worker process, which runs one task after another.

The harness runs this file by its path, so that no ``__main__`` of a user is imported again. Task and answer are pickles
in one unlinked file that both sides hold open. One byte through a pipe announces each: ``wake`` a task, ``signs`` that
its function is called and that its answer is there.
"""

from __future__ import annotations

import ctypes
import fcntl
import gc
import os
import pickle
import select
import signal
import sys
from collections.abc import Callable
from typing import BinaryIO

BEGUN, ANSWERED = b".", b"!"
# SymPy makes and drops objects by the million: looking for cycles after each 700 of them takes a twentieth of the time.
OBJECTS_BETWEEN_LOOKS = 50_000, 20, 100
# In the environment of each process, with a value of its own; what the process forks inherits it. A worker of a worker has
# the other's value before its own.
MARK = "HARNESS_WORKER"
# Of the harness's processes, where their user says nothing else. They take the processors among them: a thread of linear algebra that
# waits for work takes a tenth of a second from others at each start, and sums of several threads round as there are processors.
# MuJoCo asks a Python process of its own for the window system at each import, and nothing is drawn by it. A mechanism's expressions do
# not fit the 1000 that SymPy keeps; with more it reads a catalogue in four fifths of the time.
VARIABLES = {"OPENBLAS_NUM_THREADS": "1", "MUJOCO_GL": "disable", "SYMPY_CACHE_SIZE": "20000"}
_PR_SET_CHILD_SUBREAPER = 36


def is_worker() -> bool:
    """True where this process runs the harness's tasks, or was started by one that does: it is no process of a user's."""
    return MARK in os.environ


def open_at_start(descriptor: int) -> BinaryIO:
    """A reader of a file whose descriptor stays open."""
    os.lseek(descriptor, 0, os.SEEK_SET)
    return os.fdopen(descriptor, "rb", closefd=False)


def replace_content(descriptor: int, content: bytes = b"") -> None:
    """Make ``content`` all that a file holds."""
    with open(descriptor, "wb", closefd=False) as stream:
        stream.seek(0)
        stream.truncate()
        stream.write(content)


def main(mail: int, notes: int, wake: int, signs: int, lifeline: int) -> None:
    """Run tasks until ``wake`` is closed; the arguments are file descriptors."""
    process = os.getpid()
    gc.set_threshold(*OBJECTS_BETWEEN_LOOKS)
    _die_with_the_harness(lifeline)
    if sys.platform == "linux":
        # What loses its parent stays a descendant of this process, by which the harness finds it.
        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)

    def note(text: str) -> None:
        os.pwrite(notes, text.encode(), 0)
        os.ftruncate(notes, len(text.encode()))

    while os.read(wake, 1):
        answer = _answer(mail, signs, note)
        if os.getpid() != process:
            # A process that the task forked, and that came back from the task.
            os._exit(0)
        replace_content(mail, answer)
        os.write(signs, ANSWERED)


def _die_with_the_harness(lifeline: int) -> None:
    """Have the kernel kill this process group as soon as the harness, which holds the other end of ``lifeline``, is gone.

    The signal reaches a process that holds the interpreter lock. PR_SET_PDEATHSIG would kill when the thread ends that
    started this process.
    """
    fcntl.fcntl(lifeline, fcntl.F_SETOWN, -os.getpgrp())
    if hasattr(fcntl, "F_SETSIG"):
        fcntl.fcntl(lifeline, fcntl.F_SETSIG, signal.SIGKILL)
    fcntl.fcntl(lifeline, fcntl.F_SETFL, fcntl.fcntl(lifeline, fcntl.F_GETFL) | os.O_ASYNC)
    if select.select([lifeline], [], [], 0)[0]:
        sys.exit()


def _answer(mail: int, signs: int, note: Callable[[str], None]) -> bytes:
    """Run the task in ``mail``: the pickle of (value,), or of a pickled exception, its class's name and its text."""
    try:
        with open_at_start(mail) as stream:
            sys.path[:] = pickle.load(stream)
            function, arguments = pickle.load(stream)
        os.write(signs, BEGUN)
        return pickle.dumps((function(*arguments, note),), protocol=5)
    except Exception as error:
        return pickle.dumps((_pickled(error), type(error).__name__, _text(error)))


def _pickled(error: Exception) -> bytes:
    """The exception with its traceback as a note; empty where it cannot be pickled."""
    import traceback

    try:
        error.add_note(traceback.format_exc().strip())
        return pickle.dumps(error)
    except Exception:
        return b""


def _text(error: Exception) -> str:
    try:
        return str(error)
    except Exception:
        return "its text cannot be had"


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
