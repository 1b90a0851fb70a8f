"""Shrink a hard state: towards zero and short decimal numbers, while it stays hard.

What is tried is judged in batches, so that a shrunk state costs a few calls of the engine.

Source: the order of simplicity follows MacIver, Donaldson, Test-case reduction via test-case generation,
ECOOP 2020 (fewer parts first, then smaller ones).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.certify.compare import Comparison
from harness.crosscheck.variation import quaternion_columns, row_ranges, rows_of, states_of
from harness.equations.mechanism import Mechanism
from harness.equations.states import States

# A shrunk state keeps this much of the backward error: it stays worse than what random states show.
KEPT = 0.8
MOST_DIGITS = 16
_ROUNDS = 4


def shrink(judge: Callable[[States], Comparison], mechanism: Mechanism, state: States, kept: float = KEPT) -> tuple[States, float]:
    """A simpler state and its backward error, which is at least ``kept`` of that at ``state``, with the same verdict."""
    before = judge(state)
    verdict, least = before.verdicts[0], kept * before.backward_error[0]
    row, error = rows_of(state)[0], float(before.backward_error[0])
    for _ in range(_ROUNDS):
        began = row
        for candidates in _simplifications(mechanism, row):
            # Those behind a change see the row as it is now.
            rows = np.array([values for values in candidates(row) if count_digits(values) < count_digits(row)])
            if not len(rows):
                continue
            judged = judge(states_of(mechanism, rows))
            good = np.flatnonzero((judged.verdicts == verdict) & ~(judged.backward_error < least))
            if len(good):
                row, error = rows[good[0]], float(judged.backward_error[good[0]])
        if np.array_equal(row, began):
            break
    return states_of(mechanism, row[None]), error


def _simplifications(mechanism: Mechanism, row: Array) -> Iterator[Callable[[Array], list[Array]]]:
    """Functions from a state as one row to simpler ones, the simplest first."""
    nq, nv = mechanism.nq, mechanism.nv
    quaternions = [list(range(columns.start, columns.stop)) for columns in quaternion_columns(mechanism)]
    fixed = {column for quaternion in quaternions for column in quaternion}
    bounds = np.array([bounds or (-np.inf, np.inf) for bounds in row_ranges(mechanism)])
    columns = [column for column in range(len(row)) if column not in fixed]
    groups = [range(nq + nv, nq + 2 * nv), range(nq, nq + nv), [column for column in columns if column < nq]]

    def replaced(places: Any, make: Callable[[Array], list[Array]]) -> Callable[[Array], list[Array]]:
        def candidates(current: Array) -> list[Array]:
            changed = []
            for values in make(current[places]):
                other = current.copy()
                other[places] = values
                if np.all((bounds[:, 0] <= other) & (other <= bounds[:, 1])):
                    changed.append(other)
            return changed

        return candidates

    for group in groups:
        yield replaced(list(group), lambda values: [np.zeros_like(values)])
    yield replaced(columns, lambda values: [_rounded(values, digits) for digits in range(1, MOST_DIGITS)])
    for quaternion in quaternions:
        yield replaced(quaternion, lambda values: list(np.eye(4)))
    for column in columns:
        yield replaced([column], lambda values: [np.zeros(1), *(_rounded(values, digits) for digits in range(1, MOST_DIGITS))])


def _rounded(values: Array, digits: int) -> Array:
    """``values`` as decimals of so many significant digits."""
    return np.array([float(f"{value:.{digits - 1}e}") for value in values])


def count_digits(values: Array) -> int:
    """The number of digits it takes to write the numbers, none for a zero."""
    return sum(len(np.format_float_scientific(value, trim="-").split("e")[0].lstrip("-")) for value in values.tolist() if value)
