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
from harness.check import tasks
from harness.equations.mechanism import Mechanism
from harness.equations.states import States

# A shrunk state keeps this much of the backward error: it stays worse than what random states show.
KEPT = 0.8
MOST_DIGITS = 16
_ROUNDS = 4


def shrink(
    judge: Callable[[States], Comparison], mechanism: Mechanism, state: States, note: tasks.Note = lambda text: None
) -> tuple[States, float]:
    """A simpler state and its backward error, which is at least ``KEPT`` of that at ``state``, with the same verdict."""
    before = judge(state)
    verdict, least = before.verdicts[0], KEPT * before.backward_error[0]
    row, error = np.hstack([state.q, state.v, state.tau])[0], float(before.backward_error[0])
    sizes = np.cumsum([mechanism.nq, mechanism.nv])

    def states_at(rows: Array) -> States:
        return States.at(*np.split(rows, sizes, axis=1))

    for _ in range(_ROUNDS):
        began = row
        for candidates in _simplifications(mechanism, row):
            # Those behind a change see the row as it is now.
            rows = np.array([values for values in candidates(row) if _is_simpler(values, row)])
            if not len(rows):
                continue
            judged = judge(states_at(rows))
            good = np.flatnonzero((judged.verdicts == verdict) & ~(judged.backward_error < least))
            if len(good):
                row, error = rows[good[0]], float(judged.backward_error[good[0]])
        if np.array_equal(row, began):
            break
    return states_at(row[None]), error


def _simplifications(mechanism: Mechanism, row: Array) -> Iterator[Callable[[Array], list[Array]]]:
    """Functions from a state as one row to simpler ones, the simplest first."""
    nq, nv = mechanism.nq, mechanism.nv
    quaternions = [place + order for order, place in enumerate(mechanism.attitudes)]
    fixed = {first + part for first in quaternions for part in range(4)}
    bounds = _bounds(mechanism)
    columns = [column for column in range(len(row)) if column not in fixed]
    groups = [range(nq + nv, nq + 2 * nv), range(nq, nq + nv), [column for column in columns if column < nq]]

    def within(values: Array) -> bool:
        return bool(np.all((bounds[:, 0] <= values) & (values <= bounds[:, 1])))

    def replaced(places: Any, make: Callable[[Array], list[Array]]) -> Callable[[Array], list[Array]]:
        def candidates(current: Array) -> list[Array]:
            changed = []
            for values in make(current[places]):
                other = current.copy()
                other[places] = values
                if within(other):
                    changed.append(other)
            return changed

        return candidates

    for group in groups:
        yield replaced(list(group), lambda values: [np.zeros_like(values)])
    yield replaced(columns, lambda values: [_rounded(values, digits) for digits in range(1, MOST_DIGITS)])
    for first in quaternions:
        yield replaced(list(range(first, first + 4)), lambda values: list(np.eye(4)))
    for column in columns:
        yield replaced([column], lambda values: [np.zeros(1), *(_rounded(values, digits) for digits in range(1, MOST_DIGITS))])


def _bounds(mechanism: Mechanism) -> Array:
    positions = [bounds or (-np.inf, np.inf) for bounds in mechanism.position_ranges]
    for place in reversed(mechanism.attitudes):
        positions[place : place + 3] = [(-1.0, 1.0)] * 4
    return np.array([*positions, *mechanism.rate_ranges, *mechanism.force_ranges], dtype=np.float64)


def _rounded(values: Array, digits: int) -> Array:
    """``values`` as decimals of so many significant digits."""
    return np.array([float(f"{value:.{digits - 1}e}") for value in values])


def _is_simpler(values: Array, than: Array) -> bool:
    return _length(values) < _length(than)


def _length(values: Array) -> int:
    """Digits it takes to write the numbers, 0 for a zero."""
    return sum(len(np.format_float_scientific(value, trim="-").split("e")[0].lstrip("-")) for value in values.tolist() if value)
