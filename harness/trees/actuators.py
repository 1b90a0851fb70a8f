"""The forces of actuators, as terms of the equations of motion of a tree, and the numbers of these that each state has of its own.

The input of an actuator is such a number. A range has another few: what it holds counts ``share`` times, and each bound once where a state
lies beyond it.

Source: MuJoCo documentation, Computation, section Actuation model; XML reference, ``actuator/general`` and ``joint/actuatorfrcrange``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING

from harness.files.given import Given
from harness.files.joint_kinds import JointKind
from harness.files.tree import Actuator, Signed
from harness.programs.mechanisms.actuation import Actuation
from harness.programs.terms import Term, Vector, cross
from harness.trees.bodies.rigid import Spatial, spatial
from harness.trees.bodies.spatial import FileBuilder, FileProgram, of_quaternion, placed
from harness.trees.nodes import Kinematics

if TYPE_CHECKING:
    from harness.programs.mechanisms.clamps import Clamp

CLAMPED = "clamped"
# Generalised forces (nv,) of forces on the nodes.
Generalised = Callable[[Kinematics, Sequence[Spatial]], Vector]
_WHERE = 3


@dataclass(frozen=True)
class _Clamped:
    """A term held within a range; ``numbers`` are ``share``, ``constant`` and ``bounds`` of a ``Clamp``."""

    numbers: tuple[Given, ...]
    raw: Term


@dataclass
class Driven:
    """The forces of the actuators of a tree.

    Attributes:
        forces: (nv,) generalised. controls: ranges of controls, by actuator.
        clamped: those of forces, each before those that it is part of.
        alone: by actuator, its force in its range.
    """

    forces: Vector
    alone: dict[int, Term] = field(default_factory=dict)
    controls: dict[int, _Clamped] = field(default_factory=dict)
    clamped: list[_Clamped] = field(default_factory=list)


def driven(nodes: Kinematics, generalised: Generalised, carried: Vector) -> Driven:
    """The forces of the actuators of a tree, with the generalised forces (nv,) ``carried`` by which they compensate gravity."""
    found = Driven(nodes.builder.zeros(nodes.nv))
    for actuator in nodes.tree.actuators:
        moment = moment_of(nodes, actuator, generalised)
        force = _force(nodes, found, actuator, moment)
        if actuator.force_range is not None:
            held = _held(f"force of actuator {actuator.number}", actuator.force_range, force)
            force = _sum(nodes.builder, found.clamped, held)
        found.alone[actuator.number] = force
        found.forces = found.forces + force * moment
    found.forces = found.forces + carried
    for joint, bounds in nodes.tree.force_limits:
        for column in nodes.coordinates.columns.get(joint, ()) if nodes.tree.actuators else ():
            total = found.forces[column]
            if total.value != 0:
                found.forces[column] = _sum(nodes.builder, found.clamped, _held(f"force of actuators on {joint}", bounds, total))
    return found


def _held(what: str, bounds: tuple[Fraction, Fraction], raw: Term) -> _Clamped:
    """A force, or a control, in its range."""
    place = next(bound.place for bound in bounds if isinstance(bound, Given))
    own = (Given(1.0, place, f"{part} of {what}") for part in ("share", "constant", "times below", "times above"))
    ends = (bound if isinstance(bound, Given) else Given(float(bound), place, f"bound of {what}", end) for end, bound in enumerate(bounds))
    return _Clamped((*own, *ends), raw)


def _sum(builder: FileBuilder, clamped: list[_Clamped], held: _Clamped) -> Term:
    """The term of what a range holds, which is added to ``clamped``."""
    clamped.append(held)
    share, constant, below, above, low, high = map(builder.number, held.numbers)
    found: Term = share * held.raw + (constant + (below * low + above * high))
    return found


def _input(actuator: Actuator) -> Given:
    assert actuator.place is not None
    return Given(1.0, actuator.place, f"input of actuator {actuator.number}")


def _force(nodes: Kinematics, found: Driven, actuator: Actuator, moment: Vector) -> Term:
    builder, length = nodes.builder, nodes.builder.zero
    joints = {node.joint.name: node.joint for node in nodes.nodes}
    for name, multiple in actuator.joints:
        if joints[name].kind.is_single:
            length = length + builder.number(multiple) * nodes.coordinates.position(joints[name])
    length = builder.number(actuator.gear[0]) * length
    rate = moment @ nodes.coordinates.velocities
    gain, bias = (_affine(builder, numbers, length, rate) for numbers in (actuator.gain, actuator.bias))
    given = builder.number(_input(actuator))
    if actuator.control_range is not None and not actuator.has_activation:
        held, own = _held(f"control of actuator {actuator.number}", actuator.control_range, given), list[_Clamped]()
        given = _sum(builder, own, held)
        found.controls[actuator.number] = held
    force: Term = gain * given + bias
    return force


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
    # Mechanisms without actuators need nothing of it.
    from harness.programs.mechanisms.clamps import Clamp
    from harness.programs.mechanisms.zones import Zones

    written: FileProgram = nodes.builder.written({CLAMPED: [one.raw for one in own.clamped]})
    columns = {value.key: column for column, value in enumerate(written.parameters)}
    actuators = nodes.tree.actuators

    def clamp_of(one: _Clamped) -> Clamp:
        share, constant, *bounds = (columns.get(number.key, -1) for number in one.numbers)
        low, high = map(float, one.numbers[-2:])
        return Clamp(share, constant, low, high, tuple(bounds))

    clamps = tuple(map(clamp_of, own.clamped))
    inputs = [(columns[key], one.number, one.has_activation) for one in actuators if (key := _input(one).key) in columns]
    return Actuation(
        inputs=tuple(inputs),
        controls=max((one.number for one in actuators), default=-1) + 1,
        control_ranges=tuple((one.number, _floats(one.control_range)) for one in actuators),
        activation_ranges=tuple((one.number, _floats(one.activation_range)) for one in actuators if one.has_activation),
        clamped_controls=tuple((number, clamp_of(one)) for number, one in own.controls.items() if one.numbers[0].key in columns),
        zones=Zones(clamps, written.program) if clamps else None,
    )


def _floats(bounds: tuple[Fraction, Fraction] | None) -> tuple[float, float] | None:
    return None if bounds is None else (float(bounds[0]), float(bounds[1]))
