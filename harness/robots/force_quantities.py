"""The mass matrix and generalised forces of a tree, along the world's axes.

Sources: Featherstone, Rigid Body Dynamics Algorithms, sections 5.3 (inverse dynamics) and 6.2 (composite rigid bodies); Goldstein,
Classical Mechanics, section 1.4 (d'Alembert's principle).
"""

from __future__ import annotations

from collections.abc import Iterator

from harness.robots.nodes import Pair
from harness.robots.quantity_writer import Block, QuantityWriter
from harness.robots.rigid import Rigid
from harness.robots.spatial import Three
from harness.robots.world_motion import Moving


class ForceQuantities(QuantityWriter):
    """Writes the mass matrix and generalised forces of one tree."""

    def mass_matrix(self) -> Iterator[Block]:
        """The entries of M, by rows, with the reflected inertias of joints.

        Source: Featherstone, section 6.2, in one frame.
        """
        entries = self._entries_of_mass()
        lengths = self._lengths_of_columns()
        for i, one in enumerate(self.columns):
            for j, other in enumerate(self.columns):
                entry = entries.get((min(i, j), max(i, j)), self.zero)
                yield Block(f"entry of M for {one} and {other}", (entry,), self.product(lengths[i], lengths[j]))

    def inverse_dynamics(self) -> Iterator[Block]:
        """The generalised force of each velocity that gives the accelerations, beside springs and dampers."""
        moving = self._moving
        parts = self._parts(moving, self.given_accelerations)
        for number, (moment, force) in enumerate(self.pulls(self._moving)):
            parts[number].append((self.minus(moment), self.minus(force)))
        values, sizes = self._generalised(parts)
        of_joints = self.forces_of_joints()
        for node in self.nodes:
            multiplier = self.given(node.joint.multiplier)
            reflected = self.product(self.product(multiplier, multiplier), self.given(node.joint.armature))
            for column in node.columns:
                inertia = self.product(reflected, self.given_accelerations[column])
                values[column] = self.sum(values[column], inertia)
                sizes[column] = self.sum(sizes[column], self.size_of(inertia))
        for column, name in enumerate(self.columns):
            size = self.sum(sizes[column], self.size_of(of_joints[column]))
            yield Block(f"generalised force on {name}", (self.difference(values[column], of_joints[column]),), size)

    def power(self) -> Iterator[Block]:
        """What the forces of inverse dynamics do: kinetic and potential energy gain as much, beside what dampers take."""
        power, size = self.zero, self.zero
        for velocity, block in zip(self.given_velocities, self.inverse_dynamics(), strict=True):
            power = self.sum(power, self.product(velocity, block.values[0]))
            size = self.sum(size, self.product(self.size_of(velocity), block.size))
        yield Block("power of the applied forces", (power,), size)

    def bias(self) -> Iterator[Block]:
        """Velocity terms and gravity: what inverse dynamics without springs, dampers and accelerations ask for."""
        return self._forces_of(self._parts(self._moving, [self.zero] * self.nv), "bias force")

    def gravity(self) -> Iterator[Block]:
        """What holds the tree at rest against its weight."""
        return self._forces_of(self._weights(self._moving), "gravity force")

    def _forces_of(self, parts: list[list[Pair]], kind: str) -> Iterator[Block]:
        for name, value, size in zip(self.columns, *self._generalised(parts), strict=True):
            yield Block(f"{kind} on {name}", (value,), size)

    def _generalised(self, parts: list[list[Pair]]) -> tuple[Three, Three]:
        """The generalised force of each velocity, and the sizes, of moments and forces on the bodies of nodes."""
        values, sizes = [self.zero] * self.nv, [self.zero] * self.nv
        for number, one in enumerate(self._moving):
            moment, force = self._wrench(self._moving, parts, number, one.position)
            size_of_moment, size_of_force = self._size(self._moving, parts, number, one.position)
            for (about, along), column in zip(one.motions, one.node.columns, strict=True):
                values[column] = self.sum(values[column], self.sum(self.dot(moment, about), self.dot(force, along)))
                for motion, size in ((about, size_of_moment), (along, size_of_force)):
                    sizes[column] = self.sum(sizes[column], self.product(self._length(motion), size))
        return values, sizes

    def _entries_of_mass(self) -> dict[tuple[int, int], int]:
        moving = self._moving
        composite = [self._rigid(one) for one in moving]
        entries: dict[tuple[int, int], int] = {}
        for number in reversed(range(len(moving))):
            one = moving[number]
            if one.node.parent >= 0:
                carried = self.moved(composite[number], self.identity, one.arm)
                composite[one.node.parent] = self.joined(composite[one.node.parent], carried)
            own = list(zip(one.motions, one.node.columns, strict=True))
            for place, (motion, column) in enumerate(own):
                moment, force = self._momentum(composite[number], motion)
                at, others = number, own[: place + 1]
                while at >= 0:
                    arm = self.less(one.position, moving[at].position)
                    about = self.added(moment, self.cross(arm, force))
                    for (angular, linear), row in others:
                        # Joints that mimic another share its column: both products are part of its entry.
                        times = self.number(2 if row == column and at != number else 1)
                        power = self.product(times, self.sum(self.dot(about, angular), self.dot(force, linear)))
                        entry = min(row, column), max(row, column)
                        entries[entry] = self.sum(entries.get(entry, self.zero), power)
                    at = moving[at].node.parent
                    others = list(zip(moving[at].motions, moving[at].node.columns, strict=True))
            multiplier = self.given(one.node.joint.multiplier)
            reflected = self.product(self.product(multiplier, multiplier), self.given(one.node.joint.armature))
            for column in one.node.columns:
                entries[column, column] = self.sum(entries[column, column], reflected)
        return entries

    def _rigid(self, one: Moving) -> Rigid:
        found = Rigid(self.zero, self.still, [self.still] * 3)
        for lump in one.lumps:
            found = self.joined(found, self.moved(Rigid(lump.mass, self.still, lump.moments), self.identity, lump.centre))
        return found

    def _momentum(self, rigid: Rigid, motion: Pair) -> Pair:
        """Moment of momentum about the point where ``rigid`` is taken, and momentum."""
        angular, linear = motion
        moment = self.added(self.turned(rigid.second, angular), self.cross(rigid.first, linear))
        return moment, self.added(self.times(rigid.mass, linear), self.cross(angular, rigid.first))

    def _lengths_of_columns(self) -> Three:
        """The length of each velocity's motion of all bodies in the metric of their masses, with all arms at their longest."""
        mass = inertia = self.zero
        for number, one in enumerate(self._moving):
            for lump in one.lumps:
                reach = self.sum(self._extent, self.sum(self._from_root(number), self._length(lump.centre)))
                mass = self.sum(mass, lump.mass)
                inertia = self.sum(inertia, self.product(lump.mass, self.product(reach, reach)))
                for row in lump.moments:
                    inertia = self.sum(inertia, self._length(row))
        turning, sliding = self.add("sqrt", inertia), self.add("sqrt", mass)
        found = [self.zero] * self.nv
        for one in self._moving:
            reflected = self.size_of(
                self.product(self.given(one.node.joint.multiplier), self.add("sqrt", self.given(one.node.joint.armature)))
            )
            for (about, along), column in zip(one.motions, one.node.columns, strict=True):
                motion = self.sum(self.product(self._length(about), turning), self.product(self._length(along), sliding))
                found[column] = self.sum(found[column], self.sum(motion, reflected))
        return found
