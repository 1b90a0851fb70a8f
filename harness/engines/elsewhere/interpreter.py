"""Engines in processes of their own: the interpreter of one, one for each process that asks it, and the models it holds.

An engine of another version, or that is not installed beside the harness, is run by the interpreter of its environment. Every other
engine is run by one of this Python's: whatever it does to its process, no other engine and no truth is asked there. Where the program of
an engine runs out of memory, or raises what its bindings do not know, that process ends too, and the next question is another one's.

Its cost, measured: 0.2 s to start beside the import of the engine, 0.2 ms of CPU a request on both sides together, 0.2 ms a model that
is loaded. Checks of all mechanisms, on two workers and with a warm cache, took 1.00 to 1.03 of their CPU without it; ``benchmarks``,
``commands/isolation of check``, measures them with and without in turns.

No library does this: execnet hides the exit status and standard error of a process, which name its death; see ``harness.workers.local``.
"""

from __future__ import annotations

import copy
import functools
import os
import select
import signal
import subprocess
import sys
import weakref
from collections.abc import Callable, Collection, Mapping, Sequence
from multiprocessing import Pipe
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

from harness.engines.calls import Call
from harness.engines.elsewhere.transport import Loaded, dumps, loads, pickled
from harness.engines.engine import handed_over
from harness.engines.interface import CompiledNumber
from harness.engines.request import EngineAnswers, EngineQuestion, Request
from harness.environments import Environment
from harness.errors import is_out_of_memory
from harness.files.model_file import ModelFile
from harness.workers import memory
from harness.workers.program import VARIABLES, is_worker

if TYPE_CHECKING:
    from harness.engines import Model
    from harness.engines.loaded_file import LoadedFile
    from harness.engines.moving import HeldNumbers, MotionsRequest, Moved, MovedFile
    from harness.files.mjcf.inertias import CompiledMesh, Number
    from harness.programs.mechanisms.mechanism import Mechanism

# Never imported here: it is a program of the environment's interpreter.
_SERVER = Path(__file__).with_name("server.py")
# They would put packages before those of the environment.
_LEFT_OUT = ("PYTHONPATH", "PYTHONHOME", "PYTHONSTARTUP", "VIRTUAL_ENV")


class EngineDied(Exception):
    """The interpreter of an environment ended; the message says how."""


class Interpreter:
    """A process of an environment's own Python, or of this one's. What it writes to standard output and error goes to this process's
    standard error.

    Attributes:
        said: attributes and methods of its engine, once they have been asked for.
        has_ended: whether it answers nothing more, as after an exception that left it unsound.
    """

    def __init__(self, name: str, environment: Environment | None) -> None:
        self.has_ended = False
        self.said: tuple[dict[str, Any], list[str]] | None = None
        self._name = name
        self._forgotten: list[int] = []
        self._memory_limit = memory.limit_here()
        # Arrays as plain bytes take their time, and only another NumPy needs them.
        self._dumps = pickled if environment is None else dumps
        self._connection, theirs = Pipe()
        # ``Connection.poll`` makes a selector each time.
        self._arrivals = select.poll()
        self._arrivals.register(self._connection, select.POLLIN)
        own = {name: value for name, value in os.environ.items() if environment is None or name not in _LEFT_OUT}
        python = [sys.executable, "-P"] if environment is None else [environment.interpreter, "-P", "-s"]
        with theirs:
            self._process = subprocess.Popen(
                [*python, _SERVER, str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=2,
                pass_fds=[theirs.fileno()],
                env=VARIABLES | own,
            )
        self._folder = Path.cwd()
        if environment is None:
            self.ask("share", sys.path)

    def work_in(self, folder: Path) -> None:
        """Have files found by their names in a folder."""
        if folder != self._folder:
            self.ask("work_in", str(folder))
            self._folder = folder

    def forget(self, number: int) -> None:
        """Have a model dropped before the next request; this may run while another one is under way."""
        self._forgotten.append(number)

    def ask(self, *request: Any) -> Any:
        """The answer of a method of ``server.Server``, or what it raises; the request is its name and its arguments.

        Raises:
            EngineDied: in a process that is no worker. A worker dies as the interpreter did, and the harness names its death.
            MemoryError: it would hold more than a process of this worker may, or has found no more.
        """
        forgotten, self._forgotten = self._forgotten, []
        try:
            self._connection.send_bytes(self._dumps((forgotten, *request)))
            while not self._arrivals.poll(memory.LOOK_SECONDS * 1000):
                self._keep_within(self._memory_limit)
            is_value, answer, goes_on = loads(self._connection.recv_bytes())
        except (EOFError, BrokenPipeError, ConnectionResetError):
            self._die()
        if not goes_on:
            self._end()
        if is_value:
            return answer
        if is_out_of_memory(answer) and self._memory_limit is not None:
            raise MemoryError(f"ran out of memory, of which it may hold {memory.in_words(self._memory_limit)}: {answer}") from answer
        raise answer

    def _keep_within(self, limit: int | None) -> None:
        """Raises MemoryError where the process holds more; it answers nothing then."""
        if limit is not None and memory.resident(self._process.pid) > limit:
            self._end()
            raise MemoryError(f"needs more than {memory.in_words(limit)} of memory")

    def _end(self) -> None:
        # It may wait for a lock of its engine for ever.
        self.has_ended = True
        self._process.kill()
        self._process.wait()
        self._connection.close()

    def _die(self) -> None:
        status = self._process.wait()
        _RUNNING.clear()
        if is_worker() and status < 0:
            # As the default would have it: a handler in this process would survive it.
            signal.signal(-status, signal.SIG_DFL) if -status not in (signal.SIGKILL, signal.SIGSTOP) else None
            os.kill(os.getpid(), -status)
        if is_worker():
            os._exit(status)
        raise EngineDied(f"{self._name} ended its process with status {status}")


# By the folder of an environment, of which another cache directory has others of the same names; or by an engine file, with its time.
_RUNNING: dict[Path, tuple[int, Interpreter]] = {}


def _interpreter_of(path: Path, name: str, environment: Environment | None) -> Interpreter:
    """The interpreter of an environment, or of this Python for an engine file, in this process; started at the first call."""
    key = path if environment is None else environment.folder
    # An engine file that has been written since is run anew.
    since = 0 if environment else path.stat().st_mtime_ns
    if key not in _RUNNING or _RUNNING[key][0] != since or _RUNNING[key][1].has_ended:
        _RUNNING[key] = since, Interpreter(environment.name if environment else name, environment)
    interpreter = _RUNNING[key][1]
    interpreter.work_in(Path.cwd())
    return interpreter


class DistantModel:
    """A model in the interpreter of its engine: a ``harness.engines.Model`` that offers what its engine file offers.

    Args:
        make: asks an interpreter for the model, and returns both; it is called again where that interpreter has ended.
    """

    def __init__(self, make: Callable[[], tuple[Interpreter, Loaded]]) -> None:
        self._make = make
        self._load()

    def _load(self) -> None:
        self._interpreter, (self._number, self._attributes, self._methods) = self._make()
        weakref.finalize(self, self._interpreter.forget, self._number)

    @property
    def process(self) -> Interpreter:
        """The interpreter that answers; see ``harness.engines.calls.process_of``."""
        if self._interpreter.has_ended:
            self._load()
        return self._interpreter

    @staticmethod
    def answers_of_each(calls: Sequence[tuple[DistantModel, Sequence[Call]]]) -> list[list[tuple[Any, float]]]:
        """``harness.engines.calls.answer_each`` of models of one interpreter, in one request."""
        interpreter = calls[0][0].process
        numbered = [(model._number, own) for model, own in calls]
        found: list[list[tuple[Any, float]]] = interpreter.ask("answer_each", numbered)
        return found

    def _call(self, method: str, *arguments: Any) -> Any:
        def ask() -> Any:
            interpreter = self.process
            return interpreter.ask("call", self._number, method, arguments)

        answer = ask()
        if type(answer) is tuple:
            return tuple(self._received(one, functools.partial(lambda place: ask()[place], place)) for place, one in enumerate(answer))
        return self._received(answer, ask)

    def _received(self, answer: Any, again: Callable[[], Any]) -> Any:
        """An answer, and for a model that stays in the interpreter one here; ``again`` asks for it anew."""
        if not isinstance(answer, Loaded):
            return answer
        made = [answer]
        # The interpreter is this model's, which need not be the one that the next model would be loaded by.
        return DistantModel(lambda: (made.pop() if made else again(), self._interpreter)[::-1])

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        if name in self._attributes:
            return self._attributes[name]
        if name in self._methods:
            # Bound to this object: who holds the method alone must not have the model forgotten.
            return functools.partial(self._call, name)
        raise AttributeError(f"the model of {self._interpreter} offers no {name}")


class EngineElsewhere:
    """An ``Engine`` whose models are loaded by the interpreter of an environment, or by another one of this Python for None.

    Args:
        said: what has the attributes of the engine. methods: those that are called there; the others are methods of ``said``.
        path: of the engine file.
    """

    def __init__(self, said: Any, methods: Collection[str], path: Path, environment: Environment | None) -> None:
        self.environment, self.linear_velocity_in_body = environment, said.linear_velocity_in_body
        self._said, self._methods, self._path = said, methods, path

    def _interpreter(self) -> Interpreter:
        return _interpreter_of(self._path, self._said.name, self.environment)

    def load(self, source: ModelFile | Mechanism, joints: Sequence[str], gravity: float) -> Model:
        """See ``harness.engines.Engine``; raises what the engine file raises."""
        return cast("Model", self._made("load", handed_over(source), joints, gravity))

    def read(self, request: Request) -> LoadedFile:
        """See ``harness.engines.Engine``."""
        return cast("LoadedFile", self._made("read", request))

    def _made(self, method: str, *arguments: Any) -> DistantModel:
        def make() -> tuple[Interpreter, Loaded]:
            interpreter = self._interpreter()
            return interpreter, interpreter.ask(method, str(self._path), self._said.name, arguments)

        return DistantModel(make)

    def ask(self, question: EngineQuestion) -> EngineAnswers:
        """See ``harness.engines.Engine``."""
        answers: EngineAnswers = self.evaluate("ask", question)
        return answers

    def compiled(self, request: Request) -> tuple[CompiledNumber, ...]:
        """See ``harness.engines.Engine``."""
        numbers: tuple[CompiledNumber, ...] = self.evaluate("compiled", request)
        return numbers

    def compiled_meshes(self, path: Path) -> Mapping[Number, CompiledMesh]:
        """See ``harness.engines.Engine``."""
        found: Mapping[Number, CompiledMesh] = self.evaluate("compiled_meshes", path)
        return found

    def held_numbers(self, file: MovedFile) -> HeldNumbers:
        """See ``harness.engines.Engine``."""
        held: HeldNumbers = self.evaluate("held_numbers", file)
        return held

    def moved(self, request: MotionsRequest) -> Moved:
        """See ``harness.engines.Engine``; all motions in one request."""
        moved: Moved = self.evaluate("moved", request)
        return moved

    def evaluate(self, method: str, *arguments: Any) -> Any:
        """The answer of a method of the engine file's ``ENGINE`` there, or what it raises."""
        return self._interpreter().ask("evaluate", str(self._path), self._said.name, method, arguments)

    def run(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """See ``harness.engines.Engine``; an environment need not have what the harness's own modules import."""
        if self.environment is not None:
            return function(self, *arguments)
        named = function.__module__, function.__name__
        return self._interpreter().ask("run", str(self._path), self._said.name, named, arguments)

    def elsewhere(self, environment: Environment) -> EngineElsewhere:
        """The same, run by an environment."""
        other = copy.copy(self)
        other.environment = environment
        return other

    def __getattr__(self, name: str) -> Any:
        # Copies and pickles ask before ``__init__`` has run.
        if name.startswith("_"):
            raise AttributeError(name)
        return functools.partial(self.evaluate, name) if name in self._methods else getattr(self._said, name)


def engine_in_a_process_of_its_own(path: Path, name: str) -> EngineElsewhere:
    """The engine of a library's engine file, of which this process runs nothing; raises as ``harness.engines.engine.run_engine_file``."""
    interpreter = _interpreter_of(path, name, None)
    if interpreter.said is None:
        interpreter.said = interpreter.ask("declared", str(path), name)
    attributes, methods = interpreter.said
    return EngineElsewhere(SimpleNamespace(**attributes), methods, path, None)
