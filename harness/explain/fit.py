"""Fit of one value to a residual, and the order in which values are fitted.

Screening compares the derivative of the residual by each value with the residual: a value whose best linear change leaves
little is fitted first. The fit is Gauss and Newton's method. The derivative is updated by the secant of each step, which
for one value is Broyden's method, and computed anew where that fails. A step that does not lessen the residual, or that is
refused, is shortened.

Sources: Nocedal, Wright, Numerical Optimization, 2nd ed., sections 3.1 and 10.3; Golub, Van Loan, Matrix Computations,
4th ed., section 5.3, on the residual of a least-squares fit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from harness.arrays import Array
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
# Another value explains as well as a fitted one up to this residual, or this many times the fitted one's own.
AS_WELL, TIMES_AS_WELL = 8.0, 4.0
# A candidate whose column leaves more than this [data roundoffs, root mean square] is not fitted because of it.
NOT_WORTH_FITTING = 1e3 * AGREEMENT
# A step of a tenth of the scale may turn a column into any other.
BEND = 10.0


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
