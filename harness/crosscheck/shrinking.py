"""Shrink a hard state: towards zero and short decimal numbers, while it stays hard.

What is tried is judged in batches, so that a shrunk state costs a few calls of the engine.

Source: the order of simplicity follows MacIver, Donaldson, Test-case reduction via test-case generation,
ECOOP 2020 (fewer parts first, then smaller ones).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

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
    lowest, highest = np.array([bounds or (-np.inf, np.inf) for bounds in row_ranges(mechanism)]).T
    for _ in range(_ROUNDS):
        began = row
        for columns, simpler in _simplifications(mechanism):
            # Those behind a change see the row as it is now.
            values = simpler(row[columns])
            rows = np.tile(row, (len(values), 1))
            rows[:, columns] = values
            shorter = [count_digits(changed) < count_digits(row) for changed in rows]
            rows = rows[((lowest <= rows) & (rows <= highest)).all(axis=1) & shorter]
            if not len(rows):
                continue
            judged = judge(states_of(mechanism, rows))
            good = np.flatnonzero((judged.verdicts == verdict) & ~(judged.backward_error < least))
            if len(good):
                row, error = rows[good[0]], float(judged.backward_error[good[0]])
        if np.array_equal(row, began):
            break
    return states_of(mechanism, row[None]), error


def _simplifications(mechanism: Mechanism) -> Iterator[tuple[list[int], Callable[[Array], list[Array]]]]:
    """Columns of a state as one row, and a function from their values to simpler ones; the simplest first."""
    nq, nv = mechanism.nq, mechanism.nv
    quaternions = [list(range(columns.start, columns.stop)) for columns in quaternion_columns(mechanism)]
    columns = [column for column in range(nq + 2 * nv) if not any(column in quaternion for quaternion in quaternions)]
    for group in (range(nq + nv, nq + 2 * nv), range(nq, nq + nv), [column for column in columns if column < nq]):
        yield list(group), lambda values: [np.zeros_like(values)]
    yield columns, lambda values: [_rounded(values, digits) for digits in range(1, MOST_DIGITS)]
    for quaternion in quaternions:
        yield quaternion, lambda values: list(np.eye(4))
    for column in columns:
        yield [column], lambda values: [np.zeros(1), *(_rounded(values, digits) for digits in range(1, MOST_DIGITS))]


def _rounded(values: Array, digits: int) -> Array:
    """``values`` as decimals of so many significant digits."""
    return np.array([float(f"{value:.{digits - 1}e}") for value in values])


def count_digits(values: Array) -> int:
    """The number of digits it takes to write the numbers, none for a zero."""
    return sum(len(np.format_float_scientific(value, trim="-").split("e")[0].lstrip("-")) for value in values.tolist() if value)
