"""The mass and the second moments of geometric bodies, as instructions of a program.

Second moments over the mass are rational in the sizes; pi stands in the mass of a density alone.

Sources: MuJoCo documentation, XML reference, ``body/geom``: ``type``, ``size``, ``mass``, ``density``, ``shellinertia``; Featherstone,
Rigid Body Dynamics Algorithms, section 2.13, for the inertia of second moments: trace(J) 1 - J.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

from harness.files.tree import Solid
from harness.robots.spatial import SpatialWriter, Three


class _Shape(NamedTuple):
    """Volume (or area of the surface) over ``units``, times the power of pi; and second moments along x, y and z over the mass."""

    measure: int
    has_pi: bool
    moments: Three


class SolidWriter(SpatialWriter):
    """Writes what a ``Solid`` weighs."""

    def solid(self, solid: Solid) -> tuple[int, Three]:
        """Its mass and its principal moments of inertia."""
        if solid.mass is not None and solid.moments:
            return self.given(solid.mass), self.numbers(solid.moments)
        shape = (self._surface if solid.shell else self._volume)(solid.kind, self._sizes(solid))
        if solid.mass is not None:
            mass = self.given(solid.mass)
        else:
            mass = self.product(self.given(solid.density), shape.measure)
            mass = self.product(mass, self.add("pi")) if shape.has_pi else mass
        x, y, z = self.times(mass, shape.moments)
        return mass, [self.sum(y, z), self.sum(x, z), self.sum(x, y)]

    def _sizes(self, solid: Solid) -> Three:
        """Half the extent along x, y and z, or radius and half length; that along z from two points where these are given."""
        sizes = self.numbers(solid.size)
        if solid.ends is None:
            return sizes
        first, second = (self.numbers(end) for end in solid.ends)
        between = self.added(second, self.minus(first))
        half = self.product(self.fraction(1, 2), self.add("sqrt", self.dot(between, between)))
        return [sizes[0], half] if solid.kind in ("capsule", "cylinder") else [sizes[0], sizes[0], half]

    def fraction(self, numerator: int, denominator: int) -> int:
        return self.number(Fraction(numerator, denominator))

    def _scaled(self, numerator: int, denominator: int, *factors: int) -> int:
        """A fraction times factors."""
        found = self.fraction(numerator, denominator)
        for factor in factors:
            found = self.product(found, factor)
        return found

    def _volume(self, kind: str, sizes: Three) -> _Shape:
        if kind in ("sphere", "ellipsoid", "box"):
            a, b, c = sizes * 3 if kind == "sphere" else sizes
            share = (1, 3) if kind == "box" else (1, 5)
            measure = self._scaled(8, 1, a, b, c) if kind == "box" else self._scaled(4, 3, a, b, c)
            return _Shape(measure, kind != "box", [self._scaled(*share, size, size) for size in (a, b, c)])
        r, h = sizes
        square = self.product(r, r)
        if kind == "cylinder":
            across = self._scaled(1, 4, square)
            return _Shape(self._scaled(2, 1, square, h), True, [across, across, self._scaled(1, 3, h, h)])
        # A cylinder between two half spheres, whose centres of mass are 3/8 of a radius away from it.
        of_cylinder, of_sphere = self._scaled(2, 1, square, h), self._scaled(4, 3, square, r)
        across = self._sum_of((of_cylinder, self._scaled(1, 4, square)), (of_sphere, self._scaled(1, 5, square)))
        away = self.sum(self.product(h, h), self.sum(self._scaled(3, 4, h, r), self._scaled(1, 5, square)))
        along = self._sum_of((of_cylinder, self._scaled(1, 3, h, h)), (of_sphere, away))
        return self._mean(self.sum(of_cylinder, of_sphere), True, [across, across, along])

    def _surface(self, kind: str, sizes: Three) -> _Shape:
        if kind == "sphere":
            (r,) = sizes
            return _Shape(self._scaled(4, 1, r, r), True, [self._scaled(1, 3, r, r)] * 3)
        if kind == "box":
            faces = [self._scaled(8, 1, sizes[(axis + 1) % 3], sizes[(axis + 2) % 3]) for axis in range(3)]
            area = self.sum(faces[0], self.sum(faces[1], faces[2]))
            squares = [self.product(size, size) for size in sizes]
            # The faces across an axis are that far away; the others reach from there to there.
            moments = [
                self._sum_of(*((faces[face], self._scaled(1, 1 if face == axis else 3, squares[axis])) for face in range(3)))
                for axis in range(3)
            ]
            return self._mean(area, False, moments)
        r, h = sizes
        square, wall = self.product(r, r), self._scaled(4, 1, r, h)
        if kind == "cylinder":
            caps = self._scaled(2, 1, square)
            across = self._sum_of((wall, self._scaled(1, 2, square)), (caps, self._scaled(1, 4, square)))
            along = self._sum_of((wall, self._scaled(1, 3, h, h)), (caps, self.product(h, h)))
        else:
            caps = self._scaled(4, 1, square)
            across = self._sum_of((wall, self._scaled(1, 2, square)), (caps, self._scaled(1, 3, square)))
            away = self.sum(self.product(h, h), self.sum(self.product(h, r), self._scaled(1, 3, square)))
            along = self._sum_of((wall, self._scaled(1, 3, h, h)), (caps, away))
        return self._mean(self.sum(wall, caps), True, [across, across, along])

    def _sum_of(self, *products: tuple[int, int]) -> int:
        total = self.zero
        for first, second in products:
            total = self.sum(total, self.product(first, second))
        return total

    def _mean(self, measure: int, has_pi: bool, moments: Three) -> _Shape:
        return _Shape(measure, has_pi, [self.quotient(moment, measure) for moment in moments])
