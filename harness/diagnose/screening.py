"""Linear screening: which values to fit to a residual, and in which order, by their columns alone.

Source: Golub, Van Loan, Matrix Computations, 4th ed., section 5.3, on what a least-squares fit leaves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from harness.arrays import Array
from harness.verdict import AGREEMENT

# So many of the best are fitted at least, and so many at most where something explains already.
LEAST_FITTED, FITTED_FOR_CLASS = 8, 16
# A candidate whose column leaves more than this [data roundoffs, root mean square] is not fitted because of it.
NOT_WORTH_FITTING = 1e3 * AGREEMENT
# A step of a tenth of the scale may turn a column into any other.
BEND = 10.0


@dataclass(frozen=True)
class Promise:
    """What a column says of its value.

    Attributes:
        place: in the sequence screened.
        unexplained: the share of the residual's norm that the best change leaves if all were linear.
        worth: whether that, or the bend of so long a step, allows it to explain.
    """

    place: int
    unexplained: float
    worth: bool


def screen(columns: Sequence[Array], scales: Sequence[float], here: Array) -> list[Promise]:
    """Promises of all columns, (n, nv) each, for a residual (n, nv), the best first; none where the residual is zero or not finite."""
    size = float(np.linalg.norm(here))
    if not 0 < size < math.inf:
        return []
    promises = []
    for place, (column, scale) in enumerate(zip(columns, scales, strict=True)):
        square, along = float(np.vdot(column, column)), float(np.vdot(column, here))
        share, step = (along**2 / square / size**2, abs(along) / square) if square else (0.0, 0.0)
        unexplained = math.sqrt(max(0.0, 1 - share))
        worth = unexplained <= BEND * step / scale + NOT_WORTH_FITTING * math.sqrt(len(here)) / size
        promises.append(Promise(place, unexplained, worth))
    return sorted(promises, key=lambda promise: promise.unexplained)


def fit_in_order(
    promises: Sequence[Promise], fit: Callable[[int], None], in_class: Callable[[int], bool], explained: Callable[[], bool]
) -> None:
    """Fit the first few, then those that are worth it; once something explains, no more than a few beside its class."""
    for rank, promise in enumerate(promises):
        enough = rank >= FITTED_FOR_CLASS and explained() and not in_class(promise.place)
        if rank < LEAST_FITTED or (promise.worth and not enough):
            fit(promise.place)
