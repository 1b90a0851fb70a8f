"""The equalities of a model file besides its joints: points and frames that meet, and joints and tendons that are coupled.

They are no part of the tree's own equations of motion. An engine that has them switched on solves another problem, whose rows
``harness.trees.rows`` writes. Order and sign of the rows are part of what is said, since engines report forces by them.

Sources: MuJoCo documentation, XML reference, ``equality``, and Computation, section Constraint model; Drake, "Parsing model files",
tag drake:ball_constraint; http://wiki.ros.org/urdf/XML/joint, element ``mimic``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

from harness.files.given import Place, Pose

# What MuJoCo takes for attributes that a constraint leaves out.
SOLREF = (0.02, 1.0)
SOLIMP = (0.9, 0.95, 0.001, 0.5, 2.0)
POLYNOMIAL = (0.0, 1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class SolverParameters:
    """The attributes by which MuJoCo makes a constraint soft, its default classes resolved; engines without them hold it rigid.

    ``solref`` is (time constant [s], damping ratio), or (-stiffness [1/s^2], -damping [1/s]) where both are negative. ``solimp`` is
    (least impedance, most impedance, width [m or rad], midpoint, power).
    """

    solref: tuple[float, float] = SOLREF
    solimp: tuple[float, float, float, float, float] = SOLIMP


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

    @property
    def ends(self) -> Iterator[tuple[str, Pose]]:
        """Body and place of each point; of one that is given."""
        return ((body, pose) for body, pose in zip(self.bodies, (self.first, self.second), strict=True) if pose is not None)


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


@dataclass(frozen=True)
class Polygon:
    """A tendon that is the length of the polygon through points, each a body's name and a place in that body."""

    name: str
    points: tuple[tuple[str, Pose], ...]


Tendon = Sum | Polygon


@dataclass(frozen=True)
class TendonLinkage:
    """Tendon ``tendon`` is a polynomial of tendon ``leader``: one row; without a leader it is the polynomial's constant.

    The length of a polygon is measured from that in the file's zero position [m].
    """

    tendon: Tendon
    leader: Tendon | None
    coefficients: tuple[Fraction, ...]

    @property
    def tendons(self) -> tuple[Tendon, ...]:
        return (self.tendon,) if self.leader is None else (self.tendon, self.leader)


Rows = Meeting | Linkage | TendonLinkage


@dataclass(frozen=True)
class Equality:
    """One equality of a file.

    Attributes:
        kind: its tag. line: in the model's own file. is_active: whether it holds from the start.
        says: None where the file does not say it in words that are read. why_not: why the harness writes no rows for it, "" where it does.
        softness: None for a format that has none. name: that a mechanism finds it by, "" for none.
    """

    kind: str
    place: Place
    line: int
    says: Rows | None
    why_not: str = ""
    softness: SolverParameters | None = None
    is_active: bool = True
    name: str = ""

    @property
    def rows(self) -> Rows | None:
        """Its content; None where the harness writes no rows for that."""
        return None if self.why_not else self.says

    @property
    def couples(self) -> str:
        """The things that are tied: "point", "frame", "joint", "tendon", or its tag."""
        kinds = {Weld: "frame", Meeting: "point", Linkage: "joint", TendonLinkage: "tendon"}
        return kinds.get(type(self.says), self.kind)
