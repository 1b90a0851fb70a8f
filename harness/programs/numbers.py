"""Constants in double-double with bounds of their errors; the arithmetic is that of ``harness.programs.loops.double_double``."""

from __future__ import annotations

import math
from collections.abc import Iterable
from fractions import Fraction
from typing import Any

# high + low is what is known, bound what it may be wrong by.
Number = tuple[float, float, float]
# One unit roundoff of z is |z| 2^-53, which is once to twice half a unit in its last place.
UNIT_ROUNDOFF = 2.0**-53
# Numbers on which one instruction of the processor works at once.
LANES = 4
# Half a unit in the last place stops shrinking at the smallest subnormal number, 2^-1074: the roundoff of an input z is
# UNIT_ROUNDOFF * max(|z|, SMALLEST_SCALE).
SMALLEST_SCALE = 2.0**-1021


def exactly(value: Fraction) -> Number:
    """``value`` in double-double, with a bound of what is left; NaN for the bound where it is out of range."""
    try:
        high = float(value)
        low = float(value - Fraction(high))
        rest = abs(value - Fraction(high) - Fraction(low))
        return high, low, math.nextafter(float(rest), math.inf) if rest else 0.0
    except OverflowError:
        return math.nan, 0.0, math.nan


def root_of_ball(square: Any) -> Any:
    """The square root of an ``arb`` that is a sum of squares, whose ball may reach below 0."""
    return square.nonnegative_part().sqrt()


def length_of_balls(parts: Iterable[Any]) -> Any:
    """The Euclidean length of a vector of ``arb``; a power of a ball around 0 would be no number, and a product is one."""
    return root_of_ball(sum(part * part for part in parts))


def pi() -> Number:
    """The ratio of a circle's circumference to its diameter."""
    import flint

    with flint.ctx.workprec(400):
        return of_ball(flint.arb.pi())


def of_ball(ball: Any) -> Number:
    """An ``arb`` in double-double."""
    high = float(ball)
    low = float(ball - high)
    return high, low, math.nextafter(float((ball - high - low).abs_upper()), math.inf)
