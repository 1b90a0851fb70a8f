"""The harness's own bulk check without certification: an engine's accelerations, converted and compared.

Divided by the cost of the engine's own call it is the price of being checked. The references it compares
with are computed beforehand.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from harness.arrays import Array
from harness.bench.methods import Method, Prepared
from harness.crosscheck.assignment import Assignment, acceleration_truth_of
from harness.crosscheck.scene import Scene
from harness.engines import Subject, accelerations
from harness.library import CONSTRAINED, MECHANISMS
from harness.programs.states import States
from harness.truth.compare import compare

CHECKED = "the engine's accelerations with their conversions, compared with references at hand"


def _check(engine: str, format: str, scene: Scene, states: States) -> Prepared:
    model = scene.load(engine, format)
    truth = acceleration_truth_of(Assignment(scene.library, Subject(engine, format), scene.mechanism, scene.models[format]))
    reference = truth.kernel.evaluate(states)
    last: list[Array] = [np.full_like(states.v, np.nan)]

    def compute() -> None:
        last[0] = accelerations(model, states)
        compare(reference, last[0])

    return Prepared(compute, lambda: last[0], CHECKED, None if truth.rigid is None else truth)


_OF = (MECHANISMS, CONSTRAINED)
MUJOCO = Method("harness check of mujoco", "mjcf", partial(_check, "mujoco", "mjcf"), loop="MuJoCo", growth="up to 3", of=_OF)
PINOCCHIO = Method(
    "harness check of pinocchio",
    "urdf",
    partial(_check, "pinocchio", "urdf"),
    loop="Python",
    growth="1",
    linear_velocity_in_body=True,
    of=_OF,
)
