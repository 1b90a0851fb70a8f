"""Errors addressed to the person who wrote the file they name."""

from __future__ import annotations

import os
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


class InvalidRequest(Exception):
    """Something asked for that cannot be: a name nothing has, options that do not fit: exit status 2."""


def message_of(error: BaseException) -> str:
    """Message of an exception, also of one of somebody else's that cannot tell it."""
    try:
        return str(error)
    except Exception as further:
        return f"its message cannot be had: str() raises {type(further).__name__}"


def shown_path(path: Path) -> str:
    """The path from the current directory where it lies below that."""
    relative = os.path.relpath(path)
    return str(path) if relative.startswith(os.pardir) else relative
