"""The equalities of a robot's file besides its joints: points and frames that meet, and joints and tendons that are coupled.

They are no part of the tree's own equations of motion. An engine that has them switched on solves another problem, whose rows
``harness.robots.constraints`` writes.

Sources: MuJoCo documentation, XML reference, ``equality``; http://wiki.ros.org/urdf/XML/joint, element ``mimic``.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from harness.files.constraints import (
    POLYNOMIAL,
    End,
    FrameConstraint,
    JointConstraint,
    ModelConstraint,
    PointConstraint,
    Softness,
    Tendon,
    TendonConstraint,
)
from harness.files.tree import Place, Pose


@dataclass(frozen=True)
class Meeting:
    """Two points meet: three rows, the first minus the second along the axes of the world [m].

    Attributes:
        bodies: of the two points. first: place of the first in its body. second: of the second; None for the point of the second body
            that the first covers where all joints stand at their reference.
        floating: (body, pose) of bodies on a free joint, where the file puts them.
    """

    bodies: tuple[str, str]
    first: Pose
    second: Pose | None
    floating: tuple[tuple[str, Pose], ...] = ()


@dataclass(frozen=True)
class Weld(Meeting):
    """Two frames meet: the rows of their origins as points, and three of their orientations.

    Those are the vector part of the quaternion that turns the second frame into the first, along the second's axes, times
    ``torque_scale`` [m]. ``first`` and ``second`` are the frames; a second one of None is where the first is at the reference.
    """

    torque_scale: Fraction = Fraction(1)


@dataclass(frozen=True)
class Linkage:
    """Joint ``joint`` measured from its reference is a polynomial of joint ``leader`` measured from its own: one row [m or rad].

    Attributes:
        leader: None for a joint that the polynomial's constant holds. coefficients: of the powers 0 to 4.
    """

    joint: str
    leader: str | None
    coefficients: tuple[Fraction, ...]


@dataclass(frozen=True)
class Sum:
    """A tendon that is the sum of multiples of the positions of joints, each measured from its reference [m or rad].

    ``terms`` is (joint, multiple) of hinges and slides.
    """

    name: str
    terms: tuple[tuple[str, Fraction], ...]

    @property
    def declared(self) -> Tendon:
        """The tendon as engines that read models know it."""
        return Tendon(self.name, tuple((joint, float(multiple)) for joint, multiple in self.terms), ())


@dataclass(frozen=True)
class Polygon:
    """A tendon that is the length of the polygon through points, each a body's name and a place in that body."""

    name: str
    points: tuple[tuple[str, Pose], ...]


@dataclass(frozen=True)
class TendonLinkage:
    """Tendon ``tendon`` is a polynomial of tendon ``leader``: one row; without a leader it is the polynomial's constant."""

    tendon: Sum
    leader: Sum | None
    coefficients: tuple[Fraction, ...]

    @property
    def tendons(self) -> tuple[Sum, ...]:
        return (self.tendon,) if self.leader is None else (self.tendon, self.leader)


@dataclass(frozen=True)
class PathLinkage:
    """A ``TendonLinkage`` of which a tendon is the length of a polygon; its row is measured from the file's zero position."""

    tendon: Sum | Polygon
    leader: Sum | Polygon | None
    coefficients: tuple[Fraction, ...]


Rows = Meeting | Linkage | TendonLinkage


@dataclass(frozen=True)
class Equality:
    """One equality of a file.

    Attributes:
        kind: its tag. line: in the model's own file. is_active: whether it holds from the start.
        rows: None where the harness does not write them, ``why_not`` then says why. softness: None for a format that has none.
        name: "" for none. path: what is said of tendons along paths, in place of ``rows``.
    """

    kind: str
    place: Place
    line: int
    rows: Rows | None
    why_not: str = ""
    softness: Softness | None = None
    is_active: bool = True
    name: str = ""
    path: PathLinkage | None = None

    def declared(self, name: str) -> ModelConstraint:
        """The constraint as engines that read models know it, as far as its softness and the weights of its rows go.

        The frames of a ``Meeting`` and the coefficients of a polynomial have no part in these.
        """
        rows = self.rows
        assert rows is not None, self.why_not
        if isinstance(rows, Linkage):
            return JointConstraint(name, self.line, self.softness, rows.joint, rows.leader, POLYNOMIAL)
        if isinstance(rows, TendonLinkage):
            leader = None if rows.leader is None else rows.leader.declared
            return TendonConstraint(name, self.line, self.softness, rows.tendon.declared, leader, POLYNOMIAL)
        one, other = (End(body, (0.0, 0.0, 0.0)) for body in rows.bodies)
        if isinstance(rows, Weld):
            return FrameConstraint(name, self.line, self.softness, (one, other), float(rows.torque_scale))
        return PointConstraint(name, self.line, self.softness, (one, other))
