"""The masses and inertias of a tree: their sum, what they are after the bounds of the file, and those that no body can have.

The bounds, least masses and principal moments and means of moments that no body can have, are for each body by itself, in this order:
mass, then principal moments, then their mean. A body that they leave alone keeps its numbers; of another one, numbers that stand
nowhere in the file are exact to 256 bits.

Sources: MuJoCo documentation, XML reference, ``compiler``: ``boundmass``, ``boundinertia`` and ``balanceinertia``. The order is not
documented; it is that of MuJoCo 4.0, user/user_objects.cc, mjCBody::Compile. Wensing, Kim, Slotine, Linear matrix inequalities for
physically consistent inertial parameter identification, IEEE RA-L 3(1), 2018 (second moments); Higham, Computing a nearest symmetric
positive semidefinite matrix, Linear Algebra Appl. 103 (1988).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from harness.files.findings import Impossible
from harness.files.given import ORIGIN, Place, Placement, vector
from harness.files.tree import WORLD, Body, Bounds, Inertia, Tree
from harness.trees.bodies.rigid import Weights, about_centre, joined, square
from harness.trees.bodies.spatial import FileBuilder

_BITS = 256
# Relative to the largest moment: what rounding the decimals of three moments can do.
_ROUNDING = 2.0**-51
_PLACES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
_NOTHING = (0.0,) * 6
Rows = Sequence[Sequence[Fraction]]


def total_mass(tree: Tree) -> float:
    """The mass of all bodies [kg], rounded once."""
    if tree.total_mass is not None:
        return float(tree.total_mass)
    builder = FileBuilder(())
    [found] = builder.evaluated({"mass": [Weights(builder).mass(bounded(tree))]}, 128)["mass"]
    return float(found)


def bounded(tree: Tree) -> Tree:
    """The tree without bounds whose bodies are as those of ``tree`` after them; ``tree`` itself where it has none."""
    if tree.bounds is None:
        return tree
    return replace(tree, bodies=tuple(_bounded(body, tree.bounds) for body in tree.bodies), bounds=None)


def _bounded(body: Body, bounds: Bounds) -> Body:
    # A body that weighs nothing stands in its origin.
    given = whole(body) or Inertia((), Fraction(0), (Fraction(0),) * 6, body.place)
    mass, moments = max(given.mass, bounds.mass), _moments(given.moments, bounds)
    if (mass, moments) == (given.mass, given.moments):
        return body
    place = body.inertia.place if body.inertia is not None else body.place
    return replace(body, inertia=Inertia(given.pose, mass, moments, place), solids=())


def whole(body: Body) -> Inertia | None:
    """The inertia of a body with that of its solids; None where it has neither."""
    return _of_solids(body) if body.solids else body.inertia


def _of_solids(body: Body) -> Inertia:
    """The inertia of a body with solids; in the frame of the only one, of which all is known without a sum."""
    heavy = [solid for solid in body.solids if not solid.is_massless]
    alone = len(heavy) == 1 and body.inertia is None
    builder = FileBuilder(())
    total = joined(builder, Weights(builder).parts(replace(body, solids=(replace(heavy[0], pose=()),)) if alone else body))
    found = builder.evaluated({"all": [total.mass, *total.first, *total.second.flat]}, _BITS)["all"]
    mass, *moments = (_middle(value) for value in found)
    centre, about = about_centre(mass, moments)
    return Inertia(heavy[0].pose if alone else (Placement(vector(centre)),), mass, _six(about))


def _middle(ball: Any) -> Fraction:
    mantissa, exponent = ball.mid().man_exp()
    return Fraction(int(mantissa)) * Fraction(2) ** int(exponent)


def _moments(moments: tuple[Fraction, ...], bounds: Bounds) -> tuple[Fraction, ...]:
    """The moments after the bounds; the very ones where these leave them alone."""
    if not any(moments[3:]):
        return (*_balanced(tuple(max(moment, bounds.moment) for moment in moments[:3]), bounds), *moments[3:])
    values, axes = _principal(square(moments))
    after = _balanced(tuple(max(value, bounds.moment) for value in values), bounds)
    if after == values:
        return moments
    if len(set(after)) == 1:
        return (*after, *ORIGIN)
    parts = list(zip(after, axes, strict=True))
    return _six([[sum((value * axis[i] * axis[j] for value, axis in parts), Fraction(0)) for j in range(3)] for i in range(3)])


def _balanced(moments: tuple[Fraction, ...], bounds: Bounds) -> tuple[Fraction, ...]:
    """Their mean where one principal moment is more than the sum of the others."""
    total = sum(moments, Fraction(0))
    return (total / 3,) * 3 if bounds.balances and 2 * max(moments) > total else moments


def _principal(matrix: Rows) -> tuple[tuple[Fraction, ...], Rows]:
    """Principal moments and their axes, by rows."""
    import mpmath

    def exactly(number: mpmath.mpf) -> Fraction:
        return Fraction(int(mpmath.ldexp(number, 2 * _BITS)), 1 << 2 * _BITS)

    with mpmath.workprec(_BITS):
        given = mpmath.matrix([[mpmath.mpf(entry.numerator) / entry.denominator for entry in row] for row in matrix])
        values, axes = mpmath.eigsy(given)
        return tuple(map(exactly, values)), [[exactly(axes[row, column]) for row in range(3)] for column in range(3)]


def _six(rows: Any) -> tuple[Any, ...]:
    """xx, yy, zz, xy, xz, yz of a symmetric matrix."""
    return tuple(rows[i][j] for i, j in _PLACES)


def impossible_inertias(tree: Tree) -> tuple[Impossible, ...]:
    """The inertias of a tree that no body can have after its bounds, in the order of its bodies."""
    tree = bounded(tree)
    found = [(body.inertia.place, one) for body in tree.bodies if body.inertia is not None for one in _of_inertia(body, body.inertia)]
    found += _of_moving_links(tree)
    order = {body.name: number for number, body in enumerate(tree.bodies)}
    own = tree.place and tree.place.path
    named = [replace(one, file=place.path.name) if place and place.path != own else one for place, one in found]
    return tuple(sorted(named, key=lambda one: order[one.body]))


def _of_inertia(body: Body, inertia: Inertia) -> Iterator[Impossible]:
    mass, moments = float(inertia.mass), tuple(map(float, inertia.moments))
    line = inertia.place.line if inertia.place else 0
    if mass < 0:
        yield Impossible(body.name, line, "negative mass", (mass, *moments), 1.0, moments)
    exact = square(inertia.moments)
    # Of second moments, trace(I) / 2 1 - I.
    half = sum(inertia.moments[:3], Fraction(0)) / 2
    if _is_semidefinite([[half * (i == j) - entry for j, entry in enumerate(row)] for i, row in enumerate(exact)]):
        return
    values = np.linalg.eigvalsh(square(moments))
    largest = float(np.abs(values).max())
    definite = _is_semidefinite(exact)
    excess = float(values[2] - values[0] - values[1]) if definite else -float(values[0])
    if excess > _ROUNDING * largest:
        what = "A + B < C" if definite else "indefinite inertia"
        yield Impossible(body.name, line, what, (mass, *moments), excess / largest, nearest_inertia(moments))


def _of_moving_links(tree: Tree) -> Iterator[tuple[Place | None, Impossible]]:
    """Links that a joint moves, with what is fixed to them and their places: those without mass, and those that are a point."""
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
            yield place, Impossible(name, line, "massless moving link", (0.0, *_NOTHING), 1.0, _NOTHING)
        elif (
            len(heavy) == 1
            and heavy[0].inertia
            and not heavy[0].solids
            and not any(any(one.inertia.moments) for one in bodies if one.inertia)
        ):
            yield place, Impossible(name, line, "no inertia", (float(heavy[0].inertia.mass), *_NOTHING), 1.0, _NOTHING)


def nearest_inertia(moments: Sequence[float]) -> tuple[float, ...]:
    """The moments xx, yy, zz, xy, xz, yz whose matrix of second moments is the projection of the given one, as of ``Impossible``."""
    inertia = np.array(square(moments))
    values, vectors = np.linalg.eigh(np.trace(inertia) / 2 * np.eye(3) - inertia)
    second = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return tuple(map(float, _six(np.trace(second) * np.eye(3) - second)))


def _is_semidefinite(matrix: Rows) -> bool:
    """True where no eigenvalue is negative: the sums of the principal minors of each order are not, exactly."""
    (a, d, e), (_, b, f), (_, _, c) = matrix
    minors = a * b - d * d + a * c - e * e + b * c - f * f
    determinant = a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e)
    return a + b + c >= 0 and minors >= 0 and determinant >= 0
