"""A free joint with a rotor, a damper and a spring has one motion, in whichever frame its linear velocity is given."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from harness.engines.coordinates import accelerations_from_body, rotation, to_body
from harness.programs.states import States
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import read_robot
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import generic_sample

FLOATING = """<mujoco><worldbody><body name="trunk" pos="1 0 2" euler="20 30 -50"><joint name="f" type="free" armature="0.4" {}/>
<inertial pos="0.1 0 0.2" mass="2" diaginertia="0.1 0.2 0.25"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize("more", ["", 'damping="0.3"', 'stiffness="5"'])
def test_accelerations_are_those_of_the_other_frame(tmp_path: Path, more: str) -> None:
    path = tmp_path / "floating.xml"
    path.write_text(FLOATING.format(more))
    mechanism = mechanism_of(read_robot(path))
    states = generic_sample(mechanism, 16, 5)
    turn = np.array([rotation(quaternion) for quaternion in states.q[:, 3:]])
    in_body = States.at(states.q, to_body(turn, states.v), to_body(turn, states.tau))
    found = ReferenceKernel(mechanism).evaluate(states).high
    other = accelerations_from_body(turn, ReferenceKernel(mechanism, linear_velocity_in_body=True).evaluate(in_body).high, states.v)
    assert np.abs(found - other).max() < 1e-12 * np.abs(found).max()
