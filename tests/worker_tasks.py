"""Tasks for the tests of workers. Nothing heavy is imported, for each process imports this."""

from __future__ import annotations

import builtins
import ctypes
import os
import re
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any


class Peculiar(Exception):
    """Its pickles cannot be read, for ``args`` is not what its constructor takes."""

    def __init__(self, left: int, right: int) -> None:
        super().__init__(f"{left} beside {right}")


def own_process(note: object) -> int:
    return os.getpid()


def echo(value: Any, note: object) -> Any:
    return value


def slow_process(seconds: float, note: object) -> int:
    time.sleep(seconds)
    return os.getpid()


def compute(seconds: float, processor: int, note: object) -> None:
    """Use ``seconds`` of one processor, which others may use too."""
    os.sched_setaffinity(0, {processor})
    started = time.process_time()
    while time.process_time() < started + seconds:
        pass


def let_compute(seconds: float, processor: int, note: object) -> None:
    """``compute`` in a process of its own, which this one waits for."""
    code = f"import sys; sys.path[:] = {sys.path!r}; import worker_tasks; worker_tasks.compute({seconds}, {processor}, None)"
    subprocess.run([sys.executable, "-c", code], check=True)


def abort(number: int, note: Any) -> None:
    note(f"at {number}")
    os.write(2, b"the cow jumped over the moon")
    os.abort()


def babble(note: object) -> None:
    for number in range(100_000):
        print(number)
    sys.stdout.flush()
    os.abort()


def segfault(note: object) -> None:
    ctypes.string_at(0)


def hang_holding_the_lock(note: object) -> None:
    re.match(r"(a+)+$", "a" * 60 + "b")


def exit_at_once(note: object) -> None:
    os._exit(3)


def exit_by_exception(note: object) -> None:
    sys.exit(3)


def raise_peculiar(note: object) -> None:
    raise Peculiar(1, 2)


def raise_with_a_function(note: object) -> None:
    error = ValueError("no can do")
    error.function = lambda: 0  # type: ignore[attr-defined]
    raise error


def return_a_generator(note: object) -> Any:
    return (number for number in range(3))


def recurse(note: object) -> None:
    recurse(note)


def exhaust_memory(note: object) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30))
    bytearray(1 << 40)


def be_killed(note: object) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def chatter(note: object) -> None:
    print("the dish ran away", flush=True)
    os.write(1, b"with the spoon")
    os.write(2, b"to the moon")


def return_twice(note: object) -> int:
    os.fork()
    return os.getpid()


def fork(leave_group: bool, hang: bool, note: Any) -> int:
    child = os.fork()
    if child == 0:
        if leave_group:
            os.setsid()
        time.sleep(1000)
    note(str(child))
    if hang:
        time.sleep(1000)
    return child


def use_heyoka(note: object) -> tuple[bool, bool]:
    """Whether SymPy is imported after heyoka has computed, and whether it can be imported then."""
    from harness.programs.machine_code import load_heyoka

    heyoka = load_heyoka()
    x = heyoka.expression("x")
    heyoka.cfunc([heyoka.sin(x)], vars=[x])([0.5])
    found = "sympy" in sys.modules
    import sympy

    return found, sympy.Symbol("x").is_Symbol


def worker_of_the_cluster(seconds: float, note: object) -> int:
    time.sleep(seconds)
    return os.getppid()


def lose_worker(lost: str, times: int, note: object) -> int:
    """Kill the cluster's worker that asks; once there are files of so many deaths in the folder ``lost``, say how many."""
    deaths = len(list(Path(lost).iterdir()))
    if deaths < times:
        Path(lost, str(deaths)).touch()
        os.kill(os.getppid(), signal.SIGKILL)
        time.sleep(1000)
    return deaths


def fill_memory(note: object) -> None:
    """Hold more and more, as a program that is asked for too much does."""
    held = []
    while True:
        held.append(b"x" * (1 << 24))
        time.sleep(0.01)


def raise_unsound(kind: str, words: str, note: object) -> None:
    """An exception after which native code may be left in the middle of what it did."""
    raise getattr(builtins, kind)(words)
