"""Certified cross-checks of rigid-body dynamics: textbook Lagrangians against physics engines."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from harness.version import __version__

_PUBLIC = {
    "Attitude": "harness.equations.euler_angles",
    "System": "harness.equations.system",
    "TIME": "harness.equations.system",
    "body_rates": "harness.equations.euler_angles",
    "rotation": "harness.equations.euler_angles",
}
__all__ = ["__version__", *_PUBLIC]


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_PUBLIC[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
