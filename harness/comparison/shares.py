"""Shares of a vector that several causes make together: exact Shapley values, sampled ones, and their size in the kinetic-energy norm.

Source: Shapley, A Value for n-Person Games (1953); Castro, Gomez and Tejada, Polynomial calculation of the Shapley value based on
sampling (2009). Proofs: docs/inside/numerics.md, "The gap between two motions".
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from harness.arrays import Array

# The causes that are exchanged, as bits.
Chosen = int


def exchanges(values: Mapping[Chosen, Any], place: int, count: int) -> list[tuple[float, Any]]:
    """Shapley terms of one of ``count`` causes: its marginal effect for each subset of the others, with its weight."""
    found = []
    for chosen, before in values.items():
        if not chosen >> place & 1:
            size = chosen.bit_count()
            weight = math.factorial(size) * math.factorial(count - size - 1) / math.factorial(count)
            found.append((weight, values[chosen | 1 << place] - before))
    return found


def sampled_orders(count: int, pairs: int, seed: int) -> list[tuple[int, ...]]:
    """Orders in which causes are exchanged, each followed by its reverse, which takes what is linear in two causes out of the error."""
    generator = np.random.default_rng(seed)
    orders = [tuple(generator.permutation(count).tolist()) for _ in range(pairs)]
    return [order for one in orders for order in (one, one[::-1])]


def along(order: Sequence[int]) -> Iterator[tuple[int, Chosen]]:
    """Each cause of an order with those that are exchanged before it."""
    chosen = 0
    for place in order:
        yield place, chosen
        chosen |= 1 << place


class EnergyNorm:
    """The kinetic-energy norm of positions and velocities, by M (nv, nv)."""

    def __init__(self, mass: Array) -> None:
        self._mass = mass

    def product(self, one: Array, other: Array) -> Array:
        """Scalar products of positions and of velocities, (2,), of vectors (2 nv,)."""
        return np.array([a @ self._mass @ b for a, b in zip(np.split(one, 2), np.split(other, 2), strict=True)])

    def sizes(self, vector: Array) -> list[float]:
        """Of positions and of velocities."""
        return [float(size) for size in np.sqrt(np.maximum(self.product(vector, vector), 0.0))]

    def part(self, vector: Array, whole: Array) -> Array:
        """The part of each half of a vector along that of ``whole``, (2,), in that; 0 where there is none."""
        size = self.product(whole, whole)
        return np.divide(self.product(vector, whole), size, out=np.zeros(2), where=size > 0)
