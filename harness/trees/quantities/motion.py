"""Quantities of a tree beside accelerations, as programs of positions, velocities, accelerations and the numbers of a file.

Everything is written along the world's axes, in blocks: a number, or a vector whose length says how large an error is. Each block
comes with how large the parts are that an algorithm may form of it and cancel, which no derivative shows. Algorithms add the
arms of a tree one after another, take momenta about a point of their own choice, as the centre of mass of the whole tree, and
turn vectors from frame to frame; so an arm counts with the sum of the lengths on the way to it.

Energies, momenta, and the frames of bodies are here, forces in ``forces``.

Sources: Featherstone, Rigid Body Dynamics Algorithms, section 2.5 (velocities), chapters 5 and 6 (inverse dynamics, composite rigid
bodies); Goldstein, Classical Mechanics, sections 1.1 and 1.2 (momentum, energy), 5.1 and 5.3 (rigid bodies).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

from harness.files.tree import Tree
from harness.programs.program import StraightLineProgram
from harness.programs.terms import Term, Vector, cross, length, vector
from harness.trees.bodies.rigid import Spatial, spatial
from harness.trees.bodies.spatial import FileProgram
from harness.trees.nodes import Reflected, kinematics
from harness.trees.recursion import coupled, position_and_rest, stretched, taut
from harness.trees.world_motion import World, in_world, root


@dataclass(frozen=True)
class Block:
    """A vector of a quantity.

    Attributes:
        name: as a report says it. values: its components. size: how large the parts are that cancel in it.
    """

    name: str
    values: Sequence[Term]
    size: Term


@dataclass(frozen=True)
class ComputedQuantity(FileProgram):
    """The blocks of a quantity as programs.

    The program takes q, v, qdd, multipliers of constraints, time and the parameters; its outputs are the components of the blocks, one
    after another.

    Attributes:
        sizes: from the same inputs; its outputs are the sizes of the blocks.
        blocks: what each block is. width: the number of components of each.
    """

    sizes: StraightLineProgram
    blocks: tuple[str, ...]
    width: int


@dataclass(frozen=True)
class TreeMotion(World):
    """The bodies of one tree as they move at given accelerations, and how large the parts of their motion are.

    Attributes:
        anchors: by joint, the point that moves with its body. last: by joint, the last joint of its body.
    """

    anchors: Mapping[str, Vector]
    last: Mapping[str, str]

    @property
    def columns(self) -> list[str]:
        """The name of each velocity."""
        counts = {name: len(columns) for name, columns in self.kinematics.coordinates.columns.items()}
        return [f"joint {name!r}" + (f"[{place}]" if count > 1 else "") for name, count in counts.items() for place in range(count)]

    def named(self) -> Iterator[tuple[int, str]]:
        """The joints that have velocities of their own, in the order of these, each with the node that moves with its body."""
        numbers = {one.node.joint.name: number for number, one in enumerate(self.moving)}
        for name in self.kinematics.coordinates.joints:
            yield numbers[self.last[name]], name

    # Sizes.

    @cached_property
    def extent(self) -> Term:
        """The distance of the centre of mass from the roots, at most."""
        first = mass = self.kinematics.builder.zero
        for number, one in enumerate(self.moving):
            for lump in one.lumps:
                reach = self.from_root(number) + length(lump.centre)
                first, mass = first + lump.mass * reach, mass + lump.mass
        return first / mass

    def from_root(self, number: int) -> Term:
        """The length of the way from the first joint of the tree to a node."""
        *way, _ = self.up_from(number)
        return sum((length(one.arm) for one in way), self.kinematics.builder.zero)

    def distance(self, number: int) -> Term:
        """The length of the way from the world's origin to a node."""
        return self.from_root(number) + length(root(self, number))

    def reach_of(self, number: int, point: Vector) -> Term:
        return self.distance(number) + length(point + -self.moving[number].position)

    def sizes_of_columns(self, number: int, point: Vector) -> dict[int, tuple[Term, Term]]:
        """Sizes of the columns of the Jacobian of a point of a node's body, and of its spin, with arms taken from anywhere in the tree."""
        reach = self.extent + (self.from_root(number) + length(point + -self.moving[number].position))
        found: dict[int, tuple[Term, Term]] = {}
        for one in self.up_from(number):
            for (about, along), column in one.rates:
                linear, angular = found.get(column, (self.kinematics.builder.zero, self.kinematics.builder.zero))
                turning = length(about)
                sliding = length(along) + turning * reach
                found[column] = linear + sliding, angular + turning
        return found

    def speeds(self, number: int, point: Vector, rates: Vector | None = None) -> tuple[Term, Term]:
        """Sizes of the parts of the velocity of a point of a node's body, and of its spin, at v or at other ``rates``."""
        speed = spin = self.kinematics.builder.zero
        rates = self.kinematics.coordinates.velocities if rates is None else rates
        for column, (linear, angular) in self.sizes_of_columns(number, point).items():
            rate = size_of(rates[column])
            speed, spin = speed + rate * linear, spin + rate * angular
        return speed, spin

    def sizes_of_slopes(self, own: Reflected) -> dict[int, Term]:
        """Sizes of what cancels in the slopes of a reflected inertia, by the places of velocities: either end moves by itself."""
        zero, found = self.kinematics.builder.zero, dict[int, Term]()
        if own.spring is None:
            for column, slope in own.slopes:
                found[column] = found.get(column, zero) + size_of(slope)
            return found
        for number, _, position, _ in (self.end(body, pose) for body, pose in own.spring.ends):
            for column, (linear, _) in self.sizes_of_columns(number, position).items() if number >= 0 else ():
                found[column] = found.get(column, zero) + linear
        return found

    def size_of_rate(self, own: Reflected, velocities: Sequence[Term]) -> Term:
        """Size of what cancels in the rate of a reflected inertia."""
        sizes = self.sizes_of_slopes(own)
        return sum((size * size_of(velocities[column]) for column, size in sizes.items()), self.kinematics.builder.zero)


def size_of(value: Term) -> Term:
    """|value|."""
    return length(vector((value,)))


def tree_motion(
    tree: Tree,
    joints: Sequence[str],
    is_in_body: bool,
    read: Tree | None = None,
    has_other_points: bool = False,
    multipliers: int = 0,
) -> TreeMotion:
    """The motion of a tree, each of whose joints moves by itself; its program takes q, v, qdd, so many multipliers, and the time.

    ``read`` is another tree of the same joints, whose bodies and anchors are asked for: what is one body with two joints in one file is two
    bodies in another. ``has_other_points``: whether its anchors are other points, see ``have_same_points``.
    """
    further = [f"lambda{place}" for place in range(multipliers)]
    world = in_world(kinematics(tree, joints, is_in_body, "qdd", further))
    read = world.kinematics.tree if read is None else read
    # Another point is a number of another file, with roundings of its own.
    anchors = world.of_other(read).points if has_other_points else world.points
    return TreeMotion(
        world.kinematics, world.moving, anchors, {joint.name: body.joints[-1].name for body in read.bodies for joint in body.joints}
    )


def computed(motion: TreeMotion, blocks_of: Callable[[TreeMotion], Iterable[Block]]) -> ComputedQuantity:
    """The programs of a quantity's blocks, all of one width."""
    blocks, builder = list(blocks_of(motion)), motion.kinematics.builder
    own = builder.written({"values": [value for block in blocks for value in block.values]})
    sizes = builder.written({"sizes": [block.size for block in blocks]})
    return ComputedQuantity(own.program, own.parameters, sizes.program, tuple(block.name for block in blocks), len(blocks[0].values))


def have_same_points(tree: Tree, other: Tree, joints: Sequence[str]) -> bool:
    """True where the anchors of ``TreeMotion`` are the same in two trees, wherever these stand."""
    places = [_points_at_one_position(one, joints) for one in (tree, other)]
    return places[0].keys() == places[1].keys() and all(
        a.overlaps(b) for name in places[0] for a, b in zip(places[0][name], places[1][name], strict=True)
    )


def _points_at_one_position(tree: Tree, joints: Sequence[str]) -> dict[str, list[Any]]:
    """The points in balls, at a position that no two trees agree at by chance."""
    world = in_world(kinematics(tree, joints))
    coordinates = world.kinematics.coordinates
    count = sum(map(len, coordinates.positions.values())) + 2 * world.kinematics.nv + 1
    return world.kinematics.builder.evaluated(world.points, 256, [math.sqrt(place + 2.0) for place in range(count)])


# Energies and momenta.


def energy(motion: TreeMotion) -> Iterator[Block]:
    """Kinetic energy, and potential energy beyond that of the position zero, of gravity and springs."""
    kinetic = size = motion.kinematics.builder.zero
    half = motion.kinematics.builder.number(Fraction(1, 2))
    for number, one in enumerate(motion.moving):
        for lump in one.lumps:
            velocity = one.velocity_at(lump.centre)
            turning = one.spin @ (lump.moments @ one.spin)
            kinetic = kinetic + (lump.mass * (velocity @ velocity) + turning)
            speed, _ = motion.speeds(number, one.position + lump.centre)
            size = size + (lump.mass * (speed * speed) + turning)
    velocities = motion.kinematics.coordinates.velocities
    for own in motion.kinematics.reflected():
        for column, force in own.forces(velocities):
            kinetic = kinetic + velocities[column] * force
        felt = motion.size_of_rate(own, velocities)
        size = size + own.inertia * (felt * felt)
    yield Block("kinetic energy", (half * kinetic,), half * size)
    potential, size = _potential(motion)
    at_zero, size_at_zero = _potential(in_world(motion.kinematics.at_zero()))
    yield Block("potential energy", (potential - at_zero,), size + size_at_zero)


def momentum(motion: TreeMotion) -> Iterator[Block]:
    """Momentum, and moments of momentum about the world's origin and about the centre of mass, of all that moves."""
    linear = about_origin = first = motion.still
    mass = size = size_about_origin = motion.kinematics.builder.zero
    for number, one in enumerate(motion.moving):
        for lump in one.lumps:
            position = one.position + lump.centre
            push = lump.mass * one.velocity_at(lump.centre)
            own = lump.moments @ one.spin
            linear, first = linear + push, first + lump.mass * position
            about_origin = about_origin + (own + cross(position, push))
            mass = mass + lump.mass
            speed, _ = motion.speeds(number, one.position + lump.centre)
            of_push = lump.mass * speed
            size = size + of_push
            reach = motion.distance(number) + length(lump.centre)
            size_about_origin = size_about_origin + (length(own) + reach * of_push)
    centre = first / mass
    about_centre = about_origin + -cross(centre, linear)
    yield Block("linear momentum", linear, size)
    yield Block("angular momentum about the origin", about_origin, size_about_origin)
    of_shift = length(centre) * size
    yield Block("angular momentum about the centre of mass", about_centre, size_about_origin + of_shift)


def _potential(world: World) -> tuple[Term, Term]:
    """Potential energy [J] of a configuration, and its size."""
    builder = world.kinematics.builder
    gravity, half = builder.vector(world.kinematics.tree.gravity), builder.number(Fraction(1, 2))
    found = size = builder.zero
    for one in world.moving:
        for lump in one.lumps:
            position = one.position + lump.centre
            found = found - lump.mass * (gravity @ position)
            weight = lump.mass * length(gravity)
            size = size + weight * (length(one.position) + length(lump.centre))
    for stiffness, squared, parts in _springs(world):
        found = found + half * (stiffness * squared)
        reach = sum((size_of(part) for part in parts), builder.zero)
        size = size + stiffness * (reach * reach)
    return found, size


def _springs(world: World) -> Iterator[tuple[Term, Term, list[Term]]]:
    """Stiffness of each spring, the square of its extension, and the lengths or angles of which that is the difference."""
    nodes, builder = world.kinematics, world.kinematics.builder
    for node in nodes.nodes:
        if not node.joint.stiffness:
            continue
        stretch, parts = stretched(nodes, node.joint), list[Term]()
        if node.joint.kind.is_single:
            parts += position_and_rest(nodes, node.joint)
        else:
            # The way from the origin to where the body started is no longer than that to where it is, and from there.
            parts += [*stretch, *nodes.coordinates.positions[node.joint.name][:-4]]
        yield builder.number(node.joint.stiffness), stretch @ stretch, parts
    for coupling in nodes.tree.couplings:
        total, rest, _, _ = coupled(nodes, coupling)
        stretch, _ = taut(total, rest, coupling.slack_to)
        yield builder.number(coupling.stiffness), stretch * stretch, [total, rest]
    for spring in nodes.tree.springs:
        first, second = (world.end(body, pose)[2] for body, pose in spring.ends)
        distance, free = length(second + -first), builder.number(spring.free_length)
        reaches = [length(first), length(second)]
        stretch, _ = taut(distance, free, spring.slack_to)
        yield builder.number(spring.stiffness), stretch * stretch, [*reaches, free]


# Frames of bodies.


def positions(motion: TreeMotion) -> Iterator[Block]:
    """Anchor of each joint that moves with its body, and the rotation of its body from the position zero."""
    before = in_world(motion.kinematics.at_zero()).moving
    for number, name in motion.named():
        orientation, anchor = motion.moving[number].orientation, motion.anchors[name]
        yield Block(f"position at joint {name!r}", anchor, motion.reach_of(number, anchor))
        turned = orientation @ before[number].orientation.T
        for axis, column in zip("xyz", turned.T, strict=True):
            yield Block(f"orientation of {axis} at joint {name!r}", column, motion.kinematics.builder.one)


def velocities(motion: TreeMotion) -> Iterator[Block]:
    """Velocity of each joint's anchor that moves with its body, and the angular velocity of the body."""
    for number, name in motion.named():
        one, anchor = motion.moving[number], motion.anchors[name]
        velocity = one.velocity_at(anchor + -one.position)
        speed, spin = motion.speeds(number, anchor)
        yield Block(f"velocity at joint {name!r}", velocity, speed)
        yield Block(f"angular velocity at joint {name!r}", one.spin, spin)


def jacobians(motion: TreeMotion) -> Iterator[Block]:
    """Jacobians of the ``velocities`` of each joint."""
    still, nothing = motion.kinematics.still, (motion.kinematics.builder.zero, motion.kinematics.builder.zero)
    for number, name in motion.named():
        anchor = motion.anchors[name]
        columns: dict[int, Spatial] = dict.fromkeys(range(len(motion.columns)), still)
        for one in motion.up_from(number):
            arm = anchor + -one.position
            for (angular, linear), column in one.rates:
                columns[column] = columns[column] + spatial(linear + cross(angular, arm), angular)
        sizes = motion.sizes_of_columns(number, anchor)
        for column, other in enumerate(motion.columns):
            linear, angular = columns[column]
            size, turning = sizes.get(column, nothing)
            yield Block(f"velocity at joint {name!r} by {other}", linear, size)
            yield Block(f"angular velocity at joint {name!r} by {other}", angular, turning)
