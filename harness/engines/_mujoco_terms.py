"""The terms of the equations of motion as MuJoCo itself computes them.

M is the composite rigid bodies' with armature; gravity is the bias force at rest, velocity the bias force without
gravity, so that neither is what is left of a difference. Passive are springs, dampers and tendons.

Source: MuJoCo documentation, Computation, general framework: M v' + c = tau + J' f; API reference, ``mj_fullM``.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines import Terms


def terms_of(model: Any, addresses: tuple[Sequence[int], Sequence[int]], q: Array, v: Array, tau: Array) -> Terms:
    """Terms of an ``MjModel``; ``addresses`` are those of the columns of q and of v and tau, (n, nq) and (n, nv)."""
    import mujoco

    positions, velocities = addresses
    weightless = copy.copy(model)
    weightless.opt.gravity[:] = 0.0
    data, without_gravity = mujoco.MjData(model), mujoco.MjData(weightless)
    full = np.zeros((model.nv, model.nv))
    mass, (velocity, gravity, passive, applied) = np.empty((len(q), model.nv, model.nv)), np.empty((4, len(q), model.nv))
    for state in range(len(q)):
        for each in (data, without_gravity):
            each.qpos[positions], each.qvel[velocities], each.qfrc_applied[velocities] = q[state], v[state], tau[state]
            mujoco.mj_forward(each.model, each)
        mujoco.mj_fullM(model, data, full)
        mass[state], passive[state], applied[state], velocity[state] = full, data.qfrc_passive, data.qfrc_applied, without_gravity.qfrc_bias
        data.qvel[:] = 0.0
        mujoco.mj_forward(model, data)
        gravity[state] = data.qfrc_bias
    vectors = (np.ascontiguousarray(vector[:, velocities]) for vector in (velocity, gravity, passive, applied))
    return Terms(np.ascontiguousarray(mass[:, velocities][:, :, velocities]), *vectors)
