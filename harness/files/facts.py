"""The forces and inertias of a model file in float64, for engines whose readers pass over them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from harness.files.document.source import Unread
from harness.files.given import Pose, Quaternion
from harness.files.tree import WORLD, Joint, Spring, Tree

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


ForceElement = JointSpring | JointDamper | PointSpring


def joint_forces(joints: Iterable[Joint]) -> Iterator[JointSpring | JointDamper | Unread]:
    """The springs and dampers in joints, joint by joint; springs of joints without axis unexpressed."""
    for joint in joints:
        if joint.stiffness and joint.kind.has_attitude:
            what = f'<joint name="{joint.name}"> stiffness="{float(joint.stiffness):g}" is a spring in a {joint.kind} joint'
            yield Unread(joint.place_of("stiffness"), what, "remove it")
        elif joint.stiffness:
            yield JointSpring(joint.name, float(joint.stiffness), in_radians(joint, "spring_reference"), joint.place_of("stiffness").line)
        if joint.damping:
            yield JointDamper(joint.name, float(joint.damping), joint.place_of("damping").line)


def in_radians(joint: Joint, name: str) -> float:
    """A position of a joint by the name of its field [m or rad]."""
    value = float(getattr(joint, name))
    return math.radians(value) if joint.in_degrees else value


def point_springs(tree: Tree) -> Iterator[PointSpring | Unread]:
    """The springs and dampers of a tree on lengths; those on sums of joint positions, or with ends in a frame of the body, unexpressed."""
    authored = {body.name for body in tree.bodies if not body.is_unnamed}
    for spring in sorted((*tree.springs, *tree.couplings), key=lambda one: one.place.element if one.place else 0):
        assert spring.place is not None
        if not isinstance(spring, Spring):
            yield Unread(spring.place, "<fixed> does not run straight from one site to another", "lead it through two sites")
        elif spring.slack_to is not None:
            yield Unread(spring.place, "<spatial> is slack between two lengths", "write one springlength")
        elif spring.armature:
            place = spring.places.get("armature", spring.place)
            yield Unread(place, f'<spatial> armature="{float(spring.armature):g}" is an inertia in a tendon', "remove it")
        elif any(len(pose) > 1 or (body not in authored and body != WORLD) for body, pose in spring.ends):
            yield Unread(spring.place, "<site> is not the name of a site right inside a named body", "put the site there")
        else:
            (body_a, point_a), (body_b, point_b) = ((body, point_of(pose)) for body, pose in spring.ends)
            numbers = float(spring.free_length), float(spring.stiffness), float(spring.damping)
            yield PointSpring(body_a, point_a, body_b, point_b, *numbers, spring.place.line)


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
