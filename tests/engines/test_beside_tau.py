"""What engines make of effort limits and transmissions of a URDF is what they declare: tau is bounded by none of them."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from support import harness

from harness.comparison.robot_library import engine_of

EFFORT, SPEED, TAU = 2.0, 3.0, 10.0
FILE = f"""<robot name="r"><link name="base"/><link name="arm"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="pin" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="{EFFORT}" velocity="{SPEED}"/></joint>
<transmission name="drive"><type>transmission_interface/SimpleTransmission</type><joint name="pin"/><actuator name="motor"/></transmission>
</robot>"""
# Accelerations of one inertia of 1 kg m^2 by (tau, input of an actuator).
DRAKE = """
import json, sys, pydrake.all as p
plant = p.MultibodyPlant(0.0)
p.Parser(plant).AddModels(sys.argv[1])
plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
plant.Finalize()
c = plant.CreateDefaultContext()
def at(tau, u):
    plant.get_actuation_input_port().FixValue(c, [u])
    plant.get_applied_generalized_force_input_port().FixValue(c, [tau])
    return float(plant.get_generalized_acceleration_output_port().Eval(c)[0])
print(json.dumps([at(10.0, 0.0), at(0.0, 10.0)]))
"""
DART = """
import json, sys, dartpy as dart
options = dart.utils.DartLoaderOptions(defaultRootJointType=dart.utils.DartLoaderRootJointType.FIXED)
loader = dart.utils.DartLoader()
loader.setOptions(options)
s = loader.parseSkeleton(sys.argv[1])
def at(how):
    s.setForces([0.0])
    s.resetCommands()
    getattr(s, how)([10.0])
    s.computeForwardDynamics()
    return float(s.getAccelerations()[0])
print(json.dumps([at("setForces"), at("setCommands")]))
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "limited.urdf"
    path.write_text(FILE)
    return path


def test_mujoco_bounds_actuators_by_effort_and_tau_by_nothing(file: Path) -> None:
    import mujoco

    spec = mujoco.MjSpec.from_file(str(file))
    motor = spec.add_actuator()
    motor.target, motor.trntype = "pin", mujoco.mjtTrn.mjTRN_JOINT
    model = spec.compile()
    data, found = mujoco.MjData(model), []
    for tau, control, speed in ((TAU, 0.0, 0.0), (0.0, TAU, 0.0), (TAU, 0.0, 50.0)):
        data.qfrc_applied[0], data.ctrl[0], data.qvel[0] = tau, control, speed
        mujoco.mj_forward(model, data)
        found.append(float(data.qacc[0]))
    assert found == [TAU, EFFORT, TAU]


def test_pinocchio_stores_both_and_applies_neither(file: Path) -> None:
    import pinocchio

    model = pinocchio.buildModelFromUrdf(str(file))
    assert model.velocityLimit[0] == SPEED and model.upperEffortLimit[0] == EFFORT
    accelerations = pinocchio.aba(model, model.createData(), np.zeros(1), np.array([50.0]), np.array([TAU]))
    assert accelerations[0] == TAU


@pytest.mark.nightly
@pytest.mark.parametrize(("engine", "script"), [("drake", DRAKE), ("dartpy", DART)])
def test_inputs_of_actuators_are_bounded_and_tau_is_not(engine: str, script: str, file: Path, environment: Callable[[str], Path]) -> None:
    interpreter = next((environment(engine) / "environments").glob(f"{engine}@*")) / "bin" / "python"
    done = subprocess.run([interpreter, "-c", script, str(file)], capture_output=True, text=True, env={}, check=False)
    assert done.returncode == 0, done.stderr
    np.testing.assert_allclose(json.loads(done.stdout.splitlines()[-1]), [TAU, EFFORT], rtol=1e-12)


def test_a_comparison_says_what_each_engine_that_was_asked_makes_of_them(file: Path) -> None:
    done = harness("compare", str(file), "--all")
    (row,) = (line for line in done.stdout.splitlines() if "effort and velocity limits, 1, line 4: " in line)
    assert "no acceleration feels it at given tau; " in row
    for engine in ("mujoco", "pinocchio"):
        assert engine_of(engine).beside_tau["effort and velocity limits"] in row
    brief = harness("compare", str(file)).stdout
    assert "Not compared: effort and velocity limits (1), transmissions (1)" in brief
