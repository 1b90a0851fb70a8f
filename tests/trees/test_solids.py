"""The masses and inertias of geometric bodies, against integrals over slices of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from harness.files.given import vector
from harness.files.tree import Solid
from harness.trees.bodies.rigid import mass_and_moments
from harness.trees.bodies.spatial import FileBuilder

SIZES = st.floats(0.05, 3).map(Fraction)
NODES, WEIGHTS = np.polynomial.legendre.leggauss(40)
Numbers = tuple[float, ...]


def weighed(solid: Solid) -> np.ndarray:
    """Mass and principal moments, in balls."""
    builder = FileBuilder(())
    mass, moments = mass_and_moments(builder, solid)
    return np.array([float(value) for value in builder.evaluated({"found": [mass, *moments]}, 128)["found"]])


def integral(function: Callable[[float], np.ndarray], low: float, high: float) -> np.ndarray:
    """Of smooth functions, to the last digits."""
    half, middle = (high - low) / 2, (high + low) / 2
    return half * sum(weight * function(middle + half * node) for node, weight in zip(NODES, WEIGHTS, strict=True))


def of_slices(a: Callable[[float], float], b: Callable[[float], float], is_box: bool, *edges: float) -> np.ndarray:
    """Mass and second moments of a body of density 1 whose slice at z is an ellipse, or a rectangle, of half axes a(z) and b(z)."""

    def of_slice(z: float) -> np.ndarray:
        area = (4 if is_box else math.pi) * a(z) * b(z)
        share = 3 if is_box else 4
        return area * np.array([1, a(z) ** 2 / share, b(z) ** 2 / share, z * z])

    return sum(integral(of_slice, low, high) for low, high in pairwise(edges))


def of_rings(radius: Callable[[float], float], width: Callable[[float], float], *edges: float) -> np.ndarray:
    """The same of a surface of density 1 whose ring at z has a radius, and as much of the surface per z as its width says."""

    def of_ring(z: float) -> np.ndarray:
        return 2 * math.pi * width(z) * np.array([1, radius(z) ** 2 / 2, radius(z) ** 2 / 2, z * z])

    return sum(integral(of_ring, low, high) for low, high in pairwise(edges))


def inertia(moments: np.ndarray) -> np.ndarray:
    mass, x, y, z = moments
    return np.array([mass, y + z, x + z, x + y])


def dome(r: float, h: float) -> Callable[[float], float]:
    """The radius of a capsule at z."""
    return lambda z: r if abs(z) <= h else math.sqrt(max(0.0, r * r - (abs(z) - h) ** 2))


def solid(kind: str, *size: Fraction, shell: bool = False) -> Solid:
    return Solid(kind, size, (), None, Fraction(1), shell)


@pytest.mark.ci
@given(SIZES, SIZES, SIZES)
def test_solids_weigh_what_their_slices_weigh(first: Fraction, second: Fraction, third: Fraction) -> None:
    a, b, c = map(float, (first, second, third))
    round_at = dome(a, b)

    def scaled(z: float) -> float:
        return math.sqrt(max(0.0, 1 - (z / c) ** 2))

    cases = {
        "sphere": (solid("sphere", first), of_slices(dome(a, 0), dome(a, 0), False, -a, 0, a)),
        "ellipsoid": (
            solid("ellipsoid", first, second, third),
            of_slices(lambda z: a * scaled(z), lambda z: b * scaled(z), False, -c, 0, c),
        ),
        "box": (solid("box", first, second, third), of_slices(lambda z: a, lambda z: b, True, -c, c)),
        "cylinder": (solid("cylinder", first, second), of_slices(lambda z: a, lambda z: a, False, -b, b)),
        "capsule": (solid("capsule", first, second), of_slices(round_at, round_at, False, -b - a, -b, b, b + a)),
    }
    for kind, (body, expected) in cases.items():
        np.testing.assert_allclose(weighed(body), inertia(expected), rtol=1e-13, err_msg=kind)


@pytest.mark.ci
@given(SIZES, SIZES, SIZES)
def test_shells_weigh_what_their_rings_and_faces_weigh(first: Fraction, second: Fraction, third: Fraction) -> None:
    a, b, c = map(float, (first, second, third))
    # Of a sphere each zone has the area of the cylinder around it.
    half_spheres = of_rings(dome(a, b), lambda z: a, -b - a, -b) + of_rings(dome(a, b), lambda z: a, b, b + a)
    wall = of_rings(lambda z: a, lambda z: a, -b, b)
    disc = math.pi * a * a * np.array([1, a * a / 4, a * a / 4, b * b])
    faces = [8 * b * c, 8 * a * c, 8 * a * b]
    square = np.array([a * a, b * b, c * c])
    box = sum(area * np.array([1, *(square / [1 if axis == face else 3 for axis in range(3)])]) for face, area in enumerate(faces))
    cases = {
        "sphere": (solid("sphere", first, shell=True), of_rings(dome(a, 0), lambda z: a, -a, a)),
        "cylinder": (solid("cylinder", first, second, shell=True), wall + 2 * disc),
        "capsule": (solid("capsule", first, second, shell=True), wall + half_spheres),
        "box": (solid("box", first, second, third, shell=True), box),
    }
    for kind, (body, expected) in cases.items():
        np.testing.assert_allclose(weighed(body), inertia(expected), rtol=1e-13, err_msg=kind)


@pytest.mark.parametrize("kind", ["capsule", "cylinder", "box", "ellipsoid"])
def test_a_mass_scales_the_inertia_and_two_points_give_the_length(kind: str) -> None:
    size = [Fraction(1, 5)] * (1 if kind in ("capsule", "cylinder") else 2)
    explicit = Solid(kind, (*size, Fraction(3, 2)), (), Fraction(7), Fraction(0))
    ends = vector((1, 2, 3)), vector((2, 4, 5))
    between = Solid(kind, (size[0],), (), Fraction(7), Fraction(0), ends=ends)
    np.testing.assert_allclose(weighed(between), weighed(explicit), rtol=1e-15)
    by_density = weighed(Solid(kind, (*size, Fraction(3, 2)), (), None, Fraction(1)))
    np.testing.assert_allclose(weighed(explicit), by_density * 7 / by_density[0], rtol=1e-15)
