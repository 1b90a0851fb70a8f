"""The program of an engine's own interpreter: loads models into its engine and answers calls of their methods.

The harness runs this file by its path. An environment has no harness installed; the folder that this file is in stands for the package.

Arguments: a file descriptor, on which requests come and answers go.
"""

from __future__ import annotations

import contextlib
import importlib.util
import sys
import time
from collections.abc import Collection, Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from types import ModuleType
from typing import Any

_PACKAGE = Path(__file__).resolve().parents[2]


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

    def declared(self, path: str, name: str) -> tuple[dict[str, Any], list[str]]:
        """Plain attributes and methods of the ``ENGINE`` of an engine file."""
        attributes, methods = _public(self._engine(path, name), object)
        return {one: value for one, value in attributes.items() if _passes(value)}, methods

    def load(self, path: str, name: str, arguments: Sequence[Any]) -> tuple[int, dict[str, Any], list[str]]:
        """Number, plain attributes and methods of the model that ``ENGINE.load`` of the engine file of an engine returns."""
        from harness.engines.engine import load_keeping_arithmetic

        model = load_keeping_arithmetic(self._engine(path, name), *arguments)
        self._loaded += 1
        self._models[self._loaded] = model
        return self._loaded, *_public(model, bool | int | float | str)

    def evaluate(self, path: str, name: str, method: str, arguments: Sequence[Any]) -> Any:
        """What a method of the ``ENGINE`` of an engine file returns."""
        return getattr(self._engine(path, name), method)(*arguments)

    def call(self, number: int, method: str, arguments: Sequence[Any]) -> Any:
        from harness.engines.interface import called

        return called(method, getattr(self._models[number], method), arguments)

    def forget(self, numbers: Collection[int]) -> None:
        for number in numbers:
            self._models.pop(number, None)

    def _engine(self, path: str, name: str) -> Any:
        from harness.engines.engine import run_engine_file

        if path not in self._engines:
            self._engines[path] = run_engine_file(Path(path), name)
        return self._engines[path]


def _public(found: Any, kinds: Any) -> tuple[dict[str, Any], list[str]]:
    """Public attributes of these kinds, and names of public methods; what cannot be had is left out."""
    values = {}
    for name in dir(found):
        with contextlib.suppress(Exception):
            if not name.startswith("_"):
                values[name] = getattr(found, name)
    methods = [name for name, value in values.items() if callable(value)]
    return {name: value for name, value in values.items() if isinstance(value, kinds) and name not in methods}, methods


def _passes(value: Any) -> bool:
    """Whether a value can be passed on."""
    from harness.engines.elsewhere.transport import dumps

    try:
        dumps(value)
    except Exception:
        return False
    return True


def main(descriptor: int) -> None:
    """Answer requests until the other side is gone.

    Each is a method of ``Server`` and its arguments; the answer is (True, value, seconds that it took) or (False, exception, 0).
    """
    _import_harness()
    from harness.engines.elsewhere.transport import dumps, loads, portable

    server, connection = Server(), Connection(descriptor)
    while True:
        try:
            request = connection.recv_bytes()
        except EOFError:
            return
        try:
            method, *arguments = loads(request)
            started = time.perf_counter()
            value = getattr(server, method)(*arguments)
            answer = dumps((True, value, time.perf_counter() - started))
        except Exception as error:
            missing = None if server.shares else _missing_interface(error)
            answer = dumps((False, portable(missing or error), 0.0))
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
