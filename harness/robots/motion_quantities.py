"""Energies, momenta, and the frames of bodies of a tree, along the world's axes.

Sources: Goldstein, Classical Mechanics, sections 1.1 and 1.2 (momentum, energy), 5.1 and 5.3 (rigid bodies); Featherstone, Rigid
Body Dynamics Algorithms, section 2.5 (velocities).
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from harness.robots.nodes import Pair
from harness.robots.quantity_writer import Block, QuantityWriter
from harness.robots.spatial import Three, transposed
from harness.robots.world_motion import Moving


class MotionQuantities(QuantityWriter):
    """Writes what the motion of one tree amounts to."""

    # Energies and momenta.

    def energy(self) -> Iterator[Block]:
        """Kinetic energy, and potential energy beyond that of the position zero, of gravity and springs."""
        kinetic = size = self.zero
        half = self.number(Fraction(1, 2))
        for number, one in enumerate(self._moving):
            for lump in one.lumps:
                velocity = self.added(one.velocity, self.cross(one.spin, lump.centre))
                turning = self.dot(one.spin, self.turned(lump.moments, one.spin))
                kinetic = self.sum(kinetic, self.sum(self.product(lump.mass, self.dot(velocity, velocity)), turning))
                speed = self._speed(number, lump)
                size = self.sum(size, self.sum(self.product(lump.mass, self.product(speed, speed)), turning))
            multiplier = self.given(one.node.joint.multiplier)
            reflected = self.product(self.product(multiplier, multiplier), self.given(one.node.joint.armature))
            for column in one.node.columns:
                rate = self._first_rate + column
                turning = self.product(reflected, self.product(rate, rate))
                kinetic, size = self.sum(kinetic, turning), self.sum(size, turning)
        yield Block("kinetic energy", (self.product(half, kinetic),), self.product(half, size))
        potential, size = self._potential(self._moving)
        with self._at_zero():
            at_zero, size_at_zero = self._potential(self.moving())
        yield Block("potential energy", (self.difference(potential, at_zero),), self.sum(size, size_at_zero))

    def momentum(self) -> Iterator[Block]:
        """Momentum, and moments of momentum about the world's origin and about the centre of mass, of all that moves."""
        linear, about_origin, first, mass = self.still, self.still, self.still, self.zero
        size = size_about_origin = self.zero
        for number, one in enumerate(self._moving):
            for lump in one.lumps:
                position = self.added(one.position, lump.centre)
                push = self.times(lump.mass, self.added(one.velocity, self.cross(one.spin, lump.centre)))
                own = self.turned(lump.moments, one.spin)
                linear, first = self.added(linear, push), self.added(first, self.times(lump.mass, position))
                about_origin = self.added(about_origin, self.added(own, self.cross(position, push)))
                mass = self.sum(mass, lump.mass)
                of_push = self.product(lump.mass, self._speed(number, lump))
                size = self.sum(size, of_push)
                reach = self.sum(self._distance(number), self._length(lump.centre))
                size_about_origin = self.sum(size_about_origin, self.sum(self._length(own), self.product(reach, of_push)))
        centre = [self.quotient(value, mass) for value in first]
        about_centre = self.less(about_origin, self.cross(centre, linear))
        yield Block("linear momentum", tuple(linear), size)
        yield Block("angular momentum about the origin", tuple(about_origin), size_about_origin)
        of_shift = self.product(self._length(centre), size)
        yield Block("angular momentum about the centre of mass", tuple(about_centre), self.sum(size_about_origin, of_shift))

    def _potential(self, moving: list[Moving]) -> tuple[int, int]:
        """Potential energy [J] of a configuration, and its size."""
        gravity, half = self.numbers(self.tree.gravity), self.number(Fraction(1, 2))
        found = size = self.zero
        for one in moving:
            for lump in one.lumps:
                position = self.added(one.position, lump.centre)
                found = self.difference(found, self.product(lump.mass, self.dot(gravity, position)))
                weight = self.product(lump.mass, self._length(gravity))
                size = self.sum(size, self.product(weight, self.sum(self._length(one.position), self._length(lump.centre))))
        for stiffness, stretch, parts in self._springs(moving):
            found = self.sum(found, self.product(half, self.product(stiffness, self.product(stretch, stretch))))
            reach = self.zero
            for part in parts:
                reach = self.sum(reach, self.size_of(part))
            size = self.sum(size, self.product(stiffness, self.product(reach, reach)))
        return found, size

    def _springs(self, moving: list[Moving]) -> Iterator[tuple[int, int, Three]]:
        """Of each spring its stiffness, how far it is stretched, and what that is the difference of."""
        for node in self.nodes:
            if node.joint.stiffness and node.joint.kind in ("hinge", "slide"):
                position, rest = self.position_and_rest(node.joint)
                yield self.given(node.joint.stiffness), self.difference(position, rest), [position, rest]
        for coupling in self.tree.couplings:
            total, rest, _, _ = self.coupled(coupling)
            yield self.given(coupling.stiffness), self.difference(total, rest), [total, rest]
        for spring in self.tree.springs:
            ends = [self._end(moving, body, pose) for body, pose in spring.ends]
            positions = [position for _, _, position, _ in ends]
            length, free = self._length(self.less(*reversed(positions))), self.given(spring.free_length)
            reaches = [self._length(position) for position in positions]
            yield self.given(spring.stiffness), self.difference(length, free), [*reaches, free]

    # Frames of bodies.

    def positions(self) -> Iterator[Block]:
        """Of each joint the anchor that moves with its body, and how its body is turned from where it stands at zero."""
        with self._at_zero():
            before = [one.orientation for one in self.moving()]
        for number, name in self._named():
            orientation, anchor = self._moving[number].orientation, self._anchors[name]
            yield Block(f"position at joint {name!r}", tuple(anchor), self._reach_of(number, anchor))
            turned = self.multiplied(orientation, transposed(before[number]))
            for axis, column in zip("xyz", transposed(turned), strict=True):
                yield Block(f"orientation of {axis} at joint {name!r}", tuple(column), self.number(1))

    def velocities(self) -> Iterator[Block]:
        """Of each joint the velocity of the anchor that moves with its body, and the angular velocity of the body."""
        for number, name in self._named():
            one, anchor = self._moving[number], self._anchors[name]
            arm = self.less(anchor, one.position)
            velocity = self.added(one.velocity, self.cross(one.spin, arm))
            speed, spin = self._speeds(number, anchor)
            yield Block(f"velocity at joint {name!r}", tuple(velocity), speed)
            yield Block(f"angular velocity at joint {name!r}", tuple(one.spin), spin)

    def jacobians(self) -> Iterator[Block]:
        """Of each joint what each velocity adds to those of ``velocities``."""
        for number, name in self._named():
            anchor, at = self._anchors[name], number
            columns: dict[int, Pair] = {}
            while at >= 0:
                one = self._moving[at]
                arm = self.less(anchor, one.position)
                for (angular, linear), column in zip(one.motions, one.node.columns, strict=True):
                    before = columns.get(column, (self.still, self.still))
                    columns[column] = (
                        self.added(before[0], self.added(linear, self.cross(angular, arm))),
                        self.added(before[1], angular),
                    )
                at = one.node.parent
            sizes = self._sizes_of_columns(number, anchor)
            for column, other in enumerate(self.columns):
                linear, angular = columns.get(column, (self.still, self.still))
                size, turning = sizes.get(column, (self.zero, self.zero))
                yield Block(f"velocity at joint {name!r} by {other}", tuple(linear), size)
                yield Block(f"angular velocity at joint {name!r} by {other}", tuple(angular), turning)
