"""The forces and inertias of a model file in float64, for engines whose readers pass over them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from harness.files.equalities import Equality, Linkage
from harness.files.tree import WORLD, Joint, Pose, Quaternion, Spring, Tree

Point = tuple[float, float, float]
UNTURNED = (1.0, 0.0, 0.0, 0.0)


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
            (body_a, point_a), (body_b, point_b) = ((body, point_of(pose)) for body, pose in spring.ends)
            numbers = float(spring.free_length), float(spring.stiffness), float(spring.damping)
            yield PointSpring(body_a, point_a, body_b, point_b, *numbers, line)


def armatures(joints: Iterable[Joint]) -> Iterator[Armature]:
    """The reflected inertias of joints."""
    return (Armature(joint.name, float(joint.armature), joint.places["armature"].line) for joint in joints if joint.armature)


def mimics(equalities: Iterable[Equality]) -> Iterator[Mimic]:
    """The joints of a URDF that mimic another."""
    for one in equalities:
        if one.softness is None and isinstance(one.rows, Linkage):
            offset, multiplier, *_ = map(float, one.rows.coefficients)
            yield Mimic(one.rows.joint, str(one.rows.leader), multiplier, offset, one.line)


def point_of(pose: Pose) -> Point:
    """The origin of the innermost frame of a pose in that around it."""
    x, y, z = map(float, pose[-1].position)
    return x, y, z


def turn_of(pose: Pose) -> tuple[float, float, float, float]:
    """The orientation (w, x, y, z), of any length but 0, of the innermost frame of a pose, which is given by a quaternion or not at all."""
    for turn in pose[-1].rotation:
        if isinstance(turn, Quaternion):
            w, x, y, z = map(float, turn.components)
            return w, x, y, z
    return UNTURNED
