"""The componentwise backward error of an answer: by how many unit roundoffs the inputs must move, each by itself, to give the answer.

Proofs and sources: docs/inside/numerics.md, "Componentwise backward error".
"""

from __future__ import annotations

import math

import numpy as np

from harness.arrays import Array
from harness.programs.numbers import SMALLEST_SCALE
from harness.programs.states import States
from harness.truth.balls import columns_in_balls, forward_substitute
from harness.truth.reference import PRECISIONS, Reference, ReferenceKernel

# Of the largest component of an error: what solving for it by least squares may leave.
_NEGLIGIBLE = 1e-6


def componentwise_error(kernel: ReferenceKernel, state: States, reference: Reference, answer: Array, beyond: float = 0.0) -> float:
    """The componentwise backward error of ``answer``, (nv,), at ``state``, whose one ``reference`` is [unit roundoffs of the inputs].

    NaN where the state is not certified, the answer is not finite, or the error is certainly not ``beyond``: to see that costs
    a tenth of a millisecond, where importing the solver costs most of a second.
    """
    if not (reference.certified.all() and np.isfinite(answer).all()):
        return math.nan
    state = kernel.asked_at(state)
    [(chart, _)] = kernel.by_chart(state)
    inputs = kernel.mechanism.inputs(state)[:, 0]
    scales = np.maximum(np.abs(inputs), SMALLEST_SCALE)
    columns, _ = columns_in_balls(chart.program, inputs.tolist(), scales.tolist(), PRECISIONS)
    factor = reference.norm_factor[0]
    moved = forward_substitute(factor.T[:, :, None], columns[:, :, None])[:, :, 0]
    rounded = factor * np.maximum(np.abs(answer), SMALLEST_SCALE)
    error = factor @ ((answer - reference.high[0]) - reference.low[0])
    data, changes = np.hstack([moved, rounded]), error / kernel.unit_roundoff
    # In units in which the data move no row by more than one, none disappears beside another.
    sizes = np.abs(data).sum(axis=1)
    data, changes = data / sizes[:, None], changes / sizes
    return math.nan if least_squares_bound(data, changes) <= beyond else smallest_bound(data, changes)


def least_squares_bound(columns: Array, error: Array) -> float:
    """max_k |y_k| of the shortest y with columns y = error: at least ``smallest_bound``, and at most the root of k times that."""
    found, *_ = np.linalg.lstsq(columns, error, rcond=None)
    residual = np.abs(columns @ found - error).max()
    return float(np.abs(found).max()) if residual <= _NEGLIGIBLE * np.abs(error).max() else math.inf


def smallest_bound(columns: Array, error: Array) -> float:
    """The smallest max_k |y_k| with columns y = error, for columns (n, k) of rank n and error (n,), not 0.

    Raises:
        RuntimeError: the solver gives up.
    """
    from scipy.optimize import linprog

    largest, count = np.abs(error).max(), columns.shape[1]
    limits = np.hstack([np.vstack([np.eye(count), -np.eye(count)]), -np.ones((2 * count, 1))])
    found = linprog(
        np.append(np.zeros(count), 1.0),
        A_ub=limits,
        b_ub=np.zeros(2 * count),
        A_eq=np.hstack([columns, np.zeros((len(columns), 1))]),
        b_eq=error / largest,
        bounds=[(None, None)] * count + [(0.0, None)],
        method="highs",
    )
    if not found.success:
        raise RuntimeError(f"the linear program of the componentwise backward error: {found.message}")
    return float(found.fun * largest)
