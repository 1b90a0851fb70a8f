"""Values that answers do not tell apart: columns that are parallel, and sets of columns of less rank than they have members.

No answer distinguishes values whose columns are parallel. Of k columns of rank r, answers depend on r combinations only: the base
parameters of identification theory. A set of values whose columns are dependent is not identifiable together.

Sources: Khalil, Dombre, Modeling, Identification and Control of Robots (2002), chapter 12, on the observation matrix, and chapter 9;
Gautier, Numerical calculation of the base inertial parameters of robots, Journal of Robotic Systems 8 (1991).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from harness.arrays import Array

# The noise of columns is an estimate.
SAFETY = 4.0
# Members of a set that is sought among all columns; of a larger one the base parameters tell.
_MOST_MEMBERS = 3
# A set whose members cancel until its column is less certain than this, in the length of the other, does not do the same.
_MOST_UNCERTAIN = 1e-2
# Columns of which one is a combination of the others to less than the root of this [lengths] have no factors of their own.
_DEPENDENT = 1e-12


@dataclass(frozen=True)
class EffectColumn:
    """The derivative of answers by a value.

    Attributes:
        values: (rows, size), in a measure in which all answers weigh alike.
        noise: what is uncertain in the column's direction, relative to its norm.
    """

    values: Array
    noise: float

    @cached_property
    def norm(self) -> float:
        """Euclidean norm over all rows."""
        return float(np.linalg.norm(self.values))

    @cached_property
    def direction(self) -> Array:
        """The column as a vector of length 1."""
        return self.values.ravel() / self.norm


def are_parallel(first: EffectColumn, second: EffectColumn) -> bool:
    """True where no answer distinguishes the two values, to the noise of the columns."""
    cosine = float(first.direction @ second.direction)
    sine = float(np.linalg.norm(first.direction - cosine * second.direction))
    return sine <= SAFETY * (first.noise + second.noise)


@dataclass(frozen=True)
class BaseParameters:
    """The rank and the dependencies of k columns.

    Attributes:
        rank: number of combinations of the k values that answers feel.
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


def base_parameters(columns: Sequence[EffectColumn]) -> BaseParameters:
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


class ColumnSets:
    """Sets of at most three of some columns, and which of them do the same as another column; what all questions share is made once."""

    def __init__(self, columns: Sequence[EffectColumn]) -> None:
        self._columns = columns
        self._of_size: dict[int, tuple[Array, Array, Array]] = {}

    @cached_property
    def _directions(self) -> Array:
        return np.stack([column.direction for column in self._columns], axis=1)

    @cached_property
    def _products(self) -> Array:
        return self._directions.T @ self._directions

    @cached_property
    def _noise(self) -> Array:
        return np.array([column.noise for column in self._columns])

    def _sets(self, size: int) -> tuple[Array, Array, Array]:
        """Members (k, size) of the sets of independent columns, their scalar products (k, size, size), and the inverses of these."""
        if size not in self._of_size:
            sets = np.array(list(combinations(range(len(self._columns)), size)), dtype=np.intp).reshape(-1, size)
            squares = self._products[sets[:, :, None], sets[:, None, :]]
            sets, squares = (each[np.linalg.det(squares) > _DEPENDENT] for each in (sets, squares))
            self._of_size[size] = sets, squares, np.linalg.inv(squares)
        return self._of_size[size]

    def alternatives(self, place: int, unknown: float, is_possible: Callable[[Mapping[int, float]], bool]) -> Iterator[tuple[int, ...]]:
        """The sets of other values whose changes together do what a change of this one does: all of one, and the smallest of several.

        Args:
            unknown: the part of the column, in its length, that answers are too noisy to tell, for one other value. Of several, noise
                would let too many pass: their columns are dependent to their own noise.
            is_possible: of factors as in ``BaseParameters.combinations``, whether values may change so.
        """
        own, along = self._columns[place], self._products[place]
        # What does the same alone needs no other.
        is_asked = np.arange(len(self._columns)) != place
        for size in range(1, _MOST_MEMBERS + 1):
            sets, squares, inverses = self._sets(size)
            asked = is_asked[sets].all(axis=1)
            sets, squares, inverses = sets[asked], squares[asked], inverses[asked]
            factors = np.einsum("sij,sj->si", inverses, along[sets])
            uncertain = SAFETY * np.hypot(own.noise, np.linalg.norm(factors * self._noise[sets], axis=1))
            bound = unknown * (size == 1) + uncertain
            # The square of what is left has half of the digits: it sorts out, and what is left itself decides.
            left = 1.0 - 2 * (factors * along[sets]).sum(axis=1) + np.einsum("si,sij,sj->s", factors, squares, factors)
            near = (left <= bound**2 + _DEPENDENT * (1 + (factors**2).sum(axis=1))) & (uncertain <= _MOST_UNCERTAIN)
            same, found = set[int](), list[tuple[int, ...]]()
            for members, square, least in zip(sets[near].tolist(), squares[near], bound[near].tolist(), strict=True):
                parts = np.linalg.solve(square, along[members])
                if float(np.linalg.norm(own.direction - self._directions[:, members] @ parts)) <= least:
                    same |= {*members}
                    scaled = {one: float(part) * own.norm / self._columns[one].norm for one, part in zip(members, parts, strict=True)}
                    found += [tuple(scaled)] * bool(is_possible(scaled))
            yield from found
            if size > 1 and found:
                return
            if size == 1:
                is_asked[[*same]] = False
