"""Truths for engines in float32: states are rounded once, for the engine, for its truth and for what constraints leave open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from catalogue import BUILT_IN

from harness.crosscheck.assignment import Assignment
from harness.engines import Subject, load_engine
from harness.engines.calls import timed_answers_of
from harness.truth.quantities.accelerations import AccelerationTruth
from harness.truth.reference import asked_at
from harness.truth.sampling import random_sample
from harness.verdict import Verdict

FLOAT32 = 2.0**-24


@pytest.mark.parametrize("name", ["atwood", "free_body", "double_pendulum"])
@pytest.mark.parametrize("shift", [0.0, 1e-3])
def test_an_exact_engine_that_rounds_its_states_agrees(name: str, shift: float) -> None:
    about = Assignment.of(BUILT_IN, name, Subject("mujoco", "mjcf"), BUILT_IN.validated_models(name)["mjcf"])
    assert isinstance(about.truth, AccelerationTruth) and about.model is not None
    truth = replace(about.truth, unit_roundoff=FLOAT32)
    states = truth.asked_at(random_sample(about.mechanism, 32, 0))
    model = load_engine(BUILT_IN, "mujoco").load(about.model, about.mechanism.joints, about.mechanism.gravity)
    certified, asked = truth.evaluate(states), replace(states, v=states.v * (1 + shift))
    found = timed_answers_of(model, [truth.asks_all(model, asked)])[0][0]
    compared = truth.judge_all(certified, states, found, model)
    assert (Verdict.DISAGREES.value in compared.verdicts.tolist()) == bool(shift)


def test_quaternions_beside_half_a_turn_are_on_the_side_that_float32_sees() -> None:
    about = Assignment.of(BUILT_IN, "free_body", Subject("mujoco", "mjcf"), BUILT_IN.validated_models("free_body")["mjcf"])
    states, [place] = random_sample(about.mechanism, 2, 0), about.mechanism.attitudes
    states.q[:, place : place + 4] = [[-1e-7, 0.0, 0.0, 1.0], [-1e-3, 0.0, 0.0, 1.0]]
    for own, signs in ((FLOAT32, [1.0, -1.0]), (2.0**-53, [-1.0, -1.0])):
        assert np.sign(asked_at(states, own, about.mechanism.attitudes).q[:, place]).tolist() == signs
