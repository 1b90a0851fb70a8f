"""Fit of one value to a residual, the order in which values are fitted, and one direction that explains the errors of all states.

Proofs and sources: docs/inside/numerics.md, "A wrong number or lost digits".
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from harness.arrays import Array
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.truth.reference import ROUNDINGS, Reference
from harness.verdict import AGREEMENT

# A residual in data roundoffs is a sound engine's from here on.
SMALL_ENOUGH = 1.0
MOST_STEPS = 20
# A step that does not lessen the residual is shortened by this factor, so many times.
SHORTENED, MOST_SHORTENED = 0.3, 6
# No step is longer than this times the larger of the value and its scale.
LONGEST = 4.0
# The secant between residuals that differ by less, in data roundoffs, is rounding.
LEAST_DIFFERENCE = 1e3
# Where nothing is left in the end every full step gains much; one that leaves more than this share of the residual ends the fit.
LEAST_GAIN = 0.9
# A state agrees on a change that leaves this share of its residual.
AGREED = 1e-2
# Another value explains as well as a fitted one up to this residual, or this many times the fitted one's own.
AS_WELL, TIMES_AS_WELL = 8.0, 4.0
# A candidate whose column leaves more than this [data roundoffs, root mean square] is not fitted because of it.
NOT_WORTH_FITTING = 1e3 * AGREEMENT
# A step of a tenth of the scale may turn a column into any other.
BEND = 10.0
# Least multiple of its standard error that a change has if it is no chance. Rounding errors reach 4 over a few hundred numbers.
SIGNIFICANT = 10.0
# In each half of the mass matrices: of fewer, chance alone may exceed that.
FEWEST_MATRICES = 10


def fit(
    residual: Callable[[float], Array | None],
    derivative: Callable[[float], Array | None],
    start: float,
    column: Array | None,
    scale: float,
    is_spent: Callable[[], bool] = lambda: False,
) -> float | None:
    """The value near ``start`` at which ``residual`` is least in the square; None where it has no finite value at ``start``.

    Args:
        residual: residuals (n, nv) at a value; None where the value is refused. derivative: of them by the value, likewise.
        column: the derivative at ``start``; None to have it computed. scale: natural size of the value, above 0.
        is_spent: true where no evaluation is left; the best so far is given.
    """
    value, here = start, residual(start)
    if here is None or not np.isfinite(here).all():
        return None
    size = float(np.linalg.norm(here))
    slope = derivative(value) if column is None else column
    fresh = True
    for _ in range(MOST_STEPS):
        if slope is None or not np.isfinite(slope).all() or not slope.any() or is_spent():
            break
        if float(np.linalg.norm(here, axis=1).max()) <= SMALL_ENOUGH:
            break
        longest = LONGEST * max(abs(value), scale)
        step = float(np.clip(best_change(slope, here)[0], -longest, longest))
        taken = _lessened(residual, value, step, size, is_spent)
        stalled = taken is None
        if taken is not None:
            reached, there, smaller = taken
            if float(np.linalg.norm(there - here)) > LEAST_DIFFERENCE:
                slope, fresh = (there - here) / (reached - value), False
            stalled = smaller > LEAST_GAIN * size and abs(step) < longest
            value, here, size = taken
        if stalled:
            if fresh:
                break
            slope, fresh = derivative(value), True
    return value


def best_change(column: Array, here: Array) -> tuple[float, float]:
    """The change that leaves least of a residual if all were linear, and the share that it leaves; 0 and 1 where nothing does anything.

    ``column``: derivative of the residual, shaped alike. In numbers of about 1, as beside a state of 1e-160 squares overflow.
    """
    largest = float(np.abs(column).max())
    if not 0 < largest < math.inf:
        return 0.0, 1.0
    unit = column / largest
    length = float(np.linalg.norm(unit))
    along = float(np.vdot(unit, here)) / length
    return -along / (largest * length), math.sqrt(max(0.0, 1 - (along / float(np.linalg.norm(here))) ** 2))


def agreed(column: Array, here: Array) -> tuple[float, float]:
    """The share of the wrong states beside one that do not agree on the change of a value, and that change, the median of all.

    ``column``: as of ``best_change``. A law that is steep at some states, where nothing is linear, hides in sums what the others say.
    """
    with np.errstate(all="ignore"):
        changes = -(column * here).sum(axis=1) / (column**2).sum(axis=1)
    sizes = np.linalg.norm(here, axis=1)
    wrong = sizes > AGREEMENT
    voting = wrong & np.isfinite(changes)
    if not voting.any():
        return 1.0, 0.0
    change = float(np.median(changes[voting]))
    agree = voting & (np.linalg.norm(here + change * column, axis=1) <= AGREEMENT + AGREED * sizes)
    # One state alone agrees with itself about any value.
    return 1.0 - (int(agree.sum()) - 1) / int(wrong.sum()), change


def _lessened(
    residual: Callable[[float], Array | None], value: float, step: float, size: float, is_spent: Callable[[], bool]
) -> tuple[float, Array, float] | None:
    """(value, residual, its norm) after the longest of the shortened steps that lessens the residual; None where none does."""
    for _ in range(MOST_SHORTENED):
        reached = value + step
        if reached == value or is_spent():
            return None
        there = residual(reached)
        with np.errstate(over="ignore"):
            smaller = np.inf if there is None else float(np.linalg.norm(there))
        if there is not None and smaller < size:
            return reached, there, smaller
        # No mass is below zero: a step beyond the end of what is allowed leads to the end.
        step = -value if there is None and value * reached < 0 else step * SHORTENED
    return None


def shortest_decimal(value: float, uncertainty: float, will_do: Callable[[float], bool]) -> float:
    """The number of the fewest decimal digits within ``uncertainty`` of ``value`` that will do; ``value`` where none does."""
    for rounded in (0.0, *(float(f"{value:.{digits}e}") for digits in range(17))):
        if abs(rounded - value) <= uncertainty and will_do(rounded):
            return rounded
    return value


def as_well(left: float) -> float:
    """The residual up to which another value explains as well as one that leaves ``left`` [data roundoffs]."""
    return max(AS_WELL, TIMES_AS_WELL * left)


def screen(columns: Sequence[Array], scales: Sequence[float], here: Array) -> list[tuple[int, bool]]:
    """Places of all columns, (n, nv) each, in the order of what the best change of each leaves of a residual (n, nv) if all were linear.

    True beside a place where that, or the bend of so long a step, allows the column to explain. None where the residual is zero
    or not finite.
    """
    size = float(np.linalg.norm(here))
    if not 0 < size < math.inf:
        return []
    screened = []
    for place, (column, scale) in enumerate(zip(columns, scales, strict=True)):
        step, unexplained = best_change(column, here)
        worth = unexplained <= BEND * abs(step) / scale + NOT_WORTH_FITTING * math.sqrt(len(here)) / size
        screened.append((unexplained, place, worth))
    return [(place, worth) for _, place, worth in sorted(screened)]


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
        """Projection of errors (n, nv), whitened so that the norm of a row is the backward error there, on k derivatives."""
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
