"""The meaning of a file as a request: its joints, and what an aided engine is supplied with."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from harness.arrays import Array
from harness.engines.coordinates import cross_matrix, multiplied, rotations
from harness.engines.request import Aid, AskedJoint, BodyInertia, JointForces, Request, in_columns
from harness.files.facts import JointSpring, PointSpring, in_radians
from harness.files.given import Axes, Direction, Placement, Pose, Quaternion, Turn
from harness.files.joint_kinds import JointKind
from harness.files.model_file import ModelFile, meaning_of
from harness.files.tree import WORLD, Spring, Tree

# Orientation as a unit quaternion (w, x, y, z), and origin [m].
Frame = tuple[tuple[float, ...], tuple[float, ...]]
_OF_THE_WORLD: Frame = ((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def asked_joints(tree: Tree, names: Sequence[str] | None = None) -> tuple[AskedJoint, ...]:
    """The joints of a tree in the order of the file, or of ``names``, with their columns in q and in v."""
    by_name, frames, before = {joint.name: joint for joint in tree.joints}, _frames_of_free_joints(tree), tree.joints_before
    bodies = {joint.name: body.name for body in tree.bodies for joint in body.joints}
    found = []
    for joint in (by_name[name] for name in names) if names is not None else tree.joints:
        turn, shift = frames.get(joint.name, _OF_THE_WORLD)
        line, tag = (joint.place.line, joint.place.tag) if joint.place else (0, "")
        coupled = joint.follows, float(joint.multiplier), float(joint.offset)
        found.append(AskedJoint(joint.name, joint.kind, (), (), turn, shift, *coupled, line, before[joint.name], bodies[joint.name], tag))
    return in_columns(found)


def _frames_of_free_joints(tree: Tree) -> dict[str, Frame]:
    """Frames of the free joints of links that stand in a frame at rest; those of an MJCF are measured in the world."""
    bodies = {body.name: body for body in tree.bodies}
    found: dict[str, Frame] = {}
    for body in tree.bodies:
        pose, parent = body.pose, body.parent
        for joint in body.joints if body.joints and body.joints[0].kind == JointKind.FREE else ():
            while parent != WORLD and not bodies[parent].joints:
                pose, parent = bodies[parent].pose + pose, bodies[parent].parent
            found[joint.name] = _placed(pose)
    return found


def _placed(pose: Pose) -> Frame:
    """A pose as a frame in the world."""
    turn, shift = (np.array(part) for part in _OF_THE_WORLD)
    for placement in pose:
        shift = shift + rotations(turn[None])[0] @ _floats(placement.position)
        for part in placement.rotation:
            turn = multiplied(turn, _quaternion(part))
    return tuple(turn.tolist()), tuple(shift.tolist())


def _quaternion(part: Turn | Quaternion | Axes | Direction) -> Array:
    """The quaternion (w, x, y, z) of one rotation."""
    if isinstance(part, Turn):
        half = (math.radians(part.angle) if part.in_degrees else float(part.angle)) / 2
        return np.array([math.cos(half), *(math.sin(half) * _unit(_floats(part.axis)))])
    if isinstance(part, Quaternion):
        return _unit(_floats(part.components))
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(_rotation(part)).as_quat()[[3, 0, 1, 2]])


def model_request(file: ModelFile, joints: Sequence[str], gravity: float) -> Request:
    """A mechanism's model, for an engine aided with all that it says.

    ``joints`` names the joint of each velocity; ``gravity`` [m/s^2, along -z] is for a file that holds none.
    """
    tree = meaning_of(file).tree
    known = {joint.name for joint in tree.joints}
    asked = asked_joints(tree, [name for name in dict.fromkeys(joints) if name in known])
    aid = replace(aid_of(tree, asked), gravity=np.array(file.gravity or (0.0, 0.0, -gravity)))
    names = tuple(joint.name for joint in asked)
    return Request(path=file.path, format=file.format, joints=asked, moving=names, text=file.text, aid=aid)


def aid_of(tree: Tree, joints: Sequence[AskedJoint]) -> Aid:
    """Parts of a file that the harness supplies to an engine that leaves them out, over ``joints``."""
    by_name = {joint.name: joint for joint in tree.joints}
    velocities = sum(len(joint.velocities) for joint in joints)
    damping, armature, springs = np.zeros(velocities), np.zeros(velocities), []
    for asked in joints:
        joint, columns = by_name[asked.name], list(asked.velocities)
        armature[columns] = float(joint.armature)
        damping[columns] = float(joint.damping)
        if joint.stiffness and joint.kind.is_single:
            spring = JointSpring(joint.name, float(joint.stiffness), in_radians(joint, "spring_reference"), asked.line)
            springs.append((spring, asked.positions[0], asked.velocities[0]))
    forces = JointForces(damping, tuple(springs))
    return Aid(_floats(tree.gravity), forces, armature, springs=tuple(_point_spring(spring) for spring in tree.springs if spring.is_plain))


def _point_spring(spring: Spring) -> PointSpring:
    """A spring with its ends as points of their bodies."""
    (body_a, point_a), (body_b, point_b) = ((body, tuple(frame_of(pose)[1].tolist())) for body, pose in spring.ends)
    free_length, stiffness, damping = map(float, (spring.free_length, spring.stiffness, spring.damping))
    line = spring.place.line if spring.place else 0
    return PointSpring(body_a, point_a, body_b, point_b, free_length, stiffness, damping, line)


def inertias_of(tree: Tree) -> dict[str, BodyInertia]:
    """The inertias of links of a URDF that have one, by name, each in the link's frame and in float64."""
    found = {}
    for body in tree.bodies:
        if body.inertia is not None:
            turn, centre = frame_of(body.inertia.pose)
            xx, yy, zz, xy, xz, yz = _floats(body.inertia.moments)
            matrix = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
            found[body.name] = BodyInertia(float(body.inertia.mass), centre, (matrix + matrix.T) / 2)
    return found


def frame_of(pose: Pose) -> tuple[Array, Array]:
    """Orientation (3, 3) and origin (3,) of a pose, in float64."""
    turn, origin = np.eye(3), np.zeros(3)
    for placement in pose:
        own, position = np.eye(3), _position(placement)
        for part in placement.rotation:
            own = own @ _rotation(part)
        if placement.is_inverse:
            own, position = own.T, -own.T @ position
        turn, origin = turn @ own, origin + turn @ position
    return turn, origin


def _position(placement: Placement) -> Array:
    position = _floats(placement.position)
    return position if placement.other_end is None else (position + _floats(placement.other_end)) / 2


def _rotation(part: Turn | Quaternion | Axes | Direction) -> Array:
    """The matrix (3, 3) of one rotation, as ``harness.files.given`` defines it."""
    if isinstance(part, Turn):
        angle = math.radians(part.angle) if part.in_degrees else float(part.angle)
        skew = cross_matrix(_unit(_floats(part.axis)))
        return np.asarray(np.eye(3) + math.sin(angle) * skew + (1 - math.cos(angle)) * (skew @ skew))
    if isinstance(part, Axes):
        first, second = _unit(_floats(part.x)), _unit(_floats(part.y))
        second = _unit(second - (second @ first) * first)
        return np.column_stack([first, second, np.cross(first, second)])
    if isinstance(part, Quaternion):
        return np.asarray(rotations(_unit(_floats(part.components))[None])[0])
    x, y, z = _unit(_floats(part.end) - _floats(part.start))
    # Half a turn about x for the direction opposite to z, which alone leaves no quaternion.
    quaternion = np.array([1.0 + z, -y, x, 0.0]) if 1.0 + z or x or y else np.array([0.0, 1.0, 0.0, 0.0])
    return np.asarray(rotations(_unit(quaternion)[None])[0])


def _floats(numbers: Sequence[Fraction]) -> Array:
    return np.array([float(number) for number in numbers])


def _unit(direction: Array) -> Array:
    return np.asarray(direction / np.linalg.norm(direction))
