"""What joints transmit, as a program of positions, velocities, accelerations, and the numbers of a file.

The reaction of a joint is what the parent does to the child through it: what everything behind the joint needs for its motion,
beyond its weight, the springs between points that pull at it, and the constraints that hold it. It is written along the world's axes,
as in ``harness.robots.free_bodies``, where the same reactions are unknowns of linear equations.

Source: Goldstein, Classical Mechanics, sections 1.1 and 1.2 (momentum and angular momentum of a system of particles).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from harness.equations.kernels import BallKernel
from harness.equations.program import StraightLineProgram, without_unused
from harness.models.constraints import ModelConstraint
from harness.robots.constraints import ConstraintWriter, Row, rows_of, untied
from harness.robots.nodes import Pair
from harness.robots.spatial import Three
from harness.robots.tree import WORLD, Given, Tree
from harness.robots.world_motion import Moving, WorldWriter

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


class _Reactions(ConstraintWriter):
    """Writes the reactions of one tree."""

    INPUTS = ("q", "v", "qdd")

    def written(self, points_of: Tree | None, constraints: Sequence[ModelConstraint], bearing: Sequence[int]) -> Reactions:
        moving = self.moving()
        parts = self._parts(moving)
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

    def _behind(self, moving: list[Moving], number: int) -> Iterator[int]:
        """The nodes that a joint carries, its own first."""
        for other in range(number, len(moving)):
            at = other
            while at > number:
                at = moving[at].node.parent
            if at == number:
                yield other

    def _wrench(self, moving: list[Moving], parts: list[list[Pair]], number: int, point: Three) -> Pair:
        """The moment about a point, and the force, of all parts of the bodies behind a joint."""
        total, push = self.still, self.still
        for other in self._behind(moving, number):
            arm = self.less(moving[other].position, point)
            for moment, force in parts[other]:
                total, push = self.added(total, self.added(moment, self.cross(arm, force))), self.added(push, force)
        return total, push

    def _size(self, moving: list[Moving], parts: list[list[Pair]], number: int, point: Three) -> tuple[int, int]:
        """How large the parts of moment and force are that cancel; see ``Reactions.sizes``."""
        root = self._root(moving, number)
        moment, force = self.zero, self.zero
        for other in self._behind(moving, number):
            one = moving[other]
            distance = self._length(self.less(one.position, root))
            forces = self.zero
            for part in parts[other]:
                moment, forces = self.sum(moment, self._length(part[0])), self.sum(forces, self._length(part[1]))
            for lump in one.lumps:
                # An acceleration that is measured in the moving frame lacks spin times velocity.
                velocity = self.added(one.velocity, self.cross(one.spin, lump.centre))
                forces = self.sum(forces, self.product(lump.mass, self._length(self.cross(one.spin, velocity))))
            moment, force = self.sum(moment, self.product(distance, forces)), self.sum(force, forces)
        shift = self._length(self.less(point, root))
        return self.sum(moment, self.product(shift, force)), force

    def _root(self, moving: list[Moving], number: int) -> Three:
        """Where the tree begins: the first joint, or the origin of the body that is fixed to the world and has it."""
        while moving[number].node.parent >= 0:
            number = moving[number].node.parent
        bodies, joint = {body.name: body for body in self.planted.bodies}, moving[number].node.joint.name
        top = next(body for body in self.planted.bodies if joint in {one.name for one in body.joints})
        while top.parent != WORLD:
            top = bodies[top.parent]
        fixed, _, position = self.frames[top.name]
        return position if fixed < 0 else moving[number].position

    def _parts(self, moving: list[Moving]) -> list[list[Pair]]:
        """Of each node, what its lumps need for their motion beyond their weight: moments about the node's origin, and forces."""
        found, weight = [], self.numbers(self.tree.gravity)
        for one, (spin, acceleration) in zip(moving, self._accelerations(moving), strict=True):
            parts: list[Pair] = []
            for lump in one.lumps:
                centripetal = self.cross(one.spin, self.cross(one.spin, lump.centre))
                of_centre = self.added(acceleration, self.added(self.cross(spin, lump.centre), centripetal))
                for force in (self.times(lump.mass, of_centre), self.minus(self.times(lump.mass, weight))):
                    parts.append((self.cross(lump.centre, force), force))
                parts.append((self.turned(lump.moments, spin), self.still))
                parts.append((self.cross(one.spin, self.turned(lump.moments, one.spin)), self.still))
            found.append(parts)
        return found

    def _add_constraints(self, parts: list[list[Pair]], rows: Sequence[Row]) -> None:
        """Add what bodies need against the forces of constraints, which are -J' times the multipliers."""
        first = self._first_rate + 2 * self.nv
        for place, row in enumerate(rows):
            for number, moment, force in row.on_nodes:
                parts[number].append((self.times(first + place, moment), self.times(first + place, force)))

    def _accelerations(self, moving: list[Moving]) -> list[Pair]:
        """Of each node, the change of its spin and the acceleration of its origin."""
        found: list[Pair] = []
        for one in moving:
            spin, acceleration = found[one.node.parent] if one.node.parent >= 0 else (self.still, self.still)
            acceleration = self.added(self.added(acceleration, self.cross(spin, one.arm)), one.bias[1])
            spin = self.added(spin, one.bias[0])
            for (angular, linear), column in zip(one.motions, one.node.columns, strict=True):
                given = self._first_rate + self.nv + column
                spin, acceleration = self.added(spin, self.times(given, angular)), self.added(acceleration, self.times(given, linear))
            found.append((spin, acceleration))
        return found

    def _length(self, values: Three) -> int:
        return self.add("sqrt", self.dot(values, values))


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
