"""The mass and the second moments of geometric bodies, as terms of a program.

Second moments over the mass are rational in the sizes; pi stands in the mass of a density alone.

Sources: MuJoCo documentation, XML reference, ``body/geom``: ``type``, ``size``, ``mass``, ``density``, ``shellinertia``; Featherstone,
Rigid Body Dynamics Algorithms, section 2.13, for the inertia of second moments: trace(J) 1 - J.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

from harness.equations.term import Term, Vector, sqrt, vector
from harness.files.tree import Solid
from harness.robots.spatial import FileBuilder


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
    found = factors[0].builder.number(Fraction(numerator, denominator))
    for factor in factors:
        found = found * factor
    return found


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
    parts = iter(products)
    first, second = next(parts)
    total = first * second
    for first, second in parts:
        total = total + first * second
    return total


def _mean(measure: Term, has_pi: bool, moments: list[Term]) -> _Shape:
    return _Shape(measure, has_pi, vector(moment / measure for moment in moments))
