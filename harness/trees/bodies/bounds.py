"""A tree's bodies after its bounds: least masses and principal moments of inertia, and means of moments that no body can have.

The bounds are for each body by itself, in this order: mass, then principal moments, then their mean. A body that they leave alone
keeps its numbers; of another one, numbers that stand nowhere in the file are exact to 256 bits.

Source: MuJoCo documentation, XML reference, ``compiler``: ``boundmass``, ``boundinertia`` and ``balanceinertia``. The order is not
documented; it is that of MuJoCo 4.0, user/user_objects.cc, mjCBody::Compile.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from harness.files.tree import ORIGIN, Body, Bounds, Inertia, Placement, Pose, Tree, Vector, vector
from harness.trees.bodies.rigid import Weights, joined
from harness.trees.bodies.spatial import FileBuilder

_BITS = 256
Rows = Sequence[Sequence[Fraction]]


def bounded(tree: Tree) -> Tree:
    """The tree without bounds whose bodies are as those of ``tree`` after them; ``tree`` itself where it has none."""
    if tree.bounds is None:
        return tree
    return replace(tree, bodies=tuple(_bounded(body, tree.bounds) for body in tree.bodies), bounds=None)


@dataclass(frozen=True)
class _Weight:
    """What a body weighs: mass, and moments xx, yy, zz, xy, xz, yz in a frame whose origin is the centre of mass."""

    pose: Pose
    mass: Fraction
    moments: tuple[Fraction, ...]

    @property
    def is_diagonal(self) -> bool:
        return not any(self.moments[3:])


def _bounded(body: Body, bounds: Bounds) -> Body:
    weight = _of_solids(body) if body.solids else _of_inertia(body.inertia)
    mass, moments = max(weight.mass, bounds.mass), _moments(weight, bounds)
    if (mass, moments) == (weight.mass, weight.moments):
        return body
    place = body.inertia.place if body.inertia is not None else body.place
    return replace(body, inertia=Inertia(weight.pose, mass, moments, place), solids=())


def _of_inertia(inertia: Inertia | None) -> _Weight:
    """The weight of a body without solids, which stands in its origin where it has none."""
    return _Weight((), Fraction(0), (Fraction(0),) * 6) if inertia is None else _Weight(inertia.pose, inertia.mass, inertia.moments)


def _of_solids(body: Body) -> _Weight:
    """The weight of a body with solids; in the frame of the only one, of which all is known without a sum."""
    heavy = [solid for solid in body.solids if not solid.is_massless]
    alone = len(heavy) == 1 and body.inertia is None
    parts = replace(body, solids=(replace(heavy[0], pose=()),)) if alone else body
    mass, first, second = _evaluated(parts)
    centre = vector([component / mass for component in first]) if mass else ORIGIN
    squared = _sum(component * component for component in centre)
    about = [[second[i][j] - mass * ((squared if i == j else 0) - centre[i] * centre[j]) for j in range(3)] for i in range(3)]
    return _Weight(heavy[0].pose if alone else (Placement(centre),), mass, _six(about))


def _evaluated(body: Body) -> tuple[Fraction, Vector, Rows]:
    """Mass, first moments, and moments about the origin of the body's frame."""
    import flint

    builder = FileBuilder(())
    total = joined(builder, Weights(builder).parts(body))
    with flint.ctx.workprec(_BITS):
        found = builder.evaluated({"all": [total.mass, *total.first, *total.second.flat]})["all"]
        mass, x, y, z, *second = (_middle(value) for value in found)
    return mass, vector((x, y, z)), [second[3 * row : 3 * row + 3] for row in range(3)]


def _middle(ball: Any) -> Fraction:
    mantissa, exponent = ball.mid().man_exp()
    return Fraction(int(mantissa)) * Fraction(2) ** int(exponent)


def _moments(weight: _Weight, bounds: Bounds) -> tuple[Fraction, ...]:
    """The moments after the bounds; the very ones where these leave them alone."""
    if weight.is_diagonal:
        return (*_balanced(tuple(max(moment, bounds.moment) for moment in weight.moments[:3]), bounds), *weight.moments[3:])
    values, axes = _principal(_square(weight.moments))
    least = tuple(max(value, bounds.moment) for value in values)
    after = _balanced(least, bounds)
    if after == values:
        return weight.moments
    if len(set(after)) == 1:
        return (*after, *ORIGIN)
    return _six([[_sum(value * axis[i] * axis[j] for value, axis in zip(after, axes, strict=True)) for j in range(3)] for i in range(3)])


def _balanced(moments: tuple[Fraction, ...], bounds: Bounds) -> tuple[Fraction, ...]:
    return (_sum(moments) / 3,) * 3 if bounds.balances and _violates(moments) else moments


def _sum(values: Iterable[Fraction]) -> Fraction:
    return sum(values, Fraction(0))


def _violates(moments: Sequence[Fraction]) -> bool:
    """Whether one principal moment is more than the sum of the others."""
    return 2 * max(moments) > sum(moments)


def _principal(matrix: Rows) -> tuple[tuple[Fraction, ...], Rows]:
    """Principal moments and their axes, by rows."""
    import mpmath

    def exactly(number: mpmath.mpf) -> Fraction:
        return Fraction(int(mpmath.ldexp(number, 2 * _BITS)), 1 << 2 * _BITS)

    with mpmath.workprec(_BITS):
        given = mpmath.matrix([[mpmath.mpf(entry.numerator) / entry.denominator for entry in row] for row in matrix])
        values, axes = mpmath.eigsy(given)
        return tuple(map(exactly, values)), [[exactly(axes[row, column]) for row in range(3)] for column in range(3)]


def _square(moments: Sequence[Fraction]) -> Rows:
    xx, yy, zz, xy, xz, yz = moments
    return [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]


def _six(rows: Rows) -> tuple[Fraction, ...]:
    return (rows[0][0], rows[1][1], rows[2][2], rows[0][1], rows[0][2], rows[1][2])
