"""Engines of users' files are found by their adapters, and asked where their engine is: a toy's in an environment of its own."""

from __future__ import annotations

import importlib
import shutil
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest
import toy_engine
from comparison.robots import FILES
from support import BUILT_IN, InThisProcess, call_engines_here, completed, cross_checked

from harness.comparison.robot_library import RobotLibrary, ask_engine, engine_of, engines_of_files, robot_subjects
from harness.comparison.study import ComparisonSettings, RobotComparison
from harness.crosscheck.settings import Settings
from harness.engines import describe_engines, load_engine, runs_elsewhere
from harness.engines.loaded_file import EngineRun
from harness.engines.request import Refused
from harness.errors import InvalidRequest
from harness.explain.changes import readings
from harness.library import Stance
from harness.results.comparison import SubjectRecord
from harness.results.records import Record
from harness.workers import Workers

# What is right, what has a wrong number, and what leaves the damper out; a version whose program has no such function.
VERSIONS = {
    "1.0": toy_engine.RIGHT,
    "1.1": toy_engine.HEAVIER,
    "1.2": toy_engine.RIGHT.replace("-0.3 * v", "0.0 * v") + "APPLIES_DAMPERS = False\n",
    "1.3": toy_engine.LACKING.replace("def mass", "def masses"),
}
READINGS = """
from harness.explain.changes.readings import _left_out, readings_of
READINGS = readings_of("toy", {("urdf",): {_left_out.dampers: ("The toy applies no damping", "add it", "its own text, in a test")}})
"""
BAR = BUILT_IN.model_path("bar_pendulum", "urdf")


@pytest.fixture(scope="module")
def toy(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder of readings, none in it, where the toy has an adapter and environments."""
    with toy_engine.reading_files(tmp_path_factory.mktemp("toy"), VERSIONS) as folder:
        yield folder


def compared(path: Path, *subjects: str) -> dict[tuple[str, str], SubjectRecord]:
    study = RobotComparison(ComparisonSettings([path], states=8, subjects=subjects))
    found = completed(study, InThisProcess())
    assert not study.faults
    return {(one.subject, one.kind): one for one in found.subjects}


@pytest.mark.ci
def test_an_adapter_is_a_file_and_its_engine_is_asked_in_its_environment(toy: Path) -> None:
    assert "toy" in engines_of_files()
    assert runs_elsewhere(load_engine(RobotLibrary.without_files(), "toy@1.0"))
    records = compared(BAR, "toy@1.0/urdf", "pinocchio/urdf")
    assert list(records) == [(engine, kind) for engine in ("pinocchio/urdf", "toy@1.0/urdf") for kind in ("plain", "aided")]
    assert {records["toy@1.0/urdf", kind].outcome for kind in ("plain", "aided")} == {"agrees"}


@pytest.mark.ci
def test_a_wrong_number_of_an_engine_elsewhere_is_unexplained(toy: Path) -> None:
    records = compared(BAR, "toy@1.1/urdf")
    for record in records.values():
        assert record.outcome == "unexplained" and record.rest


@pytest.mark.ci
def test_what_an_engine_elsewhere_leaves_out_is_a_reading_of_its_file_or_unexplained(toy: Path) -> None:
    assert compared(BAR, "toy@1.2/urdf")["toy@1.2/urdf", "plain"].outcome == "unexplained"
    declared = toy / "toy_dampers.py"
    declared.write_text(READINGS)
    importlib.invalidate_caches()
    try:
        records = compared(BAR, "toy@1.2/urdf")
    finally:
        declared.unlink()
    plain = records["toy@1.2/urdf", "plain"]
    assert plain.outcome == "explained" and [one.name for one in plain.readings] == ["joint damping"]
    assert records["toy@1.2/urdf", "aided"].outcome == "agrees"


@pytest.mark.ci
def test_a_check_judges_a_plain_engine_elsewhere_as_a_comparison_does(toy: Path, tmp_path: Path) -> None:
    def checked(version: str, path: Path = BAR) -> Record:
        library = RobotLibrary.of([str(path)])
        records, _ = cross_checked(Settings(library=library, subjects=[f"toy@{version}/urdf"], states=16, examples=None))
        return records[0]

    assert checked("1.0").verdict == "agrees" and not checked("1.0").readings
    assert checked("1.2").verdict == "disagrees" and checked("1.2").rest, checked("1.2").message
    declared = toy / "toy_dampers.py"
    declared.write_text(READINGS)
    importlib.invalidate_caches()
    try:
        # What is read of a file is kept in the process.
        found = checked("1.2", Path(shutil.copy(BAR, tmp_path)))
    finally:
        declared.unlink()
    assert (found.verdict, [one.name for one in found.readings], found.as_expected) == ("explained", ["joint damping"], True)


@pytest.mark.ci
def test_what_a_version_lacks_and_what_it_refuses_are_told(toy: Path) -> None:
    lacking = compared(BAR, "toy@1.3/urdf")["toy@1.3/urdf", "plain"]
    assert lacking.outcome == "refused" and lacking.message == "toy_engine 1.3 has no mass"
    refused = compared(FILES / "arm.urdf", "toy@1.0/urdf")["toy@1.0/urdf", "plain"]
    assert refused.outcome == "refused" and refused.message == "one joint, no more"


@pytest.mark.ci
def test_by_default_every_engine_is_asked_that_is_installed_anywhere(toy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = {str(one) for one in robot_subjects()}
    assert {"toy/urdf", "mujoco/urdf", "mujoco/mjcf", "pinocchio/urdf"} <= asked
    assert ("drake/urdf" in asked) == (find_spec("pydrake") is not None)
    assert any("toy/urdf, aided: dampers" in remark for remark in RobotLibrary.of([str(BAR)], stance=Stance.AIDED).remarks())
    with pytest.raises(InvalidRequest, match=r"harness engines add toy==9\.0"):
        robot_subjects(["toy@9.0/urdf"])
    monkeypatch.setenv("HARNESS_CACHE", str(tmp_path))
    describe_engines(RobotLibrary.without_files(), Workers)
    assert not any(str(one).startswith("toy") for one in robot_subjects())
    assert "not installed; harness engines add toy" in ask_engine("toy", None).refusal  # type: ignore[arg-type]
    monkeypatch.undo()
    describe_engines(RobotLibrary.without_files(), Workers)


def test_no_engines_presence_changes_what_another_is_asked_and_answers(toy: Path) -> None:
    alone, beside = compared(FILES / "arm.urdf", "mujoco/urdf"), compared(FILES / "arm.urdf", "mujoco/urdf", "toy@1.0/urdf")
    assert all(beside[key] == record for key, record in alone.items())


def test_an_engine_of_a_version_goes_by_its_name() -> None:
    assert engine_of("mujoco@3.13.0").name == "mujoco@3.13.0" and engines_of_files()["mujoco"].name == "mujoco"
    names = [[one.name for one in readings.find_readings(engine, "urdf")] for engine in ("mujoco@3.14.0", "mujoco")]
    assert names[0] == names[1] and names[0]


def test_an_engine_with_the_reader_of_another_has_its_readings() -> None:
    own = {one.name for one in readings.find_readings("mjx", "mjcf")}
    assert {one.name for one in readings.find_readings("mjx", "mjcf", "mujoco")} > own
    assert engine_of("mjx").reader == "mujoco"


def test_a_refusal_at_a_state_is_an_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: object) -> None:
        raise Refused("not in continuous time")

    call_engines_here(monkeypatch)
    monkeypatch.setattr(EngineRun, "compute", refuse)
    answers = {kind: record for (_, kind), record in compared(FILES / "arm.urdf", "pinocchio/urdf").items()}
    assert {one.message for one in answers.values()} == {"not in continuous time"}
