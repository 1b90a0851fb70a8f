"""The elliptic cone of the forces of a contact: its three zones, and the second derivative of its cost.

Along the rows of a contact, y = J a - aref, the cost is half the square of the distance to the dual cone, in the metric of D = 1 / R. It
is homogeneous of the second degree, so that the force is -H(y) y with its second derivative H, which depends on the direction of y alone:
0 where the bodies part, D where the contact sticks, and between these

    H = D_1 / (mu^2 (1 + mu^2)) S (1, -mu u'; -mu u, mu N / T u u' + (mu^2 - mu N / T) 1) S,

S = diag(mu, mu_1, mu_2, ...), U_j = mu_j y_j+1, T = |U|, u = U / T, N = mu y_1, mu = mu_1 / sqrt(i) with the ratio i of impedances.

Source: MuJoCo documentation, Computation, sections Friction cones and Parameters; MuJoCo 4.0, engine_core_constraint.c,
mj_constraintUpdate, for the zones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.programs.terms import Matrix, Term, Vector, length, sqrt


class Zone(IntEnum):
    """Zones of a contact."""

    PARTS = 0
    STICKS = 1
    SLIDES = 2


@dataclass(frozen=True)
class Cone:
    """An elliptic cone, by the numbers of its parameters.

    Attributes:
        sticking, sliding: one of which is 1 where the contact does so.
        towards, rest: for each row, y where it slides, as the sum of two numbers.
        friction, ratio: mu_j, and i.
    """

    sticking: int
    sliding: int
    towards: tuple[int, ...]
    rest: tuple[int, ...]
    friction: tuple[int, ...]
    ratio: int

    @property
    def size(self) -> int:
        """Number of rows."""
        return len(self.towards)

    def put(self, found: Array, zone: int, towards: Sequence[float] | Array, rest: Sequence[float] | Array) -> None:
        """Set a state's own parameters, (parameters,)."""
        found[self.sticking], found[self.sliding] = zone == Zone.STICKS, zone == Zone.SLIDES
        if zone == Zone.SLIDES:
            found[list(self.towards)], found[list(self.rest)] = towards, rest

    def zone_at(self, found: Array) -> Zone:
        """The zone that ``put`` has set."""
        return Zone.STICKS if found[self.sticking] == 1.0 else Zone.SLIDES if found[self.sliding] == 1.0 else Zone.PARTS

    def edges(self, found: Array, y: Sequence[Any], root: Any) -> tuple[Any, Any]:
        """mu N + T, which is negative where the contact sticks, and N - mu T, which is negative where it does not part.

        ``y`` are floats or balls, and ``root`` their square root.
        """
        ratio, *friction = (type(y[0])(float(found[column])) for column in (self.ratio, *self.friction))
        mu = friction[0] / root(ratio)
        normal = mu * y[0]
        across = root(sum(((own * along) ** 2 for own, along in zip(friction, y[1:], strict=True)), type(y[0])(0.0)))
        return mu * normal + across, normal - mu * across

    def zone(self, found: Array, y: Sequence[Any], root: Any) -> Zone | None:
        """The zone of ``y``, of floats or balls; None where balls do not decide it."""
        sticking, parting = self.edges(found, y, root)
        if sticking <= 0:
            return Zone.STICKS
        if parting >= 0:
            return Zone.PARTS
        return Zone.SLIDES if sticking > 0 and parting < 0 else None

    def across(self, found: Array, y: Array, reach: Array) -> Zone | None:
        """The zone on the other side of an edge that ``reach``, of each of ``y``, may lead across; None where none does."""
        sticking, parting = self.edges(found, y.tolist(), np.sqrt)
        friction = found[list(self.friction)]
        widest = max(1.0, friction[0] / np.sqrt(found[self.ratio])) ** 2 * (reach[0] + friction @ reach[1:])
        zone = self.zone_at(found)
        if abs(sticking) <= widest:
            return Zone.SLIDES if zone == Zone.STICKS else Zone.STICKS
        if abs(parting) <= widest:
            return Zone.PARTS if zone == Zone.SLIDES else Zone.SLIDES
        return None


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
