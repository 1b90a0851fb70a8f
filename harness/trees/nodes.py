"""The joints of a tree as nodes, each with what moves with it, as terms of a program.

Source: Featherstone, Rigid Body Dynamics Algorithms, chapter 4 (trees and joint models).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from harness.files.given import Direction, Placement, Pose
from harness.files.joint_kinds import JointKind
from harness.files.tree import WORLD, Body, Coupling, Joint, Spring, Tree
from harness.programs.terms import Matrix, Term, Vector, cross, length, vector
from harness.trees.bodies.inertias import bounded
from harness.trees.bodies.rigid import Rigid, Spatial, Weights, joined, power, spatial
from harness.trees.bodies.spatial import FileBuilder, Frame, about, angle, direction, of_quaternion, placed, rotation


@dataclass
class Node:
    """One joint with what moves with it; its frame stands in the joint's anchor.

    Attributes:
        parent: index of the node before it, -1 for the world. frame: its frame in that of the parent.
        motions: the motion of the frame for each velocity; columns: their places in v.
        bias: the part of the acceleration of those motions that is due to their turning in the frame, for free joints.
        rigid: the bodies that move with it.
    """

    parent: int
    frame: Frame
    joint: Joint
    motions: list[Spatial]
    columns: list[int]
    bias: Spatial
    rigid: Rigid

    @property
    def rates(self) -> list[tuple[Spatial, int]]:
        """The motion of each velocity, and its place in v."""
        return list(zip(self.motions, self.columns, strict=True))

    def of_velocity(self, coefficient: str) -> Term:
        """A coefficient of the joint, of its velocity where that follows another one's: times the square of the multiplier."""
        builder = self.rigid.mass.builder
        multiplier = builder.number(self.joint.multiplier)
        return (multiplier * multiplier) * builder.number(getattr(self.joint, coefficient))

    def up(self, force: Spatial) -> Spatial:
        """A force on the node's frame, as one on the parent's."""
        moment, linear = self.frame.turn @ force[0], self.frame.turn @ force[1]
        return spatial(moment + cross(self.frame.shift, linear), linear)


@dataclass(frozen=True)
class Reflected:
    """An inertia of a rate that is no velocity of a body.

    Attributes:
        inertia: [kg m^2 or kg]. slopes: (place in v, by how much that velocity changes the rate).
        spring: whose length has the rate; None for a sum of velocities.
        related: pairs of places in v, smaller first, that the inertia couples; None for all.
    """

    inertia: Term
    slopes: Sequence[tuple[int, Term]]
    spring: Spring | None = None
    related: frozenset[tuple[int, int]] | None = None

    def couples(self, row: int, column: int) -> bool:
        """True where the entry of M of these places has a share of the inertia."""
        return self.related is None or (min(row, column), max(row, column)) in self.related

    def forces(self, rates: Sequence[Term]) -> Iterator[tuple[int, Term]]:
        """The share of M times these velocities or accelerations, by places in v."""
        for row, slope in self.slopes:
            felt = replace(self, slopes=[one for one in self.slopes if self.couples(row, one[0])])
            yield row, slope * (self.inertia * felt.rate(rates))

    def rate(self, velocities: Sequence[Term]) -> Term:
        """The rate at these velocities, or the part of its own rate that these accelerations make."""
        return sum((slope * velocities[column] for column, slope in self.slopes), self.inertia.builder.number(0))


@dataclass(frozen=True)
class Point:
    """A point of a body: the number of its node, the point in its frame and in the world, and the frame's orientation there."""

    number: int
    arm: Vector
    position: Vector
    orientation: Matrix


@dataclass(frozen=True)
class Coordinates:
    """The inputs of a tree's program: q, v, a third vector as long as v, further ones, and the time.

    Attributes:
        positions: by joint that moves by itself, in the order of q and v. columns: by joint, the places of its velocities in v.
        velocities, third: (nv,), the third vector holds applied forces or accelerations.
        is_in_body: whether the linear velocity of a free joint is given in the body's frame, instead of its parent's.
    """

    positions: Mapping[str, Vector]
    columns: Mapping[str, list[int]]
    velocities: Vector
    third: Vector
    further: Vector
    is_in_body: bool = False

    @classmethod
    def of(cls, kinds: Mapping[str, JointKind], q: Vector, velocities: Vector, *others: Any) -> Coordinates:
        """Those of joints in the order of q and v."""
        positions, columns, first, column = {}, {}, 0, 0
        for name, kind in kinds.items():
            positions[name] = q[first : first + kind.positions]
            columns[name] = list(range(column, column + kind.velocities))
            first, column = first + kind.positions, column + kind.velocities
        return cls(positions, columns, velocities, *others)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that move by themselves."""
        return tuple(self.columns)

    def position(self, joint: Joint) -> Term:
        """The position of a hinge or slide, of those that follow another too."""
        (place,) = self.positions[joint.follows or joint.name]
        multiplier = place.builder.number(joint.multiplier)
        found: Term = multiplier * place + joint.offset
        return found


@dataclass(frozen=True)
class Kinematics:
    """The joints of one tree as nodes, parents before their children.

    Attributes:
        frames: by body, the number of its node, -1 for the world's, and the body's frame in that of the node.
        weights: the inertia of its bodies.
    """

    builder: FileBuilder
    tree: Tree
    coordinates: Coordinates
    weights: Weights
    nodes: Sequence[Node]
    frames: Mapping[str, tuple[int, Frame]]

    @property
    def nv(self) -> int:
        """Number of velocities."""
        return len(self.coordinates.velocities)

    @property
    def still(self) -> Spatial:
        """No motion, and no force."""
        return self.builder.zeros(2, 3)

    def up_from(self, number: int) -> Iterator[int]:
        """A node, those before it, and the first of its tree."""
        while number >= 0:
            yield number
            number = self.nodes[number].parent

    def compensated(self, by_actuators: bool = False) -> list[tuple[int, Term, Vector]]:
        """Moving parts with gravity compensation: node, mass whose weight is carried, and its centre in the node's frame.

        Those on which a force acts upwards; or those ``by_actuators`` of some joints that carry them.
        """
        found = []
        for body in self.tree.bodies:
            number, frame = self.frames[body.name]
            if by_actuators is not any(self.nodes[at].joint.compensated_by_actuators for at in self.up_from(number)):
                continue
            for lump in self.weights.lumps(body) if body.gravity_compensation and number >= 0 else ():
                found.append((number, self.builder.number(body.gravity_compensation) * lump.mass, lump.in_frame(frame).centre))
        return found

    @property
    def related(self) -> frozenset[tuple[int, int]]:
        """Pairs (i, j), i <= j, of velocities one of which moves all that the other moves."""
        return frozenset(
            (min(i, j), max(i, j))
            for number, node in enumerate(self.nodes)
            for at in self.up_from(number)
            for i in node.columns
            for j in self.nodes[at].columns
        )

    def slopes(self, coupling: Coupling) -> list[tuple[int, Term]]:
        """The velocities of a coupling's joints by their places in v, and the multiple of each in the rate of its sum."""
        joints = {node.joint.name: node for node in self.nodes}
        own = [(joints[name], self.builder.number(multiple)) for name, multiple in coupling.joints]
        return [(node.columns[0], multiple * self.builder.number(node.joint.multiplier)) for node, multiple in own]

    def point(self, body: str, pose: Pose) -> Point:
        """The origin of a frame in a body."""
        number, frame = self.frames[body]
        arm = position = placed(self.builder, pose, frame).shift
        orientation = self.builder.identity
        for at in self.up_from(number):
            frame = self.nodes[at].frame
            position, orientation = frame.at(position), frame.turn @ orientation
        return Point(number, arm, position, orientation)

    def slopes_along(self, spring: Spring) -> list[tuple[int, Term]]:
        """The velocities that change the length of a spring by their places in v, and by how much each does."""
        ends = [self.point(body, pose) for body, pose in spring.ends]
        between = ends[1].position + -ends[0].position
        along, found = between / length(between), dict[int, Term]()
        branches = [list(self.up_from(end.number)) for end in ends]
        for own, other, end, sense in zip(branches, reversed(branches), ends, (-along, along), strict=True):
            force = end.orientation.T @ sense
            pull = spatial(cross(end.arm, force), force)
            # A joint that moves both ends changes no length.
            for node in (self.nodes[at] for at in own if at not in other):
                for motion, column in node.rates:
                    found[column] = found.get(column, self.builder.zero) + power(motion, pull)
                pull = node.up(pull)
        return list(found.items())

    def reflected(self) -> Iterator[Reflected]:
        """The inertias of rotors, and those of tendons."""
        for node in self.nodes:
            for column in node.columns if node.joint.armature else ():
                yield Reflected(self.builder.number(node.joint.armature), [(column, self.builder.number(node.joint.multiplier))])
        for coupling in self.tree.couplings:
            if coupling.armature:
                yield Reflected(self.of_gear(coupling, coupling.armature), self.slopes(coupling), None, self._related_by(coupling))
        for spring in self.tree.springs:
            if spring.armature:
                yield Reflected(self.builder.number(spring.armature), self.slopes_along(spring), spring, self._related_by(spring))

    def _related_by(self, part: Spring | Coupling) -> frozenset[tuple[int, int]] | None:
        return self.related if part.along_branches else None

    def of_gear(self, coupling: Coupling, coefficient: Fraction) -> Term:
        """A coefficient of what turns ``gear`` times as fast as the sum of a coupling, as that of the sum."""
        gear = self.builder.number(coupling.gear)
        return (gear * gear) * self.builder.number(coefficient)

    def with_tree(self, tree: Tree) -> Kinematics:
        """Another tree with the same joints, at the same coordinates."""
        return _grown(self.builder, tree, self.coordinates, self.weights)

    def at_zero(self) -> Kinematics:
        """The same tree in the position zero, where quaternions are 1."""
        kinds = joints_by_themselves(self.tree)
        positions = {name: _at_zero(self.builder, kinds[name]) for name in self.coordinates.joints}
        return _grown(self.builder, self.tree, replace(self.coordinates, positions=positions), self.weights)


def joints_by_themselves(tree: Tree) -> dict[str, JointKind]:
    """The kinds of the joints of a tree that follow no other."""
    return {joint.name: joint.kind for joint in tree.joints if not joint.follows}


def _at_zero(builder: FileBuilder, kind: JointKind) -> Vector:
    found = builder.zeros(kind.positions)
    if kind.has_attitude:
        found[-4] = builder.one
    return found


def standing(tree: Tree, positions: Mapping[str, Fraction] | None = None) -> Kinematics:
    """The nodes of a tree at rest in a program without inputs, where every joint has its reference.

    With ``positions`` [m or rad] its hinges and slides have those.
    """
    tree, builder = bounded(tree), FileBuilder(())
    joints = [joint for joint in tree.joints if not joint.follows]
    places = [_at_zero(builder, joint.kind) for joint in joints]
    for joint, values in zip(joints, places, strict=True):
        if joint.kind.is_single:
            own = angle(builder, joint.reference, joint.in_degrees) if positions is None else builder.number(positions[joint.name])
            values[0] = own
    kinds = joints_by_themselves(tree)
    rest = builder.zeros(sum(kind.velocities for kind in kinds.values()))
    coordinates = Coordinates.of(kinds, np.concatenate([rest[:0], *places]), rest, rest, rest[:0])
    return _grown(builder, tree, coordinates, Weights(builder, tree))


def kinematics(tree: Tree, joints: Sequence[str], is_in_body: bool = False, third: str = "tau", further: Sequence[str] = ()) -> Kinematics:
    """The nodes of a tree in a program of their own, whose inputs are those of ``Coordinates``: v and q follow ``joints``.

    Raises:
        ValueError: the tree has other joints.
    """
    order, own = tuple(dict.fromkeys(joints)), joints_by_themselves(tree)
    if sorted(order) != sorted(own):
        raise ValueError(f"the tree has the joints {sorted(own)}; expected {sorted(order)}")
    kinds = {name: own[name] for name in order}
    nq, nv = (sum(kind.sizes[part] for kind in kinds.values()) for part in range(2))
    sizes = {"q": nq, "v": nv, third: nv}
    builder = FileBuilder([*(f"{kind}{place}" for kind, size in sizes.items() for place in range(size)), *further, "t"])
    q, v, given, others = np.split(vector(builder.inputs[:-1]), [nq, nq + nv, nq + 2 * nv])
    tree = bounded(tree)
    return _grown(builder, tree, Coordinates.of(kinds, q, v, given, others, is_in_body), Weights(builder, tree))


def _grown(builder: FileBuilder, tree: Tree, coordinates: Coordinates, weights: Weights) -> Kinematics:
    nodes: list[Node] = []
    frames = {WORLD: (-1, Frame(builder.identity, builder.still))}
    for body in tree.bodies:
        number, frame = frames[body.name] = _grow(builder, coordinates, nodes, frames[body.parent], body)
        for part in weights.parts(body) if number >= 0 else ():
            nodes[number].rigid = nodes[number].rigid + part.moved(frame)
    return Kinematics(builder, tree, coordinates, weights, nodes, frames)


def _grow(builder: FileBuilder, coordinates: Coordinates, nodes: list[Node], parent: tuple[int, Frame], body: Body) -> tuple[int, Frame]:
    """Add the nodes of a body's joints; the last of them, and the body's frame in it."""
    number, frame = parent[0], placed(builder, body.pose, parent[1])
    for joint in body.joints:
        own = placed(builder, joint.pose)
        anchor = own.at(builder.vector(joint.anchor))
        axis = own.turn @ direction(builder, joint.axis) if any(joint.axis) else builder.still
        nodes.append(_node(builder, coordinates, number, Frame(frame.turn, frame.at(anchor)), joint, axis))
        number, frame = len(nodes) - 1, Frame(builder.identity, -anchor)
    return number, frame


def _node(builder: FileBuilder, coordinates: Coordinates, parent: int, at: Frame, joint: Joint, axis: Vector) -> Node:
    """The node of a joint whose frame at zero is ``at``, in that of the parent, and whose unit axis is given in that frame."""
    name, kind, turn, shift, still = joint.follows or joint.name, joint.kind, at.turn, at.shift, builder.still
    positions, columns = coordinates.positions[name], coordinates.columns[name]
    rates = coordinates.velocities[columns]
    bias = spatial(still, still)
    if kind.is_single:
        multiplier = builder.number(joint.multiplier)
        position = coordinates.position(joint)
        moved, felt = position - angle(builder, joint.reference, joint.in_degrees), multiplier * axis
        if kind.turning[0]:
            turn, motions = turn @ about(axis, moved), [spatial(felt, still)]
        else:
            shift, motions = shift + turn @ (moved * axis), [spatial(still, felt)]
    elif kind.has_axis:
        along = rotation(builder, Placement(rotation=(Direction(joint.axis),))).T
        own = about(axis, positions[2])
        moved = positions[0] * along[0] + positions[1] * along[1]
        shift, turn = shift + turn @ moved, turn @ own
        motions = [*(spatial(still, own.T @ row) for row in along[:2]), spatial(axis, still)]
        rate = rates[0] * along[0] + rates[1] * along[1]
        # The velocity is given in the frame that does not turn.
        bias = spatial(still, -cross(rates[2] * axis, own.T @ rate))
    else:
        if kind.linear:
            shift = shift + turn @ positions[:3]
        own = of_quaternion(positions[-4:])
        turn = turn @ own
        motions = [spatial(row, still) for row in builder.identity]
        if kind.linear:
            motions = [*(spatial(still, row) for row in (builder.identity if coordinates.is_in_body else own)), *motions]
        if kind.linear and not coordinates.is_in_body:
            # The velocity is given in the parent's frame, which turns in the body's.
            bias = spatial(still, -cross(rates[3:], own.T @ rates[:3]))
    return Node(parent, Frame(turn, shift), joint, motions, columns, bias, joined(builder, ()))


def composite_inertias(
    nodes: Kinematics,
    rates: Sequence[Sequence[tuple[Spatial, int]]],
    rigids: Sequence[Rigid],
    frames: Sequence[Frame],
    carried: Callable[[int, Spatial], Iterable[tuple[int, Spatial]]],
) -> dict[tuple[int, int], Term]:
    """The entries (i, j), i <= j, of the mass matrix that are not zero, with the reflected inertias of joints.

    Of each node: the motions of its velocities with their places in v, the inertia of its bodies, and its frame in that of its parent,
    along the axes in which these are given. ``carried`` has a force on a node as one on it and on each node before it, with their numbers.

    Source: Featherstone, Rigid Body Dynamics Algorithms, section 6.2 (composite rigid bodies).
    """
    builder, composite = nodes.builder, list(rigids)
    entries: dict[tuple[int, int], Term] = {}
    for number in reversed(range(len(composite))):
        node = nodes.nodes[number]
        if node.parent >= 0:
            composite[node.parent] = composite[node.parent] + composite[number].moved(frames[number])
        for place, (motion, column) in enumerate(rates[number]):
            for at, force in carried(number, composite[number].momentum(motion)):
                for other, row in rates[at][: place + 1] if at == number else rates[at]:
                    # Joints that mimic another share its column: both products are part of its entry.
                    times = builder.number(2 if row == column and at != number else 1)
                    entry = min(row, column), max(row, column)
                    entries[entry] = entries.get(entry, builder.zero) + times * power(other, force)
    for one in nodes.reflected():
        for at, (column, slope) in enumerate(one.slopes):
            for before, (row, other) in enumerate(one.slopes[: at + 1]):
                times = builder.number(2 if row == column and before != at else 1)
                entry = min(row, column), max(row, column)
                if not one.couples(row, column):
                    continue
                entries[entry] = entries.get(entry, builder.zero) + one.inertia * (times * (slope * other))
    return entries
