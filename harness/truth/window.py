"""Rows that an engine leaves out of a step's problem, because nothing seems to lead there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from harness.arrays import Array
from harness.files.rules import StepRegularisation
from harness.programs.evaluation import values
from harness.programs.kernels import full_matrices
from harness.programs.mechanisms.mechanism import JACOBIAN
from harness.programs.program import StraightLineProgram
from harness.truth.compare import Flags


def are_beyond(
    problem: StraightLineProgram, inputs: Array, v: Array, rows: Sequence[int], distances: Array, laws: Sequence[StepRegularisation]
) -> Flags:
    """(n, rows) whether limits of n states are farther than the windows of their laws; float64 decides at the end of a window.

    ``inputs``, (number of inputs, n), are those of ``problem``, in which limits have the numbers ``rows``; v is (n, nv), distances are
    (n, rows).
    """
    outputs = values(problem, inputs[: len(problem.inputs)])
    jacobian = outputs[JACOBIAN].T.reshape(len(v), -1, v.shape[1])[:, rows]
    lengths, reaches = np.array([[law.length, law.window * law.length] for law in laws]).T
    moved = np.linalg.solve(full_matrices(outputs["mass"]), outputs["force"].T[:, :, None])[:, :, 0]
    before, change = (np.einsum("nri,ni->nr", jacobian, rates) for rates in (v, moved))
    return np.asarray(distances > reaches * np.maximum(np.abs(before), np.abs(before + lengths * change)))
