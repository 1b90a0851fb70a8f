"""The masses and inertias of a tree: their sum, and those that no body can have.

Sources: Wensing, Kim, Slotine, Linear matrix inequalities for physically consistent inertial parameter identification, IEEE RA-L
3(1), 2018 (second moments); Higham, Computing a nearest symmetric positive semidefinite matrix, Linear Algebra Appl. 103 (1988).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

import numpy as np

from harness.arrays import Array
from harness.files.findings import Impossible
from harness.files.tree import WORLD, Body, Inertia, Tree
from harness.trees.bodies.bounds import bounded
from harness.trees.bodies.rigid import Weights
from harness.trees.bodies.spatial import FileBuilder

# Relative to the largest moment: what rounding the decimals of three moments can do.
_ROUNDING = 2.0**-51
_PLACES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
_NOTHING = (0.0,) * 6
_BITS = 128


def total_mass(tree: Tree) -> float:
    """The mass of all bodies [kg], rounded once."""
    import flint

    if tree.total_mass is not None:
        return float(tree.total_mass)
    builder = FileBuilder(())
    mass = Weights(builder).mass(bounded(tree))
    with flint.ctx.workprec(_BITS):
        [found] = builder.evaluated({"mass": [mass]})["mass"]
        return float(found)


def impossible_inertias(tree: Tree) -> tuple[Impossible, ...]:
    """The inertias of a tree that no body can have after its bounds, in the order of its bodies."""
    tree = bounded(tree)
    found = [one for body in tree.bodies if body.inertia is not None for one in _of_inertia(body, body.inertia)]
    found += _of_moving_links(tree)
    order = {body.name: number for number, body in enumerate(tree.bodies)}
    return tuple(sorted(found, key=lambda one: order[one.body]))


def _of_inertia(body: Body, inertia: Inertia) -> Iterator[Impossible]:
    mass, moments = float(inertia.mass), tuple(map(float, inertia.moments))
    line = inertia.place.line if inertia.place else 0
    if mass < 0:
        yield Impossible(body.name, line, "negative mass", (mass, *moments), 1.0, moments)
    if _is_semidefinite(_second_moments(inertia.moments)):
        return
    values = np.linalg.eigvalsh(_matrix(moments))
    largest = float(np.abs(values).max())
    definite = _is_semidefinite(_square(inertia.moments))
    excess = float(values[2] - values[0] - values[1]) if definite else -float(values[0])
    if excess > _ROUNDING * largest:
        what = "A + B < C" if definite else "indefinite inertia"
        yield Impossible(body.name, line, what, (mass, *moments), excess / largest, nearest_inertia(moments))


def _of_moving_links(tree: Tree) -> Iterator[Impossible]:
    """Links that a joint moves, with what is fixed to them: those without mass, and those that are a point."""
    carrier = {WORLD: ""}
    parts: dict[str, list[Body]] = {}
    for body in tree.bodies:
        carrier[body.name] = body.name if body.joints else carrier[body.parent]
        parts.setdefault(carrier[body.name], []).append(body)
    parts.pop("", None)
    for name, bodies in parts.items():
        place = bodies[0].place
        line = place.line if place else 0
        heavy = [body for body in bodies if not body.is_massless]
        if not heavy:
            yield Impossible(name, line, "massless moving link", (0.0, *_NOTHING), 1.0, _NOTHING)
        elif (
            len(heavy) == 1
            and heavy[0].inertia
            and not heavy[0].solids
            and not any(any(one.inertia.moments) for one in bodies if one.inertia)
        ):
            yield Impossible(name, line, "no inertia", (float(heavy[0].inertia.mass), *_NOTHING), 1.0, _NOTHING)


def nearest_inertia(moments: Sequence[float]) -> tuple[float, ...]:
    """The moments xx, yy, zz, xy, xz, yz whose matrix of second moments is the projection of the given one, as of ``Impossible``."""
    inertia = _matrix(moments)
    values, vectors = np.linalg.eigh(np.trace(inertia) / 2 * np.eye(3) - inertia)
    second = (vectors * np.maximum(values, 0.0)) @ vectors.T
    found = np.trace(second) * np.eye(3) - second
    return tuple(float(found[place]) for place in _PLACES)


def _square(moments: Sequence[Fraction]) -> list[list[Fraction]]:
    xx, yy, zz, xy, xz, yz = moments
    return [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]


def _matrix(moments: Sequence[float]) -> Array:
    xx, yy, zz, xy, xz, yz = moments
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _second_moments(moments: Sequence[Fraction]) -> list[list[Fraction]]:
    """trace(I) / 2 1 - I, exactly."""
    half = sum(moments[:3], Fraction(0)) / 2
    return [[half * (i == j) - entry for j, entry in enumerate(row)] for i, row in enumerate(_square(moments))]


def _is_semidefinite(matrix: Sequence[Sequence[Fraction]]) -> bool:
    """Whether no eigenvalue is negative: the sums of the principal minors of each order are not, exactly."""
    (a, d, e), (_, b, f), (_, _, c) = matrix
    minors = a * b - d * d + a * c - e * e + b * c - f * f
    determinant = a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e)
    return a + b + c >= 0 and minors >= 0 and determinant >= 0
