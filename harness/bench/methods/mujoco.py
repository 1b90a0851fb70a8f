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
from harness.crosscheck.assignment import Assignment, acceleration_truth_of
from harness.crosscheck.scene import Scene
from harness.engines import Subject, Unsupported
from harness.engines.adapters.mujoco import MujocoModel
from harness.files.text.scan import compact
from harness.library import CONSTRAINED, MECHANISMS
from harness.programs.states import States
from harness.truth.quantities.accelerations import AccelerationTruth


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
        q, v, applied, accelerations, warm_start = data.qpos, data.qvel, data.qfrc_applied, data.qacc, data.qacc_warmstart
        for state, (q_row, v_row, force_row) in enumerate(rows):
            q[:], v[:], applied[:] = q_row, v_row, force_row
            if model.neq:
                warm_start[:] = 0.0
            mujoco.mj_forward(model, data)
            found[state] = accelerations

    return Prepared(compute, lambda: np.ascontiguousarray(found[:, velocities]), truth=declared_truth(scene))


def batch(all_stages: bool, scene: Scene, states: States) -> Prepared:
    import mujoco.batch

    loaded: MujocoModel = scene.load("mujoco", "mjcf")
    model = copy.copy(loaded.model)
    if all_stages:
        # Gravity is no stage: a file that switches it off describes a mechanism that feels none.
        kept = loaded.model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
        model.opt.disableflags = kept | mujoco.mjtDisableBit.mjDSBL_AUTORESET
        if model.opt.disableflags == loaded.model.opt.disableflags:
            raise Unsupported("the model switches no stage off")
    runs = mujoco.batch.Batch(model, nsim=len(states), nthread=1)
    positions, velocities = loaded.addresses
    runs.bind("qpos")[:, positions] = states.q
    runs.bind("qvel")[:, velocities] = states.v
    runs.bind("qfrc_applied")[:, velocities] = states.tau
    found: Array = runs.bind("qacc")
    warm_start: Array = runs.bind("qacc_warmstart")

    def compute() -> None:
        if model.neq:
            # A solver that starts from the answer of the last repetition has nothing left to do.
            warm_start[:] = 0.0
        runs.forward()

    def reproducer(state: int, certified: Array) -> str:
        source = repr(compact(scene.models["mjcf"].text))
        return loaded.reproducer(source, states.q[state], states.v[state], states.tau[state], certified)

    # A program reads the file, which has stages off.
    alone = None if all_stages else reproducer
    return Prepared(compute, lambda: np.ascontiguousarray(found[:, velocities]), truth=declared_truth(scene), reproducer=alone)


def declared_truth(scene: Scene) -> AccelerationTruth | None:
    """The problem that the scene's MJCF declares of its constraints; None where it has none, and the truth is rigid."""
    truth = acceleration_truth_of(Assignment(scene.library, Subject("mujoco", "mjcf"), scene.mechanism, scene.models["mjcf"]))
    return None if truth.rigid is None else truth


_OF = (MECHANISMS, CONSTRAINED)
FORWARD = Method("mujoco mj_forward", "mjcf", _forward, loop="Python", growth="up to 3", of=_OF)
BATCH = Method("mujoco batch", "mjcf", partial(batch, False), loop="MuJoCo", growth="up to 3", of=_OF)
ALL_STAGES = Method("mujoco batch, all stages on", "mjcf", partial(batch, True), loop="MuJoCo", growth="up to 3", of=_OF)
