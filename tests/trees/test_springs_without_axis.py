"""Springs of ball and free joints: a force on the way, and a torque along the rotation vector, from where they are relaxed."""

from __future__ import annotations

import math
from pathlib import Path

import flint
import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support_robots import by_mujoco

from harness.programs.states import States
from harness.trees.bodies.spatial import FileBuilder, rotation_vector
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import read_robot
from harness.truth.compare import compare
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import beside_half_turns, generic_sample
from harness.verdict import AGREEMENT

SPRUNG = """<mujoco><option gravity="0 0 0"/><worldbody>
<body name="arm" pos="0.1 0.2 1" quat="0.9 0.1 -0.3 0.2"><joint name="b" type="ball" stiffness="3" pos="0.1 0 0"/>
<inertial pos="0.1 0 0" mass="2" diaginertia="1 1 1"/></body>
<body name="floating" pos="1 0 2" euler="20 30 -50"><joint name="f" type="free" stiffness="5"/>
<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body>
</worldbody></mujoco>"""
BITS = 300


def vector_of(quaternion: list[float], bits: int = BITS) -> list[flint.arb]:
    builder = FileBuilder(["w", "x", "y", "z"])
    found = builder.written({"vector": rotation_vector(np.array(builder.inputs[:4], dtype=object))})
    with flint.ctx.workprec(bits):
        return found.in_balls()(*quaternion)["vector"]


@pytest.mark.parametrize("scale", [1.0, 0.7])
@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-9, 0.3, 2.0, 3.0, 3.1415926, -1e-5, -2.9])
def test_a_rotation_vector_is_that_of_the_definition(angle: float, scale: float) -> None:
    """2 atan2(|v|, w) along v, in more digits than any answer has; at no rotation too, where that is a quotient of zeros."""
    axis = [0.6, 0.0, -0.8]
    quaternion = [scale * math.cos(angle / 2), *(scale * math.sin(angle / 2) * one for one in axis)]
    found = vector_of(quaternion)
    with flint.ctx.workprec(BITS):
        w, *rest = map(flint.arb, quaternion)
        sine = sum((one * one for one in rest), flint.arb(0)).sqrt()
        expected = [2 * flint.arb.atan2(sine, w) * one / sine for one in rest] if any(quaternion[1:]) else [flint.arb(0)] * 3
        for one, other in zip(found, expected, strict=True):
            assert one.is_finite() and abs(one - other) <= flint.arb(2) ** -210 * abs(other) + abs(one - other).rad() * 2


def test_both_signs_of_a_quaternion_are_one_rotation_but_for_half_a_turn() -> None:
    quaternion = [-0.3, 0.5, 0.1, -0.7]
    assert [float(one) for one in vector_of(quaternion)] == [float(one) for one in vector_of([-one for one in quaternion])]
    half = [float(one) for one in vector_of([0.0, 0.0, 1.0, 0.0])]
    assert half == [0.0, math.pi, 0.0]
    assert [float(one) for one in vector_of([0.0, 0.0, -1.0, 0.0])] == [-one for one in half]
    # Of a real part below rounding the searches draw the sign that the program sees, and in float32 more are.
    assert beside_half_turns(np.array([[-1e-7, 0.0, 0.0, 1.0]]), 2.0**-24).tolist() == [[1e-7, 0.0, 0.0, -1.0]]
    assert beside_half_turns(np.array([[-1e-40, 0.0, 0.6, 0.8], [-0.6, 0.8, 0.0, 0.0]])).tolist() == [
        [1e-40, 0.0, -0.6, -0.8],
        [-0.6, 0.8, 0.0, 0.0],
    ]


def test_springs_pull_back_to_where_the_file_relaxes_them(tmp_path: Path) -> None:
    """Bodies of unit inertia about their joints: the acceleration is the spring's force over 2 kg, and its torque over 1 kg m^2."""
    path = tmp_path / "sprung.xml"
    path.write_text(SPRUNG)
    mechanism = mechanism_of(read_robot(path))
    start = Rotation.from_euler("XYZ", [20, 30, -50], degrees=True)
    turns = [np.zeros(3), np.array([0.3, -0.4, 0.1]), np.array([-2.0, 1.0, 1.5])]
    for turn in turns:
        ball, floating = Rotation.from_rotvec(turn), start * Rotation.from_rotvec(turn)
        (x, y, z, w), (a, b, c, real) = ball.as_quat(), floating.as_quat()
        q = np.array([[w, x, y, z, 1.5, 0.25, 1.0, real, a, b, c]])
        found = ReferenceKernel(mechanism).evaluate(States.at(q, np.zeros((1, 9)), np.zeros((1, 9))))
        expected = [*(-3 * turn), -5 / 2 * 0.5, -5 / 2 * 0.25, 5 / 2, *(-5 * turn)]
        assert found.certified.all()
        assert np.allclose(found.high[0], expected, rtol=0, atol=1e-13)


def test_mujoco_has_the_law_at_rest_and_at_half_turns_too(tmp_path: Path) -> None:
    path = tmp_path / "sprung.xml"
    path.write_text(SPRUNG)
    mechanism = mechanism_of(read_robot(path))
    states = generic_sample(mechanism, 32, 3)
    states.q[:4, :4], states.q[4:6, :4] = [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]
    model = mujoco.MjModel.from_xml_path(str(path))
    reference = ReferenceKernel(mechanism).evaluate(states)
    assert reference.certified.all()
    assert compare(reference, by_mujoco(model, states)).backward_error.max() < AGREEMENT
    model.jnt_stiffness *= 1 + 1e-11
    assert compare(reference, by_mujoco(model, states)).backward_error.max() > AGREEMENT
