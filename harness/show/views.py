"""The direction from which a mechanism is seen: a planar one along its hinges, a spatial one from a corner."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from harness.arrays import Array
from harness.show.placement import Placement

Point = tuple[float, float]
_FLAT = 1e-6


@dataclass(frozen=True)
class View:
    """A direction to look along: unit vectors to the right, up, and towards the viewer; a name for the caption."""

    name: str
    right: Array
    up: Array

    @property
    def towards(self) -> Array:
        return np.cross(self.right, self.up)

    def flat(self, vector: Array) -> Point:
        """A vector's components to the right and up."""
        return float(np.dot(vector, self.right)), float(np.dot(vector, self.up))


def _view(name: str, right: Sequence[float], up: Sequence[float]) -> View:
    return View(name, np.array(right) / np.linalg.norm(right), np.array(up) / np.linalg.norm(up))


PLANES = (_view("x-z plane", (1, 0, 0), (0, 0, 1)), _view("x-y plane", (1, 0, 0), (0, 1, 0)), _view("y-z plane", (0, 1, 0), (0, 0, 1)))
CORNER = _view("seen from a corner: x to the right and front, y to the right and back", (0.8, 0.6, 0), (-0.27, 0.36, 0.893))


def choose_view(placements: Iterable[Placement]) -> View:
    """The plane the mechanism moves in, where it extends most if there are several; a corner for spatial ones."""
    placements = list(placements)
    points = np.array([point for placement in placements for point in placement.points()])

    def in_plane(view: View) -> bool:
        joints = placements[0].joints.values()
        if any(joint.kind not in ("hinge", "slide") for joint in joints):
            return False
        along = [(joint.kind, abs(float(np.dot(joint.axis, view.towards)))) for joint in joints]
        return all(amount > 1 - _FLAT if kind == "hinge" else amount < _FLAT for kind, amount in along)

    def extent(view: View) -> float:
        return float(sum(np.ptp(points @ direction) for direction in (view.right, view.up)))

    return max((view for view in PLANES if in_plane(view)), key=extent, default=CORNER)
