"""Cholesky factors of batches of mass matrices, scaled to unit diagonal, in float64 and in balls.

Sources: Golub, Van Loan, Matrix Computations, 4th ed., section 4.2 (Cholesky); van der Sluis, Condition numbers
and equilibration of matrices, Numer. Math. 14 (1969), for the scaling.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from harness.arrays import Array


def scaled_cholesky(mass: Array) -> tuple[Array, Array]:
    """Scale (nv, n) and lower factor (nv, nv, n) of M = diag(scale) L L' diag(scale), L L' of unit diagonal.

    NaN where M is not positive definite in float64. Scaling first costs no digits and saves those that
    badly scaled coordinates would lose (van der Sluis).
    """
    n, nv = mass.shape[:2]
    scale = np.sqrt(np.diagonal(mass, axis1=1, axis2=2).T)
    scaled = mass.transpose(1, 2, 0) / scale[:, None] / scale[None]
    factor = np.zeros((nv, nv, n))
    for j in range(nv):
        factor[j, j] = np.sqrt(scaled[j, j] - (factor[j, :j] ** 2).sum(axis=0))
        for i in range(j + 1, nv):
            factor[i, j] = (scaled[i, j] - (factor[i, :j] * factor[j, :j]).sum(axis=0)) / factor[j, j]
    return scale, factor


def cholesky_in_balls(upper: Sequence[Any], pairs: list[tuple[int, int]], scale: Sequence[float]) -> Array:
    """The factor (nv, nv) of ``scaled_cholesky`` from M in balls at the working precision, to the last digit.

    NaN where M is not certainly positive definite at this precision.
    """
    import flint

    n = len(scale)
    factor = np.zeros((n, n))
    if not all(0 < value < math.inf for value in scale):
        return np.full_like(factor, np.nan)
    entries = {(j, i): entry / (flint.arb(scale[i]) * flint.arb(scale[j])) for (i, j), entry in zip(pairs, upper, strict=True)}
    exact: dict[tuple[int, int], Any] = {}
    for j in range(n):
        pivot = entries[j, j] - sum((exact[j, k] ** 2 for k in range(j)), flint.arb(0))
        if not pivot > 0:
            return np.full_like(factor, np.nan)
        exact[j, j] = pivot.sqrt()
        for i in range(j + 1, n):
            exact[i, j] = (entries[i, j] - sum((exact[i, k] * exact[j, k] for k in range(j)), flint.arb(0))) / exact[j, j]
    for place, entry in exact.items():
        factor[place] = float(entry)
    return factor


def forward_substitute(factor: Array, columns: Array) -> Array:
    """L^-1 columns, for factor (nv, nv, n) and columns (nv, k, n)."""
    solution = np.empty_like(columns)
    for i in range(len(columns)):
        known = (factor[i, :i, None] * solution[:i]).sum(axis=0)
        solution[i] = (columns[i] - known) / factor[i, i]
    return solution


def condition_number(factors: Array) -> Array:
    """2-norm condition numbers, (n,), of L L' for factors L (nv, nv, n); infinite where there is no factor.

    Those of L, squared: its singular values keep their digits up to twice as many orders as the eigenvalues of L L'.
    """
    matrices = factors.transpose(2, 0, 1)
    usable = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    values = np.linalg.svd(np.where(usable[:, None, None], matrices, 0.0), compute_uv=False)
    smallest, largest = values[:, -1], values[:, 0]
    return np.where(usable & (smallest > 0), (largest / np.where(smallest > 0, smallest, 1.0)) ** 2, np.inf)


def norm_over_first_axis(vectors: Array) -> Array:
    """Euclidean norms along axis 0, without overflow or underflow in the squares."""
    largest = np.abs(vectors).max(axis=0)
    divisor = np.where(largest > 0, largest, 1.0)
    return np.asarray(largest * np.sqrt(((vectors / divisor) ** 2).sum(axis=0)))
