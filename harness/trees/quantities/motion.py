"""Energies, momenta, and the frames of bodies of a tree, along the world's axes.

Sources: Goldstein, Classical Mechanics, sections 1.1 and 1.2 (momentum, energy), 5.1 and 5.3 (rigid bodies); Featherstone, Rigid
Body Dynamics Algorithms, section 2.5 (velocities).
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from harness.programs.terms import Term, cross, length
from harness.trees.bodies.rigid import Spatial, spatial
from harness.trees.joint_forces import coupled, position_and_rest
from harness.trees.quantities.tree_motion import Block, TreeMotion, size_of
from harness.trees.world_motion import World, in_world

# Energies and momenta.


def energy(motion: TreeMotion) -> Iterator[Block]:
    """Kinetic energy, and potential energy beyond that of the position zero, of gravity and springs."""
    kinetic = size = motion.builder.zero
    half = motion.builder.number(Fraction(1, 2))
    for number, one in enumerate(motion.moving):
        for lump in one.lumps:
            velocity = one.velocity_at(lump.centre)
            turning = one.spin @ (lump.moments @ one.spin)
            kinetic = kinetic + (lump.mass * (velocity @ velocity) + turning)
            speed, _ = motion.speeds(number, one.position + lump.centre)
            size = size + (lump.mass * (speed * speed) + turning)
        reflected = one.node.armature
        for column in one.node.columns:
            rate = motion.world.kinematics.coordinates.velocities[column]
            turning = reflected * (rate * rate)
            kinetic, size = kinetic + turning, size + turning
    yield Block("kinetic energy", (half * kinetic,), half * size)
    potential, size = _potential(motion.world)
    at_zero, size_at_zero = _potential(in_world(motion.world.kinematics.at_zero()))
    yield Block("potential energy", (potential - at_zero,), size + size_at_zero)


def momentum(motion: TreeMotion) -> Iterator[Block]:
    """Momentum, and moments of momentum about the world's origin and about the centre of mass, of all that moves."""
    linear = about_origin = first = motion.world.still
    mass = size = size_about_origin = motion.builder.zero
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
    for stiffness, stretch, parts in _springs(world):
        found = found + half * (stiffness * (stretch * stretch))
        reach = sum((size_of(part) for part in parts), builder.zero)
        size = size + stiffness * (reach * reach)
    return found, size


def _springs(world: World) -> Iterator[tuple[Term, Term, list[Term]]]:
    """Of each spring its stiffness, how far it is stretched, and what that is the difference of."""
    nodes, builder = world.kinematics, world.kinematics.builder
    for node in nodes.nodes:
        if node.joint.stiffness and node.joint.kind.is_single:
            position, rest = position_and_rest(nodes, node.joint)
            yield builder.number(node.joint.stiffness), position - rest, [position, rest]
    for coupling in nodes.tree.couplings:
        total, rest, _, _ = coupled(nodes, coupling)
        yield builder.number(coupling.stiffness), total - rest, [total, rest]
    for spring in nodes.tree.springs:
        first, second = (world.end(body, pose)[2] for body, pose in spring.ends)
        distance, free = length(second + -first), builder.number(spring.free_length)
        reaches = [length(first), length(second)]
        yield builder.number(spring.stiffness), distance - free, [*reaches, free]


# Frames of bodies.


def positions(motion: TreeMotion) -> Iterator[Block]:
    """Of each joint the anchor that moves with its body, and how its body is turned from where it stands at zero."""
    before = in_world(motion.world.kinematics.at_zero()).moving
    for number, name in motion.named():
        orientation, anchor = motion.moving[number].orientation, motion.anchors[name]
        yield Block(f"position at joint {name!r}", anchor, motion.reach_of(number, anchor))
        turned = orientation @ before[number].orientation.T
        for axis, column in zip("xyz", turned.T, strict=True):
            yield Block(f"orientation of {axis} at joint {name!r}", column, motion.builder.one)


def velocities(motion: TreeMotion) -> Iterator[Block]:
    """Of each joint the velocity of the anchor that moves with its body, and the angular velocity of the body."""
    for number, name in motion.named():
        one, anchor = motion.moving[number], motion.anchors[name]
        velocity = one.velocity_at(anchor + -one.position)
        speed, spin = motion.speeds(number, anchor)
        yield Block(f"velocity at joint {name!r}", velocity, speed)
        yield Block(f"angular velocity at joint {name!r}", one.spin, spin)


def jacobians(motion: TreeMotion) -> Iterator[Block]:
    """Of each joint what each velocity adds to those of ``velocities``."""
    still, nothing = motion.world.kinematics.still, (motion.builder.zero, motion.builder.zero)
    for number, name in motion.named():
        anchor = motion.anchors[name]
        columns: dict[int, Spatial] = dict.fromkeys(range(len(motion.columns)), still)
        for one in motion.world.up_from(number):
            arm = anchor + -one.position
            for (angular, linear), column in one.rates:
                columns[column] = columns[column] + spatial(linear + cross(angular, arm), angular)
        sizes = motion.sizes_of_columns(number, anchor)
        for column, other in enumerate(motion.columns):
            linear, angular = columns[column]
            size, turning = sizes.get(column, nothing)
            yield Block(f"velocity at joint {name!r} by {other}", linear, size)
            yield Block(f"angular velocity at joint {name!r} by {other}", angular, turning)
