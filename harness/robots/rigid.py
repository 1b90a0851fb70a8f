"""Rigid bodies of a tree as instructions of a program: mass, first moments and moments of inertia.

Source: Featherstone, Rigid Body Dynamics Algorithms, sections 2.13 (rigid body inertia) and 6.2 (composite rigid bodies).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

from harness.files.tree import Body, Inertia, Solid, Tree
from harness.robots.solids import SolidWriter
from harness.robots.spatial import Matrix, Three, transposed


@dataclass
class Rigid:
    """Mass, first moments and moments about the origin of a frame."""

    mass: int
    first: Three
    second: Matrix


@dataclass
class Lump:
    """A part of a body: its mass, its centre of mass, and its moments of inertia about that, in the axes and from the origin of a frame."""

    mass: int
    centre: Three
    moments: Matrix


class BodyWriter(SolidWriter):
    """Writes what bodies weigh."""

    _scale: int | None = None

    def scale_to(self, tree: Tree) -> None:
        """From here on, scale all bodies as the tree's ``total_mass`` says."""
        if tree.total_mass is not None:
            self._scale = self.quotient(self.given(tree.total_mass), self.mass(tree))

    def mass(self, tree: Tree) -> int:
        """The mass of all bodies."""
        total = self.zero
        for body in tree.bodies:
            for part in self.parts(body):
                total = self.sum(total, part.mass)
        return total

    def parts(self, body: Body) -> Iterator[Rigid]:
        """A body's inertia and solids, each about the origin of the body's frame."""
        for lump in self.lumps(body):
            yield self.moved(Rigid(lump.mass, self.still, lump.moments), self.identity, lump.centre)

    def lumps(self, body: Body) -> Iterator[Lump]:
        """A body's inertia and solids, each about its own centre of mass, in the body's frame."""
        given: tuple[Inertia | Solid, ...] = (body.inertia, *body.solids) if body.inertia else body.solids
        for part in given:
            turn, centre = self.placed(self.identity, self.still, part.pose)
            mass, moments = self._of_inertia(part) if isinstance(part, Inertia) else self._of_solid(part)
            if self._scale is not None:
                mass, moments = self.product(self._scale, mass), [self.times(self._scale, row) for row in moments]
            yield Lump(mass, centre, self.multiplied(self.multiplied(turn, moments), transposed(turn)))

    def _of_inertia(self, inertia: Inertia) -> tuple[int, Matrix]:
        xx, yy, zz, xy, xz, yz = (self.given(moment) for moment in inertia.moments)
        return self.given(inertia.mass), [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]

    def _of_solid(self, solid: Solid) -> tuple[int, Matrix]:
        mass, principal = self.solid(solid)
        return mass, [[principal[i] if i == j else self.zero for j in range(3)] for i in range(3)]

    def joined(self, one: Rigid, other: Rigid) -> Rigid:
        second = [self.added(a, b) for a, b in zip(one.second, other.second, strict=True)]
        return Rigid(self.sum(one.mass, other.mass), self.added(one.first, other.first), second)

    def moved(self, rigid: Rigid, turn: Matrix, shift: Three) -> Rigid:
        """The same about the origin of the frame in which its own stands at ``shift``, turned by ``turn``."""
        first = self.turned(turn, rigid.first)
        second = self.multiplied(self.multiplied(turn, rigid.second), transposed(turn))
        half = self.added(first, self.times(self.product(rigid.mass, self.number(Fraction(1, 2))), shift))
        # With h' = h + m p / 2: 2 (p.h') 1 - p h'' - h' p'.
        trace = self.product(self.number(2), self.dot(shift, half))
        rows = []
        for i in range(3):
            row = []
            for j in range(3):
                mixed = self.sum(self.product(shift[i], half[j]), self.product(half[i], shift[j]))
                row.append(self.sum(second[i][j], self.difference(trace if i == j else self.zero, mixed)))
            rows.append(row)
        return Rigid(rigid.mass, self.added(first, self.times(rigid.mass, shift)), rows)
