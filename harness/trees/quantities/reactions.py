"""What joints transmit, as a program of positions, velocities, accelerations, and the numbers of a file.

The reaction of a joint is what the parent does to the child through it: what everything behind the joint needs for its motion,
beyond its weight, the springs between points that pull at it, and the constraints that hold it. It is written along the world's axes.

Source: Goldstein, Classical Mechanics, sections 1.1 and 1.2 (momentum and angular momentum of a system of particles).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from harness.files.equalities import Equality
from harness.files.joint_kinds import JointKind
from harness.files.tree import Given, Tree
from harness.programs.program import StraightLineProgram, without_unused
from harness.programs.terms import Term
from harness.trees.constraints.rows import rows_in, rows_of, untied
from harness.trees.nodes import kinematics
from harness.trees.world_motion import Moving, in_world, parts_of_motion, root, size_of_wrench, wrench

_BITS = 256


@dataclass(frozen=True)
class Reactions:
    """The reactions of one tree.

    Attributes:
        program: from q, v, qdd, multipliers of constraints, time and ``parameters``; for each of ``joints`` the outputs "force" [N] and
            "moment" [N m], three components each along the world's axes; the moment is about the joint's point.
        sizes: a program with the same inputs; its outputs of the same names hold, one number a joint, how large the parts are that
            an algorithm may form of that vector and cancel: weight, inertia, and mass times spin times velocity, of each body, what
            constraints do to it, and their moments about the root of the tree.
        joints: names of the joints that move by themselves and transmit something: all but free ones, in the tree's order.
    """

    program: StraightLineProgram
    sizes: StraightLineProgram
    parameters: tuple[Given, ...]
    joints: tuple[str, ...]


def reactions_program(
    tree: Tree,
    joints: Sequence[str],
    linear_velocity_in_body: bool = False,
    points_of: Tree | None = None,
    constraints: Sequence[Equality] = (),
    bearing: Sequence[int] = (),
) -> Reactions:
    """The reactions of a tree; q, v and qdd follow ``joints`` as ``recursion_program`` takes them.

    The point of a joint is the anchor of the last joint of its body, and moves with the body: that of ``points_of``, where the same
    joints may have their anchors elsewhere; by default of the tree itself.

    ``bearing`` are the numbers of those rows of ``constraints`` that bear something, for each of which there is a multiplier. A coupling
    of joints acts through the joints, whose accelerations tell of it.

    Raises:
        ValueError: a tree has other joints, or a constraint couples tendons.
    """
    further = [f"lambda{place}" for place in range(len(bearing))]
    world = in_world(kinematics(untied(tree, joints), joints, linear_velocity_in_body, "qdd", further))
    nodes, builder = world.kinematics, world.kinematics.builder
    parts = parts_of_motion(world, nodes.coordinates.third)
    rows = rows_in(world, rows_of(nodes.tree, constraints))
    for multiplier, row in zip(nodes.coordinates.further, (rows[number] for number in bearing), strict=True):
        # What bodies need against the forces of constraints, which are -J' times the multipliers.
        for number, acts in row.on_nodes:
            parts[number].append(multiplier * acts)
    for number, pull in enumerate(world.pulls()):
        parts[number].append(-pull)
    of_points = world if points_of is None else world.of_other(untied(points_of, nodes.coordinates.joints))
    points = of_points.points
    chosen = [(number, one.node.joint.name) for number, one in enumerate(world.moving) if _transmits(one)]
    vectors: dict[str, list[Term]] = {"force": [], "moment": []}
    sizes: dict[str, list[Term]] = {"force": [], "moment": []}
    for number, name in chosen:
        moment, force = wrench(world, parts, number, points[name])
        size_of_moment, size_of_force = size_of_wrench(world, parts, number, points[name], root(world, number, of_points.kinematics))
        vectors["force"] += force.tolist()
        vectors["moment"] += moment.tolist()
        sizes["force"].append(size_of_force)
        sizes["moment"].append(size_of_moment)
    program, of_sizes = (without_unused(builder.program(outputs)) for outputs in (vectors, sizes))
    return Reactions(program, of_sizes, builder.parameters, tuple(name for _, name in chosen))


def have_same_points(tree: Tree, other: Tree, joints: Sequence[str]) -> bool:
    """Whether the points of the joints, see ``reactions_program``, are the same in two trees, wherever these stand."""
    import flint

    with flint.ctx.workprec(_BITS):
        places = [_points_at_one_position(one, joints) for one in (tree, other)]
    return places[0].keys() == places[1].keys() and all(
        a.overlaps(b) for name in places[0] for a, b in zip(places[0][name], places[1][name], strict=True)
    )


def _points_at_one_position(tree: Tree, joints: Sequence[str]) -> dict[str, list[Any]]:
    """The points in balls, at a position that no two trees agree at by chance."""
    world = in_world(kinematics(tree, joints))
    coordinates = world.kinematics.coordinates
    count = sum(map(len, coordinates.positions.values())) + 2 * world.kinematics.nv + 1
    return world.kinematics.builder.evaluated(world.points, [math.sqrt(place + 2.0) for place in range(count)])


def _transmits(one: Moving) -> bool:
    return one.node.joint.kind != JointKind.FREE and not one.node.joint.follows
