"""What the bodies behind a joint need for their motion, as moments and forces along the world's axes, and how large the parts of it are.

Source: Goldstein, Classical Mechanics, sections 1.1 and 1.2 (momentum and angular momentum of a system of particles).
"""

from __future__ import annotations

from collections.abc import Iterator

from harness.files.tree import WORLD
from harness.robots.constraints import ConstraintWriter
from harness.robots.nodes import Pair
from harness.robots.spatial import Three
from harness.robots.world_motion import Moving


class WrenchWriter(ConstraintWriter):
    """Writes moments and forces of one tree at given accelerations, which are its third inputs."""

    INPUTS = ("q", "v", "qdd")

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
            arm = self._length(self.less(one.position, root))
            forces = self.zero
            for part in parts[other]:
                moment, forces = self.sum(moment, self._length(part[0])), self.sum(forces, self._length(part[1]))
            for lump in one.lumps:
                # A force through the axis has no moment about it, and its arm does.
                arm = self.sum(arm, self._length(lump.centre))
                # An acceleration that is measured in the moving frame lacks spin times velocity.
                velocity = self.added(one.velocity, self.cross(one.spin, lump.centre))
                forces = self.sum(forces, self.product(lump.mass, self._length(self.cross(one.spin, velocity))))
            moment, force = self.sum(moment, self.product(arm, forces)), self.sum(force, forces)
        shift = self._length(self.less(point, root))
        return self.sum(moment, self.product(shift, force)), force

    def _root(self, moving: list[Moving], number: int) -> Three:
        """Where the tree begins: the first joint, or the origin of the body that is fixed to the world and has it.

        What slides from there or floats is measured from the world's origin.
        """
        while moving[number].node.parent >= 0:
            number = moving[number].node.parent
        if moving[number].node.joint.kind not in ("hinge", "ball"):
            return self.still
        bodies, joint = {body.name: body for body in self.planted.bodies}, moving[number].node.joint.name
        top = next(body for body in self.planted.bodies if joint in {one.name for one in body.joints})
        while top.parent != WORLD:
            top = bodies[top.parent]
        fixed, _, position = self.frames[top.name]
        return position if fixed < 0 else moving[number].position

    @property
    def given_velocities(self) -> Three:
        """The second inputs."""
        return list(range(self._first_rate, self._first_rate + self.nv))

    @property
    def given_accelerations(self) -> Three:
        """The third inputs."""
        return list(range(self._first_rate + self.nv, self._first_rate + 2 * self.nv))

    def _parts(self, moving: list[Moving], accelerations: Three) -> list[list[Pair]]:
        """Of each node, what its lumps need for their motion beyond their weight: moments about the node's origin, and forces."""
        found = []
        of_nodes = zip(moving, self._accelerations(moving, accelerations), self._weights(moving), strict=True)
        for one, (spin, acceleration), weights in of_nodes:
            parts: list[Pair] = []
            for lump, weight in zip(one.lumps, weights, strict=True):
                centripetal = self.cross(one.spin, self.cross(one.spin, lump.centre))
                of_centre = self.added(acceleration, self.added(self.cross(spin, lump.centre), centripetal))
                force = self.times(lump.mass, of_centre)
                parts += [(self.cross(lump.centre, force), force), weight]
                parts.append((self.turned(lump.moments, spin), self.still))
                parts.append((self.cross(one.spin, self.turned(lump.moments, one.spin)), self.still))
            found.append(parts)
        return found

    def _weights(self, moving: list[Moving]) -> list[list[Pair]]:
        """Of each node, what holds each of its lumps against gravity: moments about the node's origin, and forces."""
        gravity = self.numbers(self.tree.gravity)
        forces = [[self.minus(self.times(lump.mass, gravity)) for lump in one.lumps] for one in moving]
        return [
            [(self.cross(lump.centre, force), force) for lump, force in zip(one.lumps, own, strict=True)]
            for one, own in zip(moving, forces, strict=True)
        ]

    def _accelerations(self, moving: list[Moving], accelerations: Three) -> list[Pair]:
        """Of each node, the change of its spin and the acceleration of its origin at given accelerations of the joints."""
        found: list[Pair] = []
        for one in moving:
            spin, acceleration = found[one.node.parent] if one.node.parent >= 0 else (self.still, self.still)
            acceleration = self.added(self.added(acceleration, self.cross(spin, one.arm)), one.bias[1])
            spin = self.added(spin, one.bias[0])
            for (angular, linear), column in zip(one.motions, one.node.columns, strict=True):
                given = accelerations[column]
                spin, acceleration = self.added(spin, self.times(given, angular)), self.added(acceleration, self.times(given, linear))
            found.append((spin, acceleration))
        return found

    def _length(self, values: Three) -> int:
        return self.add("sqrt", self.dot(values, values))
