"""A mechanism as its model file states it: bodies in a tree, joints between them, and the numbers exactly as they stand there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from harness.models.model_file import ForceElement

Vector = tuple[Fraction, Fraction, Fraction]
ORIGIN: Vector = (Fraction(0), Fraction(0), Fraction(0))
WORLD = "world"


@dataclass(frozen=True)
class Turn:
    """A rotation about an axis of any length by an angle [rad, or degrees]."""

    axis: Vector
    angle: Fraction
    in_degrees: bool = False


@dataclass(frozen=True)
class Quaternion:
    """A rotation by a quaternion (w, x, y, z) of any length but 0."""

    components: tuple[Fraction, ...]


@dataclass(frozen=True)
class Axes:
    """A rotation by the new x axis, and the new y axis as far as it is square to that."""

    x: Vector
    y: Vector


@dataclass(frozen=True)
class Direction:
    """The least rotation that turns the z axis into a direction."""

    z: Vector


# Rotations about the axes that those before have turned.
Rotation = tuple[Turn | Quaternion | Axes | Direction, ...]


@dataclass(frozen=True)
class Placement:
    """A frame in another: its origin [m] and its orientation."""

    position: Vector = ORIGIN
    rotation: Rotation = ()


# Frames one in the other, the outermost first.
Pose = tuple[Placement, ...]


@dataclass(frozen=True)
class Joint:
    """One joint of a body.

    Attributes:
        kind: "hinge", "slide", "ball" or "free".
        axis, anchor: in the frame ``pose`` of the body; the axis has any length but 0. A free joint has neither, a ball joint no axis.
        reference: position [m, rad, or degrees] at which the body stands where its pose says.
        armature: inertia [kg m^2 or kg] that a rotor adds to the joint's own.
        follows: name of the joint that it mimics, "" for one that moves by itself; its position is ``multiplier`` times that of
            the other, and ``offset`` [m or rad].
    """

    name: str
    kind: str
    axis: Vector = ORIGIN
    anchor: Vector = ORIGIN
    pose: Pose = ()
    reference: Fraction = Fraction(0)
    in_degrees: bool = False
    armature: Fraction = Fraction(0)
    follows: str = ""
    multiplier: Fraction = Fraction(1)
    offset: Fraction = Fraction(0)


@dataclass(frozen=True)
class Inertia:
    """Mass [kg] and moments xx, yy, zz, xy, xz, yz [kg m^2] about the centre of mass, in the frame ``pose`` of a body."""

    pose: Pose
    mass: Fraction
    moments: tuple[Fraction, ...]


@dataclass(frozen=True)
class Body:
    """A body in the frame of its parent; with several joints, the first is the nearest to the parent."""

    name: str
    parent: str
    pose: Pose
    joints: tuple[Joint, ...]
    inertia: Inertia | None


@dataclass(frozen=True)
class Tree:
    """Bodies, parents before their children, the gravity [m/s^2] they feel, and springs and dampers."""

    bodies: tuple[Body, ...]
    gravity: Vector
    forces: tuple[ForceElement, ...]


def vector(numbers: Sequence[float | Fraction]) -> Vector:
    """Three numbers of a file, exactly."""
    x, y, z = (Fraction(number) for number in numbers)
    return x, y, z
