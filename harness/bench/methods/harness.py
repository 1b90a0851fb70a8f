"""The harness's own bulk check without certification: an engine's accelerations, converted and compared.

Divided by the cost of the engine's own call it is the price of being checked. The references it compares
with are computed beforehand.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from harness.arrays import Array
from harness.bench.methods import Method, Prepared
from harness.certify.compare import compare
from harness.crosscheck.scene import Scene
from harness.crosscheck.truth import reference_kernel
from harness.engines import accelerations, linear_velocity_in_body, load_engine
from harness.equations.states import States

CHECKED = "the engine's accelerations with their conversions, compared with references at hand"


def _check(engine: str, format: str, scene: Scene, states: States) -> Prepared:
    model, in_body = scene.load(engine, format), linear_velocity_in_body(load_engine(scene.library, engine))
    reference = reference_kernel(scene.mechanism, in_body).evaluate(states)
    last: list[Array] = [np.full_like(states.v, np.nan)]

    def compute() -> None:
        last[0] = accelerations(model, states)
        compare(reference, last[0])

    return Prepared(compute, lambda: last[0], CHECKED)


MUJOCO = Method("harness check of mujoco", "mjcf", partial(_check, "mujoco", "mjcf"), loop="MuJoCo", growth="up to 3")
PINOCCHIO = Method(
    "harness check of pinocchio", "urdf", partial(_check, "pinocchio", "urdf"), loop="Python", growth="1", linear_velocity_in_body=True
)
