"""The forces, inertias and constraints of a model file in float64, for engines whose readers pass over them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from harness.files.constraints import (
    UNTURNED,
    End,
    FrameConstraint,
    JointConstraint,
    ModelConstraint,
    Point,
    PointConstraint,
    Quaternion,
    Tendon,
    TendonConstraint,
)
from harness.files.equalities import Equality, Linkage, Meeting, PathLinkage, Polygon, Sum, TendonLinkage, Weld
from harness.files.tree import WORLD, Joint, Pose, Spring, Tree
from harness.files.tree import Quaternion as Turned

Coefficients = tuple[float, float, float, float, float]


@dataclass(frozen=True)
class JointSpring:
    """Force -stiffness (q - reference) in a joint [N/m and m, or N m/rad and rad]."""

    joint: str
    stiffness: float
    reference: float
    line: int


@dataclass(frozen=True)
class JointDamper:
    """Force -damping v in a joint [N s/m or N m s/rad]."""

    joint: str
    damping: float
    line: int


@dataclass(frozen=True)
class PointSpring:
    """Spring and damper between a point of body A and a point of body B, each in its link's frame [m].

    ``stiffness`` [N/m] acts on the length beyond ``free_length`` [m], ``damping`` [N s/m] on its rate.
    """

    body_a: str
    point_a: Point
    body_b: str
    point_b: Point
    free_length: float
    stiffness: float
    damping: float
    line: int

    @property
    def ends(self) -> tuple[tuple[str, Point], tuple[str, Point]]:
        """Body and point of either end."""
        return (self.body_a, self.point_a), (self.body_b, self.point_b)


@dataclass(frozen=True)
class Armature:
    """Inertia [kg m^2, or kg] that a geared rotor adds to its joint: gear_ratio^2 rotor_inertia.

    The gear ratio is a number for a revolute joint and in 1/m for a prismatic one.
    """

    joint: str
    reflected_inertia: float
    line: int


@dataclass(frozen=True)
class Mimic:
    """The position of ``joint`` is multiplier q + offset [m or rad], where q is that of the joint it follows, ``leader``."""

    joint: str
    leader: str
    multiplier: float
    offset: float
    line: int


@dataclass(frozen=True)
class Unexpressed:
    """A force, or an inertia, that the file states and that no force element expresses."""

    line: int
    what: str


ForceElement = JointSpring | JointDamper | PointSpring


def joint_forces(joints: Iterable[Joint]) -> Iterator[JointSpring | JointDamper]:
    """The springs and dampers in joints, joint by joint."""
    for joint in joints:
        if joint.stiffness:
            yield JointSpring(joint.name, float(joint.stiffness), in_radians(joint, "spring_reference"), joint.places["stiffness"].line)
        if joint.damping:
            yield JointDamper(joint.name, float(joint.damping), joint.places["damping"].line)


def in_radians(joint: Joint, name: str) -> float:
    """A position of a joint by the name of its field [m or rad]."""
    value = float(getattr(joint, name))
    return math.radians(value) if joint.in_degrees else value


def point_springs(tree: Tree) -> Iterator[PointSpring | Unexpressed]:
    """The springs and dampers of a tree on lengths; those on sums of joint positions, or with ends in a frame of the body, unexpressed."""
    authored = {body.name for body in tree.bodies if not body.is_unnamed}
    for spring in sorted((*tree.springs, *tree.couplings), key=lambda one: one.place.element if one.place else 0):
        line = spring.place.line if spring.place else 0
        if not isinstance(spring, Spring):
            yield Unexpressed(line, "<fixed> does not run straight from one site to another")
        elif any(len(pose) > 1 or (body not in authored and body != WORLD) for body, pose in spring.ends):
            yield Unexpressed(line, "<site> is not the name of a site right inside a named body")
        else:
            (body_a, point_a), (body_b, point_b) = ((body, _point(pose)) for body, pose in spring.ends)
            numbers = float(spring.free_length), float(spring.stiffness), float(spring.damping)
            yield PointSpring(body_a, point_a, body_b, point_b, *numbers, line)


def _point(pose: Pose) -> Point:
    x, y, z = map(float, pose[-1].position)
    return x, y, z


def armatures(joints: Iterable[Joint]) -> Iterator[Armature]:
    """The reflected inertias of joints."""
    return (Armature(joint.name, float(joint.armature), joint.places["armature"].line) for joint in joints if joint.armature)


def mimics(equalities: Iterable[Equality]) -> Iterator[Mimic]:
    """The joints of a URDF that mimic another."""
    for one in equalities:
        if one.softness is None and isinstance(one.rows, Linkage):
            offset, multiplier, *_ = map(float, one.rows.coefficients)
            yield Mimic(one.rows.joint, str(one.rows.leader), multiplier, offset, one.line)


def constraints(tree: Tree, equalities: Iterable[Equality]) -> Iterator[ModelConstraint]:
    """What equalities say, each by the name it is found by."""
    joints = {joint.name: joint for joint in tree.joints}
    for one in equalities:
        about = one.name, one.line, one.softness
        said = one.path or one.rows
        if isinstance(said, Weld):
            yield FrameConstraint(*about, _ends(said, True), float(said.torque_scale))
        elif isinstance(said, Meeting):
            yield PointConstraint(*about, _ends(said, False))
        elif isinstance(said, Linkage):
            references = in_radians(joints[said.joint], "reference"), in_radians(joints[said.leader], "reference") if said.leader else 0.0
            yield JointConstraint(*about, said.joint, said.leader, _coefficients(said), references)
        elif said is not None:
            led = None if said.leader is None else _tendon(said.leader)
            yield TendonConstraint(*about, _tendon(said.tendon), led, _coefficients(said))


def _coefficients(said: Linkage | TendonLinkage | PathLinkage) -> Coefficients:
    constant, first, second, third, fourth = map(float, said.coefficients)
    return constant, first, second, third, fourth


def _ends(meeting: Meeting, turned: bool) -> tuple[End, End]:
    first, second = (
        End(body, _point(pose), _turn(pose) if turned else UNTURNED)
        for body, pose in zip(meeting.bodies, (meeting.first, meeting.second or meeting.first), strict=True)
    )
    return first, second


def _turn(pose: Pose) -> Quaternion:
    for turn in pose[-1].rotation:
        if isinstance(turn, Turned):
            w, x, y, z = map(float, turn.components)
            return w, x, y, z
    return UNTURNED


def _tendon(tendon: Sum | Polygon) -> Tendon:
    if isinstance(tendon, Sum):
        return tendon.declared
    return Tendon(tendon.name, (), tuple(End(body, _point(pose)) for body, pose in tendon.points))
