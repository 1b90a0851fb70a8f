"""The search of a robot's file with its contacts on: where bodies touch, what it finds is far worse than states at random, and replays."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from comparison.test_random_trees import BRANCHES
from support import harness

from harness.comparison.robot_library import RobotLibrary
from harness.crosscheck.assignment import Assignment, contact_source
from harness.crosscheck.explanation import explain_by_file
from harness.crosscheck.stages import compare_all
from harness.engines import Subject, Unsupported
from harness.engines.adapters.mujoco import robot
from harness.explain.touching_truth import ContactSource
from harness.files.contacts import FoundContact
from harness.hard.evolution import touched
from harness.programs.states import States
from harness.truth.sampling import generic_sample
from harness.verdict import Verdict

HOPPER = """
<mujoco model="hopper">
  <option cone="elliptic" {settings}/>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 1"/>
    <body name="trunk" pos="0 0 0.3">
      <freejoint name="root"/>
      <geom name="trunk" type="sphere" size="0.1" mass="2"/>
      <body name="leg" pos="0.15 0 0">
        <joint name="hip" axis="0 1 0"/>
        <geom name="leg" type="capsule" fromto="0 0 0 0 0 -0.2" size="0.03" mass="0.4" friction="0.8"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
TO_THE_END = 'solver="Newton" iterations="100" tolerance="0"'
BUDGET = 240
MUJOCO = Subject("mujoco", "mjcf")


def written(folder: Path, settings: str = "") -> Path:
    path = folder / "hopper.xml"
    path.write_text(HOPPER.format(settings=settings))
    return path


def assignment(path: Path) -> Assignment:
    library = replace(RobotLibrary.of([str(path)], acts=True, touches=True), calls_engines_here=True)
    return Assignment.of(library, str(path), MUJOCO)


@pytest.mark.ci
def test_a_search_is_ten_times_worse_than_chance_and_replays(tmp_path: Path) -> None:
    path = written(tmp_path)
    asked = ("search", "hopper.xml", "--contacts", "--subject", "mujoco/mjcf", "--budget", str(BUDGET), "--json", "found.json", "--no-keep")
    done = harness(*asked, cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    first = done.stdout.splitlines()[0]
    assert "MuJoCo stops its solver up to" in first and first.endswith("Contacts on.")
    case = json.loads((tmp_path / "found.json").read_text())["search"]["found"][0]
    found = case["found"]["backward_error"]
    own = assignment(path)
    at_random = own.judge(own.truth.asked_at(generic_sample(own.mechanism, BUDGET, 0))).backward_error
    assert found > 10 * np.nanmax(at_random)
    # With no other words than those that are printed.
    assert "--contacts" in case["replay"]
    again = harness("check", "hopper.xml", "--subject", "mujoco/mjcf", "--contacts", "--state", json.dumps(case["found"]["state"]),
                    "--json", "again.json", cwd=tmp_path)  # fmt: skip
    (record,) = json.loads((tmp_path / "again.json").read_text())["records"]
    assert again.returncode == 0 and record["verdict"] == "explained" and record["backward_error"] == found


@pytest.mark.ci
def test_states_that_a_search_begins_with_touch(tmp_path: Path) -> None:
    own = assignment(written(tmp_path))
    begun, _ = touched(own, 16, 0)
    assert len(begun) == 16
    assert sum(any(one.pushes for one in found) for found in contact_source(own).contacts(begun)) >= 8


@pytest.mark.ci
def test_a_solver_that_goes_to_the_end_agrees_at_contacts(tmp_path: Path) -> None:
    written(tmp_path, TO_THE_END)
    words = ("check", "hopper.xml", "--contacts", "--subject", "mujoco/mjcf", "--states", "64", "--json", "found.json")
    done = harness(*words, cwd=tmp_path)
    assert done.returncode == 0 and done.stdout.splitlines()[0].endswith("Contacts on."), done.stdout + done.stderr
    # What an engine finds of contacts is no data that moves, componentwise either.
    (record,) = json.loads((tmp_path / "found.json").read_text())["records"]
    assert record["componentwise_error"] is None and "componentwise" not in done.stdout


@pytest.mark.ci
def test_who_has_no_contacts_is_said_first(tmp_path: Path) -> None:
    written(tmp_path, TO_THE_END)
    done = harness("check", "hopper.xml", "--contacts", "--states", "8", cwd=tmp_path)
    assert done.stdout.splitlines()[0].endswith("contacts in pinocchio)."), done.stdout + done.stderr


@pytest.mark.ci
def test_a_contact_that_rubs_otherwise_is_red(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = assignment(written(tmp_path, TO_THE_END))
    states = own.truth.asked_at(generic_sample(own.mechanism, 64, 0))
    assert not (own.judge(states).verdicts == Verdict.DISAGREES.value).any()
    found_contacts = robot.found_contacts

    def rubs_more(model: object, contacts: object) -> list[FoundContact]:
        return [replace(one, friction=(1.001 * one.friction[0], *one.friction[1:])) for one in found_contacts(model, contacts)]

    monkeypatch.setattr(robot, "found_contacts", rubs_more)
    verdicts = own.judge(states).verdicts
    touching = np.array([any(one.pushes for one in found) for found in contact_source(own).contacts(states)])
    assert (verdicts[touching] == Verdict.DISAGREES.value).sum() > 8
    assert not (verdicts[~touching] == Verdict.DISAGREES.value).any()
    assert explain_by_file(own, 0, states[:4]) == "it is only with contacts on that it is not what its documentation gives"


def test_an_engine_that_refuses_what_touches_is_unsupported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its own contacts are in its truth, which there is none of then."""
    own = assignment(written(tmp_path))

    def refused(self: ContactSource, states: States) -> list[object]:
        raise Unsupported("its meshes are not there")

    monkeypatch.setattr(ContactSource, "contacts", refused)
    _, _, answers = compare_all([own], generic_sample(own.mechanism, 8, 0), lambda text: None)
    found = answers[own.title]
    assert found.unsupported and found.failure == "its meshes are not there"


@pytest.mark.parametrize(("below", "pushes"), [(0, False), (1, True)])
def test_what_is_at_its_margin_does_not_push(below: int, pushes: bool, tmp_path: Path) -> None:
    own = assignment(written(tmp_path, TO_THE_END))
    height = 0.1
    for _ in range(below):
        height = float(np.nextafter(height, 0.0))
    # The sphere alone is low enough, with the leg above it.
    q = [0.0, 0.0, height, 1.0, 0.0, 0.0, 0.0, 3.0]
    state = States.at(q, [0.0] * 7, [0.0] * 7)
    [contacts] = contact_source(own).contacts(state)
    assert [one.pushes for one in contacts if one.shapes == ("floor", "trunk")] == [pushes]
    assert own.judge(state).verdicts[0] != Verdict.DISAGREES.value


@pytest.mark.parametrize("words", [["search", "double_pendulum"], ["check", "double_pendulum"]])
def test_contacts_are_of_files(words: list[str], tmp_path: Path) -> None:
    done = harness(*words, "--contacts", cwd=tmp_path)
    assert done.returncode == 2 and "--contacts is for a robot's file" in done.stderr


@pytest.mark.ci
@pytest.mark.parametrize("jacobian", ["dense", "sparse"])
def test_a_solver_that_ends_elsewhere_is_told_as_that(jacobian: str, tmp_path: Path) -> None:
    """See docs/issues/mujoco-sparse-newton.md."""
    (tmp_path / "branches.xml").write_text(BRANCHES.format(jacobian=jacobian))
    asked = ("search", "branches.xml", "--contacts", "--subject", "mujoco/mjcf", "--budget", "40", "--no-keep")
    done = harness(*asked, cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    is_wrong = (jacobian, mujoco.__version__) == ("sparse", "4.0.0")
    assert ("factorises a wrong Hessian" in done.stdout.splitlines()[0]) == is_wrong
