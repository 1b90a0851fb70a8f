"""check of a user's file with all on that is judged: dry friction, limits, equalities; and engines that apply some of it, or stop early."""

from __future__ import annotations

import json
import pickle
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import etree
from support import Done, call_engines_here, harness

from harness.comparison.robot_library import RobotLibrary
from harness.crosscheck.assignment import Assignment
from harness.engines import Subject
from harness.engines.adapters.mujoco import acting as adapter
from harness.files.document.source import read_any
from harness.library import Library
from harness.truth.sampling import sample
from harness.verdict import Verdict

FILES = Path(__file__).parent.parent / "comparison" / "files"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("arm.xml", "arm.urdf", "mimic.urdf", "firm.xml", "rubbing.xml"):
        shutil.copy(FILES / name, tmp_path)
    return tmp_path


def checked(folder: Path, name: str, *words: str) -> tuple[Done, dict[str, Any]]:
    """The check of a file, and its records by subject."""
    done = harness("check", name, *words, "--json", "found.json", cwd=folder)
    return done, {one["subject"]: one for one in json.loads((folder / "found.json").read_text())["records"]}


@pytest.mark.ci
def test_who_applies_none_of_what_is_on_is_said_first(folder: Path) -> None:
    done, records = checked(folder, "arm.urdf", "--states", "40")
    assert done.returncode == 0, done.stdout
    assert done.stdout.splitlines()[0].endswith("2 joint limits on (no dry friction or joint limits in pinocchio)."), done.stdout
    assert records["mujoco/urdf"]["verdict"] == "agrees" and records["pinocchio/urdf"]["verdict"] == "explained"
    (friction,) = [one for one in records["pinocchio/urdf"]["readings"] if one["name"] == "dry friction"]
    assert friction["alone"] > 0.01 and friction["lines"]
    done, records = checked(folder, "arm.urdf", "--states", "40", "--aided")
    assert {one["verdict"] for one in records.values()} == {"agrees"} and "Off: joint limits and dry friction." in done.stdout


def test_what_no_engine_is_judged_with_is_off(folder: Path) -> None:
    """Noslip iterations change dry friction by no law, and Pinocchio applies none."""
    text = (folder / "arm.xml").read_text()
    (folder / "slipping.xml").write_text(re.sub("<mujoco[^>]*>", r'\g<0><option noslip_iterations="3"/>', text, count=1))
    done, records = checked(folder, "slipping.xml", "--subject", "mujoco/mjcf", "--states", "40")
    assert (done.returncode, records["mujoco/mjcf"]["verdict"]) == (0, "agrees"), done.stdout
    on, off = done.stdout.splitlines()[0].split("; off: ")
    assert "dry friction" not in on and "dry friction" in off
    done, _ = checked(folder, "arm.xml", "--subject", "pinocchio/mjcf", "--states", "40")
    assert "dry friction" in done.stdout.splitlines()[0].partition("ff: ")[2]


@pytest.mark.ci
@pytest.mark.parametrize("name", ["arm.xml", "rubbing.xml"])
def test_states_that_are_searched_at_limits_are_decided(folder: Path, name: str) -> None:
    """Hypothesis draws the ends of ranges, where rounding decides whether a limit is there."""
    _, records = checked(folder, name, "--subject", "mujoco/mjcf", "--states", "400")
    counts = records["mujoco/mjcf"]["verdict_counts"]
    assert counts.keys() <= {"agrees", "explained"}, counts


@pytest.mark.ci
def test_a_state_that_is_named_is_asked_as_it_is(folder: Path) -> None:
    words = ("--subject", "mujoco/mjcf", "--state")
    for q in ([2.125, 0.25], [-2.5, 0.75], [0.5, -0.25]):
        state = {"q": q, "v": [0.5, -1.5], "tau": [0.0, 1.0]}
        _, records = checked(folder, "arm.xml", *words, json.dumps(state))
        assert records["mujoco/mjcf"]["worst_state"] == state and records["mujoco/mjcf"]["verdict"] == "agrees"
    _, records = checked(folder, "arm.xml", *words, json.dumps({"q": [2.0, 0.0], "v": [1.0, 0.0], "tau": [0.0, 0.0]}))
    assert records["mujoco/mjcf"]["verdict"] == "undecided", "half an ulp decides whether the limit is there"


@pytest.mark.ci
@pytest.mark.parametrize(
    ("attribute", "said"),
    [("dof_frictionloss", "frictionloss = 0.125"), ("jnt_range", "range [1] = 0.5"), ("dof_damping", "damping =")],
)
def test_a_number_of_what_acts_that_an_engine_holds_otherwise_is_red_and_named(
    folder: Path, monkeypatch: pytest.MonkeyPatch, attribute: str, said: str
) -> None:
    real = adapter.let_act

    def otherwise(model: Any, places: Any, held: Any) -> None:
        real(model, places, held)
        numbers = getattr(model, attribute)
        place = tuple(np.argwhere(numbers)[-1])
        numbers[place] *= 1.25

    call_engines_here(monkeypatch)
    monkeypatch.setattr("harness.engines.adapters.mujoco.robot.let_act", otherwise)
    done, records = checked(folder, "arm.xml", "--subject", "mujoco/mjcf", "--states", "60")
    assert done.returncode == 1 and records["mujoco/mjcf"]["verdict"] == "disagrees"
    assert any(said in one for one in records["mujoco/mjcf"]["rest"]), records["mujoco/mjcf"]["rest"]


@pytest.mark.ci
@pytest.mark.parametrize("states", ["60", "4"])
def test_a_solver_that_stops_early_is_no_agreement_and_no_fault(folder: Path, states: str) -> None:
    done, records = checked(folder, "firm.xml", "--subject", "mujoco/mjcf", "--states", states)
    assert done.returncode == 0 and records["mujoco/mjcf"]["verdict"] == "explained"
    first = done.stdout.splitlines()[0]
    assert "stops before the solution that the engine documents" in first and 'set <option solver="Newton"' in first


@pytest.mark.ci
def test_a_solver_that_ends_elsewhere_is_red(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = adapter.let_act

    def softer(model: Any, places: Any, held: Any) -> None:
        real(model, places, held)
        model.eq_solref[:, 1] *= 1.5

    call_engines_here(monkeypatch)
    monkeypatch.setattr("harness.engines.adapters.mujoco.robot.let_act", softer)
    done, records = checked(folder, "firm.xml", "--subject", "mujoco/mjcf", "--states", "40")
    assert done.returncode == 1 and records["mujoco/mjcf"]["verdict"] == "disagrees"
    assert any("solref" in one for one in records["mujoco/mjcf"]["rest"]), records["mujoco/mjcf"]["rest"]


@pytest.mark.ci
def test_a_mimic_joint_that_is_held_by_a_constraint_is_told_with_the_constraint_on(folder: Path) -> None:
    _, records = checked(folder, "mimic.urdf", "--states", "60")
    held, free = (
        next(one for one in records[name]["readings"] if one["name"] == "mimic joints") for name in ("mujoco/urdf", "pinocchio/urdf")
    )
    assert 0 < held["alone"] < free["alone"] / 2


def test_an_element_goes_to_another_process_with_all_that_it_holds() -> None:
    root = read_any(FILES / "driven.xml", "a model").root
    assert etree.tostring(pickle.loads(pickle.dumps(root))) == etree.tostring(root)


@pytest.mark.ci
def test_what_is_read_is_another_mechanism_though_no_equation_feels_the_difference() -> None:
    """Pinocchio passes over the pose of a body that is fixed to the world."""
    path = str(Library.built_in().model_path("two_fingers_bar", "mjcf"))
    asked = Assignment.of(RobotLibrary.of([path], anywhere=True, acts=True), path, Subject("pinocchio", "mjcf"))
    read = asked.as_read
    assert read is not asked and read.mechanism.key == asked.mechanism.key and read.as_read is read
    assert asked.judge(asked.truth.asked_at(sample(asked.mechanism, 4, seed=0))).are_all(Verdict.AGREES)
