"""The constraints that a model file holds besides its joints, which close loops and couple joints.

Each is rows that stay zero. Their order and sign are part of a declaration, since engines report forces by them:

- ``PointConstraint``: first point minus second, along the axes of the world, x, y, z [m];
- ``FrameConstraint``: the same of the origins of two frames, then the vector part of the quaternion that turns the second frame
  into the first, times ``torque_scale`` [m];
- ``JointConstraint``: (q - reference) - p(q of the leader - its reference), with the polynomial p [m or rad];
- ``TendonConstraint``: the same of the lengths of two tendons, each measured from its length in the file's zero position [m].

Sources: MuJoCo documentation, XML reference, equality, and Computation, section Constraint model; Drake, "Parsing model files", tag
drake:ball_constraint; http://wiki.ros.org/urdf/XML/joint, element ``mimic``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

Point = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
UNTURNED: Quaternion = (1.0, 0.0, 0.0, 0.0)
# What MuJoCo takes for attributes that a constraint leaves out.
SOLREF = (0.02, 1.0)
SOLIMP = (0.9, 0.95, 0.001, 0.5, 2.0)
POLYNOMIAL = (0.0, 1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Softness:
    """The attributes by which MuJoCo makes a constraint soft, its default classes resolved; engines without them hold it rigid.

    ``solref`` is (time constant [s], damping ratio), or (-stiffness [1/s^2], -damping [1/s]) where both are negative. ``solimp`` is
    (least impedance, most impedance, width [m or rad], midpoint, power).
    """

    solref: tuple[float, float] = SOLREF
    solimp: tuple[float, float, float, float, float] = SOLIMP


@dataclass(frozen=True)
class End:
    """A point [m] and an orientation (w, x, y, z), of any length but 0, in the frame of a body; "world" is the world."""

    body: str
    point: Point
    turn: Quaternion = UNTURNED


@dataclass(frozen=True)
class Tendon:
    """The sum of multiples of joint positions, or the length of a polygon through points; one of the two is empty.

    ``joints`` is (name, multiple) of hinges and slides.
    """

    name: str
    joints: tuple[tuple[str, float], ...]
    points: tuple[End, ...]


@dataclass(frozen=True)
class ModelConstraint:
    """What all constraints have: a name, which a system finds it by, the line of its element, and in MJCF how soft it is."""

    name: str
    line: int
    softness: Softness | None
    kind: ClassVar[str]


@dataclass(frozen=True)
class PointConstraint(ModelConstraint):
    """Two points meet: three rows."""

    ends: tuple[End, End]
    kind: ClassVar[str] = "point"


@dataclass(frozen=True)
class FrameConstraint(ModelConstraint):
    """Two frames meet: six rows."""

    ends: tuple[End, End]
    torque_scale: float
    kind: ClassVar[str] = "frame"


@dataclass(frozen=True)
class JointConstraint(ModelConstraint):
    """The position of ``joint`` is a polynomial of that of ``leader``: one row; without a leader it is a constant.

    ``coefficients`` are those of the powers 0 to 4; ``references`` the positions [m or rad] that both are measured from.
    """

    joint: str
    leader: str | None
    coefficients: tuple[float, float, float, float, float]
    references: tuple[float, float] = (0.0, 0.0)
    kind: ClassVar[str] = "joint"


@dataclass(frozen=True)
class TendonConstraint(ModelConstraint):
    """The length of ``tendon`` is a polynomial of that of ``leader``: one row; without a leader it is a constant.

    ``coefficients`` are those of the powers 0 to 4.
    """

    tendon: Tendon
    leader: Tendon | None
    coefficients: tuple[float, float, float, float, float]
    kind: ClassVar[str] = "tendon"
