"""Statistics of a sample of backward errors: the bounds of a quantile, and the half decade that an error is in."""

from __future__ import annotations

import math
from bisect import bisect_right
from decimal import Context, Decimal
from functools import cache

# Standard deviations of the rank between a quantile of a sample and its bounds.
BOUNDS_AT = 3.0


def quantile_ranks(count: int, share: float) -> tuple[int, int] | None:
    """The ranks, from 0, of the two values of a sorted sample that bound the quantile at ``share``; None where the sample has none.

    How many values are below the quantile is binomial, whatever they are distributed like: the ranks are ``BOUNDS_AT`` standard
    deviations of that apart from its mean.

    Source: Conover, Practical Nonparametric Statistics, 3rd ed., section 3.2.
    """
    mean, deviation = count * share, math.sqrt(count * share * (1 - share))
    low, high = math.floor(mean - BOUNDS_AT * deviation), math.ceil(mean + BOUNDS_AT * deviation)
    return (low, high) if low >= 0 and high < count else None


# Of the smallest and of the largest positive float64.
_LEAST, _LARGEST = -647, 616


@cache
def half_decade_edges() -> tuple[float, ...]:
    """The float64 nearest to 10^(k/2), ascending, from that of the smallest to that of the largest half decade of float64.

    Errors are compared with them: a logarithm may err by its last bit, and which way depends on the processor's vector units.
    """
    context = Context(prec=30)
    root = context.sqrt(Decimal(10))
    return tuple(float((root if k % 2 else Decimal(1)).scaleb(k // 2, context)) for k in range(_LEAST, _LARGEST + 1))


def half_decade(backward_error: float) -> str:
    """Key of ``Record.distribution``: the largest k whose edge is not above the error, "exact" for 0, "inf" for no finite number."""
    if not math.isfinite(backward_error):
        return "inf"
    return "exact" if backward_error == 0 else str(_LEAST - 1 + bisect_right(half_decade_edges(), backward_error))
