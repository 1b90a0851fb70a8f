"""The numbers that engines hold of a file as its user loads it: those of the file, by the engines' own names."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from harness.comparison.robot_library import engine_of, engines_of_files, robot_at
from harness.engines.interface import CompiledNumber
from harness.engines.request import Held, Refused
from harness.explain.meant import request_of
from harness.library import Stance

MOMENTS = (0.03, 0.04, 0.05, 0.002, -0.003, 0.004)
MJCF = """<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.004" integrator="RK4"><flag contact="disable"/></option>
  <worldbody>
    <body name="bar" quat="0.6 0 0.8 0">
      <joint name="pin" axis="0 1 0" pos="0 0 0.1" damping="0.3" stiffness="2" range="-1 1"/>
      <inertial pos="0.1 0 0.05" mass="2" fullinertia="0.03 0.04 0.05 0.002 -0.003 0.004"/>
      <geom name="shin" type="capsule" size="0.1 0.2" friction="0.7 0.01 0.001"/>
      <geom name="picture" type="sphere" size="0.1" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <actuator><position name="servo" joint="pin" kp="30" kv="4"/></actuator>
</mujoco>
"""
URDF = """<robot name="bar">
  <link name="base"/>
  <link name="bar"><inertial><origin xyz="0.1 0 0.05"/><mass value="2"/>
    <inertia ixx="0.03" iyy="0.04" izz="0.05" ixy="0.002" ixz="-0.003" iyz="0.004"/></inertial></link>
  <joint name="pin" type="revolute"><parent link="base"/><child link="bar"/><origin xyz="0 0 0.5"/><axis xyz="0 0.6 0.8"/>
    <dynamics damping="0.3" friction="0.1"/><limit lower="-1" upper="1" effort="7" velocity="3"/></joint>
</robot>
"""


def numbers(folder: Path, engine: str, name: str, text: str) -> dict[tuple[str, str], CompiledNumber]:
    path = folder / name
    path.write_text(text)
    found = engine_of(engine).compiled(request_of(robot_at(path), Stance.PLAIN))
    assert len({(one.quantity, one.owner) for one in found}) == len(found)
    assert all(isinstance(value, str) or np.isfinite(value) for one in found for value in one.values)
    return {(one.quantity, one.owner): one for one in found}


def test_mujoco_gives_what_it_compiles_actuators_and_contacts_too(tmp_path: Path) -> None:
    found = numbers(tmp_path, "mujoco", "bar.xml", MJCF)
    inertia = found["body_inertia", "bar"]
    assert inertia.parts == ("xx", "yy", "zz", "xy", "xz", "yz") and inertia.values == pytest.approx(MOMENTS, abs=1e-15)
    assert found["body_quat", "bar"].values == (0.6, 0.0, 0.8, 0.0)
    assert (found["jnt_type", "pin"].values, found["jnt_range", "pin"].values) == (("hinge",), (-1.0, 1.0))
    assert found["dof_damping", "pin"].values[0] == 0.3 and found["jnt_stiffness", "pin"].felt
    assert found["actuator_biasprm", "servo"].values[:3] == (0.0, -30.0, -4.0) and not found["actuator_biasprm", "servo"].felt
    assert found["geom_friction", "shin"].values == (0.7, 0.01, 0.001) and ("geom_friction", "picture") not in found
    options = {name: found[f"opt_{name}", ""].values for name in ("integrator", "timestep", "disableflags", "gravity")}
    assert options == {"integrator": ("rk4",), "timestep": (0.004,), "disableflags": ("contact",), "gravity": (0.0, 0.0, -9.81)}


def test_numbers_of_actuators_that_drive_are_felt(tmp_path: Path) -> None:
    """Of those that do not, and all where none does, no acceleration that is compared feels any."""
    path = tmp_path / "bar.xml"
    path.write_text(MJCF.replace("</actuator>", '<motor name="other" joint="pin"/></actuator>'))
    request = request_of(robot_at(path), Stance.PLAIN)
    for driven in ((), (0,), (0, 1)):
        found = engine_of("mujoco").compiled(replace(request, held=Held((), (), actuators=driven)))
        felt = {(one.quantity, one.owner) for one in found if one.felt}
        for number, name in enumerate(("servo", "other")):
            of_actuator = {("actuator_biasprm", name), ("actuator_gear", name), ("actuator_ctrlrange", name)}
            assert of_actuator & felt == (of_actuator if number in driven else set())
        assert (("jnt_actfrcrange", "pin") in felt) == bool(driven)
        assert ("actuator_armature", "other") in felt and ("actuator_cranklength", "other") not in felt


def test_pinocchio_gives_what_its_reader_holds_though_aba_feels_not_all(tmp_path: Path) -> None:
    found = numbers(tmp_path, "pinocchio", "bar.urdf", URDF)
    assert found["inertias.inertia", "pin"].values == pytest.approx(MOMENTS, abs=1e-15)
    assert found["inertias.lever", "pin"].values == pytest.approx((0.1, 0.0, 0.05))
    assert found["joints.S", "pin"].values == (0.0, 0.0, 0.0, 0.0, 0.6, 0.8)
    assert found["jointPlacements.translation", "pin"].values == (0.0, 0.0, 0.5)
    assert (found["damping", "pin"].values, found["damping", "pin"].felt) == ((0.3,), False)
    assert found["upperEffortLimit", "pin"].values == (7.0,) and found["armature", "pin"].felt


def test_a_file_that_is_refused_has_none(tmp_path: Path) -> None:
    with pytest.raises(Refused, match="A \\+ B >= C"):
        numbers(tmp_path, "mujoco", "bar.urdf", URDF.replace('izz="0.05"', 'izz="0.5"'))


def test_every_engine_can_be_asked(tmp_path: Path) -> None:
    path = tmp_path / "bar.urdf"
    path.write_text(URDF)
    request = request_of(robot_at(path), Stance.PLAIN)
    silent = [engine for name, engine in engines_of_files().items() if name not in ("mujoco", "pinocchio")]
    assert silent and all(engine.compiled(request) == () for engine in silent)
