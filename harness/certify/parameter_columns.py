"""What a change of each parameter of a system does to its accelerations: exact derivatives, as those of the data roundoff."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from harness.arrays import Array
from harness.certify.reference import Reference, ReferenceKernel
from harness.equations.states import States


def parameter_derivatives(kernel: ReferenceKernel, states: States, reference: Reference, values: Sequence[float]) -> Array:
    """d(accelerations)/d(parameter), (parameters, n, nv) [SI], at parameter ``values``, by which ``reference`` was certified.

    Not a number at a state that is not certified.
    """
    mechanism = kernel.mechanism
    parameters = np.broadcast_to(np.array(values, dtype=np.float64), (len(states), len(values)))
    forces = np.empty((len(values), *reference.high.shape))
    for chart, chosen in kernel.by_chart(states):
        inputs = mechanism.inputs(states[chosen], parameters[chosen])
        derivatives = chart.derivatives(np.ascontiguousarray(inputs.T), reference.high[chosen])
        forces[:, chosen] = derivatives[:, :, -len(values) :].transpose(2, 0, 1)
    factor = np.where(reference.certified[:, None, None], reference.norm_factor, np.eye(mechanism.nv))
    with np.errstate(all="ignore"):
        slopes = np.linalg.solve(factor, np.linalg.solve(factor.transpose(0, 2, 1), forces.transpose(1, 2, 0)))
    return np.where(reference.certified[:, None], slopes.transpose(2, 0, 1), np.nan)
