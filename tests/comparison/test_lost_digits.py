"""What readings explain, and what is lost beyond them: an answer with a thousand data roundoffs left is not simply explained."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from comparison.robots import FILES, edited, meant_by, record_of

from harness.comparison.judgement import judge
from harness.comparison.robot_library import engine_of
from harness.engines.request import EngineAnswers
from harness.explain.as_read import read_by
from harness.explain.meant import read_as
from harness.library import Stance
from harness.report.comparison import subject_lines
from harness.report.survey import survey_sections
from harness.results.comparison import FileRecord, FilesComparison
from harness.trees.robot import read_robot
from harness.truth.compare import compare
from harness.verdict import AGREEMENT, Verdict

# Two wheels on one axis: of the light one that carries the other, ABA keeps what is left of a difference.
TEXT = """<robot name="wheels"><link name="ground"/>
<link name="light"><inertial><mass value="1e-6"/><inertia ixx="1e-6" ixy="0" ixz="0" iyy="{light}" iyz="0" izz="1e-6"/></inertial></link>
<link name="heavy"><inertial><origin xyz="0.1 0 0.2"/><mass value="3"/>
  <inertia ixx="1" ixy="0" ixz="0" iyy="0.7" iyz="0" izz="1"/></inertial></link>
<joint name="first" type="continuous"><parent link="ground"/><child link="light"/><axis xyz="0 1 0"/><dynamics damping="1e-6"/></joint>
<joint name="second" type="continuous"><parent link="light"/><child link="heavy"/><axis xyz="0 1 0"/></joint>
</robot>
"""


def wheels(folder: Path, light: str) -> Path:
    path = folder / "wheels.urdf"
    path.write_text(TEXT.format(light=light))
    return path


def test_digits_that_are_lost_beyond_the_readings_are_named(tmp_path: Path) -> None:
    record = record_of(wheels(tmp_path, "1e-6"), "pinocchio")
    assert record.explained and record.left is not None and record.left > AGREEMENT
    assert (record.outcome, [reading.name for reading in record.readings]) == ("explained, digits lost", ["joint damping"])
    assert "the condition of M" in record.lost_digits and any(record.lost_digits in line for line in subject_lines(record))
    found = FilesComparison(files=[FileRecord(path=record.path)], subjects=[record])
    assert "Pinocchio: explained, digits lost 1 (joint damping 1)" in str(next(iter(survey_sections(found))).parts[0])


def test_an_answer_without_lost_digits_is_simply_explained(tmp_path: Path) -> None:
    record = record_of(wheels(tmp_path, "0.7"), "pinocchio")
    assert (record.outcome, record.lost_digits) == ("explained", "")


def test_an_error_that_a_number_explains_is_no_lost_digits(tmp_path: Path) -> None:
    """The answer of an engine that has a mass wrong by 1e-8, which the condition of M alone would excuse."""
    found = meant_by(wheels(tmp_path, "1e-6"))
    other = tmp_path / "other.urdf"
    other.write_text(found.robot.path.read_text().replace('<mass value="3"/>', '<mass value="3.00000003"/>'))
    wrong = read_as(found, read_robot(other)).truth.high
    assert set(compare(found.truth, wrong, factorises=True).verdicts) <= {Verdict.AGREES, Verdict.UNSTABLE}
    answers = EngineAnswers(dict(zip(found.robot.joints, wrong.T[:, :, None], strict=True)))
    record = judge(found, answers, "pinocchio", Stance.AIDED)
    assert (record.explained, record.outcome) == (False, "unexplained") and "behaves as with 3.00000003" in record.rest[0]


@pytest.mark.parametrize(("number", "value"), [('mass value="2"', "-2"), ('iyy="0.078125"', "0.2")])
def test_a_number_that_no_body_can_have_is_not_named(number: str, value: str, tmp_path: Path) -> None:
    """The answer is that of such a number, and still it is none of the body's."""
    found = meant_by(FILES / "arm.urdf")
    other = tmp_path / "other.urdf"
    text = found.robot.path.read_text()
    other.write_text(text.replace(number, f'{number.partition("=")[0]}="{value}"', 1))
    wrong = read_as(found, read_robot(other)).truth.high
    answers = EngineAnswers(dict(zip(found.robot.joints, wrong.T[:, :, None], strict=True)))
    record = judge(found, answers, "mujoco", Stance.AIDED)
    assert not record.explained and record.rest[0].startswith("no single number of the file explains it; it differs in")


def test_a_mass_of_which_a_reading_computes_moments_is_named(tmp_path: Path) -> None:
    """PyBullet makes the inertia of a link of its mass and its shapes: another mass is another inertia too."""
    found = meant_by(FILES / "arm.urdf")
    other = read_robot(edited(FILES / "arm.urdf", tmp_path, ('<mass value="1"/>', '<mass value="1.000001"/>')))
    wrong = read_as(found, read_by(other, "pybullet", engine_of("pybullet"), Stance.PLAIN).robot).truth.high
    answers = EngineAnswers(dict(zip(found.robot.joints, wrong.T[:, :, None], strict=True)))
    record = judge(found, answers, "pybullet", Stance.PLAIN)
    assert not record.explained and "mass value = 1: the engine behaves as with 1.000001" in record.rest[0]


@pytest.mark.ci
def test_a_number_that_explains_a_part_is_not_named(tmp_path: Path) -> None:
    """Two masses are wrong, the one by little: the other leaves 1e-6 of the difference, and more than a data roundoff."""
    found = meant_by(FILES / "arm.urdf")
    other = edited(FILES / "arm.urdf", tmp_path, ('mass value="2"', 'mass value="3"'), ('mass value="0.5"', 'mass value="0.5000005"'))
    wrong = read_as(found, read_robot(other)).truth.high
    answers = EngineAnswers(dict(zip(found.robot.joints, wrong.T[:, :, None], strict=True)))
    record = judge(found, answers, "mujoco", Stance.AIDED)
    assert not record.explained and record.rest[0].startswith("no single number of the file explains it")


def test_an_answer_without_a_finite_number_is_said_so() -> None:
    found = meant_by(FILES / "arm.urdf")
    answers = EngineAnswers({name: np.full((len(found.states), 1), np.nan) for name in found.robot.joints})
    assert judge(found, answers, "mujoco", Stance.AIDED).rest == ["it answers with finite numbers at no state"]
