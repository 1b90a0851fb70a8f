"""The terms of the equations of motion as Pinocchio itself computes them.

M is the composite rigid bodies' with armature, velocity the inverse dynamics without gravity and accelerations. Passive
are the force elements that the harness adds to ABA, which applies none.

Source: Featherstone, Rigid Body Dynamics Algorithms, chapters 5 (inverse dynamics) and 6 (composite rigid bodies).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines import Terms


def terms_of(model: Any, velocities: Sequence[int], configuration: Array, velocity: Array, force: Array, passive: Array) -> Terms:
    """Terms of a ``pinocchio.Model``.

    ``velocities`` are the indices of the columns of the result; ``configuration`` (nq, n), ``velocity``, the applied
    ``force`` and the ``passive`` one (nv, n) are in Pinocchio's own order.
    """
    import pinocchio

    weightless = pinocchio.Model(model)
    weightless.gravity.linear = np.zeros(3)
    data, without_gravity = model.createData(), weightless.createData()
    n, nv = configuration.shape[1], model.nv
    mass, bias, gravity = np.empty((n, nv, nv)), np.empty((n, nv)), np.empty((n, nv))
    # Rows of a transpose cost half of what columns cost.
    for state, (q, v) in enumerate(zip(configuration.T, velocity.T, strict=True)):
        upper = np.triu(pinocchio.crba(model, data, q))
        mass[state] = upper + np.triu(upper, 1).T
        bias[state] = pinocchio.nonLinearEffects(weightless, without_gravity, q, v)
        gravity[state] = pinocchio.computeGeneralizedGravity(model, data, q)
    vectors = (np.ascontiguousarray(vector[:, velocities]) for vector in (bias, gravity, passive.T, force.T))
    return Terms(np.ascontiguousarray(mass[:, velocities][:, :, velocities]), *vectors)
