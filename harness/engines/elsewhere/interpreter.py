"""Engines in environments of their own: the interpreter of one, one for each process that asks it, and the models it holds.

No library does this: execnet hides the exit status and standard error of a process, which name its death; see ``harness.workers.local``.
"""

from __future__ import annotations

import functools
import os
import signal
import subprocess
import weakref
from collections.abc import Mapping, Sequence
from multiprocessing import Pipe
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from harness.engines.elsewhere.transport import dumps, loads
from harness.engines.engine import handed_over
from harness.environments import Environment
from harness.files.model_file import ModelFile
from harness.workers.program import is_worker

if TYPE_CHECKING:
    from harness.engines import Engine, Model
    from harness.programs.mechanisms.mechanism import Mechanism

# Never imported here: it is a program of the environment's interpreter.
_SERVER = Path(__file__).with_name("server.py")
# They would put packages before those of the environment.
_LEFT_OUT = ("PYTHONPATH", "PYTHONHOME", "PYTHONSTARTUP", "VIRTUAL_ENV")


class EngineDied(Exception):
    """The interpreter of an environment ended; the message says how."""


class Interpreter:
    """A process of an environment's own Python. What it writes to standard output and error goes to this process's standard error.

    Attributes:
        seconds: that it has spent on answers, without the way there and back.
    """

    def __init__(self, environment: Environment) -> None:
        self.seconds = 0.0
        self._environment = environment
        self._forgotten: list[int] = []
        self._connection, theirs = Pipe()
        variables = {name: value for name, value in os.environ.items() if name not in _LEFT_OUT}
        with theirs:
            self._process = subprocess.Popen(
                [environment.interpreter, "-P", "-s", _SERVER, str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=2,
                pass_fds=[theirs.fileno()],
                env=variables,
            )

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
        raise EngineDied(f"{self._environment.name} ended its process with status {status}")


# By folder: another cache directory has other environments of the same names.
_RUNNING: dict[Path, Interpreter] = {}


def interpreter_of(environment: Environment) -> Interpreter:
    """The interpreter of an environment in this process, started at the first call."""
    folder = environment.folder
    if folder not in _RUNNING:
        _RUNNING[folder] = Interpreter(environment)
    return _RUNNING[folder]


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
    """An ``Engine`` whose models are loaded by the interpreter of an environment; what else it says is said by its engine file here."""

    def __init__(self, engine: Engine, path: Path, module: str, environment: Environment) -> None:
        self.requires, self.formats = engine.requires, engine.formats
        self.environment = environment
        self._engine, self._file = engine, (str(path), module, environment.engine)

    def load(self, source: ModelFile | Mechanism, joints: Sequence[str], gravity: float) -> Model:
        """See ``harness.engines.Engine``; raises what the engine file raises."""
        interpreter = interpreter_of(self.environment)
        number, attributes, methods = interpreter.ask("load", *self._file, (handed_over(source), joints, gravity))
        return cast("Model", DistantModel(interpreter, number, attributes, methods))

    def evaluate(self, method: str, *arguments: Any) -> Any:
        """What a method of the engine file's ``ENGINE`` returns in the environment, or raises there."""
        return interpreter_of(self.environment).ask("evaluate", *self._file, method, arguments)

    def __getattr__(self, name: str) -> Any:
        # Copies and pickles ask before ``__init__`` has run.
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._engine, name)
