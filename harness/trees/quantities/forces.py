"""The mass matrix and generalised forces of a tree, along the world's axes.

Sources: Featherstone, Rigid Body Dynamics Algorithms, sections 5.3 (inverse dynamics) and 6.2 (composite rigid bodies); Goldstein,
Classical Mechanics, section 1.4 (d'Alembert's principle).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from harness.programs.terms import Term, Vector, cross, length, sqrt
from harness.trees.bodies.rigid import Spatial, joined, power
from harness.trees.bodies.spatial import Frame
from harness.trees.joint_forces import forces_of_joints
from harness.trees.nodes import composite_inertias
from harness.trees.quantities.tree_motion import Block, TreeMotion, size_of
from harness.trees.world_motion import Parts, World, parts_of_motion, root, size_of_wrench, weights, wrench


def mass_matrix(motion: TreeMotion) -> Iterator[Block]:
    """The entries of M, by rows, with the reflected inertias of joints.

    Source: Featherstone, section 6.2, in one frame.
    """
    entries, lengths = entries_of_mass(motion.world), _lengths_of_columns(motion)
    for i, one in enumerate(motion.columns):
        for j, other in enumerate(motion.columns):
            entry = entries.get((min(i, j), max(i, j)), motion.builder.zero)
            yield Block(f"entry of M for {one} and {other}", (entry,), lengths[i] * lengths[j])


def inverse_dynamics(motion: TreeMotion) -> Iterator[Block]:
    """The generalised force of each velocity that gives the accelerations, beside springs and dampers."""
    nodes = motion.world.kinematics
    parts = parts_of_motion(motion.world, nodes.coordinates.third)
    for number, pull in enumerate(motion.world.pulls()):
        parts[number].append(-pull)
    values, sizes = generalised(motion.world, range(len(motion.moving)), parts, parts)
    of_joints = forces_of_joints(nodes)
    for node in nodes.nodes:
        reflected = node.armature
        for column in node.columns:
            inertia = reflected * nodes.coordinates.third[column]
            values[column] = values[column] + inertia
            sizes[column] = sizes[column] + size_of(inertia)
    for column, name in enumerate(motion.columns):
        size = sizes[column] + size_of(of_joints[column])
        yield Block(f"generalised force on {name}", (values[column] - of_joints[column],), size)


def power_of_forces(motion: TreeMotion) -> Iterator[Block]:
    """What the forces of inverse dynamics do: kinetic and potential energy gain as much, beside what dampers take."""
    found = size = motion.builder.zero
    for velocity, block in zip(motion.world.kinematics.coordinates.velocities, inverse_dynamics(motion), strict=True):
        found = found + velocity * block.values[0]
        size = size + size_of(velocity) * block.size
    yield Block("power of the applied forces", (found,), size)


def bias(motion: TreeMotion) -> Iterator[Block]:
    """Velocity terms and gravity: what inverse dynamics without springs, dampers and accelerations ask for."""
    world = motion.world
    return _forces_of(motion, parts_of_motion(world, world.kinematics.builder.zeros(world.kinematics.nv)), "bias force")


def gravity(motion: TreeMotion) -> Iterator[Block]:
    """What holds the tree at rest against its weight."""
    return _forces_of(motion, weights(motion.world), "gravity force")


def _forces_of(motion: TreeMotion, parts: Parts, kind: str) -> Iterator[Block]:
    values, sizes = generalised(motion.world, range(len(motion.moving)), parts, parts)
    for name, value, size in zip(motion.columns, values, sizes, strict=True):
        yield Block(f"{kind} on {name}", (value,), size)


def generalised(world: World, numbers: Iterable[int], parts: Parts, that_cancel: Parts) -> tuple[Vector, Vector]:
    """The generalised force of each velocity of some nodes, and the sizes, of moments and forces on the bodies of nodes.

    ``that_cancel`` are as long as what cancels in the components of ``parts``.
    """
    builder = world.kinematics.builder
    values, sizes = builder.zeros(world.kinematics.nv), builder.zeros(world.kinematics.nv)
    for number in numbers:
        one = world.moving[number]
        force = wrench(world, parts, number, one.position)
        size_of_moment, size_of_force = size_of_wrench(world, that_cancel, number, one.position, root(world, number))
        for (about, along), column in one.rates:
            values[column] = values[column] + power(force, (about, along))
            for motion, size in ((about, size_of_moment), (along, size_of_force)):
                sizes[column] = sizes[column] + length(motion) * size
    return values, sizes


def entries_of_mass(world: World) -> dict[tuple[int, int], Term]:
    """The entries (i, j), i <= j, of the mass matrix that are not zero, in one frame."""
    moving, builder = world.moving, world.kinematics.builder

    def carried(number: int, wrench: Spatial) -> Iterator[tuple[int, Spatial]]:
        at, (moment, force) = number, wrench
        for before in world.up_from(number):
            yield at, (moment + cross(moving[number].position + -before.position, force), force)
            at = before.node.parent

    rigids = [joined(builder, (lump.about_origin(builder) for lump in one.lumps)) for one in moving]
    frames = [Frame(builder.identity, one.arm) for one in moving]
    return composite_inertias(world.kinematics, [one.motions for one in moving], rigids, frames, carried)


def _lengths_of_columns(motion: TreeMotion) -> Vector:
    """The length of each velocity's motion of all bodies in the metric of their masses, with all arms at their longest."""
    builder = motion.builder
    mass = inertia = builder.zero
    for number, one in enumerate(motion.moving):
        for lump in one.lumps:
            reach = motion.extent + (motion.from_root(number) + length(lump.centre))
            mass = mass + lump.mass
            inertia = inertia + lump.mass * (reach * reach)
            for row in lump.moments:
                inertia = inertia + length(row)
    turning, sliding = sqrt(inertia), sqrt(mass)
    found = builder.zeros(motion.world.kinematics.nv)
    for one in motion.moving:
        joint = one.node.joint
        reflected = size_of(builder.number(joint.multiplier) * sqrt(builder.number(joint.armature)))
        for (about, along), column in one.rates:
            found[column] = found[column] + ((length(about) * turning + length(along) * sliding) + reflected)
    return found
