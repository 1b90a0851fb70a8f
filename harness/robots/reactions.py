"""What joints transmit, as a program of positions, velocities, accelerations, and the numbers of a file.

The reaction of a joint is what the parent does to the child through it: what everything behind the joint needs for its motion,
beyond its weight and the springs between points that pull at it. It is written along the world's axes, as in
``harness.robots.free_bodies``, where the same reactions are unknowns of linear equations.

Source: Goldstein, Classical Mechanics, sections 1.1 and 1.2 (momentum and angular momentum of a system of particles).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from harness.equations.program import StraightLineProgram, without_unused
from harness.robots.nodes import Pair
from harness.robots.spatial import Three
from harness.robots.tree import Given, Tree
from harness.robots.world_motion import Moving, WorldWriter


@dataclass(frozen=True)
class Reactions:
    """The reactions of one tree.

    Attributes:
        program: from q, v, qdd, time and ``parameters``; for each of ``joints`` the outputs "force" [N] and "moment" [N m], three
            components each along the world's axes; the moment is about the joint's point.
        sizes: a program with the same inputs; its outputs of the same names hold, one number a joint, the sum of the lengths of the
            parts of which that vector is the sum.
        joints: names of the joints that transmit something: all but free ones, in the tree's order.
    """

    program: StraightLineProgram
    sizes: StraightLineProgram
    parameters: tuple[Given, ...]
    joints: tuple[str, ...]


def reactions_program(
    tree: Tree, joints: Sequence[str], linear_velocity_in_body: bool = False, points_of: Tree | None = None
) -> Reactions:
    """The reactions of a tree; q, v and qdd follow ``joints`` as ``recursion_program`` takes them.

    The point of a joint is the anchor of the last joint of its body, and moves with the body: that of ``points_of``, where the same
    joints may have their anchors elsewhere; by default of the tree itself.

    Raises:
        ValueError: a tree has other joints.
    """
    return _Reactions(tree, joints, linear_velocity_in_body).written(points_of)


class _Reactions(WorldWriter):
    """Writes the reactions of one tree."""

    INPUTS = ("q", "v", "qdd")

    def written(self, points_of: Tree | None) -> Reactions:
        moving = self.moving()
        parts = self._parts(moving)
        for number, (moment, force) in enumerate(self.pulls(moving)):
            parts[number].append((self.minus(moment), self.minus(force)))
        points = self.points(moving) if points_of is None else self.positions_of(points_of)
        # The nodes of the other tree may have taken the place of this one's.
        chosen = [number for number, one in enumerate(moving) if one.node.joint.kind != "free" and not one.node.joint.follows]
        names = tuple(moving[number].node.joint.name for number in chosen)
        vectors: dict[str, Three] = {"force": [], "moment": []}
        sizes: dict[str, Three] = {"force": [], "moment": []}
        for number, name in zip(chosen, names, strict=True):
            about = self._about(moving, parts, number, points[name])
            for kind, found in (("moment", [part[0] for part in about]), ("force", [part[1] for part in about])):
                total = self.still
                for part in found:
                    total = self.added(total, part)
                vectors[kind] += total
                sizes[kind].append(self._total(self._length(part) for part in found))
        program, of_sizes = self.program(vectors), self.program(sizes)
        return Reactions(without_unused(program), without_unused(of_sizes), self.parameters, names)

    def _about(self, moving: list[Moving], parts: list[list[Pair]], number: int, point: Three) -> list[Pair]:
        """All parts of the bodies behind a joint, with their moments about its point."""
        found = []
        for other, one in enumerate(moving):
            at: int = other
            while at > number:
                at = moving[at].node.parent
            if at == number:
                arm = self.less(one.position, point)
                found += [(self.added(moment, self.cross(arm, force)), force) for moment, force in parts[other]]
        return found

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

    def _total(self, values: Iterable[int]) -> int:
        total = self.zero
        for value in values:
            total = self.sum(total, value)
        return total
