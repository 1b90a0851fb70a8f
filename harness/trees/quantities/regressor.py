"""The derivatives of inverse dynamics by the inertial parameters of bodies, in which it is linear: the joint torque regressor.

Sources: Atkeson, An, Hollerbach, Estimation of inertial parameters of manipulator loads and links, IJRR 5 (1986); Featherstone, Rigid
Body Dynamics Algorithms, section 2.13, for the parameters.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from harness.files.tree import Tree
from harness.programs.terms import cross, length
from harness.trees.bodies.rigid import Lump, Spatial, spatial
from harness.trees.constraints.rows import untied
from harness.trees.quantities.forces import generalised
from harness.trees.quantities.tree_motion import Block, TreeMotion
from harness.trees.world_motion import World, accelerations_of_nodes

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
    nodes = motion.world.kinematics
    numbers = {one.node.joint.name: number for number, one in enumerate(motion.moving)}
    accelerations = accelerations_of_nodes(motion.world, nodes.coordinates.third)
    for joint in carrying_joints(nodes.tree, nodes.coordinates.joints):
        number = numbers[joint]
        for parameter in PARAMETERS:
            unit = _unit(motion, number, parameter, accelerations[number])
            alone = [replace(one, lumps=[unit.lump] if at == number else []) for at, one in enumerate(motion.moving)]
            of_node, of_sizes = ([own if at == number else [] for at in range(len(alone))] for own in (unit.parts, unit.that_cancel))
            way = [number]
            while motion.moving[way[-1]].node.parent >= 0:
                way.append(motion.moving[way[-1]].node.parent)
            values, sizes = generalised(World(nodes, alone), way, of_node, of_sizes)
            for column, value, size in zip(motion.columns, values, sizes, strict=True):
                name = f"derivative by {parameter} of the body behind {joint!r} of the generalised force on {column}"
                yield Block(name, (value,), size)


def _unit(motion: TreeMotion, number: int, parameter: str, acceleration: Spatial) -> UnitWrench:
    """The wrench of a unit of a parameter of a node's body, which moves with an acceleration against gravity."""
    builder, one, (turning, of_origin) = motion.builder, motion.moving[number], acceleration
    still, nothing = builder.still, builder.zeros(3, 3)
    upward = -builder.vector(motion.world.kinematics.tree.gravity)
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
    last = {body.joints[-1].name for body in untied(tree, joints).bodies if body.joints}
    return tuple(name for name in dict.fromkeys(joints) if name in last)
