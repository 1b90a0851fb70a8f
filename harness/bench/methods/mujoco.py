"""MuJoCo on the MJCF model, with only the stages that the scene needs, and with all of them.

Source: MuJoCo documentation, Computation (forward dynamics, sparse factorisation of M) and Python bindings,
``mujoco.batch``.
"""

from __future__ import annotations

import copy
from functools import partial

import numpy as np

from harness.arrays import Array
from harness.bench.methods import Method, Prepared
from harness.crosscheck.scene import Scene
from harness.engines import Unsupported
from harness.engines.mujoco import MujocoModel
from harness.equations.states import States


def _forward(scene: Scene, states: States) -> Prepared:
    import mujoco

    loaded: MujocoModel = scene.load("mujoco", "mjcf")
    model, data = loaded.model, mujoco.MjData(loaded.model)
    positions, velocities = loaded.addresses
    configuration, velocity, force = (np.zeros((len(states), size)) for size in (model.nq, model.nv, model.nv))
    configuration[:, positions], velocity[:, velocities], force[:, velocities] = states.q, states.v, states.tau
    rows = list(zip(configuration, velocity, force, strict=True))
    found = np.full((len(states), model.nv), np.nan)

    def compute() -> None:
        q, v, applied, accelerations = data.qpos, data.qvel, data.qfrc_applied, data.qacc
        for state, (q_row, v_row, force_row) in enumerate(rows):
            q[:], v[:], applied[:] = q_row, v_row, force_row
            mujoco.mj_forward(model, data)
            found[state] = accelerations

    return Prepared(compute, lambda: np.ascontiguousarray(found[:, velocities]))


def _batch(all_stages: bool, scene: Scene, states: States) -> Prepared:
    import mujoco.batch

    loaded: MujocoModel = scene.load("mujoco", "mjcf")
    model = copy.copy(loaded.model)
    if all_stages:
        model.opt.disableflags = mujoco.mjtDisableBit.mjDSBL_AUTORESET
        if model.opt.disableflags == loaded.model.opt.disableflags:
            raise Unsupported("the model switches no stage off")
    batch = mujoco.batch.Batch(model, nsim=len(states), nthread=1)
    positions, velocities = loaded.addresses
    batch.bind("qpos")[:, positions] = states.q
    batch.bind("qvel")[:, velocities] = states.v
    batch.bind("qfrc_applied")[:, velocities] = states.tau
    found: Array = batch.bind("qacc")
    return Prepared(batch.forward, lambda: np.ascontiguousarray(found[:, velocities]))


FORWARD = Method("mujoco mj_forward", "mjcf", _forward, loop="Python", growth="up to 3")
BATCH = Method("mujoco batch", "mjcf", partial(_batch, False), loop="MuJoCo", growth="up to 3")
ALL_STAGES = Method("mujoco batch, all stages on", "mjcf", partial(_batch, True), loop="MuJoCo", growth="up to 3")
