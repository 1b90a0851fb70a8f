"""States of a robot over all joints of its tree, and what the harness supplies of its file at them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from harness.arrays import Array
from harness.comparison.coordinates import multiplied, rotations
from harness.comparison.questions import Aid, Asked, BodyInertia, JointForces, Request
from harness.equations.states import States
from harness.files.facts import PointSpring
from harness.files.tree import WORLD, Axes, Body, Direction, Placement, Pose, Quaternion, Spring, Tree, Turn
from harness.robots.robot import Robot

# Orientation as a unit quaternion (w, x, y, z), and origin [m].
Frame = tuple[tuple[float, ...], tuple[float, ...]]
_OF_THE_WORLD: Frame = ((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def asked_joints(tree: Tree, names: Sequence[str] | None = None) -> tuple[Asked, ...]:
    """The joints of a tree in the order of the file, or of ``names``, with their columns in q and in v."""
    kinds, frames = {joint.name: joint.kind for joint in tree.joints}, _frames_of_free_joints(tree)
    found, q, v = [], 0, 0
    for name in names if names is not None else kinds:
        nq, nv = kinds[name].sizes
        turn, shift = frames.get(name, _OF_THE_WORLD)
        found.append(Asked(name, kinds[name], tuple(range(q, q + nq)), tuple(range(v, v + nv)), turn, shift))
        q, v = q + nq, v + nv
    return tuple(found)


def _frames_of_free_joints(tree: Tree) -> dict[str, Frame]:
    """Of the free joints of links that stand in a frame at rest; those of an MJCF are measured in the world."""
    bodies = {body.name: body for body in tree.bodies}
    found: dict[str, Frame] = {}
    for body in tree.bodies:
        pose, parent = body.pose, body.parent
        for joint in body.joints if body.joints and body.joints[0].kind == "free" else ():
            while parent != WORLD and not bodies[parent].joints:
                pose, parent = bodies[parent].pose + pose, bodies[parent].parent
            found[joint.name] = _placed(_OF_THE_WORLD, pose)
    return found


def _placed(frame: Frame, pose: Pose) -> Frame:
    """A pose of a URDF in a frame, as that frame stands in the world."""
    turn, shift = (np.array(part) for part in frame)
    for placement in pose:
        shift = shift + rotations(turn[None])[0] @ np.array([float(value) for value in placement.position])
        for part in placement.rotation:
            assert isinstance(part, Turn), "a URDF has roll, pitch and yaw alone"
            half = float(part.angle) / 2
            turn = multiplied(turn, np.array([math.cos(half), *(math.sin(half) * float(value) for value in part.axis)]))
    return tuple(turn.tolist()), tuple(shift.tolist())


def spread(robot: Robot, states: States, joints: Sequence[Asked]) -> States:
    """States of a robot's own joints, over ``joints`` of its tree: a joint that mimics another moves as the other lets it, unloaded."""
    own = {joint.name: joint for joint in asked_joints(robot.tree, robot.joints)}
    by_name = {joint.name: joint for joint in robot.tree.joints}
    q, v, tau = [], [], []
    for joint in joints:
        leader = by_name[joint.name].follows or joint.name
        if leader not in own:
            raise KeyError(f"joint {joint.name!r} follows {leader!r}, which follows another")
        positions, velocities = list(own[leader].positions), list(own[leader].velocities)
        if leader == joint.name:
            q.append(states.q[:, positions])
            v.append(states.v[:, velocities])
            tau.append(states.tau[:, velocities])
        else:
            multiplier, offset = float(by_name[joint.name].multiplier), float(by_name[joint.name].offset)
            q.append(multiplier * states.q[:, positions] + offset)
            v.append(multiplier * states.v[:, velocities])
            tau.append(np.zeros((len(states), len(velocities))))
    count = len(states)
    own_q, own_v, own_tau = (np.hstack([np.empty((count, 0)), *columns]) for columns in (q, v, tau))
    return States(own_q, own_v, own_tau, np.zeros(count))


def request_of(robot: Robot, aided: bool) -> Request:
    """What a plain or aided engine is to load."""
    joints = asked_joints(robot.tree)
    return Request(
        path=robot.path,
        format=robot.format,
        joints=joints,
        floating_base=robot.floating_base,
        aid=aid(robot, joints) if aided else None,
    )


def aid(robot: Robot, joints: Sequence[Asked]) -> Aid:
    """What the harness supplies of the file to an engine that leaves it out, over ``joints``."""
    by_name = {joint.name: joint for joint in robot.tree.joints}
    velocities = sum(len(joint.velocities) for joint in joints)
    damping, armature, springs = np.zeros(velocities), np.zeros(velocities), []
    for asked in joints:
        joint, columns = by_name[asked.name], list(asked.velocities)
        armature[columns] = float(joint.armature)
        damping[columns] = float(joint.damping)
        if joint.stiffness and len(asked.positions) == 1:
            reference = float(joint.spring_reference)
            relaxed = math.radians(reference) if joint.in_degrees else reference
            springs.append((asked.positions[0], asked.velocities[0], float(joint.stiffness), relaxed))
    gravity = np.array([float(component) for component in robot.tree.gravity])
    inertias = (
        {body.name: inertia for body in robot.tree.bodies if (inertia := _inertia(body)) is not None} if robot.format == "urdf" else {}
    )
    leaders = asked_joints(robot.tree, robot.joints)
    forces, between_points = JointForces(damping, tuple(springs)), tuple(map(_point_spring, robot.tree.springs))
    return Aid(gravity, forces, armature, inertias, _couplings(robot, joints), leaders, between_points)


def _point_spring(spring: Spring) -> PointSpring:
    """A spring with its ends as points of their bodies."""
    (body_a, point_a), (body_b, point_b) = ((body, tuple(_frame(pose)[1].tolist())) for body, pose in spring.ends)
    free_length, stiffness, damping = map(float, (spring.free_length, spring.stiffness, spring.damping))
    line = spring.place.line if spring.place else 0
    return PointSpring(body_a, point_a, body_b, point_b, free_length, stiffness, damping, line)


def _couplings(robot: Robot, joints: Sequence[Asked]) -> Array | None:
    own = {joint.name: joint for joint in asked_joints(robot.tree, robot.joints)}
    by_name = {joint.name: joint for joint in robot.tree.joints}
    if all(not joint.follows for joint in robot.tree.joints):
        return None
    found = np.zeros((sum(len(joint.velocities) for joint in joints), sum(len(joint.velocities) for joint in own.values())))
    for joint in joints:
        leader = by_name[joint.name].follows or joint.name
        found[list(joint.velocities), list(own[leader].velocities)] = 1.0 if leader == joint.name else float(by_name[joint.name].multiplier)
    return found


def _inertia(body: Body) -> BodyInertia | None:
    """The inertia of a link of a URDF in the link's frame, in float64."""
    if body.inertia is None:
        return None
    turn, centre = _frame(body.inertia.pose)
    xx, yy, zz, xy, xz, yz = (float(moment) for moment in body.inertia.moments)
    matrix = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
    return BodyInertia(float(body.inertia.mass), centre, (matrix + matrix.T) / 2)


def _frame(pose: Pose) -> tuple[Array, Array]:
    """Orientation (3, 3) and origin (3,) of a pose, in float64."""
    turn, origin = np.eye(3), np.zeros(3)
    for placement in pose:
        origin = origin + turn @ _position(placement)
        for part in placement.rotation:
            turn = turn @ _rotation(part)
    return turn, origin


def _position(placement: Placement) -> Array:
    position = _floats(placement.position)
    return position if placement.other_end is None else (position + _floats(placement.other_end)) / 2


def _rotation(part: Turn | Quaternion | Axes | Direction) -> Array:
    """The matrix (3, 3) of one rotation, as ``harness.files.tree`` defines it."""
    if isinstance(part, Turn):
        x, y, z = _unit(_floats(part.axis))
        angle = math.radians(part.angle) if part.in_degrees else float(part.angle)
        skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
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
