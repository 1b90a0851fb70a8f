"""What solving for the forces of constraints may lose: by the rank of their rows, and by forces that they cancel.

Both are in the metric of M = R'R, whose factor R, (n, nv, nv), is ``norm_factor``.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from harness.arrays import Array
from harness.programs.evaluation import values
from harness.programs.mechanisms.mechanism import JACOBIAN, Constraints
from harness.programs.program import OUTPUTS, right_hand_side, without_unused


def rank_condition(constraints: Constraints, inputs: Array, norm_factor: Array) -> Array:
    """(n,) condition number of J M^-1 J' scaled to unit diagonal, over the rows that are not redundant; infinite where they lose rank.

    ``inputs``, (number of inputs, n), are those of the mechanism's programs.
    """
    rows = without_unused(replace(constraints.program, outputs={JACOBIAN: constraints.program.outputs[JACOBIAN]}))
    n, nv = norm_factor.shape[:2]
    jacobian = values(rows, inputs)[JACOBIAN].reshape(len(constraints.rows), nv, n).transpose(2, 1, 0)
    columns = _whitened(norm_factor, jacobian[:, :, list(constraints.independent)])
    with np.errstate(all="ignore"):
        columns = columns / np.linalg.norm(columns, axis=1, keepdims=True)
        usable = np.asarray(np.isfinite(columns).all(axis=(1, 2)))
        sizes = np.linalg.svd(np.where(usable[:, None, None], columns, 0.0), compute_uv=False)
        return np.where(usable, (sizes[:, 0] / sizes[:, -1]) ** 2, np.inf)


def free_size(constraints: Constraints, inputs: Array, applied: Array, norm_factor: Array) -> Array:
    """(n,) energy norm of the accelerations M^-1 f that the tree would have without constraints, under forces ``applied``, (n, nv)."""
    names = OUTPUTS[1:]
    found = values(without_unused(replace(constraints.tree, outputs={name: constraints.tree.outputs[name] for name in names})), inputs)
    force = np.array(right_hand_side({name: list(found[name]) for name in names}, list(applied.T))).T
    return np.asarray(np.linalg.norm(_whitened(norm_factor, force[:, :, None])[:, :, 0], axis=1))


def _whitened(norm_factor: Array, columns: Array) -> Array:
    """R^-T times columns, (n, nv, k); NaN where M has no factor."""
    pivots = np.diagonal(norm_factor, axis1=1, axis2=2)
    regular = np.flatnonzero(np.isfinite(norm_factor).all(axis=(1, 2)) & (pivots != 0).all(axis=1))
    found = np.full_like(columns, np.nan)
    found[regular] = np.linalg.solve(norm_factor[regular].transpose(0, 2, 1), columns[regular])
    return found
