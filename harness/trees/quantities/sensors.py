"""Measures of the sensors of a tree at given accelerations, each a block.

The acceleration of a site is that of the point less gravity, as an accelerometer has it. A body gets from the one that it hangs on what its
own bodies and those behind them need for their motion, beyond their weight, and beyond what equalities of points and frames do to them.
What acts along velocities alone (dry friction, limits, couplings, actuators of joints) is transmitted by the joints.

Source: MuJoCo documentation, XML reference, ``sensor``; Goldstein, Classical Mechanics, sections 1.1, 4.9 and 5.1.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from harness.files.equalities import Meeting
from harness.files.tree import WORLD, Sensor, SensorKind, Tree
from harness.programs.terms import Matrix, Term, Vector, cross, length, vector
from harness.trees.actuators import moment_of
from harness.trees.bodies.rigid import Lump, Spatial
from harness.trees.bodies.spatial import Frame, placed
from harness.trees.quantities.motion import Block, TreeMotion, size_of
from harness.trees.recursion import driven_by_actuators, generalised
from harness.trees.rows import rows_in
from harness.trees.world_motion import accelerations_of_nodes


@dataclass(frozen=True)
class _MovingPoint:
    """A point of a body, along the world's axes.

    Attributes:
        position, velocity, acceleration: of the point, the latter less gravity. spin, turning: angular velocity and its rate.
        speed, push: sizes of the parts of velocity and acceleration. rate, twist: of spin and turning. reach: of the position.
    """

    position: Vector
    velocity: Vector
    acceleration: Vector
    spin: Vector
    turning: Vector
    speed: Term
    push: Term
    rate: Term
    twist: Term
    reach: Term


@dataclass(frozen=True)
class _Pull:
    """Moment about the origin of a node, and force, that a body which moves with it needs against a constraint."""

    body: str
    number: int
    acts: Spatial


class _MovingPoints:
    """Points of the bodies of a tree at its accelerations."""

    def __init__(self, motion: TreeMotion) -> None:
        self._motion = motion
        self._gravity = motion.kinematics.builder.vector(motion.kinematics.tree.gravity)
        self._of_nodes: list[Spatial] = accelerations_of_nodes(motion, motion.kinematics.coordinates.third)

    def orientation(self, number: int) -> Matrix:
        return self._motion.kinematics.builder.identity if number < 0 else self._motion.moving[number].orientation

    def at(self, number: int, arm: Vector) -> _MovingPoint:
        """The point at an arm from the origin of a node, or of the world for -1."""
        motion, weight = self._motion, length(self._gravity)
        still, nothing = motion.still, motion.kinematics.builder.zero
        if number < 0:
            return _MovingPoint(arm, still, -self._gravity, still, still, nothing, weight, nothing, nothing, length(arm))
        one, (turning, acceleration) = motion.moving[number], self._of_nodes[number]
        position = one.position + arm
        centripetal = cross(one.spin, cross(one.spin, arm))
        speed, rate = motion.speeds(number, position)
        push, twist = motion.speeds(number, position, motion.kinematics.coordinates.third)
        return _MovingPoint(
            position=position,
            velocity=one.velocity_at(arm),
            acceleration=(acceleration + (cross(turning, arm) + centripetal)) + -self._gravity,
            spin=one.spin,
            turning=turning,
            speed=speed,
            # What turns and slides at once is accelerated twice by that.
            push=(push + (rate * speed + rate * speed)) + weight,
            rate=rate,
            twist=twist + rate * rate,
            reach=motion.reach_of(number, position),
        )


def why_not_judged(tree: Tree, sensor: Sensor) -> str:
    """Why the value of a sensor of a tree is not judged; "" where it is."""
    # A reader may leave out bodies and joints.
    if sensor.body not in {WORLD, *(one.name for one in tree.bodies)} or sensor.joint not in {"", *(one.name for one in tree.joints)}:
        return "is of what the engine's reader leaves out"
    if sensor.why_not or not sensor.kind.is_of_actuators:
        return sensor.why_not
    acting = [one.number for one in tree.actuators]
    return "" if (sensor.actuator in acting if sensor.kind is SensorKind.ACTUATOR_FORCE else acting) else "is of actuators that are off"


def sensors(motion: TreeMotion, ties: Mapping[str, Meeting] | None = None) -> Iterator[Block]:
    """The measure of each sensor that is judged, in the order of the file.

    ``ties`` are the rows of equalities of points and frames by their names, for each of which there is a multiplier.
    """
    tree, points = motion.kinematics.tree, _MovingPoints(motion)
    pulls = list(_pulls(motion, ties or {}))
    of_actuators = _actuator_forces(motion) if tree.actuators else {}
    for one in tree.sensors:
        if not why_not_judged(tree, one):
            name = f"{one.kind} {one.name!r}" if one.name else f"{one.kind} of line {one.line}"
            if one.kind.is_of_joints:
                yield Block(name, *_of_joint(motion, one))
            else:
                yield Block(name, *(of_actuators[one] if one.kind.is_of_actuators else _at_site(motion, points, one, pulls)))


def _pulls(motion: TreeMotion, ties: Mapping[str, Meeting]) -> Iterator[_Pull]:
    rows = rows_in(motion, ties)
    for multiplier, row in zip(motion.kinematics.coordinates.further, rows, strict=True):
        moving = [body for body in ties[row.constraint].bodies if motion.kinematics.frames[body][0] >= 0]
        # The forces of constraints are -J' times the multipliers.
        for body, (number, acts) in zip(moving, row.on_nodes, strict=True):
            yield _Pull(body, number, multiplier * acts)


def _actuator_forces(motion: TreeMotion) -> dict[Sensor, tuple[Vector, Term]]:
    """The forces of actuators and of all of them on joints, and their sizes."""
    nodes, found = motion.kinematics, dict[Sensor, tuple[Vector, Term]]()
    driven, zero = driven_by_actuators(nodes), nodes.builder.zero
    moments = {one.number: moment_of(nodes, one, generalised) for one in nodes.tree.actuators}
    for one in nodes.tree.sensors:
        if why_not_judged(nodes.tree, one) or not one.kind.is_of_actuators:
            continue
        if one.kind is SensorKind.ACTUATOR_FORCE:
            force = driven.alone[one.actuator]
            size = size_of(force)
        else:
            (column,) = nodes.coordinates.columns[one.joint]
            force = driven.forces[column]
            size = sum((size_of(moments[number][column] * alone) for number, alone in driven.alone.items()), size_of(force))
        found[one] = vector((force, zero, zero)), size
    return found


def _of_joint(motion: TreeMotion, sensor: Sensor) -> tuple[Vector, Term]:
    """Position or velocity of a hinge or slide, and its size."""
    nodes = motion.kinematics
    [joint] = [node.joint for node in nodes.nodes if node.joint.name == sensor.joint]
    (column,) = nodes.coordinates.columns[sensor.joint]
    is_position = sensor.kind is SensorKind.JOINT_POSITION
    value = nodes.coordinates.position(joint) if is_position else nodes.coordinates.velocities[column]
    return vector((value, nodes.builder.zero, nodes.builder.zero)), size_of(value)


def _at_site(motion: TreeMotion, points: _MovingPoints, sensor: Sensor, pulls: Sequence[_Pull]) -> tuple[Vector, Term]:
    """The measure of a sensor at a site, and its size."""
    number, frame = motion.kinematics.frames[sensor.body]
    site, turn = placed(motion.kinematics.builder, sensor.pose, frame), points.orientation(number)
    point = points.at(number, turn @ site.shift)
    measured, size = {
        SensorKind.ACCELEROMETER: (point.acceleration, point.push),
        SensorKind.LINEAR_ACCELERATION: (point.acceleration, point.push),
        SensorKind.VELOCIMETER: (point.velocity, point.speed),
        SensorKind.GYRO: (point.spin, point.rate),
        SensorKind.ANGULAR_ACCELERATION: (point.turning, point.twist),
    }.get(sensor.kind) or _transmitted(motion, points, sensor, point, pulls)
    return measured if sensor.kind.is_in_world else (turn @ site.turn).T @ measured, size


def _transmitted(
    motion: TreeMotion, points: _MovingPoints, sensor: Sensor, about: _MovingPoint, pulls: Sequence[_Pull]
) -> tuple[Vector, Term]:
    """Force, or moment about a point, that the body of a sensor gets from the one that it hangs on, with its size."""
    force, moment = motion.still, motion.still
    size = size_of_moment = motion.kinematics.builder.zero
    bodies = _behind(motion.kinematics.tree, sensor.body)
    for number, lump in _lumps(motion, bodies):
        own = lump.in_frame(Frame(points.orientation(number), motion.still))
        centre = points.at(number, own.centre)
        push = own.mass * centre.acceleration
        turning, spinning = own.moments @ centre.turning, cross(centre.spin, own.moments @ centre.spin)
        force = force + push
        moment = moment + ((turning + spinning) + cross(centre.position + -about.position, push))
        weight = own.mass * centre.push
        size = size + weight
        size_of_moment = size_of_moment + ((length(turning) + length(spinning)) + weight * (centre.reach + about.reach))
    for pull in pulls:
        if pull.body in bodies:
            turned, pushed = pull.acts
            one = motion.moving[pull.number]
            force = force + pushed
            moment = moment + (turned + cross(one.position + -about.position, pushed))
            size = size + length(pushed)
            size_of_moment = size_of_moment + (length(turned) + length(pushed) * (motion.distance(pull.number) + about.reach))
    return (force, size) if sensor.kind is SensorKind.FORCE else (moment, size_of_moment)


def _behind(tree: Tree, body: str) -> set[str]:
    """A body, and those that hang on it."""
    behind = {body}
    for one in tree.bodies:
        if one.parent in behind:
            behind.add(one.name)
    return behind


def _lumps(motion: TreeMotion, bodies: Collection[str]) -> Iterator[tuple[int, Lump]]:
    """The lumps of bodies, each in the frame of its node, with that node's number."""
    for one in motion.kinematics.tree.bodies:
        if one.name in bodies:
            number, frame = motion.kinematics.frames[one.name]
            for lump in motion.kinematics.weights.lumps(one):
                yield number, lump.in_frame(frame)
