"""Rigid bodies of a tree as terms of a program: mass, first moments and moments of inertia, those of geometric bodies too.

Second moments over the mass of a geometric body are rational in its sizes; pi stands in the mass of a density alone.

Sources: Featherstone, Rigid Body Dynamics Algorithms, sections 2.13 (rigid body inertia; that of second moments is trace(J) 1 - J) and
6.2 (composite rigid bodies); MuJoCo documentation, XML reference, ``body/geom``: ``type``, ``size``, ``mass``, ``density``,
``shellinertia``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple

from harness.files.tree import Body, Inertia, Solid, Tree
from harness.programs.terms import Matrix, Term, Vector, cross, matrix, sqrt, vector
from harness.trees.bodies.spatial import FileBuilder, Frame, by_entries, placed


class _Shape(NamedTuple):
    """Volume (or area of the surface) over ``units``, times the power of pi; and second moments along x, y and z over the mass."""

    measure: Term
    has_pi: bool
    moments: Vector


def mass_and_moments(builder: FileBuilder, solid: Solid) -> tuple[Term, Vector]:
    """The mass of a solid and its principal moments of inertia."""
    if solid.mass is not None and solid.moments:
        return builder.number(solid.mass), builder.vector(solid.moments)
    shape = (_surface if solid.shell else _volume)(solid.kind, _sizes(builder, solid))
    if solid.mass is not None:
        mass = builder.number(solid.mass)
    else:
        mass = builder.number(solid.density) * shape.measure
        mass = mass * builder.add("pi") if shape.has_pi else mass
    x, y, z = mass * shape.moments
    return mass, vector((y + z, x + z, x + y))


def _sizes(builder: FileBuilder, solid: Solid) -> list[Term]:
    """Half the extent along x, y and z, or radius and half length; that along z from two points where these are given."""
    sizes = list(builder.vector(solid.size))
    if solid.ends is None:
        return sizes
    first, second = (builder.vector(end) for end in solid.ends)
    between = second + -first
    half = builder.number(Fraction(1, 2)) * sqrt(between @ between)
    return [sizes[0], half] if solid.kind in ("capsule", "cylinder") else [sizes[0], sizes[0], half]


def _scaled(numerator: int, denominator: int, *factors: Term) -> Term:
    """A fraction times factors."""
    return math.prod(factors, start=factors[0].builder.number(Fraction(numerator, denominator)))


def _volume(kind: str, sizes: list[Term]) -> _Shape:
    if kind in ("sphere", "ellipsoid", "box"):
        a, b, c = sizes * 3 if kind == "sphere" else sizes
        share = (1, 3) if kind == "box" else (1, 5)
        measure = _scaled(8, 1, a, b, c) if kind == "box" else _scaled(4, 3, a, b, c)
        return _Shape(measure, kind != "box", vector([_scaled(*share, size, size) for size in (a, b, c)]))
    r, h = sizes
    square = r * r
    if kind == "cylinder":
        across = _scaled(1, 4, square)
        return _Shape(_scaled(2, 1, square, h), True, vector((across, across, _scaled(1, 3, h, h))))
    # A cylinder between two half spheres, whose centres of mass are 3/8 of a radius away from it.
    of_cylinder, of_sphere = _scaled(2, 1, square, h), _scaled(4, 3, square, r)
    across = _sum_of((of_cylinder, _scaled(1, 4, square)), (of_sphere, _scaled(1, 5, square)))
    away = h * h + (_scaled(3, 4, h, r) + _scaled(1, 5, square))
    along = _sum_of((of_cylinder, _scaled(1, 3, h, h)), (of_sphere, away))
    return _mean(of_cylinder + of_sphere, True, [across, across, along])


def _surface(kind: str, sizes: list[Term]) -> _Shape:
    if kind == "sphere":
        (r,) = sizes
        return _Shape(_scaled(4, 1, r, r), True, vector([_scaled(1, 3, r, r)] * 3))
    if kind == "box":
        faces = [_scaled(8, 1, sizes[(axis + 1) % 3], sizes[(axis + 2) % 3]) for axis in range(3)]
        area = faces[0] + (faces[1] + faces[2])
        squares = [size * size for size in sizes]
        # The faces across an axis are that far away; the others reach from there to there.
        moments = [_sum_of(*((faces[face], _scaled(1, 1 if face == axis else 3, squares[axis])) for face in range(3))) for axis in range(3)]
        return _mean(area, False, moments)
    r, h = sizes
    square, wall = r * r, _scaled(4, 1, r, h)
    if kind == "cylinder":
        caps = _scaled(2, 1, square)
        across = _sum_of((wall, _scaled(1, 2, square)), (caps, _scaled(1, 4, square)))
        along = _sum_of((wall, _scaled(1, 3, h, h)), (caps, h * h))
    else:
        caps = _scaled(4, 1, square)
        across = _sum_of((wall, _scaled(1, 2, square)), (caps, _scaled(1, 3, square)))
        away = h * h + (h * r + _scaled(1, 3, square))
        along = _sum_of((wall, _scaled(1, 3, h, h)), (caps, away))
    return _mean(wall + caps, True, [across, across, along])


def _sum_of(*products: tuple[Term, Term]) -> Term:
    return sum((first * second for first, second in products), products[0][0].builder.number(0))


def _mean(measure: Term, has_pi: bool, moments: list[Term]) -> _Shape:
    return _Shape(measure, has_pi, vector(moment / measure for moment in moments))


# A motion, the angular velocity and the velocity of a frame's origin, or a force, the moment about it and the force: (2, 3).
Spatial = Vector


def spatial(angular: Vector, linear: Vector) -> Spatial:
    """A motion or a force of its two vectors."""
    return matrix((angular, linear))


def power(motion: Spatial, force: Spatial) -> Term:
    """Power of a force along a motion."""
    found: Term = motion[0] @ force[0] + motion[1] @ force[1]
    return found


@dataclass(frozen=True)
class Rigid:
    """Mass, first moments and moments about the origin of a frame."""

    mass: Term
    first: Vector
    second: Matrix

    def __add__(self, other: Rigid) -> Rigid:
        """Both as one body."""
        second = self.second + other.second
        return Rigid(self.mass + other.mass, self.first + other.first, second)

    def moved(self, frame: Frame) -> Rigid:
        """The same about the origin of what ``frame`` stands in, its own being that of ``frame``."""
        turn, shift = frame.turn, frame.shift
        first = turn @ self.first
        second = turn @ self.second @ turn.T
        half = first + (self.mass * Fraction(1, 2)) * shift
        two, zero = self.mass.builder.number(2), self.mass.builder.number(0)
        # With h' = h + m p / 2: 2 (p.h') 1 - p h'' - h' p'.
        trace = two * (shift @ half)
        moments = by_entries(lambda i, j: second[i, j] + ((trace if i == j else zero) - (shift[i] * half[j] + half[i] * shift[j])))
        return Rigid(self.mass, first + self.mass * shift, moments)

    def momentum(self, motion: Spatial) -> Spatial:
        """Moment of momentum about the origin, and momentum."""
        angular, linear = motion
        moment = self.second @ angular + cross(self.first, linear)
        return spatial(moment, self.mass * linear + cross(angular, self.first))


@dataclass(frozen=True)
class Lump:
    """A part of a body: its mass, its centre of mass, and its moments of inertia about that, in the axes and from the origin of a frame."""

    mass: Term
    centre: Vector
    moments: Matrix

    def in_frame(self, frame: Frame) -> Lump:
        """The same in what ``frame`` stands in, its own being ``frame``."""
        centre = frame.at(self.centre)
        return Lump(self.mass, centre, frame.turn @ self.moments @ frame.turn.T)

    def about_origin(self, builder: FileBuilder) -> Rigid:
        """The lump about the origin of its frame."""
        return Rigid(self.mass, builder.still, self.moments).moved(Frame(builder.identity, self.centre))


def joined(builder: FileBuilder, parts: Iterable[Rigid]) -> Rigid:
    """All parts as one body, which is nothing without any."""
    return sum(parts, Rigid(builder.zero, builder.still, builder.zeros(3, 3)))


class Weights:
    """The inertia of the bodies of one tree, all scaled as its ``total_mass`` says."""

    def __init__(self, builder: FileBuilder, tree: Tree | None = None) -> None:
        self._builder = builder
        self._scale: Term | None = None
        if tree is not None and tree.total_mass is not None:
            total = builder.number(tree.total_mass)
            self._scale = total / self.mass(tree)

    def mass(self, tree: Tree) -> Term:
        """The mass of all bodies."""
        return sum((part.mass for body in tree.bodies for part in self.parts(body)), self._builder.zero)

    def parts(self, body: Body) -> Iterator[Rigid]:
        """A body's inertia and solids, each about the origin of the body's frame."""
        for lump in self.lumps(body):
            yield lump.about_origin(self._builder)

    def lumps(self, body: Body) -> Iterator[Lump]:
        """A body's inertia and solids, each about its own centre of mass, in the body's frame."""
        builder, scale = self._builder, self._scale
        given: tuple[Inertia | Solid, ...] = (body.inertia, *body.solids) if body.inertia else body.solids
        for part in given:
            frame = placed(builder, part.pose)
            mass, moments = _of_part(builder, part)
            if scale is not None:
                mass, moments = scale * mass, scale * moments
            yield Lump(mass, frame.shift, frame.turn @ moments @ frame.turn.T)


def _of_part(builder: FileBuilder, part: Inertia | Solid) -> tuple[Term, Matrix]:
    """Mass, and moments of inertia along the axes of its own frame."""
    if isinstance(part, Inertia):
        moments = builder.vector(part.moments)
        return builder.number(part.mass), matrix(square(moments))
    mass, principal = mass_and_moments(builder, part)
    return mass, matrix(square([*principal, *builder.still]))


def square(moments: Sequence[Any]) -> list[list[Any]]:
    """The symmetric matrix of moments xx, yy, zz, xy, xz, yz, by rows."""
    xx, yy, zz, xy, xz, yz = moments
    return [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]


def about_centre(mass: Any, moments: Sequence[Any]) -> tuple[list[Any], list[list[Any]]]:
    """Centre of mass and moments of inertia about it, by rows, of three first moments and nine about an origin: of any numbers."""
    centre = [part / mass for part in moments[:3]] if mass != 0 else [mass * 0] * 3
    squared = sum((part * part for part in centre), mass * 0)
    return centre, [
        [moments[3 + 3 * i + j] - mass * ((squared if i == j else 0) - centre[i] * centre[j]) for j in range(3)] for i in range(3)
    ]
