"""The forces of actuators, as terms of the equations of motion of a tree, and the numbers of these that each state has of its own.

The input of an actuator is such a number. A range is another two: what it holds counts ``share`` times, beside a constant force.

Source: MuJoCo documentation, Computation, section Actuation model; XML reference, ``actuator/general`` and ``joint/actuatorfrcrange``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from harness.files.given import Given
from harness.files.joint_kinds import JointKind
from harness.files.tree import Actuator, Signed
from harness.programs.mechanisms.actuation import Actuation
from harness.programs.mechanisms.zones import Clamp, Zones
from harness.programs.terms import Term, Vector, cross
from harness.trees.bodies.rigid import Spatial, spatial
from harness.trees.bodies.spatial import FileBuilder, FileProgram, of_quaternion, placed
from harness.trees.nodes import Kinematics

CLAMPED = "clamped"
# Generalised forces (nv,) of forces on the nodes.
Generalised = Callable[[Kinematics, Sequence[Spatial]], Vector]
_WHERE = 3


@dataclass(frozen=True)
class _Clamped:
    share: Given
    constant: Given
    bounds: tuple[Fraction, Fraction]
    raw: Term


@dataclass
class Driven:
    """The forces of the actuators of a tree.

    Attributes:
        forces: (nv,) generalised. clamped: what ranges hold, each before those that it is part of.
    """

    forces: Vector
    clamped: list[_Clamped] = field(default_factory=list)


def driven(nodes: Kinematics, generalised: Generalised) -> Driven:
    """The forces of the actuators of a tree."""
    found = Driven(nodes.builder.zeros(nodes.nv))
    for actuator in nodes.tree.actuators:
        moment = moment_of(nodes, actuator, generalised)
        force = _force(nodes, actuator, moment)
        if actuator.force_range is not None:
            force = _held(nodes.builder, found, f"force of actuator {actuator.number}", actuator.force_range, force)
        found.forces = found.forces + force * moment
    for joint, bounds in nodes.tree.force_limits:
        for column in nodes.coordinates.columns.get(joint, ()) if nodes.tree.actuators else ():
            total = found.forces[column]
            if total.value != 0:
                found.forces[column] = _held(nodes.builder, found, f"force of actuators on {joint}", bounds, total)
    return found


def _held(builder: FileBuilder, found: Driven, what: str, bounds: tuple[Fraction, Fraction], raw: Term) -> Term:
    """A force in its range."""
    place = next(bound.place for bound in bounds if isinstance(bound, Given))
    share, constant = (Given(1.0, place, f"{part} of {what}") for part in ("share", "constant"))
    found.clamped.append(_Clamped(share, constant, bounds, raw))
    held: Term = builder.number(share) * raw + builder.number(constant)
    return held


def _input(actuator: Actuator) -> Given:
    assert actuator.place is not None
    return Given(1.0, actuator.place, f"input of actuator {actuator.number}")


def _force(nodes: Kinematics, actuator: Actuator, moment: Vector) -> Term:
    builder, length = nodes.builder, nodes.builder.zero
    joints = {node.joint.name: node.joint for node in nodes.nodes}
    for name, multiple in actuator.joints:
        if joints[name].kind.is_single:
            length = length + builder.number(multiple) * nodes.coordinates.position(joints[name])
    length = builder.number(actuator.gear[0]) * length
    rate = moment @ nodes.coordinates.velocities
    gain, bias = (_affine(builder, numbers, length, rate) for numbers in (actuator.gain, actuator.bias))
    found: Term = gain * builder.number(_input(actuator)) + bias
    return found


def _affine(builder: FileBuilder, numbers: Sequence[Signed], length: Term, rate: Term) -> Term:
    found = builder.zero
    for (sign, number), factor in zip(numbers, (builder.one, length, rate), strict=True):
        part = builder.number(number) * factor
        found = found + part if sign > 0 else found - part
    return found


def moment_of(nodes: Kinematics, actuator: Actuator, generalised: Generalised) -> Vector:
    """(nv,) generalised forces of an actuator's force 1."""
    builder, found = nodes.builder, nodes.builder.zeros(nodes.nv)
    gear = builder.vector(actuator.gear)
    if actuator.site is not None:
        body, pose = actuator.site
        number, frame = nodes.frames[body]
        if number < 0:
            return found
        at = placed(builder, pose, frame)
        force = at.turn @ gear[:_WHERE]
        on_nodes = [nodes.still] * len(nodes.nodes)
        on_nodes[number] = spatial(at.turn @ gear[_WHERE:] + cross(at.shift, force), force)
        return generalised(nodes, on_nodes)
    joints = {node.joint.name: node for node in nodes.nodes}
    for name, multiple in actuator.joints:
        node = joints[name]
        if node.joint.kind.is_single:
            (column,) = node.columns
            found[column] = found[column] + builder.number(multiple) * gear[0]
            continue
        along = gear[:_WHERE] if node.joint.kind is JointKind.BALL else gear[_WHERE:]
        if actuator.in_parent:
            along = of_quaternion(nodes.coordinates.positions[name][-4:]).T @ along
        found[node.columns] = [*gear[: len(node.columns) - _WHERE], *along]
    return found


def actuation_of(nodes: Kinematics, own: Driven) -> Actuation:
    """The places of the numbers of each state among the parameters of what was written, and the program of what their ranges hold."""
    written: FileProgram = nodes.builder.written({CLAMPED: [one.raw for one in own.clamped]})
    columns = {value.key: column for column, value in enumerate(written.parameters)}
    actuators = nodes.tree.actuators
    clamps = tuple(Clamp(columns[one.share.key], columns[one.constant.key], *map(float, one.bounds)) for one in own.clamped)
    inputs = [(columns[key], one.number, one.has_activation) for one in actuators if (key := _input(one).key) in columns]
    return Actuation(
        inputs=tuple(inputs),
        controls=max((one.number for one in actuators), default=-1) + 1,
        control_ranges=tuple((one.number, _floats(one.control_range)) for one in actuators),
        activation_ranges=tuple((one.number, _floats(one.activation_range)) for one in actuators if one.has_activation),
        zones=Zones(clamps, written.program) if clamps else None,
    )


def _floats(bounds: tuple[Fraction, Fraction] | None) -> tuple[float, float] | None:
    return None if bounds is None else (float(bounds[0]), float(bounds[1]))
