"""Engines as their users call them, one a module here that defines ``CALLER``, a ``harness.comparison.questions.Caller``.

What is particular to an engine's conventions and readers stays in its module. No list is kept: a module is found by its name, which is
that of the engine; one whose name begins with an underscore holds what several share.

Each also defines ``ENGINE``, the same engine aided, so that the modules are the engine files of robots' files: like any other they are
run in an environment where the engine is not installed beside the harness. See ``CallersLibrary`` and ``harness.comparison.asking``.
"""

from __future__ import annotations

import copy
import importlib
import pkgutil
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

from harness.comparison.questions import Caller
from harness.environments.folders import split_name
from harness.library import Library


def find_callers() -> dict[str, Caller]:
    """Every caller by the name of its engine, sorted."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__) if not module.name.startswith("_"))
    return {name: importlib.import_module(f"{__name__}.{name}").CALLER for name in names}


def caller_of(engine: str) -> Caller:
    """The caller of an engine, or of a version of it, ``engine@version``, by whose name it goes then."""
    caller = copy.copy(find_callers()[split_name(engine)[0]])
    caller.engine = engine
    return caller


@dataclass(frozen=True)
class CallersLibrary(Library):
    """A library whose engines are the callers, which stand in ``folders``."""

    folders: tuple[Path, ...] = field(default_factory=lambda: tuple(map(Path, __path__)))

    @classmethod
    def without_files(cls) -> Self:
        """The engines alone."""
        folder = Path(__path__[0])
        return cls("robots", folder, folder, folder, folder / "expected_verdicts.toml", folder / "hard_states")

    def engine_folders(self) -> list[Path]:
        return list(self.folders)

    def native(self, formats: Sequence[str]) -> Sequence[str]:
        """All: a user has one file, and asks about every engine that reads it."""
        return formats
