"""Shares of a vector that several causes make together: exact Shapley values, sampled ones, and their size in the kinetic-energy norm.

Source: Shapley, A Value for n-Person Games (1953); Castro, Gomez and Tejada, Polynomial calculation of the Shapley value based on
sampling (2009). Proofs: docs/inside/numerics.md, "The gap between two motions".
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from harness.arrays import Array

# The causes that are exchanged, as bits.
Chosen = int


def exchanges(values: Mapping[Chosen, Any], place: int, count: int) -> list[tuple[float, Any]]:
    """Shapley terms of one of ``count`` causes: its marginal effect for each subset of the others, with its weight.

    The weight is the part of all orders that exchange the cause after that subset. Orders through a subset without a value are left out;
    there is one without, see ``leads_through``.
    """
    before, after = _orders(values, count)
    found = []
    for chosen, value in values.items():
        further = chosen | 1 << place
        if further != chosen and further in values:
            weight = before[chosen] * after[further] / before[(1 << count) - 1]
            found.append((weight, values[further] - value))
    return found


def leads_through(values: Collection[Chosen], count: int) -> bool:
    """True where some order of ``count`` causes comes through subsets with values alone."""
    return _orders(values, count)[0].get((1 << count) - 1, 0) > 0


def _orders(values: Collection[Chosen], count: int) -> tuple[dict[Chosen, int], dict[Chosen, int]]:
    """By subset with a value, the number of orders in which its causes come through such ones, and of those of all others behind it."""
    before, after = {0: 1} if 0 in values else {}, {(1 << count) - 1: 1} if (1 << count) - 1 in values else {}
    rising = sorted(values, key=int.bit_count)
    for chosen in rising:
        if chosen not in before:
            before[chosen] = sum(before.get(chosen ^ 1 << place, 0) for place in range(count) if chosen >> place & 1)
    for chosen in reversed(rising):
        if chosen not in after:
            after[chosen] = sum(after.get(chosen | 1 << place, 0) for place in range(count) if not chosen >> place & 1)
    return before, after


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
        products: Array = np.vecdot(one.reshape(2, -1) @ self._mass, other.reshape(2, -1))
        return products

    def sizes(self, vector: Array) -> list[float]:
        """The size of the half of positions, and of that of velocities."""
        return [float(size) for size in np.sqrt(np.maximum(self.product(vector, vector), 0.0))]

    def part(self, vector: Array, whole: Array) -> Array:
        """The part of each half of a vector along that of ``whole``, (2,), in that; 0 where there is none."""
        size = self.product(whole, whole)
        return np.divide(self.product(vector, whole), size, out=np.zeros(2), where=size > 0)
