"""Numbers that have trends, and their logarithms, by which changes are found: of an error above a floor, and of a cost."""

from __future__ import annotations

import math

# A change of an error by less than so many data roundoffs is none: one unit roundoff of an input moves the answer by one.
LEAST_ERROR, LARGEST_ERROR = 0.1, 1e16
MEDIAN, PERCENTILE_99, WORST, COST = "median backward error", "99 % backward error", "worst backward error", "cost"
# Backward errors that are followed from run to run, by the titles of their columns.
TRACKED = {"trend of the worst": WORST, "trend of the 99 %": PERCENTILE_99, "trend of the median": MEDIAN}


def logarithm_of(value: float, number: str) -> float:
    """Logarithm of a value of the number of this name; that of the largest error for NaN."""
    if number == COST:
        return math.log(value)
    return math.log(min(max(value, 0.0), LARGEST_ERROR) + LEAST_ERROR) if not math.isnan(value) else math.log(LARGEST_ERROR)


def number_of(logarithm: float, number: str) -> float:
    """The value with this logarithm."""
    value = math.exp(logarithm)
    return value if number == COST else max(0.0, value - LEAST_ERROR)


def change_of(before: float, now: float, number: str) -> float:
    """Logarithm of the ratio of two values, which may be zero."""
    floor = 0.0 if number == COST else LEAST_ERROR
    return math.log((now + floor) / (before + floor))
