"""Readers answer wrongly above a speed: no number of the file says so, and no slow motion shows it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.explain.changes import Change
from harness.explain.changes.mistakes import Mistake
from harness.models.anatomy.parts import Anatomy
from harness.models.text import Place

# A quarter of the rates that are sampled by default [rad/s], and a drag [1/rad] that is one thousandth of the acceleration there.
SPEED, DRAG = 2.5, 1e-3


class _Dragged:
    """A loaded model, or an engine that loads such, with a drag that sets in above ``SPEED``; else the one that it wraps."""

    def __init__(self, wrapped: Any) -> None:
        self._wrapped = wrapped

    def __getattr__(self, name: str) -> Any:
        return getattr(self._wrapped, name)

    def load(self, *arguments: Any) -> _Dragged:
        return _Dragged(self._wrapped.load(*arguments))

    def forward_dynamics(self, q: Array, v: Array, tau: Array, *time: Array) -> Array:
        excess = np.maximum(np.abs(v) - SPEED, 0.0)
        return np.asarray(self._wrapped.forward_dynamics(q, v, tau, *time) - DRAG * np.sign(v) * excess**2)


def _above_speed(parts: Anatomy) -> Iterator[Change]:
    place, text = Place(0, "engine", "", None, ""), parts.model.text
    yield Change("above_speed", f"a drag above {SPEED:g} per second", (place,), lambda size: text, through=_Dragged)


ABOVE_SPEED = Mistake(
    "above_speed",
    "answers wrong above a speed only",
    "drag, saturation and speed limits that an engine applies and no textbook equation holds",
    changes=None,
    plants=_above_speed,
)
