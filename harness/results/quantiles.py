"""The values of a sample between which a quantile of what it was drawn from lies."""

from __future__ import annotations

import math

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
