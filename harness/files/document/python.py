"""Python files of a library, which run without being installed."""

from __future__ import annotations

import importlib.util
import sys
import traceback
from contextlib import suppress
from pathlib import Path
from types import ModuleType

from harness.arithmetic import SAFE_LINKING, KeptArithmetic
from harness.errors import InvalidInput, message_of


class CannotRun(InvalidInput):
    """A Python file of a library that is not Python, or raises."""


def run_file(path: Path, name: str) -> ModuleType:
    """Run a library's Python file as module ``name``, with helpers from its own folder and no trace left.

    Raises:
        CannotRun: the file or a helper of it is not Python, raises, or leaves other arithmetic behind.
    """
    specification = importlib.util.spec_from_file_location(name, path)
    assert specification is not None and specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    wrote_bytecode, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    sys.path.insert(0, str(path.parent))
    loaded_before = set(sys.modules)
    try:
        with KeptArithmetic() as arithmetic:
            specification.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        # A helper's syntax error lies in the helper; one in a string the file parses lies in neither.
        if isinstance(error, SyntaxError) and (error.filename is None or Path(error.filename).parent == path.parent):
            raise CannotRun(Path(error.filename or path), error.lineno or None, f"is not Python: {error.msg}") from error
        # Python before 3.11.4 has no SyntaxError for a null byte.
        if isinstance(error, ValueError) and not _lines_run(path, error):
            raise CannotRun(path, None, f"is not Python: {error}") from error
        raise raised_in(path, error) from error
    finally:
        with suppress(ValueError):
            sys.path.remove(str(path.parent))
        # A helper must not answer for one of the same name in another library, nor for its own older text.
        for helper in set(sys.modules) - loaded_before:
            if Path(getattr(sys.modules[helper], "__file__", None) or "").parent == path.parent:
                del sys.modules[helper]
        sys.dont_write_bytecode = wrote_bytecode
    if arithmetic.left:
        raise CannotRun(path, None, f"leaves {arithmetic.left} for everything behind it in the process; {SAFE_LINKING}")
    return module


def raised_in(path: Path, error: BaseException) -> CannotRun:
    """``error`` with the line of ``path`` it came through."""
    line = next(reversed(_lines_run(path, error)), None)
    return CannotRun(path, line, f"raises {type(error).__name__}: {message_of(error) or 'no message'}")


def _lines_run(path: Path, error: BaseException) -> list[int | None]:
    """The lines of ``path`` that ``error`` came through, the innermost last."""
    return [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
