"""Engines as their users call them, one a module here that defines ``CALLER``, a ``harness.comparison.questions.Caller``.

What is particular to an engine's conventions and readers stays in its module. No list is kept: a module is found by its name.

Each also defines ``ENGINE``, the same engine aided, so that the modules are the engine files of robots' files; see
``harness.comparison.robot_library``.
"""

from __future__ import annotations

import importlib
import pkgutil

from harness.comparison.questions import Caller


def find_callers() -> dict[str, Caller]:
    """Every caller by the name of its engine, sorted."""
    modules = [importlib.import_module(f"{__name__}.{module.name}") for module in pkgutil.iter_modules(__path__)]
    return {caller.engine: caller for caller in sorted((module.CALLER for module in modules), key=lambda caller: caller.engine)}
