"""The mass matrix and the forces of a tree, along the world's axes: generalised ones, those that joints transmit, and the regressor.

The reaction of a joint is what the parent does to the child through it: what everything behind the joint needs for its motion,
beyond its weight, the springs between points that pull at it, and the constraints that hold it. The joint torque regressor is the
derivatives of inverse dynamics by the inertial parameters of bodies, in which it is linear.

Sources: Featherstone, Rigid Body Dynamics Algorithms, sections 2.13 (inertial parameters), 5.3 (inverse dynamics) and 6.2 (composite
rigid bodies); Goldstein, Classical Mechanics, sections 1.1 and 1.2 (momentum and angular momentum of a system of particles) and 1.4
(d'Alembert's principle); Atkeson, An, Hollerbach, Estimation of inertial parameters of manipulator loads and links, IJRR 5 (1986).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from harness.files.equalities import Equality
from harness.files.joint_kinds import JointKind
from harness.files.tree import Tree
from harness.programs.terms import Term, Vector, cross, length, sqrt
from harness.trees.bodies.rigid import Lump, Spatial, joined, power, spatial
from harness.trees.bodies.spatial import Frame
from harness.trees.nodes import composite_inertias, joints_by_themselves
from harness.trees.quantities.motion import Block, TreeMotion, size_of
from harness.trees.recursion import drift, forces_of_joints, of_reflected_inertias
from harness.trees.rows import rows_in, rows_of
from harness.trees.world_motion import (
    Parts,
    World,
    accelerations_of_nodes,
    cancelling_in_motion,
    parts_of_motion,
    root,
    size_of_wrench,
    weights,
    wrench,
)


def mass_matrix(motion: TreeMotion) -> Iterator[Block]:
    """The entries of M, by rows, with the reflected inertias of joints.

    Source: Featherstone, section 6.2, in one frame.
    """
    entries, lengths = entries_of_mass(motion), _lengths_of_columns(motion)
    for i, one in enumerate(motion.columns):
        for j, other in enumerate(motion.columns):
            entry = entries.get((min(i, j), max(i, j)), motion.kinematics.builder.zero)
            yield Block(f"entry of M for {one} and {other}", (entry,), lengths[i] * lengths[j])


def inverse_dynamics(motion: TreeMotion) -> Iterator[Block]:
    """The generalised force of each velocity that gives the accelerations, beside springs and dampers."""
    nodes = motion.kinematics
    parts = parts_of_motion(motion, nodes.coordinates.third)
    for number, pull in enumerate(motion.pulls()):
        parts[number].append(-pull)
    values, sizes = generalised(motion, range(len(motion.moving)), parts, cancelling_in_motion(motion, parts))
    of_joints = forces_of_joints(nodes)
    for own in nodes.reflected():
        felt = motion.size_of_rate(own, nodes.coordinates.third)
        for column, force in own.forces(nodes.coordinates.third):
            values[column] = values[column] + force
        for column, size in motion.sizes_of_slopes(own).items():
            sizes[column] = sizes[column] + size * (own.inertia * felt)
    turning, of_turning = of_reflected_inertias(nodes), _sizes_of_reflected_inertias(motion)
    for column, name in enumerate(motion.columns):
        size = sizes[column] + size_of(of_joints[column]) + (size_of(turning[column]) + of_turning[column])
        values[column] = values[column] + turning[column]
        yield Block(f"generalised force on {name}", (values[column] - of_joints[column],), size)


def power_of_forces(motion: TreeMotion) -> Iterator[Block]:
    """Power of the forces of inverse dynamics: kinetic and potential energy gain as much, beside what dampers take."""
    found = size = motion.kinematics.builder.zero
    for velocity, block in zip(motion.kinematics.coordinates.velocities, inverse_dynamics(motion), strict=True):
        found = found + velocity * block.values[0]
        size = size + size_of(velocity) * block.size
    yield Block("power of the applied forces", (found,), size)


def bias(motion: TreeMotion) -> Iterator[Block]:
    """Velocity terms and gravity: what inverse dynamics without springs, dampers and accelerations ask for."""
    still = motion.kinematics.builder.zeros(motion.kinematics.nv)
    further, sizes = of_reflected_inertias(motion.kinematics), _sizes_of_reflected_inertias(motion)
    parts = parts_of_motion(motion, still)
    return _forces_of(motion, parts, cancelling_in_motion(motion, parts), "bias force", (further, sizes))


def gravity(motion: TreeMotion) -> Iterator[Block]:
    """Forces that hold the tree at rest against its weight."""
    nothing = motion.kinematics.builder.zeros(motion.kinematics.nv)
    return _forces_of(motion, weights(motion), weights(motion), "gravity force", (nothing, nothing))


def _forces_of(motion: TreeMotion, parts: Parts, cancelling: Parts, kind: str, further: tuple[Vector, Vector]) -> Iterator[Block]:
    """Those of ``parts``, in which ``cancelling`` ones cancel, and ``further`` ones with their sizes."""
    values, sizes = generalised(motion, range(len(motion.moving)), parts, cancelling)
    for name, value, size, more, other in zip(motion.columns, values, sizes, *further, strict=True):
        yield Block(f"{kind} on {name}", (value + more,), size + (size_of(more) + other))


def _sizes_of_reflected_inertias(motion: TreeMotion) -> Vector:
    """Sizes of what cancels in ``of_reflected_inertias`` of tendons between points: the accelerations of either end, and its velocity."""
    builder, found = motion.kinematics.builder, motion.kinematics.builder.zeros(motion.kinematics.nv)
    for own in motion.kinematics.reflected():
        if own.spring is None:
            continue
        ends = [motion.end(body, pose) for body, pose in own.spring.ends]
        nothing = builder.zero, builder.zero
        speeds = [motion.speeds(number, position) if number >= 0 else nothing for number, _, position, _ in ends]
        # Twice for what turns in an end's frame, as of Coriolis.
        drawn = sum((builder.number(2) * (spin * speed) for speed, spin in speeds), builder.zero)
        relative = sum((speed for speed, _ in speeds), builder.zero)
        drift = drawn + (relative * relative) / length(ends[1][2] + -ends[0][2])
        for column, size in motion.sizes_of_slopes(own).items():
            found[column] = found[column] + size * (own.inertia * drift)
    return found


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
    return composite_inertias(world.kinematics, [one.rates for one in moving], rigids, frames, carried)


def _lengths_of_columns(motion: TreeMotion) -> Vector:
    """The length of each velocity's motion of all bodies in the metric of their masses, with all arms at their longest."""
    builder = motion.kinematics.builder
    mass = inertia = builder.zero
    for number, one in enumerate(motion.moving):
        for lump in one.lumps:
            reach = motion.extent + (motion.from_root(number) + length(lump.centre))
            mass = mass + lump.mass
            inertia = inertia + lump.mass * (reach * reach)
            for row in lump.moments:
                inertia = inertia + length(row)
    turning, sliding = sqrt(inertia), sqrt(mass)
    found = builder.zeros(motion.kinematics.nv)
    for one in motion.moving:
        for (about, along), column in one.rates:
            found[column] = found[column] + (length(about) * turning + length(along) * sliding)
    for own in motion.kinematics.reflected():
        for column, size in motion.sizes_of_slopes(own).items():
            found[column] = found[column] + size * sqrt(own.inertia)
    return found


# Reactions.


def transmitting_joints(tree: Tree) -> list[str]:
    """The joints that transmit something: all but free ones that move by themselves, in the tree's order."""
    return [name for name, kind in joints_by_themselves(tree).items() if kind != JointKind.FREE]


def reactions(
    motion: TreeMotion, points_of: Tree | None = None, constraints: Sequence[Equality] = (), bearing: Sequence[int] = ()
) -> Iterator[Block]:
    """Forces [N], and then moments [N m] about their points, of ``transmitting_joints``.

    The point of a joint is the anchor of the last joint of its body, and moves with the body: that of ``points_of``, where the same
    joints may have their anchors elsewhere; by default of the tree itself. What cancels in a vector is weight, inertia, and mass times
    spin times velocity, of each body, what constraints do to it, and their moments about the root of the tree.

    ``bearing`` are the numbers of those rows of ``constraints`` that bear something, for each of which there is a multiplier. A coupling
    of joints acts through the joints, whose accelerations tell of it.

    Raises:
        ValueError: a tree has other joints, or a constraint couples tendons.
    """
    nodes = motion.kinematics
    parts = parts_of_motion(motion, nodes.coordinates.third)
    rows = rows_in(motion, rows_of(nodes.tree, constraints))
    for multiplier, row in zip(nodes.coordinates.further, (rows[number] for number in bearing), strict=True):
        # What bodies need against the forces of constraints, which are -J' times the multipliers.
        for number, acts in row.on_nodes:
            parts[number].append(multiplier * acts)
    for number, pull in enumerate(motion.pulls()):
        parts[number].append(-pull)
    _add_inertias_of_tendons(motion, parts)
    of_points: World = motion if points_of is None else motion.of_other(points_of)
    points, numbers = of_points.points, {node.joint.name: number for number, node in enumerate(nodes.nodes)}
    blocks: dict[str, list[Block]] = {"force": [], "moment": []}
    cancelling = cancelling_in_motion(motion, parts)
    for name in transmitting_joints(nodes.tree):
        number, point = numbers[name], points[name]
        moment, force = wrench(motion, parts, number, point)
        size_of_moment, size_of_force = size_of_wrench(motion, cancelling, number, point, root(motion, number, of_points.kinematics))
        blocks["force"].append(Block(f"force of joint {name!r}", force, size_of_force))
        blocks["moment"].append(Block(f"moment of joint {name!r}", moment, size_of_moment))
    yield from (*blocks["force"], *blocks["moment"])


def _add_inertias_of_tendons(motion: TreeMotion, parts: Parts) -> None:
    """Add to ``parts`` what the ends of tendons with inertia need, along their line, for the acceleration of its length."""
    nodes = motion.kinematics
    for own in nodes.reflected():
        if own.spring is None:
            continue
        ends = [motion.end(body, pose) for body, pose in own.spring.ends]
        between = ends[1][2] + -ends[0][2]
        needed = own.inertia * (own.rate(nodes.coordinates.third) + drift(nodes, own.spring))
        force = (needed / length(between)) * between
        for (number, arm, _, _), one in zip(ends, (-force, force), strict=True):
            if number >= 0:
                parts[number].append(spatial(cross(arm, one), one))


# The regressor.

# Mass, first moments, and moments of inertia about the origin of a frame of the body.
PARAMETERS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
_AXES = {"x": 0, "y": 1, "z": 2}


@dataclass(frozen=True)
class UnitWrench:
    """The wrench that a unit of one inertial parameter of a body requires, and a bound of the terms that cancel in it.

    Attributes:
        parts: its terms, against inertia and weight. that_cancel: vectors as long as what cancels in their components.
        lump: a body by which the arms are measured.
    """

    parts: list[Spatial]
    that_cancel: list[Spatial]
    lump: Lump


def regressor(motion: TreeMotion) -> Iterator[Block]:
    """By body, parameter and velocity: what a unit of the parameter adds to the generalised force.

    The parameters are about the anchor of the last joint of the body, along the axes of the body's frame.
    """
    nodes = motion.kinematics
    numbers = {one.node.joint.name: number for number, one in enumerate(motion.moving)}
    accelerations = accelerations_of_nodes(motion, nodes.coordinates.third)
    for joint in carrying_joints(nodes.tree, nodes.coordinates.joints):
        number = numbers[joint]
        for parameter in PARAMETERS:
            unit = _unit(motion, number, parameter, accelerations[number])
            alone = [replace(one, lumps=[unit.lump] if at == number else []) for at, one in enumerate(motion.moving)]
            of_node, of_sizes = ([own if at == number else [] for at in range(len(alone))] for own in (unit.parts, unit.that_cancel))
            values, sizes = generalised(World(nodes, alone), nodes.up_from(number), of_node, of_sizes)
            for column, value, size in zip(motion.columns, values, sizes, strict=True):
                name = f"derivative by {parameter} of the body behind {joint!r} of the generalised force on {column}"
                yield Block(name, (value,), size)


def _unit(motion: TreeMotion, number: int, parameter: str, acceleration: Spatial) -> UnitWrench:
    """The wrench of a unit of a parameter of a node's body, which moves with an acceleration against gravity."""
    builder, one, (turning, of_origin) = motion.kinematics.builder, motion.moving[number], acceleration
    still, nothing = builder.still, builder.zeros(3, 3)
    upward = -builder.vector(motion.kinematics.tree.gravity)
    axes = one.orientation.T
    if parameter == "m":
        parts = [spatial(still, of_origin), spatial(still, upward)]
        return UnitWrench(parts, parts, Lump(builder.one, still, nothing))
    # As long as the square of the spin.
    squared = length(one.spin) * one.spin
    if parameter[0] == "m":
        axis = axes[_AXES[parameter[1]]]
        parts = [
            spatial(cross(axis, of_origin), cross(turning, axis)),
            spatial(cross(axis, upward), still),
            spatial(still, cross(one.spin, cross(one.spin, axis))),
        ]
        that_cancel = [spatial(of_origin, turning), spatial(upward, still), spatial(still, squared)]
        return UnitWrench(parts, that_cancel, Lump(builder.one, axis, nothing))
    first, second = (axes[_AXES[name]] for name in parameter[1:])
    momenta = []
    for angular in (turning, one.spin):
        momentum = (second @ angular) * first
        mirrored = (first @ angular) * second
        momenta.append(momentum if parameter[1] == parameter[2] else momentum + mirrored)
    parts = [spatial(momenta[0], still), spatial(cross(one.spin, momenta[1]), still)]
    return UnitWrench(parts, [spatial(turning, still), spatial(squared, still)], Lump(builder.zero, still, nothing))


def carrying_joints(tree: Tree, joints: Sequence[str]) -> tuple[str, ...]:
    """The joints that bodies hang on, of several joints of a body the last one, in the order of ``joints``."""
    last = {body.joints[-1].name for body in tree.bodies if body.joints}
    return tuple(name for name in dict.fromkeys(joints) if name in last)
