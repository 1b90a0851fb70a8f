"""What engines compute of a robot's file beside accelerations, held against the numbers of the file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from catalogue import BUILT_IN
from support import InThisProcess, completed

from harness.comparison.robot_library import RobotLibrary
from harness.crosscheck.run import CrossCheck
from harness.crosscheck.settings import Settings
from harness.engines.adapters.mujoco.model import MujocoModel
from harness.library import Stance
from harness.results.cross_check import CrossCheckResult
from harness.results.records import Record
from harness.truth.quantities import Quantity, find_quantities, of_files

ARM = BUILT_IN.model_path("puma_560", "urdf")
FLOATING = BUILT_IN.model_path("quadrotor", "mjcf")
QUANTITIES = [value for value in vars(of_files).values() if isinstance(value, Quantity) and value.is_quick]


def checked(file: Path, quantities: list[Quantity]) -> dict[tuple[str, str], Record]:
    library = RobotLibrary.of([str(file)], stance=Stance.AIDED)
    subjects = [f"{engine}/{library.formats_of(str(file))[0]}" for engine in ("mujoco", "pinocchio")]
    study = CrossCheck(Settings(library=library, states=8, subjects=subjects, examples=None), [quantity.name for quantity in quantities])
    result: CrossCheckResult = completed(study, InThisProcess())
    return {(record.subject, record.quantity): record for record in result.records}


def test_both_engines_agree_with_the_numbers_of_an_arm() -> None:
    for (subject, quantity), record in checked(ARM, QUANTITIES).items():
        assert record.verdict == "agrees", (subject, quantity, record.message)


def test_what_would_have_to_be_converted_is_not_offered_and_says_so() -> None:
    records = checked(FLOATING, QUANTITIES)
    for (subject, quantity), record in records.items():
        assert record.as_expected and record.verdict in {"agrees", "unsupported"}, (subject, quantity, record.message)
    assert records["mujoco/mjcf", "mass_matrix"].verdict == "agrees"
    assert "in another frame" in records["pinocchio/mjcf", "mass_matrix"].message


def test_a_mistake_is_red_for_a_robot_too(monkeypatch: pytest.MonkeyPatch) -> None:
    right: Any = MujocoModel.gravity
    monkeypatch.setattr(MujocoModel, "gravity", lambda self, q: -right(self, q))
    record = checked(ARM, [find_quantities()["gravity"]])["mujoco/urdf", "gravity"]
    assert record.verdict == "disagrees" and "gravity force on joint" in record.message


def test_files_whose_names_together_are_longer_than_a_file_system_takes(tmp_path: Path) -> None:
    paths = [tmp_path / f"{'arm' * 40}_{number}.urdf" for number in range(3)]
    for path in paths:
        path.write_text(ARM.read_text())
    settings = Settings(library=RobotLibrary.of(map(str, paths)), states=8, subjects=["pinocchio/urdf"], examples=tmp_path / "examples")
    result: CrossCheckResult = completed(CrossCheck(settings), InThisProcess())
    assert {record.verdict for record in result.records} == {"agrees"}, [record.message for record in result.records]
