"""The constraints of a model file besides its joints: what meets, what is coupled, what rubs, and limits.

They are no part of the tree's own equations of motion. An engine that has them switched on solves another problem, whose rows
``harness.trees.rows`` writes. Order and sign of the rows are part of what is said, since engines report forces by them.

Sources: MuJoCo documentation, XML reference, ``equality`` and ``joint``, and Computation, section Constraint model; Drake, "Parsing
model files", tag drake:ball_constraint; http://wiki.ros.org/urdf/XML/joint, element ``mimic``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

from harness.files.document.source import one_sign
from harness.files.given import Place, Placed, Pose
from harness.files.joint_kinds import JointKind
from harness.files.touching import Touch

if TYPE_CHECKING:
    from harness.files.tree import Joint, Tree

# What MuJoCo takes for attributes that a constraint leaves out.
SOLREF = (0.02, 1.0)
SOLIMP = (0.9, 0.95, 0.001, 0.5, 2.0)
POLYNOMIAL = (0.0, 1.0, 0.0, 0.0, 0.0)
# Numbers of a file are exact, and those that an engine tells are floats.
_Real = float | Fraction


@dataclass(frozen=True)
class SolverParameters:
    """The attributes by which MuJoCo makes a constraint soft, its default classes resolved; engines without them hold it rigid.

    ``solref`` is (time constant [s], damping ratio), or (-stiffness [1/s^2], -damping [1/s]) where both are negative. ``solimp`` is
    (least impedance, most impedance, width [m or rad], midpoint, power).
    """

    solref: tuple[_Real, _Real] = SOLREF
    solimp: tuple[_Real, _Real, _Real, _Real, _Real] = SOLIMP


BY_DEFAULT = SolverParameters()


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
class BoundTendon(Placed):
    """A tendon with dry friction or limits, as of ``Joint``; ``why_not``: why the harness writes no rows for it, "" where it does."""

    tendon: Tendon
    friction_loss: Fraction
    friction_softness: SolverParameters
    limits: tuple[Fraction, Fraction] | None
    margin: Fraction
    limit_softness: SolverParameters
    place: Place | None
    why_not: str = ""
    in_degrees: bool = False


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


@dataclass(frozen=True)
class _Bound:
    """A bound of a joint, ``of`` its name, or of a tendon."""

    of: str | Tendon

    @property
    def owner(self) -> str:
        """ "joint elbow", "tendon left"."""
        return f"joint {self.of}" if isinstance(self.of, str) else f"tendon {self.of.name}"


@dataclass(frozen=True)
class DryFriction(_Bound):
    """Dry friction: a row for each of the ``velocities``, which leaves nothing and whose force is at most ``bound`` [N or N m]."""

    bound: Fraction
    velocities: int = 1


@dataclass(frozen=True)
class Limit(_Bound):
    """A limit of a position, of the angle of a ball joint, or of the length of a tendon.

    One row, whose force pushes back alone: the distance to ``bound``, less ``margin``, which is negative where it is there [m or rad].

    Attributes:
        is_upper: whether the position is to stay below ``bound``. in_degrees: whether ``bound`` is in degrees.
    """

    is_upper: bool
    bound: Fraction
    margin: Fraction
    in_degrees: bool = False


Rows = Meeting | Linkage | TendonLinkage
AnyRows = Rows | DryFriction | Limit | Touch


@dataclass(frozen=True)
class Constraint:
    """One constraint of a file.

    Attributes:
        kind: its tag. line: in the model's own file. is_active: whether it holds from the start.
        says: None where the file does not say it in words that are read. why_not: why the harness writes no rows for it, "" where it does.
        softness: None for a format that has none. name: that a mechanism finds it by, "" for none.
    """

    kind: str
    place: Place
    line: int
    says: AnyRows | None
    why_not: str = ""
    softness: SolverParameters | None = None
    is_active: bool = True
    name: str = ""

    @property
    def rows(self) -> AnyRows | None:
        """Its content; None where the harness writes no rows for that."""
        return None if self.why_not else self.says

    @property
    def couples(self) -> str:
        """The things that are tied: "point", "frame", "joint", "tendon", or its tag."""
        kinds = {Weld: "frame", Meeting: "point", Linkage: "joint", TendonLinkage: "tendon"}
        return kinds.get(type(self.says), self.kind)


@dataclass(frozen=True)
class Equality(Constraint):
    """A constraint that is to hold always."""

    says: Rows | None

    @property
    def rows(self) -> Rows | None:
        """See ``Constraint``."""
        return None if self.why_not else self.says


def frictions_of(tree: Tree) -> list[Constraint]:
    """Dry friction of the joints and tendons of a tree."""
    owners: Sequence[Joint | BoundTendon] = [*tree.joints, *tree.tendons]
    return [
        _of(one, "dry friction", DryFriction(_owner(one), one.friction_loss, _velocities(one)), one.friction_softness)
        for one in owners
        if one.friction_loss
    ]


def limits_of(tree: Tree, of_tendons: bool = False) -> list[Constraint]:
    """The limits of the joints or tendons of a tree, lower ones first; the angle of a ball joint has an upper one alone."""
    owners: Sequence[Joint | BoundTendon] = tree.tendons if of_tendons else tree.joints
    return [
        _of(one, kind, Limit(_owner(one), is_upper, one.limits[is_upper], one.margin, one.in_degrees), one.limit_softness)
        for one in owners
        if one.limits is not None
        for is_upper, kind in ((False, "lower limit"), (True, "upper limit"))
        if is_upper or _velocities(one) == 1
    ]


def _owner(one: Joint | BoundTendon) -> str | Tendon:
    return one.tendon if isinstance(one, BoundTendon) else one.name


def _velocities(one: Joint | BoundTendon) -> int:
    return 1 if isinstance(one, BoundTendon) else one.kind.velocities


def _of(one: Joint | BoundTendon, kind: str, says: DryFriction | Limit, softness: SolverParameters) -> Constraint:
    place = one.place_of("friction_loss" if isinstance(says, DryFriction) else "limits")
    time, ratio = map(float, softness.solref)
    complaint = one_sign((time, ratio))
    why_not = f"has solref {time:g} {ratio:g}, which {complaint}" if complaint else ""
    if isinstance(one, BoundTendon):
        why_not = one.why_not or why_not
    elif one.kind is JointKind.PLANAR:
        why_not = "is of a planar joint, which engines make several of"
    return Constraint(kind, place, place.line, says, why_not, softness, name=f"{kind} of {says.owner}")
