"""Errors addressed to the person who wrote the file they name."""

from __future__ import annotations

import importlib.util
import os
import sys
from pathlib import Path


class InvalidInput(Exception):
    """A system, model or settings file that cannot be used: exit status 2.

    ``path`` and ``line`` (1-based, None where no line applies) say where, ``problem`` says what was
    found, what was expected and what to do, on one line even where an engine's words took several.
    """

    def __init__(self, path: Path | str, line: int | None, problem: str) -> None:
        super().__init__(path, line, problem)
        self.path = Path(path)
        self.line = line
        self.problem = " ".join(problem.split())

    def __str__(self) -> str:
        place = f"{self.path}:{self.line}" if self.line is not None else str(self.path)
        return f"{place}: {self.problem}"


class InvalidSystem(InvalidInput):
    """A system file that raises, lacks ``SYSTEM``, or contradicts itself."""


class InvalidModel(InvalidInput):
    """A model file that is malformed, non-physical, or not the mechanism its system describes."""


class InvalidEngine(InvalidInput):
    """An engine file that gives no engine. It costs the records of its own engine, where it is asked, and no command."""


class Terminated(SystemExit):
    """A signal to terminate, which unwinds the command with its exit status."""


class InvalidRequest(Exception):
    """Something asked for that cannot be: a name nothing has, options that do not fit, a package that is not installed: exit status 2."""


DISTRIBUTION = "rigid-body-harness"
# The extra of the distribution that installs a module; every other module that is used is a dependency.
EXTRAS = {"bokeh": "report", "cma": "search", "distributed": "cluster", "heyoka": "lagrange", "pxr": "usd"}


def require(needed_for: str, *modules: str) -> None:
    """Raise ``InvalidRequest`` where one of these ``modules`` is not installed.

    ``needed_for`` opens its sentence, as "a report has charts".
    """
    if missing := [module for module in modules if not _is_installed(module)]:
        raise InvalidRequest(f"{needed_for}: {not_installed(*missing)}")


def not_installed(*modules: str) -> str:
    """The sentence that these modules are not installed, with the command that installs those of extras."""
    extras = ",".join(sorted({EXTRAS[module] for module in modules if module in EXTRAS}))
    remedy = f"; pip install '{DISTRIBUTION}[{extras}]', or '.[{extras}]' in a clone" if extras else ""
    if "heyoka" in modules and sys.platform != "linux":
        remedy += "; its wheels are for Linux alone, and conda-forge has heyoka.py for macOS"
    return f"{' and '.join(modules)} {'is' if len(modules) == 1 else 'are'} not installed{remedy}"


def _is_installed(module: str) -> bool:
    try:
        return importlib.util.find_spec(module) is not None
    except ModuleNotFoundError:
        return False


def message_of(error: BaseException) -> str:
    """Message of an exception, also of one of somebody else's that cannot tell it."""
    try:
        return str(error)
    except Exception as further:
        return f"its message cannot be had: str() raises {type(further).__name__}"


def is_out_of_memory(exception: BaseException | None) -> bool:
    """True where there is no memory left, be it for a library that is imported late."""
    # Of a library that Python imports it is an ImportError, of one that ctypes loads an OSError without a number, of which llvmlite
    # makes another that does not say why.
    if isinstance(exception, ImportError | OSError):
        return any(
            words in message_of(exception) for words in ("failed to map segment", "bad_alloc", "Could not find/load shared object file")
        )
    return isinstance(exception, MemoryError)


# What pybind11, Boost.Python and nanobind say of a C++ exception that they do not know.
_UNKNOWN_EXCEPTION = ("unknown exception", "unidentifiable c++ exception", "could not be translated")


def leaves_process_unsound(exception: BaseException | None) -> bool:
    """True where native code may have been left in the middle of what it did, with locks that it holds and structures half made."""
    if isinstance(exception, RuntimeError):
        return any(words in message_of(exception).lower() for words in _UNKNOWN_EXCEPTION)
    return isinstance(exception, SystemError) or is_out_of_memory(exception)


def shown_path(path: Path) -> str:
    """The path from the current directory where it lies below that."""
    relative = os.path.relpath(path)
    return str(path) if relative.startswith(os.pardir) else relative
