"""The elliptic cone of the forces of a contact: its three zones, and the second derivative of its cost.

Along the rows of a contact, y = J a - aref, the cost is half the square of the distance to the dual cone, in the metric of D = 1 / R. It
is homogeneous of the second degree, so that the force is -H(y) y with its second derivative H, which depends on the direction of y alone:
0 where the bodies part, D where the contact sticks, and between these

    H = D_1 / (mu^2 (1 + mu^2)) S (1, -mu u'; -mu u, mu N / T u u' + (mu^2 - mu N / T) 1) S,

S = diag(mu, mu_1, mu_2, ...), U_j = mu_j y_j+1, T = |U|, u = U / T, N = mu y_1, mu = mu_1 / sqrt(i) with the ratio i of impedances.

By Coulomb's law what slides does not part besides. The normal force is -D y_1 where y_1 < 0, and where mu N + T > 0 the others are
-D mu_j y_1 u_j. They are homogeneous too, of the first degree, and -H(y) y with

    H = D (1, 0; -mu_j u_j, -y_1 / T mu_j (1 - u u') mu_k),

which is not symmetric, since there is no cost.

Source: MuJoCo documentation, Computation, sections Friction cones and Parameters; MuJoCo 4.0, engine_core_constraint.c,
mj_constraintUpdate, for the zones; De Saxce, Feng, The bipotential method, Mathl. Comput. Modelling 28 (1998), for Coulomb's law.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.programs.loops.interpreter import Bounded
from harness.programs.numbers import UNIT_ROUNDOFF, root_of_ball
from harness.programs.terms import Matrix, Term, Vector, length, sqrt

Flags = np.ndarray[Any, np.dtype[np.bool_]]
# Roundings of an edge in float64 of at most five coefficients, in part of each y.
_ROUNDINGS = 64
# Of the distance from the axis, how far y may be from where the weights of a contact that slides are taken.
_NEAR = 2.0**-64


class Zone(IntEnum):
    """Zones of a contact."""

    PARTS = 0
    STICKS = 1
    SLIDES = 2


@dataclass(frozen=True)
class Flow:
    """The forces of an elliptic cone.

    Attributes:
        is_convex: whether they are those of a convex cost.
        edges: two numbers of ratio and coefficients, of y, and of a square root: negative where the contact sticks, and where it does not
            part. weights, weights_at: H of a contact that slides, as ``sliding_weights`` and ``sliding_weights_at``.
    """

    is_convex: bool
    edges: Callable[[Any, Any, Any], tuple[Any, Any]]
    weights: Callable[[Term, Vector, Term, Vector], Matrix]
    weights_at: Callable[[Array, Array, Array, Array], Array]


def _edges(numbers: Any, y: Any, root: Any) -> tuple[Any, Any]:
    """As ``Cone.edges``, of arrays or balls; ``numbers`` are the ratio and the coefficients of friction."""
    ratio, *friction = numbers
    mu = friction[0] / root(ratio)
    lateral = (own * along for own, along in zip(friction, y[1:], strict=True))
    normal, across = mu * y[0], root(sum(part * part for part in lateral))
    return mu * normal + across, normal - mu * across


def sliding_weights(first: Term, friction: Vector, ratio: Term, towards: Vector) -> Matrix:
    """H of a contact that slides, (rows, rows); ``first`` is D_1, ``towards`` y."""
    mu = friction[0] / sqrt(ratio)
    squared = mu * mu
    lateral = friction * towards[1:]
    across = length(lateral)
    unit, steepness = lateral / across, mu * ((mu * towards[0]) / across)
    scaled, count = first / (squared * (squared + 1)), len(towards)
    scales = [mu, *friction]
    found = np.empty((count, count), dtype=object)
    for i in range(count):
        for j in range(i, count):
            if not i:
                entry = mu.builder.number(1) if not j else -(mu * unit[j - 1])
            else:
                entry = steepness * (unit[i - 1] * unit[j - 1]) + (squared - steepness if i == j else 0)
            found[i, j] = found[j, i] = (scaled * (scales[i] * scales[j])) * entry
    return found


def sliding_weights_at(first: Array, friction: Array, ratio: Array, y: Array) -> Array:
    """The same in float64 at n states, (n, rows, rows); ``first`` and ``ratio`` are (n,), ``friction`` (n, rows - 1), y (n, rows)."""
    mu = friction[:, :1] / np.sqrt(ratio)[:, None]
    lateral = friction * y[:, 1:]
    across = np.linalg.norm(lateral, axis=1, keepdims=True)
    unit, steepness = lateral / across, mu * mu * y[:, :1] / across
    inner = np.empty((*y.shape, y.shape[1]))
    inner[:, 0, 0], inner[:, 0, 1:], inner[:, 1:, 0] = 1.0, -mu * unit, -mu * unit
    own = steepness[:, :, None]
    inner[:, 1:, 1:] = own * unit[:, :, None] * unit[:, None, :] + ((mu * mu)[:, :, None] - own) * np.eye(unit.shape[1])
    scales = np.hstack([mu, friction])
    size = first / (mu * mu * (1 + mu * mu))[:, 0]
    return np.asarray(size[:, None, None] * scales[:, :, None] * scales[:, None, :] * inner)


def _coulomb_edges(numbers: Any, y: Any, root: Any) -> tuple[Any, Any]:
    """As ``_edges``: what is pressed together does not part, however it slides."""
    ratio, first, *_ = numbers
    return _edges(numbers, y, root)[0], first / root(ratio) * y[0]


def coulomb_weights(first: Term, friction: Vector, _ratio: Term, towards: Vector) -> Matrix:
    """H of a contact that slides by Coulomb's law, (rows, rows), as ``sliding_weights``; of a ratio of 1."""
    lateral = friction * towards[1:]
    across = length(lateral)
    unit, share, count = lateral / across, towards[0] / across, len(towards)
    found = np.full((count, count), towards[0].builder.number(0), dtype=object)
    found[0, 0] = first
    for i in range(1, count):
        found[i, 0] = -(first * (friction[i - 1] * unit[i - 1]))
        for j in range(i, count):
            entry = (1 if i == j else 0) - unit[i - 1] * unit[j - 1]
            found[i, j] = found[j, i] = -(first * ((friction[i - 1] * friction[j - 1]) * (share * entry)))
    return found


def coulomb_weights_at(first: Array, friction: Array, _ratio: Array, y: Array) -> Array:
    """The same in float64 at n states, as ``sliding_weights_at``."""
    lateral = friction * y[:, 1:]
    across = np.linalg.norm(lateral, axis=1, keepdims=True)
    unit, found = lateral / across, np.zeros((*y.shape, y.shape[1]))
    found[:, 0, 0], found[:, 1:, 0] = 1.0, -friction * unit
    bent = np.eye(unit.shape[1]) - unit[:, :, None] * unit[:, None, :]
    found[:, 1:, 1:] = -(y[:, :1] / across)[:, :, None] * friction[:, :, None] * friction[:, None, :] * bent
    return np.asarray(first[:, None, None] * found)


ASSOCIATED = Flow(True, _edges, sliding_weights, sliding_weights_at)
COULOMB = Flow(False, _coulomb_edges, coulomb_weights, coulomb_weights_at)


@dataclass(frozen=True)
class Cone:
    """An elliptic cone, by the numbers of its parameters.

    Attributes:
        sticking, sliding: one of which is 1 where the contact does so.
        towards, rest: for each row, y where it slides, as the sum of two numbers.
        friction, ratio: mu_j, and i. rest_of_ratio: what i is besides, where it is the sum of two numbers; None elsewhere.
        flow: what its forces are.
    """

    sticking: int
    sliding: int
    towards: tuple[int, ...]
    rest: tuple[int, ...]
    friction: tuple[int, ...]
    ratio: int
    rest_of_ratio: int | None = None
    flow: Flow = ASSOCIATED

    @property
    def size(self) -> int:
        """Number of rows."""
        return len(self.towards)

    def put(self, found: Array, zones: Array, towards: Array, rest: Array) -> None:
        """Set the own parameters of n states, (n, parameters), from zones (n,) and y, (n, rows) each."""
        found[:, self.sticking], found[:, self.sliding] = zones == Zone.STICKS, zones == Zone.SLIDES
        slides = np.flatnonzero(zones == Zone.SLIDES)[:, None]
        found[slides, list(self.towards)], found[slides, list(self.rest)] = towards[slides[:, 0]], rest[slides[:, 0]]

    def zones_at(self, found: Array) -> Array:
        """(n,) the zones that ``put`` has set."""
        return np.where(found[:, self.sticking] == 1.0, Zone.STICKS, np.where(found[:, self.sliding] == 1.0, Zone.SLIDES, Zone.PARTS))

    def edges(self, found: Array, y: Array) -> tuple[Array, Array]:
        """mu N + T, which is negative where the contact sticks, and N - mu T, which is negative where it does not part, at n states."""
        return self.flow.edges(found[:, [self.ratio, *self.friction]].T, y.T, np.sqrt)

    def zone_in_balls(self, found: Array, y: Sequence[Any]) -> Zone | None:
        """The zone of ``y`` at one state; None where its balls do not decide it."""
        import flint

        ratio, *friction = (flint.arb(float(found[one])) for one in (self.ratio, *self.friction))
        if self.rest_of_ratio is not None:
            ratio += flint.arb(float(found[self.rest_of_ratio]))
        sticking, parting = self.flow.edges([ratio, *friction], y, root_of_ball)
        if sticking <= 0:
            return Zone.STICKS
        if parting >= 0:
            return Zone.PARTS
        return Zone.SLIDES if sticking > 0 and parting < 0 else None

    def zones(self, found: Array, y: Array) -> Array:
        """(n,) the zones of y, (n, rows), in float64; what is not a number parts."""
        sticking, parting = self.edges(found, y)
        return np.where(sticking <= 0, Zone.STICKS, np.where((sticking > 0) & (parting < 0), Zone.SLIDES, Zone.PARTS))

    def across(self, found: Array, y: Array, reach: Array) -> Array:
        """(n,) the zones on the other side of an edge that ``reach``, of each of ``y``, may lead across; the own ones where none does."""
        (sticking, parting), widest, own = self.edges(found, y), self._widest(found, reach), self.zones_at(found)
        parts = np.where(own == Zone.SLIDES, Zone.PARTS, Zone.SLIDES)
        sticks = np.where(own == Zone.STICKS, Zone.SLIDES, Zone.STICKS)
        return np.where(np.abs(sticking) <= widest, sticks, np.where(np.abs(parting) <= widest, parts, own))

    def are_shown(self, found: Array, zones: Array, y: Bounded, from_before: Array) -> Flags:
        """(n,) whether y are certainly of these zones, and where they slide so near to where the weights are taken, ``from_before`` away.

        What the weights leave of the force is then the square of that, over the distance from the axis.
        """
        (sticking, parting), size = self.edges(found, y.high), np.abs(y.high)
        room = self._widest(found, np.abs(y.low) + y.bound + _ROUNDINGS * UNIT_ROUNDOFF * size)
        scales = np.hstack([self._mu(found)[:, None], found[:, list(self.friction)]])
        apart = np.linalg.norm(scales * (np.abs(from_before) + y.bound), axis=1)
        slides = (sticking > room) & (parting < -room) & (apart <= _NEAR * np.linalg.norm((scales * size)[:, 1:], axis=1))
        of_zone = {Zone.STICKS: sticking < -room, Zone.PARTS: parting > room, Zone.SLIDES: slides}
        return np.asarray(np.logical_or.reduce([(zones == zone) & fits for zone, fits in of_zone.items()]))

    def _mu(self, found: Array) -> Array:
        return np.asarray(found[:, self.friction[0]] / np.sqrt(found[:, self.ratio]))

    def _widest(self, found: Array, reach: Array) -> Array:
        """The most that both edges move where y moves by ``reach``."""
        across = (found[:, list(self.friction)] * reach[:, 1:]).sum(axis=1)
        return np.asarray(np.maximum(1.0, self._mu(found)) ** 2 * (reach[:, 0] + across))
