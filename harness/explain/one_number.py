"""One direction of the parameters that explains the errors of all states: a wrong number, however ill-conditioned M is.

Rounding errors at different mass matrices have nothing to do with each other. A wrong number moves every answer by the same
multiple of its own derivative. So the errors are projected on the derivatives by each number: least squares with one unknown,
states weighted by what their conditioning may lose. The errors of states that share M are one observation, for their rounding
is shared too; how far observations disagree about the multiple is its standard error.

Source: Belsley, Kuh, Welsch, Regression Diagnostics (1980), chapter 2; Liang, Zeger, Longitudinal data analysis using
generalized linear models, Biometrika 73 (1986), for errors that are dependent within groups.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from harness.arrays import Array
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.truth.reference import ROUNDINGS, Reference
from harness.verdict import AGREEMENT

# Least multiple of its standard error that a change has if it is no chance. Rounding errors reach 4 over a few hundred numbers.
SIGNIFICANT = 10.0
# In each half of the mass matrices: of fewer, chance alone may exceed that.
FEWEST_MATRICES = 10


@dataclass(frozen=True)
class NumberDirection:
    """The change of one number that explains the errors.

    Attributes:
        index: of the number. change: of its value, in the unit of its derivative.
        effect: what the change does to the accelerations, at the state that feels it most [data roundoffs].
        significance: the change over its standard error, in that half of the mass matrices where it is less.
    """

    index: int
    change: float
    effect: float
    significance: float

    @property
    def explains(self) -> bool:
        """True where the change is no chance, and would itself not agree."""
        return self.significance > SIGNIFICANT and self.effect > AGREEMENT


@dataclass(frozen=True)
class Projection:
    """Errors of n states projected on k columns, summed over the states that share one of m mass matrices.

    Attributes:
        products, squares: (k, m) of errors with columns, and of columns. largest: (k,) norm of the column [data roundoffs per unit].
    """

    products: Array
    squares: Array
    largest: Array

    @classmethod
    def of(cls, reference: Reference, residual: Array, columns: Sequence[Array]) -> Projection:
        """Of errors (n, nv), whitened so that the norm of a row is the backward error there, and their derivatives by k numbers."""
        with np.errstate(all="ignore"):
            noise = 1 + UNIT_ROUNDOFF * reference.instability / reference.roundoff_with_share
            usable = reference.certified & np.isfinite(residual).all(axis=1) & np.isfinite(noise)
            # What the rounding of M alone may do to an answer that is solved with it [data roundoffs].
            shared = ROUNDINGS * reference.high.shape[1] * reference.condition * reference.size / reference.sensitivity
        # Where that would agree, each state speaks for itself.
        own = np.where(shared > AGREEMENT, 0, np.arange(1, len(usable) + 1))
        matrices = np.hstack([reference.norm_factor.reshape(len(usable), -1), own[:, None]])[usable]
        _, first, group = np.unique(matrices, axis=0, return_index=True, return_inverse=True)
        # In the order of the states, so that halves are alike.
        member = np.argsort(np.argsort(first))[group.ravel()][None] == np.arange(len(first))[:, None]
        weights, errors = 1 / noise[usable, None] ** 2, residual[usable]
        columns = [column[usable] for column in columns]
        sums = [[member @ (weights * column * other).sum(axis=1) for other in (errors, column)] for column in columns]
        products, squares = np.reshape(sums, (len(columns), 2, len(first))).transpose(1, 0, 2)
        largest = np.array([np.linalg.norm(column, axis=1).max(initial=0.0) for column in columns])
        return cls(products, squares, largest)


def explaining_directions(parts: Sequence[Projection]) -> list[NumberDirection]:
    """The numbers whose change explains the errors of all parts, the most significant first; [] where none does.

    Each part has the same numbers, as those of one family of mechanisms.
    """
    products, squares = (np.concatenate([getattr(part, name) for part in parts], axis=1) for name in ("products", "squares"))
    largest = np.max([part.largest for part in parts], axis=0)
    found = [_direction(index, *sums) for index, sums in enumerate(zip(products, squares, largest, strict=True))]
    return sorted((one for one in found if one is not None and one.explains), key=lambda one: -one.significance)


def _direction(index: int, products: Array, squares: Array, largest: float) -> NumberDirection | None:
    """The change of one number that leaves least of the errors; None where too few mass matrices feel it."""
    felt = squares > 0
    products, squares = products[felt], squares[felt]
    if len(squares) < 2 * FEWEST_MATRICES:
        return None
    change = float(products.sum() / squares.sum())
    # What one state alone feels explains that state, whatever its error is: both halves have to say the same.
    halves = [_change_and_deviation(products[half], squares[half]) for half in (slice(0, None, 2), slice(1, None, 2))]
    significance = min(part * math.copysign(1, change) / deviation if deviation > 0 else math.inf for part, deviation in halves)
    return NumberDirection(index, change, abs(change) * float(largest), significance if change else 0.0)


def _change_and_deviation(products: Array, squares: Array) -> tuple[float, float]:
    """The least-squares multiple, and its standard error from how far the mass matrices disagree about it."""
    change, count = float(products.sum() / squares.sum()), len(squares)
    scatter = float(((products - change * squares) ** 2).sum()) * count / (count - 1)
    return change, math.sqrt(scatter) / float(squares.sum())
