"""Base parameters: the classes of a model's values that no acceleration distinguishes, and the combinations they determine.

No acceleration distinguishes values whose perturbation columns are parallel. Of k columns of rank r, accelerations depend
on r combinations only: the base parameters of identification theory.

Sources: Gautier, Numerical calculation of the base inertial parameters of robots, Journal of Robotic Systems 8
(1991); Khalil, Dombre, Modeling, Identification and Control of Robots (2002), chapter 9.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from harness.arrays import Array
from harness.explain.columns import ChangeColumn

# The noise of columns is an estimate.
SAFETY = 4.0


def are_parallel(first: ChangeColumn, second: ChangeColumn) -> bool:
    """True where no acceleration distinguishes the two values, to the noise of the columns."""
    cosine = float(first.direction @ second.direction)
    sine = float(np.linalg.norm(first.direction - cosine * second.direction))
    return sine <= SAFETY * (first.noise + second.noise)


@dataclass(frozen=True)
class BaseParameters:
    """The rank and the dependencies of k columns.

    Attributes:
        rank: number of combinations of the k values that accelerations feel.
        combinations: place of each column that others span to the places of those that it is a combination of, with factors:
            a change of 1 of its value does what these changes of theirs do.
    """

    rank: int
    combinations: Mapping[int, Mapping[int, float]]

    def together_with(self, place: int) -> set[int]:
        """Places of the smallest set of values whose changes together do what a change of this one does; empty for none."""
        if place in self.combinations:
            return set(self.combinations[place])
        sets = [{*parts, other} - {place} for other, parts in self.combinations.items() if place in parts]
        return min(sets, key=len, default=set())


def base_parameters(columns: Sequence[ChangeColumn]) -> BaseParameters:
    """Rank and dependencies of the columns, by QR factorisation with column pivoting of the columns scaled to length 1.

    Source: Gautier (1991), section 3; Golub, Van Loan, Matrix Computations, 4th ed., sections 5.2.8 and 5.4.2.
    """
    if not columns:
        return BaseParameters(0, {})
    # By the modified process of Gram and Schmidt: libraries start threads for it that busy processors keep waiting.
    rest = np.stack([column.direction for column in columns], axis=1)
    # What rounding leaves of a column that is a combination of others.
    left = SAFETY * float(np.linalg.norm([column.noise for column in columns]))
    base: list[int] = []
    rows: list[Array] = []
    while len(base) < min(rest.shape):
        lengths = np.sqrt((rest * rest).sum(axis=0))
        pivot = int(lengths.argmax())
        if lengths[pivot] <= left:
            break
        direction = rest[:, pivot] / lengths[pivot]
        rows.append((direction[:, None] * rest).sum(axis=0))
        rest = rest - direction[:, None] * rows[-1]
        base.append(pivot)
    upper = np.array(rows).reshape(len(base), len(columns))
    others = [place for place in range(len(columns)) if place not in base]
    factors = np.linalg.solve(upper[:, base], upper[:, others]) if base and others else np.zeros((len(base), len(others)))
    combinations = {}
    for number, place in enumerate(others):
        parts = zip(base, factors[:, number].tolist(), strict=True)
        combinations[place] = {
            row: factor * columns[place].norm / columns[row].norm for row, factor in parts if abs(factor) > math.sqrt(left)
        }
    return BaseParameters(len(base), combinations)
