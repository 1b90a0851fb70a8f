"""Families: mechanisms of many sizes, each member ``<family>_<n>`` made by the family's writers.

A system file that defines ``SIZES`` and ``system(n)`` is a family; ``mjcf/<family>.py`` and
``urdf/<family>.py`` define ``model(n)``, which returns the text of the model. A member's own path, as
``systems/chain_12.py``, does not exist; it stands for the family's file and the size.
"""

from __future__ import annotations

import ast
import importlib.util
import re
import sys
import traceback
from pathlib import Path
from types import ModuleType

_MEMBER = re.compile(r"(?P<family>.+)_(?P<size>[1-9]\d{0,3})")


def member_of(path: Path) -> tuple[Path, int] | None:
    """The family's file and the size that a member's path stands for; None for a path of its own."""
    match = _MEMBER.fullmatch(path.stem)
    if match is None or path.exists():
        return None
    writer = path.with_name(match["family"] + ".py")
    return (writer, int(match["size"])) if writer.is_file() else None


def sizes(path: Path) -> tuple[int, ...]:
    """The sizes a family's system file lists in ``SIZES``, read without running it; () for a single system."""
    try:
        source = path.read_bytes()
        if b"SIZES" not in source:
            return ()
        for node in ast.parse(source).body:
            if isinstance(node, ast.Assign) and [ast.unparse(target) for target in node.targets] == ["SIZES"]:
                return tuple(int(size) for size in ast.literal_eval(node.value) if int(size) > 0)
    except (OSError, ValueError, TypeError, SyntaxError):
        return ()
    return ()


class CannotRun(Exception):
    """A Python file of a library that cannot be run: which, in which line, and why."""

    def __init__(self, path: Path, line: int | None, problem: str) -> None:
        super().__init__(path, line, problem)
        self.path, self.line, self.problem = path, line, problem


def run_file(path: Path, name: str) -> ModuleType:
    """Run a library's Python file as module ``name``, with helpers from its own folder and no trace left.

    Raises:
        CannotRun: the file or a helper of it is not Python, or raises.
    """
    specification = importlib.util.spec_from_file_location(name, path)
    assert specification is not None and specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    wrote_bytecode, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    sys.path.insert(0, str(path.parent))
    loaded_before = set(sys.modules)
    try:
        specification.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        # A helper's syntax error lies in the helper; one in a string the file parses lies in neither.
        if isinstance(error, SyntaxError) and (error.filename is None or Path(error.filename).parent == path.parent):
            raise CannotRun(Path(error.filename or path), error.lineno or None, f"is not Python: {error.msg}") from error
        raise raised_in(path, error) from error
    finally:
        sys.path.remove(str(path.parent))
        # A helper must not answer for one of the same name in another library, nor for its own older text.
        for helper in set(sys.modules) - loaded_before:
            if Path(getattr(sys.modules[helper], "__file__", None) or "").parent == path.parent:
                del sys.modules[helper]
        sys.dont_write_bytecode = wrote_bytecode
    return module


def raised_in(path: Path, error: BaseException) -> CannotRun:
    """``error`` with the line of ``path`` it came through."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    return CannotRun(path, frames[-1].lineno if frames else None, f"raises {type(error).__name__}: {str(error) or 'no message'}")
