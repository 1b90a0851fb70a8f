"""The program of an environment's interpreter: loads models into its engine and answers calls of their methods.

The harness runs this file by its path. The environment has no harness installed; the folder that this file is in stands for the package.

Arguments: a file descriptor, on which requests come and answers go.
"""

from __future__ import annotations

import importlib
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
    """The models that are loaded, by number."""

    def __init__(self) -> None:
        self._models: dict[int, Any] = {}
        self._loaded = 0

    def load(self, path: str, module: str, name: str, arguments: Sequence[Any]) -> tuple[int, dict[str, Any], list[str]]:
        """Number, plain attributes and methods of the model that ``ENGINE.load`` of an engine file returns.

        Args:
            path: of the engine file. module: its name among the harness's own modules, "" for a file of a library.
            name: of the engine.
        """
        model = self.evaluate(path, module, name, "load", arguments)
        self._loaded += 1
        self._models[self._loaded] = model
        public = [name for name in dir(type(model)) if not name.startswith("_")]
        plain = {name: value for name, value in vars(model).items() if isinstance(value, bool | int | float | str)}
        plain |= {name: value for name in public if isinstance(value := getattr(type(model), name), bool | int | float | str)}
        return self._loaded, plain, [name for name in public if callable(getattr(type(model), name))]

    def evaluate(self, path: str, module: str, name: str, method: str, arguments: Sequence[Any]) -> Any:
        """What a method of the ``ENGINE`` of an engine file returns; the file as of ``load``."""
        from harness.library import run_file

        engine = (importlib.import_module(module) if module else run_file(Path(path), f"_harness_engine_{name}")).ENGINE
        engine.name = name
        return getattr(engine, method)(*arguments)

    def call(self, number: int, method: str, arguments: Sequence[Any]) -> Any:
        return getattr(self._models[number], method)(*arguments)

    def forget(self, numbers: Collection[int]) -> None:
        for number in numbers:
            self._models.pop(number, None)


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
            answer = dumps((False, portable(_missing_interface(error) or error), 0.0))
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
