"""What the sensors of a tree measure at given accelerations, each a block.

The acceleration of a site is that of the point less gravity, as an accelerometer has it. A body gets from the one that it hangs on what its
own bodies and those behind them need for their motion, beyond their weight.

Source: MuJoCo documentation, XML reference, ``sensor``; Goldstein, Classical Mechanics, sections 1.1, 4.9 and 5.1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from harness.files.tree import Sensor, SensorKind
from harness.programs.terms import Matrix, Term, Vector, cross, length
from harness.trees.bodies.rigid import Lump, Spatial
from harness.trees.bodies.spatial import Frame, placed
from harness.trees.quantities.motion import Block, TreeMotion
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


def sensors(motion: TreeMotion) -> Iterator[Block]:
    """What each sensor measures that is judged, in the order of the file."""
    points = _MovingPoints(motion)
    for one in motion.kinematics.tree.sensors:
        if not one.why_not:
            yield _block(motion, points, one)


def _block(motion: TreeMotion, points: _MovingPoints, sensor: Sensor) -> Block:
    number, frame = motion.kinematics.frames[sensor.body]
    site, turn = placed(motion.kinematics.builder, sensor.pose, frame), points.orientation(number)
    point = points.at(number, turn @ site.shift)
    measured, size = {
        SensorKind.ACCELEROMETER: (point.acceleration, point.push),
        SensorKind.LINEAR_ACCELERATION: (point.acceleration, point.push),
        SensorKind.VELOCIMETER: (point.velocity, point.speed),
        SensorKind.GYRO: (point.spin, point.rate),
        SensorKind.ANGULAR_ACCELERATION: (point.turning, point.twist),
    }.get(sensor.kind) or _transmitted(motion, points, sensor, point)
    name = f"{sensor.kind} {sensor.name!r}" if sensor.name else f"{sensor.kind} of line {sensor.line}"
    return Block(name, measured if sensor.kind.is_in_world else (turn @ site.turn).T @ measured, size)


def _transmitted(motion: TreeMotion, points: _MovingPoints, sensor: Sensor, about: _MovingPoint) -> tuple[Vector, Term]:
    """Force, or moment about a point, that the body of a sensor gets from the one that it hangs on, with its size."""
    force, moment = motion.still, motion.still
    size = size_of_moment = motion.kinematics.builder.zero
    for number, lump in _lumps_behind(motion, sensor.body):
        own = lump.in_frame(Frame(points.orientation(number), motion.still))
        centre = points.at(number, own.centre)
        push = own.mass * centre.acceleration
        turning, spinning = own.moments @ centre.turning, cross(centre.spin, own.moments @ centre.spin)
        force = force + push
        moment = moment + ((turning + spinning) + cross(centre.position + -about.position, push))
        weight = own.mass * centre.push
        size = size + weight
        size_of_moment = size_of_moment + ((length(turning) + length(spinning)) + weight * (centre.reach + about.reach))
    return (force, size) if sensor.kind is SensorKind.FORCE else (moment, size_of_moment)


def _lumps_behind(motion: TreeMotion, body: str) -> Iterator[tuple[int, Lump]]:
    """The lumps of a body and of those that hang on it, each in the frame of its node, with that node's number."""
    behind = {body}
    for one in motion.kinematics.tree.bodies:
        if one.name in behind or one.parent in behind:
            behind.add(one.name)
            number, frame = motion.kinematics.frames[one.name]
            for lump in motion.kinematics.weights.lumps(one):
                yield number, lump.in_frame(frame)
