"""The harness's own bulk check without certification: an engine's accelerations, converted and compared.

Divided by the cost of the engine's own call it is the price of being checked. The references it compares
with are computed beforehand.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from harness.arrays import Array
from harness.bench.methods import Method, Prepared, load_model
from harness.certify.compare import compare
from harness.crosscheck.scene import Scene
from harness.crosscheck.tasks import reference_kernel
from harness.engines import linear_velocity_in_body
from harness.equations.states import States

CHECKED = "the engine's accelerations with their conversions, compared with references at hand"


def _check(engine: str, format: str, scene: Scene, states: States) -> Prepared:
    loader, model = load_model(scene, engine, format)
    reference = reference_kernel(scene.mechanism, linear_velocity_in_body(loader)).evaluate(states)
    last: list[Array] = [np.full_like(states.v, np.nan)]

    def compute() -> None:
        last[0] = model.forward_dynamics(states.q, states.v, states.tau)
        compare(reference, last[0])

    return Prepared(compute, lambda: last[0], CHECKED)


MUJOCO = Method("harness check of mujoco", "mjcf", partial(_check, "mujoco", "mjcf"), growth="up to 3")
PINOCCHIO = Method("harness check of pinocchio", "urdf", partial(_check, "pinocchio", "urdf"), growth="1", linear_velocity_in_body=True)
