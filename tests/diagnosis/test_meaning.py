"""A file is judged by what it says, and not by how many engines agree on it."""

from __future__ import annotations

from pathlib import Path

import pytest
from catalogue import BUILT_IN
from comparison.robots import edited
from support import InThisProcess, cross_checked

from harness.comparison.wanted import find_causes
from harness.crosscheck.settings import Settings
from harness.diagnosis.causes import errors_of_files
from harness.explain.pattern import infer, infer_from_records
from harness.verdict import Verdict

AGREES, DISAGREES = Verdict.AGREES.value, Verdict.DISAGREES.value
READERS = [f"{engine}/{form}" for engine in ("mujoco", "pinocchio") for form in ("mjcf", "urdf")]


@pytest.fixture
def turned(tmp_path: Path) -> Path:
    """The free body with its inertia turned by 5e-10 rad, which MuJoCo leaves out."""
    change = '<inertial pos="0 0 0"', '<inertial pos="0 0 0" quat="1 2.5e-10 0 0"'
    return edited(BUILT_IN.model_path("free_body", "mjcf"), tmp_path, change)


def test_a_file_that_an_engine_misreads_into_the_right_one_is_at_fault(turned: Path) -> None:
    settings = Settings(library=BUILT_IN, names=["free_body"], states=20, examples=None, stand_ins={"mjcf": turned})
    records, _ = cross_checked(settings)
    verdicts = {record.subject: record.verdict for record in records}
    assert (verdicts["mujoco/mjcf"], verdicts["pinocchio/mjcf"]) == (AGREES, DISAGREES)
    # What the majority says: Pinocchio, which reads the file as it stands.
    assert infer_from_records(records)["free_body"].party == "reader pinocchio/mjcf"
    [cause] = find_causes(settings, records, InThisProcess(), evaluations=1)
    assert cause.inference.startswith("the mjcf model is at fault: it means another mechanism, by ")
    assert "wrong with it: pinocchio/mjcf; mujoco/mjcf agrees with the energies, and so does not use what the file says" in cause.inference


def test_files_are_judged_by_what_they_mean(turned: Path) -> None:
    paths = {"mjcf": turned, "urdf": BUILT_IN.model_path("free_body", "urdf")}
    errors = errors_of_files(BUILT_IN, "free_body", paths, [], 1, lambda text: None)
    assert errors["urdf"] < 4 and errors["mjcf"] > 1e4
    broken = {"mjcf": BUILT_IN.model_path("arm_2r", "mjcf")}
    assert errors_of_files(BUILT_IN, "free_body", broken, [], 1, lambda text: None) == {}


@pytest.mark.parametrize(
    ("wrong", "mjcf", "urdf", "expected"),
    [
        ({"mujoco/mjcf", "pinocchio/mjcf"}, 1e6, 1.0, "model mjcf"),
        ({"pinocchio/mjcf"}, 1e6, 1.0, "model mjcf"),
        ({"pinocchio/mjcf"}, 1.0, 1.0, "reader pinocchio/mjcf"),
        ({"mujoco/mjcf", "pinocchio/mjcf"}, 1.0, 1.0, "readers mjcf"),
        ({"mujoco/mjcf", "mujoco/urdf"}, 1.0, 1.0, "engine mujoco"),
        (set(READERS), 1e6, 1e6, "equations"),
        ({"mujoco/mjcf", "pinocchio/mjcf", "mujoco/urdf"}, 1e6, 1.0, "undecided"),
        (set(), 1.0, 1.0, "nothing"),
        ({"lagrange"}, 1.0, 1.0, "kernel"),
    ],
)
def test_what_a_file_means_goes_before_the_majority(wrong: set[str], mjcf: float, urdf: float, expected: str) -> None:
    verdicts = {subject: DISAGREES if subject in wrong else AGREES for subject in (*READERS, "lagrange")}
    assert infer(verdicts, meanings={"mjcf": mjcf, "urdf": urdf}).party == expected


def test_two_faults_are_both_told() -> None:
    verdicts = {subject: DISAGREES if subject != "pinocchio/urdf" else AGREES for subject in READERS} | {"lagrange": AGREES}
    sentence = infer(verdicts, meanings={"mjcf": 1e6, "urdf": 1.0}).sentence
    assert sentence.startswith("more than one fault: the mjcf model is at fault: ")
    assert "mujoco/urdf" in sentence and "model urdf" not in sentence
