"""MuJoCo on the MJCF model, with only the stages that the scene needs and with all of them; on models with constraints by solver and by
impedance: what each costs, and how far from rigid it is.

The default solver is Newton's method, of at most 100 iterations to a tolerance of 1e-8. Its first step ends there, with what a
factorisation of M + J' D J loses, and more steps to a tolerance of 0 give the rest. The impedance d of a constraint is 0.9 on the
manifold by default, and 0.9999 at most; the nearer to 1, the smaller the distance from rigid. Its regularisation is (1 - d) / d times an
inverse weight of the file's zero position, or with the flag ``diagexact`` times the exact diagonal of J M^-1 J' at the state. Each
choice is another problem that MuJoCo documents, and its answers are held against that one.

Source: MuJoCo documentation, Computation, sections Forward dynamics, Constraint solver and Solver parameters; Python bindings,
``mujoco.batch``; XML reference, option and equality.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from harness.arrays import Array
from harness.bench.methods import Method, Prepared, reproducer_of, truth_of_engine
from harness.crosscheck.scene import Scene
from harness.engines import Unsupported
from harness.files.model_file import Attributes, with_attributes
from harness.library import CONSTRAINED, MECHANISMS
from harness.programs.states import States
from harness.truth.quantities.accelerations import AccelerationTruth

if TYPE_CHECKING:
    from harness.engines.adapters.mujoco.model import MujocoModel


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

    return Prepared(compute, lambda: np.ascontiguousarray(found[:, velocities]), truth=_declared(scene))


def _batch(all_stages: bool, scene: Scene, states: States) -> Prepared:
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

    # A program reads the file, which has stages off.
    alone = None if all_stages else reproducer_of(loaded, scene.models["mjcf"].text, states)
    return Prepared(compute, lambda: np.ascontiguousarray(found[:, velocities]), truth=_declared(scene), reproducer=alone)


def _declared(scene: Scene) -> AccelerationTruth | None:
    """The problem that the scene's MJCF declares of its constraints; None where it has none, and the truth is rigid."""
    truth = truth_of_engine(scene, "mujoco", "mjcf")
    return None if truth.rigid is None else truth


def _changed(attributes: Attributes, scene: Scene, states: States) -> Prepared:
    if "mjcf" not in scene.models:
        raise Unsupported(f"{scene.mechanism.name} has no MJCF model")
    changed = with_attributes(scene.models["mjcf"], attributes)
    return _batch(False, replace(scene, models={**scene.models, "mjcf": changed}), states)


def _solimp(impedance: str, **flags: str) -> dict[str, dict[str, str]]:
    return {"equality/*": {"solimp": f"{impedance} {impedance}"}} | ({"option/flag": flags} if flags else {})


def _method(name: str, prepare: Callable[[Scene, States], Prepared], *of: str, loop: str = "MuJoCo") -> Method:
    return Method(f"mujoco {name}", "mjcf", prepare, loop=loop, growth="up to 3", of=of)


_NEWTON = {"option": {"solver": "Newton"}}
METHODS = (
    _method("mj_forward", _forward, MECHANISMS, CONSTRAINED, loop="Python"),
    _method("batch", partial(_batch, False), MECHANISMS, CONSTRAINED),
    _method("batch, all stages on", partial(_batch, True), MECHANISMS, CONSTRAINED),
    *(
        _method(f"batch, {name}", partial(_changed, attributes), CONSTRAINED)
        for name, attributes in {
            "Newton": _NEWTON,
            "CG": {"option": {"solver": "CG"}},
            "PGS": {"option": {"solver": "PGS"}},
            "impedance 0.9": _NEWTON | _solimp("0.9"),
            "impedance 0.9999": _NEWTON | _solimp("0.9999"),
            "impedance 0.9999, tolerance 0": {"option": {"solver": "Newton", "tolerance": "0"}} | _solimp("0.9999"),
            "impedance 0.9, diagexact": _NEWTON | _solimp("0.9", diagexact="enable"),
            "impedance 0.9999, diagexact": _NEWTON | _solimp("0.9999", diagexact="enable"),
        }.items()
    ),
)
