"""Places of a model's joints, bodies and springs at one configuration, as an engine's own kinematics has them.

Everything is in the world's frame [m].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

Vector = tuple[float, float, float]
WORLD = -1


@dataclass(frozen=True)
class PlacedJoint:
    """A joint at one configuration.

    Attributes:
        kind: "hinge", "slide", "ball" or "free". body: index of the body it moves.
        anchor: its point on the side of the body's parent. moved: the same point on the body's own side.
        axis: unit vector; of no meaning for ball and free joints.
    """

    name: str
    kind: str
    body: int
    anchor: Vector
    moved: Vector
    axis: Vector


@dataclass(frozen=True)
class PlacedBody:
    """A moving body at one configuration; ``parent`` is an index, or ``WORLD``. Mass in kg."""

    name: str
    parent: int
    mass: float
    centre: Vector


@dataclass(frozen=True)
class Placement:
    """A mechanism at one configuration; the joints of a body stand in their order from its parent.

    ``springs`` are the lines of springs between points, from end to end.
    """

    bodies: tuple[PlacedBody, ...]
    joints: tuple[PlacedJoint, ...]
    springs: tuple[tuple[Vector, ...], ...]

    def points(self) -> list[Vector]:
        """Everything that a picture must hold."""
        ends = [point for joint in self.joints for point in (joint.anchor, joint.moved)]
        return ends + [body.centre for body in self.bodies if body.mass > 0] + [point for line in self.springs for point in line]


def as_vector(values: Any) -> Vector:
    """Three numbers as plain floats."""
    x, y, z = (float(value) for value in values)
    return x, y, z
