"""The range of a force as parameters of a program: how much of the force counts, and the bound in its place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from harness.arrays import Array

# Least and largest forces, (n, clamps) each.
Ranges = tuple[Array, Array]


@dataclass(frozen=True)
class Clamp:
    """A range of a force: the parameters ``share`` and ``constant`` by their numbers, and the bounds [N or N m].

    ``bounds``: the parameters that say how often the lower and the upper bound count, and those that the bounds are, -1 for a bound of 0;
    () where the constant is the bound.
    ``size``: the parameter that is the largest force in either direction, of which the constant is a multiple; -1 without.
    """

    share: int
    constant: int
    low: float
    high: float
    bounds: tuple[int, ...] = ()
    size: int = -1

    @property
    def own(self) -> tuple[int, ...]:
        """The parameters that each state has of its own."""
        return self.share, self.constant, *(column for column in self.bounds[:2] if column >= 0)

    def least(self, found: Array) -> Array:
        """(n,) lower bounds in parameters of n states."""
        if self.size >= 0:
            return -found[:, self.size]
        return found[:, self.bounds[2]] if self.bounds and self.bounds[2] >= 0 else np.full(len(found), self.low)

    def most(self, found: Array) -> Array:
        """(n,) upper bounds."""
        if self.size >= 0:
            return found[:, self.size]
        return found[:, self.bounds[3]] if self.bounds and self.bounds[3] >= 0 else np.full(len(found), self.high)

    def put(self, found: Array, sides: Array, low: Array, high: Array) -> None:
        """Set a state's own parameters where it is below the range, inside or beyond, as ``sides`` (n,) say by -1, 0 and 1."""
        found[:, self.share] = sides == 0
        unit = found[:, self.size] if self.size >= 0 else 1.0
        found[:, self.constant] = 0.0 if self.bounds else np.where(sides == 0, 0.0, np.where(sides < 0, low, high) / unit)
        for column, is_beyond in zip(self.bounds[:2], (sides < 0, sides > 0), strict=False):
            if column >= 0:
                found[:, column] = is_beyond

    def side(self, found: Array, high: Array) -> Array:
        """(n,) the sides that ``put`` has set."""
        below, above = self.bounds[:2] or (-1, -1)
        if max(below, above) < 0:
            is_above = found[:, self.constant] * (found[:, self.size] if self.size >= 0 else 1.0) == high
        else:
            is_above = found[:, above] == 1.0 if above >= 0 else found[:, below] != 1.0
        return np.where(found[:, self.share] == 1.0, 0.0, np.where(is_above, 1.0, -1.0))
