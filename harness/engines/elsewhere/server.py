"""The program of an engine's own interpreter: loads models into its engine and answers calls of their methods.

The harness runs this file by its path. An environment has no harness installed; the folder that this file is in stands for the package.

Arguments: a file descriptor, on which requests come and answers go.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import importlib
import importlib.util
import inspect
import os
import sys
from collections.abc import Callable, Collection, Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from harness.engines.calls import Call
    from harness.engines.elsewhere.transport import Loaded

_PACKAGE = Path(__file__).resolve().parents[2]


def _is_plain(value: Any) -> bool:
    return isinstance(value, bool | int | float | str)


class Server:
    """The engine of each file, and the models that are loaded, by number.

    Attributes:
        shares: whether the program of the engine is the one beside the harness, and no other version of it.
    """

    def __init__(self) -> None:
        self.shares = False
        self._engines: dict[str, Any] = {}
        self._models: dict[int, Any] = {}
        self._loaded = 0

    def share(self, search_path: Sequence[str]) -> None:
        """Find what the harness finds."""
        self.shares = True
        sys.path[:] = search_path

    def work_in(self, folder: str) -> None:
        """Find files by their names in the folder in which the harness finds them."""
        os.chdir(folder)

    def declared(self, path: str, name: str) -> tuple[dict[str, Any], list[str]]:
        """Plain attributes and methods of the ``ENGINE`` of an engine file."""
        return _public(self._engine(path, name), _passes)

    def read(self, path: str, name: str, arguments: Sequence[Any]) -> Loaded:
        """The file that ``ENGINE.read`` of the engine file of an engine returns, with all attributes that can be passed on."""
        return self._kept(self._engine(path, name).read(*arguments), _passes)

    def load(self, path: str, name: str, arguments: Sequence[Any]) -> Loaded:
        """The model that ``ENGINE.load`` of the engine file of an engine returns."""
        from harness.engines.engine import load_keeping_arithmetic

        return self._kept(load_keeping_arithmetic(self._engine(path, name), *arguments))

    def evaluate(self, path: str, name: str, method: str, arguments: Sequence[Any]) -> Any:
        """The answer of a method of the ``ENGINE`` of an engine file."""
        return getattr(self._engine(path, name), method)(*arguments)

    def run(self, path: str, name: str, function: tuple[str, str], arguments: Sequence[Any]) -> Any:
        """The answer of a function of a module of the harness, both by name, for the engine of an engine file."""
        module, own = function
        return getattr(importlib.import_module(module), own)(self._engine(path, name), *arguments)

    def call(self, number: int, method: str, arguments: Sequence[Any]) -> Any:
        """The answer of a method of a model; another model of its class stays here, also one that a tuple holds."""
        from harness.engines.calls import called

        model = self._models[number]
        answer = called(method, getattr(model, method), arguments)

        def handed_out(one: Any) -> Any:
            return self._kept(one) if type(one) is type(model) else one

        return tuple(map(handed_out, answer)) if type(answer) is tuple else handed_out(answer)

    def answer_each(self, calls: Sequence[tuple[int, Sequence[Call]]]) -> list[list[tuple[Any, float]]]:
        """The answer of each model to each of its calls, and its seconds."""
        from harness.engines.calls import answer_each

        return [answer_each(self._models[number], own) for number, own in calls]

    def forget(self, numbers: Collection[int]) -> None:
        """Drop models."""
        for number in numbers:
            self._models.pop(number, None)

    def _kept(self, model: Any, attributes: Callable[[Any], bool] = _is_plain) -> Loaded:
        from harness.engines.elsewhere.transport import Loaded

        self._loaded += 1
        self._models[self._loaded] = model
        return Loaded(self._loaded, *_public(model, attributes))

    def _engine(self, path: str, name: str) -> Any:
        from harness.engines.engine import run_engine_file

        if path not in self._engines:
            self._engines[path] = run_engine_file(Path(path), name)
        return self._engines[path]


def _public(found: object, is_wanted: Callable[[Any], bool]) -> tuple[dict[str, Any], list[str]]:
    """Public attributes that are wanted, and names of public methods; what cannot be had is left out."""
    kind: Any = type(found)
    methods, others = _names_of(kind)
    own = {name for name in getattr(found, "__dict__", {}) if not name.startswith("_")}
    if kind.__dir__ is not object.__dir__:
        # What an object says that it has beside these, it makes when it is asked for it.
        methods = [*methods, *{name for name in dir(found) if not name.startswith("_")} - own - {*methods, *others}]
    values = {}
    for name in {*others, *own}:
        with contextlib.suppress(Exception):
            values[name] = getattr(found, name)
    methods += [name for name, value in values.items() if callable(value)]
    return {name: value for name, value in values.items() if not callable(value) and is_wanted(value)}, methods


@functools.cache
def _names_of(kind: Any) -> tuple[list[str], list[str]]:
    """Names of the public functions of a class, and of what else it has: an engine may load a thousand models of one."""
    names = [name for name in dir(kind) if not name.startswith("_")]
    functions = [name for name in names if callable(inspect.getattr_static(kind, name))]
    return functions, [name for name in names if name not in functions]


def _passes(value: Any) -> bool:
    """True for a value that can be passed on."""
    from harness.engines.elsewhere.transport import dumps

    try:
        dumps(value)
    except Exception:
        return False
    return True


def main(descriptor: int) -> None:
    """Answer requests until the other side is gone, or until this process is of no more use.

    Each is the numbers of models that are no longer needed, a method of ``Server`` and its arguments. The answer is (True, value) or
    (False, exception), and whether this process goes on: what an exception left unsound answers nothing more.
    """
    _import_harness()
    from harness.engines.elsewhere.transport import dumps, loads, pickled, portable
    from harness.errors import leaves_process_unsound
    from harness.workers.program import OBJECTS_BETWEEN_LOOKS

    gc.set_threshold(*OBJECTS_BETWEEN_LOOKS)
    server, connection, goes_on = Server(), Connection(descriptor), True
    while goes_on:
        try:
            request = connection.recv_bytes()
        except EOFError:
            return
        try:
            forgotten, method, *arguments = loads(request)
            server.forget(forgotten)
            value = getattr(server, method)(*arguments)
            answer = (pickled if server.shares else dumps)((True, value, goes_on))
        except Exception as error:
            missing = None if server.shares else _missing_interface(error)
            goes_on = not leaves_process_unsound(error)
            answer = dumps((False, portable(missing or error), goes_on))
        connection.send_bytes(answer)


def _missing_interface(error: Exception) -> Exception | None:
    """``Unsupported`` where this version has no such function or class, which is no fault of the engine; None for other errors."""
    from harness.engines import Unsupported

    if not (isinstance(error, AttributeError) and isinstance(error.obj, ModuleType)) or error.obj.__name__.startswith(_PACKAGE.name):
        return None
    version = getattr(sys.modules[error.obj.__name__.partition(".")[0]], "__version__", "")
    return Unsupported(" ".join(filter(None, [error.obj.__name__, version, "has no", error.name])))


def _import_harness() -> None:
    """Import the package by its folder: what is installed beside it must not be found, as that is another version's."""
    spec = importlib.util.spec_from_file_location(_PACKAGE.name, _PACKAGE / "__init__.py", submodule_search_locations=[str(_PACKAGE)])
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[_PACKAGE.name] = module
    spec.loader.exec_module(module)


if __name__ == "__main__":
    main(int(sys.argv[1]))
