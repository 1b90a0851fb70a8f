"""What joints transmit, as a program of positions, velocities, accelerations, and the numbers of a file.

The reaction of a joint is what the parent does to the child through it: what everything behind the joint needs for its motion,
beyond its weight, the springs between points that pull at it, and the constraints that hold it. It is written along the world's axes,
as in ``harness.robots.free_bodies``, where the same reactions are unknowns of linear equations.

Source: Goldstein, Classical Mechanics, sections 1.1 and 1.2 (momentum and angular momentum of a system of particles).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from harness.equations.kernels import BallKernel
from harness.equations.program import StraightLineProgram, without_unused
from harness.files.constraints import ModelConstraint
from harness.files.tree import Given, Tree
from harness.robots.constraints import Row, rows_of, untied
from harness.robots.nodes import Pair
from harness.robots.spatial import Three
from harness.robots.world_motion import Moving, WorldWriter
from harness.robots.wrenches import WrenchWriter

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
    constraints: Sequence[ModelConstraint] = (),
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
    further = tuple(f"lambda{place}" for place in range(len(bearing)))
    return _Reactions(untied(tree, joints), joints, linear_velocity_in_body, further).written(points_of, constraints, bearing)


class _Reactions(WrenchWriter):
    """Writes the reactions of one tree."""

    def written(self, points_of: Tree | None, constraints: Sequence[ModelConstraint], bearing: Sequence[int]) -> Reactions:
        moving = self.moving()
        parts = self._parts(moving, self.given_accelerations)
        rows = self.rows(moving, rows_of(self.tree, constraints))
        self._add_constraints(parts, [rows[number] for number in bearing])
        for number, (moment, force) in enumerate(self.pulls(moving)):
            parts[number].append((self.minus(moment), self.minus(force)))
        points = self.points(moving) if points_of is None else self.positions_of(untied(points_of, self._order))
        chosen = [(number, one.node.joint.name) for number, one in enumerate(moving) if _transmits(one)]
        vectors: dict[str, Three] = {"force": [], "moment": []}
        sizes: dict[str, Three] = {"force": [], "moment": []}
        for number, name in chosen:
            moment, force = self._wrench(moving, parts, number, points[name])
            size_of_moment, size_of_force = self._size(moving, parts, number, points[name])
            vectors["force"] += force
            vectors["moment"] += moment
            sizes["force"].append(size_of_force)
            sizes["moment"].append(size_of_moment)
        program, of_sizes = self.program(vectors), self.program(sizes)
        return Reactions(without_unused(program), without_unused(of_sizes), self.parameters, tuple(name for _, name in chosen))

    def _add_constraints(self, parts: list[list[Pair]], rows: Sequence[Row]) -> None:
        """Add what bodies need against the forces of constraints, which are -J' times the multipliers."""
        first = self._first_rate + 2 * self.nv
        for place, row in enumerate(rows):
            for number, moment, force in row.on_nodes:
                parts[number].append((self.times(first + place, moment), self.times(first + place, force)))


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
    writer = WorldWriter(tree, joints, False)
    points = writer.points(writer.moving())
    program = writer.program(points)
    numbers = [float(value) for value in writer.parameters]
    inputs = [math.sqrt(place + 2.0) for place in range(len(program.inputs) - len(numbers))]
    values = iter(BallKernel(program, len(numbers)).bind(numbers)(*inputs))
    return {name: [next(values) for _ in range(3)] for name in points}


def _transmits(one: Moving) -> bool:
    return one.node.joint.kind != "free" and not one.node.joint.follows
