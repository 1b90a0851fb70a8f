"""The stages of a night: what their units are, and what of their results is a case that fails."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from catalogue import BUILT_IN
from support import make_library
from support_results import RECORD

from harness.diagnosis.faults.summary import Campaign, Fault
from harness.hard.cases import hard_cases
from harness.library import Library
from harness.night.course import digests
from harness.night.stage import NightChoice
from harness.night.stages import find_stages
from harness.results.atlas import Atlas, HardRow
from harness.results.benchmark import AccelerationCost, Benchmark
from harness.results.comparison import FileRecord, FilesComparison, SubjectRecord
from harness.results.cross_check import CrossCheckResult, HeldDifference, SuperfluousPart
from harness.results.motion_benchmark import Figure
from harness.results.night import NightSettings

STAGES = find_stages()
GOOD = replace(RECORD, verdict="agrees", backward_error=1.0, message="")
DIFFERENCE = HeldDifference(
    system="arm_2r", quantity="mass", joint="elbow", subjects=["mujoco/urdf"], statement="mass of elbow is 1", places=[]
)  # fmt: skip
PART = SuperfluousPart("arm_2r", "mujoco/mjcf", "mjcf/arm_2r.xml", 7, "joint", "armature", "0", "is not felt; leave it out")
ROW = HardRow(case="far_base", title="", subject="mujoco/mjcf", knob="distance", unit="m", points=[], verdict="agrees")
COST = AccelerationCost(system="arm_2r", method="pinocchio aba", states=5, seconds_per_state=1e-6)
FIGURE = Figure(system="tmd", what="mass", unit="kg", printed=1.0, computed=2.0, truth=2.0, reproduced=False)
FAULT = Fault(system="arm_2r", format="mjcf", kind="axis", statement="", where=((3, "joint", "axis"),), caught_by="check")
ROBOT = SubjectRecord(path="r.urdf", engine="mujoco", format="urdf", aided=False, call="", verdict="agrees", explained=True)


def choice(library: Library = BUILT_IN, **settings: Any) -> NightChoice:
    return NightChoice(library, NightSettings(**{"stages": [], "states": 100, "seed": 0} | settings))


def outcomes(stage: str, found: Any) -> dict[tuple[str, str], str]:
    cases = list(STAGES[stage].cases(found))
    assert len({case.key for case in cases}) == len(cases)
    assert {case.stage for case in cases} == {stage}
    assert all(case.is_good or (case.message and case.details) for case in cases)
    return {(case.group, case.name): case.outcome for case in cases}


def test_what_fails_in_a_cross_check() -> None:
    found = CrossCheckResult(
        records=[GOOD, replace(GOOD, subject="a/mjcf", verdict="error"), replace(GOOD, subject="b/mjcf", verdict="disagrees")]
    )
    files = ("arm_2r", "models")
    expected = {("arm_2r", "mujoco/mjcf"): "passed", ("arm_2r", "a/mjcf"): "error", ("arm_2r", "b/mjcf"): "failed", files: "passed"}
    assert outcomes("cross-check", found) == expected
    for parts in (CrossCheckResult(differs=[DIFFERENCE]), CrossCheckResult(superfluous=[PART])):
        parts.records = [GOOD]
        assert outcomes("cross-check", parts)[files] == "failed"
    fine = CrossCheckResult(records=[GOOD], differs=[replace(DIFFERENCE, reason="why")], superfluous=[replace(PART, fails=False)])
    assert outcomes("cross-check", fine)[files] == "passed"


@pytest.mark.parametrize(
    ("row", "outcome"), [({}, "passed"), ({"problems": ["no"]}, "failed"), ({"problems": ["no"], "crashed": True}, "error")]
)
def test_what_fails_in_an_atlas(row: dict[str, Any], outcome: str) -> None:
    assert outcomes("atlas", Atlas(rows=[replace(ROW, **row)])) == {("far_base", "mujoco/mjcf"): outcome}


def test_an_engine_that_cannot_be_loaded_is_one_case() -> None:
    assert outcomes("atlas", Atlas(problems=["x/mjcf: raises"] * 3)) == {("not measured", "x/mjcf"): "error"}


def test_what_fails_in_a_benchmark() -> None:
    broken, left_out = (
        replace(COST, method="a", failed=True, note="raises"),
        replace(COST, method="b", seconds_per_state=None, note="not offered"),
    )
    found = Benchmark(accelerations=[COST, broken, left_out], problems=["arm_2r, a: raises", "arm_2r, motion: crashed"], figures=[FIGURE])
    assert outcomes("bench", found) == {
        ("arm_2r", "pinocchio aba"): "passed",
        ("arm_2r", "a"): "error",
        ("arm_2r", "b"): "skipped",
        ("not measured", "arm_2r, motion"): "error",
        ("theory", "tmd, mass"): "failed",
    }


def test_what_fails_in_a_campaign() -> None:
    named = {("all models", "named"): "passed"}
    assert outcomes("faults", Campaign(faults=[FAULT])) == {("arm_2r/mjcf", "axis"): "passed"} | named
    for wrong in ({"caught_by": ""}, {"blamed": "mujoco"}, {"smallest": 1.0, "theory": 1e-9}):
        assert outcomes("faults", Campaign(faults=[FAULT, replace(FAULT, **wrong)])) == {("arm_2r/mjcf", "axis"): "failed"} | named
    unnamed = [replace(FAULT, diagnosed=1.0)] * 3
    assert outcomes("faults", Campaign(faults=unnamed))["all models", "named"] == "failed"
    assert outcomes("faults", Campaign(deaths=["arm_2r, mjcf: killed"]))["arm_2r, mjcf", "campaign"] == "error"


def test_what_fails_in_a_survey() -> None:
    wrong = replace(ROBOT, engine="pinocchio", verdict="disagrees", explained=False, rest=["nothing explains it"])
    refused = replace(ROBOT, aided=True, verdict="unsupported", message="too old")
    found = FilesComparison(files=[FileRecord(path="r.urdf", format="urdf"), FileRecord(path="s.urdf", problem="no links")])
    found.subjects = [ROBOT, wrong, refused]
    assert outcomes("survey", found) == {
        ("r.urdf", "urdf"): "passed",
        ("s.urdf", "file"): "failed",
        ("r.urdf", "mujoco/urdf, plain"): "passed",
        ("r.urdf", "pinocchio/urdf, plain"): "failed",
        ("r.urdf", "mujoco/urdf, aided"): "skipped",
    }


def test_units() -> None:
    assert STAGES["cross-check"].units(choice()) == BUILT_IN.select((), with_variants=True)
    assert list(STAGES["atlas"].units(choice())) == list(hard_cases())
    assert STAGES["atlas"].units(choice(cases=["far_base"], motion=True)) == ["far_base", "motion"]
    assert STAGES["survey"].units(choice()) == [] == STAGES["faults"].units(choice())
    assert all(stage.is_timed == (name == "bench") for name, stage in STAGES.items())


def test_a_family_is_one_unit_of_a_benchmark() -> None:
    units = STAGES["bench"].units(choice())
    members = [name for name in BUILT_IN.system_names() if name.startswith("chain_")]
    assert len(members) > 1
    assert "chain" in units and not set(members) & set(units)
    assert STAGES["bench"].units(choice(names=[members[0], "collar"])) == ["chain", "collar"]


def test_a_variant_alone_is_measured_nowhere_else() -> None:
    variant = BUILT_IN.variant_names()[0]
    asked = choice(names=[variant], models=4)
    assert STAGES["cross-check"].units(asked) == [variant]
    assert STAGES["bench"].units(asked) == [] == STAGES["faults"].units(asked)


def test_a_campaign_takes_models_by_the_seed() -> None:
    units = STAGES["faults"].units
    first, again, other = (units(choice(models=4, seed=seed)) for seed in (1, 1, 2))
    assert first == again != other
    assert len(first) == 4
    assert units(choice(models=100, names=["collar"])) == ["collar/mjcf", "collar/urdf"]


def test_whatever_is_changed_changes_the_inputs(tmp_path: Path) -> None:
    root = make_library(tmp_path / "library", ["bar_pendulum"], {"engine": "ENGINE = None"})
    (tmp_path / "robots").mkdir()
    robot = tmp_path / "robots" / "r.urdf"
    robot.write_text("<robot/>")
    library = Library.at(root)
    before = digests(library, [str(robot.parent)])
    assert set(before) == {
        "harness", "systems/bar_pendulum.py", "mjcf/bar_pendulum.xml", "urdf/bar_pendulum.urdf", "engines/engine.py", str(robot)
    }  # fmt: skip
    for name in sorted(set(before) - {"harness", str(robot)}):
        (root / name).write_text("changed")
        now = digests(library, [str(robot.parent)])
        assert [one for one in now if now[one] != before[one]] == [name]
        before = now
    robot.write_text("<robot name='r'/>")
    (root / "expected_verdicts.toml").write_text("")
    now = digests(library, [str(robot.parent)])
    assert {one for one in now if now[one] != before.get(one)} == {str(robot), "expected_verdicts.toml"}
