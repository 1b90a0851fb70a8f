"""What engines compute of a robot's file beside accelerations, held against the numbers of the file."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from catalogue import BUILT_IN
from comparison.robots import FILES, edited, meant_by, record_of
from support import InThisProcess, call_engines_here, completed

from harness.comparison.robot_library import RobotLibrary
from harness.crosscheck.run import CrossCheck
from harness.crosscheck.settings import Settings
from harness.engines.adapters.mujoco.model import MujocoModel
from harness.library import Stance
from harness.results.cross_check import CrossCheckResult
from harness.results.records import Record
from harness.trees.nodes import Kinematics
from harness.truth.quantities import Quantity, find_quantities, of_files

ARM = BUILT_IN.model_path("puma_560", "urdf")
MJCF = BUILT_IN.model_path("arm_7r", "mjcf")
MIMIC = FILES / "mimic.urdf"
FLOATING = BUILT_IN.model_path("quadrotor", "mjcf")
QUANTITIES = [value for value in vars(of_files).values() if isinstance(value, Quantity) and value.is_quick]


def checked(file: Path, quantities: list[Quantity], stance: Stance = Stance.AIDED) -> dict[tuple[str, str], Record]:
    library = RobotLibrary.of([str(file)], stance=stance)
    subjects = [f"{engine}/{library.formats_of(str(file))[0]}" for engine in ("mujoco", "pinocchio")]
    study = CrossCheck(Settings(library=library, states=8, subjects=subjects, examples=None), [quantity.name for quantity in quantities])
    result: CrossCheckResult = completed(study, InThisProcess())
    return {(record.subject, record.quantity): record for record in result.records}


@pytest.mark.ci
def test_both_engines_agree_with_the_numbers_of_an_arm() -> None:
    for (subject, quantity), record in checked(ARM, QUANTITIES).items():
        assert record.verdict == "agrees", (subject, quantity, record.message)


@pytest.mark.ci
def test_plain_engines_are_asked_about_the_joints_that_they_read() -> None:
    """Both leave a joint free that mimics another: every quantity is that of the robot with one joint more."""
    for (subject, quantity), record in checked(MIMIC, QUANTITIES, Stance.PLAIN).items():
        assert record.verdict == "explained" and record.as_expected, (subject, quantity, record.message)
        assert "mimic joints" in {reading.name for reading in record.readings} and record.stance == "plain"


@pytest.mark.ci
def test_what_would_have_to_be_converted_is_not_offered_and_says_so() -> None:
    records = checked(FLOATING, QUANTITIES)
    for (subject, quantity), record in records.items():
        assert record.as_expected and record.verdict in {"agrees", "unsupported"}, (subject, quantity, record.message)
    assert records["mujoco/mjcf", "mass_matrix"].verdict == "agrees"
    assert "in another frame" in records["pinocchio/mjcf", "mass_matrix"].message


def test_a_mistake_is_red_for_a_robot_too(monkeypatch: pytest.MonkeyPatch) -> None:
    right: Any = MujocoModel.gravity
    call_engines_here(monkeypatch)
    monkeypatch.setattr(MujocoModel, "gravity", lambda self, q: -right(self, q))
    for file, stance in ((ARM, Stance.AIDED), (MIMIC, Stance.PLAIN)):
        record = checked(file, [find_quantities()["gravity"]], stance)["mujoco/urdf", "gravity"]
        assert record.verdict == "disagrees" and "gravity force on joint" in record.message and record.stance == stance


@pytest.mark.ci
def test_files_whose_names_together_are_longer_than_a_file_system_takes(tmp_path: Path) -> None:
    paths = [tmp_path / f"{'arm' * 40}_{number}.urdf" for number in range(3)]
    for path in paths:
        path.write_text(ARM.read_text())
    settings = Settings(library=RobotLibrary.of(map(str, paths)), states=8, subjects=["pinocchio/urdf"], examples=tmp_path / "examples")
    result: CrossCheckResult = completed(CrossCheck(settings), InThisProcess())
    assert {record.verdict for record in result.records} == {"agrees"}, [record.message for record in result.records]


def compensated(folder: Path, *more: tuple[str, str]) -> Path:
    """An arm whose second body has all of its weight carried, and whose third half of it."""
    names = [str(name) for name in re.findall(r'<body name="([^"]+)"', MJCF.read_text())]
    changes = [
        (f'<body name="{name}"', f'<body name="{name}" gravcomp="{share}"') for name, share in zip(names[1:3], (1, 0.5), strict=True)
    ]
    return edited(MJCF, folder, ('damper="disable"', 'damper="enable"'), *changes, *more)


@pytest.mark.ci
def test_gravity_compensation_is_on_in_mujoco_and_is_judged(tmp_path: Path) -> None:
    for (subject, quantity), record in checked(compensated(tmp_path), QUANTITIES).items():
        assert record.verdict == ("agrees" if subject == "mujoco/mjcf" else record.verdict), (subject, quantity, record.message)
        assert record.verdict in {"agrees", "explained", "unsupported"}, (subject, quantity, record.message)
    assert record_of(compensated(tmp_path), "mujoco").verdict == "agrees"
    reader = record_of(compensated(tmp_path), "pinocchio")
    assert reader.explained
    assert max(reader.readings, key=lambda reading: reading.alone or 0.0).name == "gravity compensation"


def test_another_share_of_a_weight_is_red(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    right = Kinematics.compensated
    wrong = lambda nodes, **of: [(at, (1 + 1e-10) * mass, centre) for at, mass, centre in right(nodes, **of)]  # noqa: E731
    monkeypatch.setattr(Kinematics, "compensated", wrong)
    assert not record_of(compensated(tmp_path), "mujoco").explained


def test_without_springs_and_dampers_mujoco_carries_no_weight(tmp_path: Path) -> None:
    assert any(body.gravity_compensation for body in meant_by(compensated(tmp_path)).robot.tree.bodies)
    file = edited(compensated(tmp_path), tmp_path, ('damper="enable"', 'damper="disable"'))
    assert not any(body.gravity_compensation for body in meant_by(file).robot.tree.bodies)
    assert record_of(file, "mujoco").verdict == "agrees"


@pytest.mark.ci
def test_gravity_compensation_by_actuators_is_theirs(tmp_path: Path) -> None:
    """It is off where they are, in every quantity, but for other joints that carry the body."""
    first = next(iter(re.findall(r'<joint name="[^"]+"', MJCF.read_text())))
    file = compensated(tmp_path, (first, f'{first} actuatorgravcomp="true"'))
    for (subject, quantity), record in checked(file, QUANTITIES).items():
        assert record.verdict == ("agrees" if subject == "mujoco/mjcf" else record.verdict), (subject, quantity, record.message)
    assert record_of(file, "mujoco").verdict == "agrees"
