"""What somebody types first: a robot's file and no mechanism."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from support import harness, make_library

from harness.comparison.robot_library import RobotLibrary
from harness.library import Library

BUILT_IN = Library.built_in()
# As exporters write them: with meshes and materials, which the harness refuses of a model.
ROBOT = """<?xml version="1.0"?>
<robot name="r2">
  <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>
  <link name="base"><visual><geometry><mesh filename="package://r2/base.stl"/></geometry></visual></link>
  <link name="lower"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="waist" type="continuous"><parent link="base"/><child link="lower"/></joint>
</robot>
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "robot.urdf").write_text(ROBOT)
    shutil.copy(BUILT_IN.model_path("double_pendulum", "urdf"), tmp_path / "own.urdf")
    shutil.copy(BUILT_IN.model_path("cart_pendulum", "mjcf"), tmp_path / "own.xml")
    return tmp_path


def test_a_robot_is_checked_by_itself(folder: Path) -> None:
    done = harness("check", "robot.urdf", "--states", "8", cwd=folder)
    assert done.returncode == 0, done.stderr
    for subject in ("mujoco/urdf", "pinocchio/urdf"):
        assert re.search(rf"^robot.urdf +{subject} +8 +agrees", done.stdout, re.MULTILINE)
        assert f"{subject}, aided: " in done.stdout


def test_a_file_that_stands_in_for_nothing_is_answered_with_what_to_do(folder: Path) -> None:
    done = harness("check", "--urdf", "robot.urdf", cwd=folder)
    assert done.returncode == 2 and done.stdout == ""
    ways = ("harness check NAME --urdf robot.urdf", "harness check robot.urdf", "harness list", "harness new NAME")
    for words in ("robot.urdf is a model file", *ways):
        assert words in done.stderr
    # Not with the whole catalogue.
    assert sum(name in done.stderr for name in BUILT_IN.system_names()) == 0
    assert max(map(len, done.stderr.splitlines())) < 120


@pytest.mark.parametrize(
    ("file", "command"),
    [
        ("own.urdf", "harness check double_pendulum --urdf own.urdf"),
        ("own.xml", "harness check cart_pendulum --mjcf own.xml"),
    ],
)
def test_a_mechanism_whose_joints_have_the_names_of_the_file_is_named(folder: Path, file: str, command: str) -> None:
    done = harness("check", "--mjcf" if file.endswith("xml") else "--urdf", file, cwd=folder)
    assert done.returncode == 2 and command in done.stderr
    (likeness,) = [remark for remark in RobotLibrary.of([str(folder / file)]).remarks() if "to hold it against their energies" in remark]
    assert likeness.endswith(command.replace(file, str(folder / file)))


@pytest.mark.parametrize(
    ("options", "command"),
    [
        (["--mjcf", "own.xml"], "(cart|double)_pendulum --mjcf own.xml --urdf own.urdf"),
        (["--library", "mine"], "double_pendulum --library mine --urdf own.urdf"),
    ],
)
def test_both_files_of_a_mechanism_and_the_library_of_the_user_are_kept(folder: Path, options: list[str], command: str) -> None:
    make_library(folder / "mine", ["double_pendulum"])
    done = harness("check", "--urdf", "own.urdf", *options, cwd=folder)
    assert done.returncode == 2 and re.search(f"harness check {command}$", done.stderr, re.MULTILINE), done.stderr


@pytest.mark.parametrize("file", ["nowhere.urdf", "torn.urdf", "own.xml"])
def test_a_file_that_cannot_be_read_is_named_with_its_fault_and_what_to_do(folder: Path, file: str) -> None:
    (folder / "torn.urdf").write_text(ROBOT[:200])
    done = harness("check", "--urdf", file, cwd=folder)
    assert done.returncode == 2
    assert done.stderr.startswith(f"harness: {file}:") and f"harness check NAME --urdf {file}" in done.stderr
