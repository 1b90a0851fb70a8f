"""Engines in processes of their own: the interpreter of one, one for each process that asks it, and the models it holds.

An engine of another version, or that is not installed beside the harness, is run by the interpreter of its environment. The engine file
of a library is run by one of this Python's: whatever it does to its process, no other engine and no truth is asked there.

No library does this: execnet hides the exit status and standard error of a process, which name its death; see ``harness.workers.local``.
"""

from __future__ import annotations

import copy
import functools
import os
import signal
import subprocess
import sys
import weakref
from collections.abc import Collection, Mapping, Sequence
from multiprocessing import Pipe
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

from harness.engines.elsewhere.transport import dumps, loads
from harness.engines.engine import handed_over
from harness.engines.interface import CompiledNumber
from harness.engines.request import EngineAnswers, EngineQuestion, Request
from harness.environments import Environment
from harness.files.model_file import ModelFile
from harness.workers.program import is_worker

if TYPE_CHECKING:
    from harness.engines import Model
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
        seconds: that it has spent on answers, without the way there and back.
        said: attributes and methods of its engine, once they have been asked for.
    """

    def __init__(self, name: str, environment: Environment | None) -> None:
        self.seconds = 0.0
        self.said: tuple[dict[str, Any], list[str]] | None = None
        self._name = name
        self._forgotten: list[int] = []
        self._connection, theirs = Pipe()
        variables = {name: value for name, value in os.environ.items() if environment is None or name not in _LEFT_OUT}
        python = [sys.executable, "-P"] if environment is None else [environment.interpreter, "-P", "-s"]
        with theirs:
            self._process = subprocess.Popen(
                [*python, _SERVER, str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=2,
                pass_fds=[theirs.fileno()],
                env=variables,
            )
        if environment is None:
            self.ask("share", sys.path)

    def call(self, number: int, method: str, *arguments: Any) -> Any:
        """What a method of a model returns, or raises.

        Raises:
            EngineDied: in a process that is no worker. A worker dies as the interpreter did, and the harness names its death.
        """
        if self._forgotten:
            forgotten, self._forgotten = self._forgotten, []
            self.ask("forget", forgotten)
        return self.ask("call", number, method, arguments)

    def forget(self, number: int) -> None:
        """Have the model dropped before the next call; this may run while another call is under way."""
        self._forgotten.append(number)

    def ask(self, *request: Any) -> Any:
        """What a method of ``server.Server`` returns, or raises; the request is its name and its arguments."""
        try:
            self._connection.send_bytes(dumps(request))
            is_value, answer, seconds = loads(self._connection.recv_bytes())
        except (EOFError, BrokenPipeError, ConnectionResetError):
            self._die()
        self.seconds += seconds
        if is_value:
            return answer
        raise answer

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


# By the folder of an environment, of which another cache directory has others of the same names; or by an engine file, and its time.
_RUNNING: dict[Path, tuple[int, Interpreter]] = {}


def _interpreter_of(path: Path, name: str, environment: Environment | None) -> Interpreter:
    """The interpreter of an environment, or of this Python for an engine file, in this process; started at the first call."""
    key = path if environment is None else environment.folder
    # An engine file that has been written since is run anew.
    written = 0 if environment else path.stat().st_mtime_ns
    if key not in _RUNNING or _RUNNING[key][0] != written:
        _RUNNING[key] = written, Interpreter(environment.name if environment else name, environment)
    return _RUNNING[key][1]


class DistantModel:
    """A model in an environment's interpreter: a ``harness.engines.Model`` that offers what its engine file offers."""

    def __init__(self, interpreter: Interpreter, number: int, attributes: Mapping[str, Any], methods: Sequence[str]) -> None:
        self._interpreter, self._number = interpreter, number
        self._attributes, self._methods = attributes, methods
        weakref.finalize(self, interpreter.forget, number)

    def clock(self) -> float:
        """See ``harness.engines.Model``."""
        return self._interpreter.seconds

    def _call(self, method: str, *arguments: Any) -> Any:
        return self._interpreter.call(self._number, method, *arguments)

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

    @property
    def _interpreter(self) -> Interpreter:
        return _interpreter_of(self._path, self._said.name, self.environment)

    def load(self, source: ModelFile | Mechanism, joints: Sequence[str], gravity: float) -> Model:
        """See ``harness.engines.Engine``; raises what the engine file raises."""
        interpreter = self._interpreter
        number, attributes, methods = interpreter.ask("load", str(self._path), self._said.name, (handed_over(source), joints, gravity))
        return cast("Model", DistantModel(interpreter, number, attributes, methods))

    def ask(self, question: EngineQuestion) -> EngineAnswers:
        """See ``harness.engines.Engine``."""
        answers: EngineAnswers = self.evaluate("ask", question)
        return answers

    def compiled(self, request: Request) -> tuple[CompiledNumber, ...]:
        """See ``harness.engines.Engine``."""
        numbers: tuple[CompiledNumber, ...] = self.evaluate("compiled", request)
        return numbers

    def evaluate(self, method: str, *arguments: Any) -> Any:
        """What a method of the engine file's ``ENGINE`` returns there, or raises."""
        return self._interpreter.ask("evaluate", str(self._path), self._said.name, method, arguments)

    def for_files(self) -> EngineElsewhere:
        """See ``harness.engines.Engine``."""
        other = copy.copy(self)
        other.linear_velocity_in_body = False
        return other

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
