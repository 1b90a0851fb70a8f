"""One file has one verdict, whichever command asks: ``check FILE`` and ``compare FILE``."""

from __future__ import annotations

import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from comparison.test_lost_digits import wheels
from support import InThisProcess, completed, cross_checked

from harness.comparison import judgement
from harness.comparison.judgement import judge
from harness.comparison.robot_library import RobotLibrary, ask_engine, engine_of
from harness.comparison.study import ComparisonSettings, RobotComparison
from harness.crosscheck.assignment import Assignment, load_audited
from harness.crosscheck.settings import Settings
from harness.engines import Calls, Model, Subject
from harness.engines.request import EngineAnswers
from harness.explain.meant import Meant, meant, question_of, reference_of
from harness.library import Stance
from harness.programs.states import States
from harness.results.comparison import FilesComparison
from harness.results.records import Record
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import read_robot
from harness.truth.quantities.accelerations import AccelerationTruth
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import sample

# Seats that hang from arms of 4 m on a mast. Where one hangs still its acceleration is zero, and so is what its data round.
CHAIROPLANE = """
<mujoco model="chairoplane">
  <worldbody>
    <body name="mast" pos="0 0 6">
      <joint name="mast" axis="0 0 1" damping="2.5"/>
      <inertial pos="0 0 0" mass="200" diaginertia="150 150 300"/>
      <body name="near" pos="4 0 0">
        <joint name="swing" axis="0 1 0" damping="0.4" stiffness="3"/>
        <inertial pos="0 0 -3" mass="80" diaginertia="4 4 2"/>
      </body>
      <body name="far" pos="-4 0 0" euler="0 0 180">
        <joint name="other swing" axis="0 1 0" damping="0.4"/>
        <inertial pos="0 0 -3" mass="60" diaginertia="4 4 2"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "chairoplane.xml"
    path.write_text(CHAIROPLANE)
    return path


def asked_by_both(file: Path, model_format: str, states: int) -> tuple[dict[str, Record], FilesComparison]:
    """The records of a check by subject, and a comparison, both of the aided engines; both are as expected."""
    library, subjects = (
        RobotLibrary.of([str(file)], stance=Stance.AIDED),
        [f"{engine}/{model_format}" for engine in ("mujoco", "pinocchio")],
    )
    records, _ = cross_checked(Settings(library=library, subjects=subjects, states=states, examples=None))
    found = completed(RobotComparison(ComparisonSettings([file], stances=(Stance.AIDED,), subjects=subjects)), InThisProcess())
    assert all(record.as_expected for record in records), [record.explanation for record in records]
    assert found.as_expected, [(one.subject, one.outcome) for one in found.subjects]
    return {record.subject: record for record in records}, found


@pytest.mark.parametrize(("light", "pinocchio"), [("1e-3", "agrees"), ("1e-5", "unstable")])
def test_digits_that_are_lost_for_one_are_lost_for_the_other(light: str, pinocchio: str, tmp_path: Path) -> None:
    records, found = asked_by_both(wheels(tmp_path, light), "urdf", 100)
    verdicts = {one.subject: one.verdict for one in found.subjects}
    assert verdicts == {subject: record.verdict for subject, record in records.items()}
    assert verdicts == {"mujoco/urdf": "unstable", "pinocchio/urdf": pinocchio}


def test_an_error_that_a_number_explains_is_no_lost_digits_for_either(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A mass that is wrong by 1e-8, which the condition of M alone would excuse; M is the same at all states."""
    path = wheels(tmp_path, "1e-6")
    other = tmp_path / "other.urdf"
    other.write_text(path.read_text().replace('<mass value="3"/>', '<mass value="3.00000003"/>'))
    wrong = mechanism_of(read_robot(other))
    kernel = ReferenceKernel(wrong)

    def asks(self: AccelerationTruth, model: Model, states: States) -> Calls:
        return Calls((), lambda answers: kernel.evaluate(states).high)

    monkeypatch.setattr(AccelerationTruth, "asks", asks)
    library = RobotLibrary.of([str(path)], stance=Stance.AIDED)
    records, _ = cross_checked(Settings(library=library, subjects=["pinocchio/urdf"], states=40, examples=None))
    (record,) = records
    assert record.verdict == "disagrees" and not record.as_expected
    assert "mass" in record.message and "3.00000003" in record.message

    robot = read_robot(path)
    states = sample(mechanism_of(robot), 40, 0)
    values = kernel.evaluate(states).high
    meant = Meant(robot, states, reference_of(robot).evaluate(states))
    answers = EngineAnswers({name: values[:, [column]] for column, name in enumerate(robot.joints)})
    compared = judge(meant, answers, "pinocchio", Stance.AIDED)
    assert compared.verdict == "disagrees" and any("3.00000003" in one for one in compared.rest)


@pytest.mark.ci
def test_a_file_that_compare_explains_is_as_expected_for_check(file: Path) -> None:
    records, _ = asked_by_both(file, "mjcf", 400)
    # The search comes upon hanging seats, which no sample does: what their weights leave where they cancel is granted.
    worst = records["mujoco/mjcf"]
    assert worst.verdict == "agrees" and worst.granted and worst.worst_state is not None

    robot, state = read_robot(file), States.at(*(worst.worst_state[name] for name in ("q", "v", "tau")))
    meant = Meant(robot, state, reference_of(robot).evaluate(state))
    aided = judge(meant, ask_engine("mujoco", question_of(meant, Stance.AIDED)), "mujoco", Stance.AIDED)
    assert (aided.verdict, aided.outcome) == ("agrees", "agrees"), "the same state has the same verdict"


@pytest.mark.parametrize("size", [1e-9, 1e-11])
def test_a_wrong_answer_is_no_lost_digits(file: Path, size: float) -> None:
    library, path = RobotLibrary.of([str(file)], stance=Stance.AIDED), str(file)
    assignment = Assignment.of(library, path, Subject("mujoco", "mjcf"))
    states = States.at(np.full((1, 3), 0.3), np.full((1, 3), 0.2), np.full((1, 3), 0.1))
    truth, model = assignment.truth, load_audited(assignment)
    certified = truth.evaluate(states)
    answers = truth.answers(model, states)
    assert set(truth.judge(certified, states, answers, model).verdicts) == {"agrees"}
    assert set(truth.judge(certified, states, answers * (1 + size), model).verdicts) == {"disagrees"}


@pytest.mark.parametrize(
    ("unit_roundoff", "factor", "verdict"), [(2.0**-24, 1.0, "agrees"), (2.0**-24, 1.0 + 1e-4, "disagrees"), (2.0**-53, 1.0, "disagrees")]
)
def test_a_file_is_judged_in_the_precision_of_its_engine(
    unit_roundoff: float, factor: float, verdict: str, file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Answers in float32 at states rounded to it, of an engine that says so, and of one that does not."""
    found = meant(read_robot(file), 32, 0)
    caller = copy.copy(engine_of("mujoco"))
    caller.unit_roundoff = unit_roundoff
    monkeypatch.setattr(judgement, "engine_of", lambda name: caller)
    question = question_of(found.rounded(2.0**-24), Stance.AIDED)
    assert (question.q == question.q.astype(np.float32)).all() and (question.q != question_of(found, Stance.AIDED).q).any()
    exact = ask_engine("mujoco", question)
    rounded = {name: factor * values.astype(np.float32).astype(float) for name, values in exact.accelerations.items()}
    record = judge(found, replace(exact, accelerations=rounded), "mujoco", Stance.AIDED)
    assert record.verdict == verdict
    assert any("2^-24" in note for note in record.notes) == (unit_roundoff == 2.0**-24)
