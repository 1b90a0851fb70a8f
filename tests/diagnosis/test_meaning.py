"""A file is judged by what it says, and not by how many engines agree on it."""

from __future__ import annotations

from pathlib import Path

import pytest
from catalogue import BUILT_IN
from comparison.robots import edited
from support import InThisProcess, cross_checked

from harness.crosscheck.settings import Settings
from harness.diagnosis.causes import errors_of_files
from harness.diagnosis.wanted import find_causes
from harness.explain.pattern import infer_from_records
from harness.verdict import Verdict


@pytest.fixture
def turned(tmp_path: Path) -> Path:
    """The free body with its inertia turned by 5e-10 rad, which MuJoCo leaves out."""
    change = '<inertial pos="0 0 0"', '<inertial pos="0 0 0" quat="1 2.5e-10 0 0"'
    return edited(BUILT_IN.model_path("free_body", "mjcf"), tmp_path, change)


@pytest.mark.ci
def test_a_file_that_an_engine_misreads_into_the_right_one_is_at_fault(turned: Path) -> None:
    settings = Settings(library=BUILT_IN, names=["free_body"], states=20, examples=None, stand_ins={"mjcf": turned})
    records, _ = cross_checked(settings)
    verdicts = {record.subject: record.verdict for record in records}
    assert (verdicts["mujoco/mjcf"], verdicts["pinocchio/mjcf"]) == (Verdict.AGREES, Verdict.DISAGREES)
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
