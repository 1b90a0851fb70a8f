"""``harness atlas``: what it asks, what it keeps, what it prints, and its exit statuses."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import Result
from support import Stage, where
from support_results import RUN

from harness import workers
from harness.engines import select_subjects
from harness.hard.cases import hard_cases
from harness.hard.measurement import measure
from harness.hard.motions import OSCILLATOR, STABILITY_LIMITS, hard_motions, partings
from harness.library import Library
from harness.results.atlas import Atlas, HardPoint, HardRow, Parting, StableStep
from harness.results.history import History
from harness.results.run import Run
from harness.workers import Crash, Outcome, Task

POINT = HardPoint(
    knob=1.0, system="spring_damper", verdict="agrees", backward_error=1.5, digits_lost=0.3, condition=1.0, unstable_bound=16.0,
    certified=8, states=8, bits=128, state={"q": [0.1], "v": [0.0], "tau": [1.0]},
)  # fmt: skip
PARTING = Parting(
    motion="chaos", system="double_pendulum", integrator="mujoco RK4", knob=2.4, rate=1.1, expected_rate=1.0, parted=25.0, earliest=24.0,
    largest=1.0, verdict="agrees",
)  # fmt: skip
STEP = StableStep(
    case=OSCILLATOR, system="spring_damper", integrator="mujoco Euler", knob=1.0, frequency=1.0, measured=math.inf, expected=2.0,
    verdict="disagrees",
)  # fmt: skip


def row(case: str, subject: str, *points: HardPoint) -> HardRow:
    return HardRow(
        case=case, title="a title", subject=subject, knob="stiffness", unit="N/m", points=list(points), verdict=points[-1].verdict
    )


def answer(task: Task) -> Outcome:
    """Agreement everywhere."""
    if task.function is measure:
        return Outcome(task, value=row(where(task)[0], str(where(task)[1]), POINT))
    return Outcome(task, value=[PARTING] if task.function is partings else [replace(STEP, measured=2.0, verdict="agrees")])


def unstable(task: Task) -> Outcome:
    """Agreement at the first value of the knob alone."""
    worse = replace(POINT, verdict="unstable", backward_error=1e5)
    return Outcome(task, value=row(where(task)[0], str(where(task)[1]), POINT, worse))


def latest(reports: Path) -> tuple[Run, Atlas]:
    with History(reports / "history.sqlite") as history:
        found = history.latest(Atlas, "built-in")
    assert found is not None
    return found


@pytest.fixture
def stage(monkeypatch: pytest.MonkeyPatch) -> Stage:
    stage = Stage(answer)
    monkeypatch.setattr(workers, "Workers", stage)
    return stage


@pytest.mark.ci
def test_every_case_is_asked_of_every_subject_and_motion_only_when_asked_for(stage: Stage, invoke: Callable[..., Result]) -> None:
    # Without a single "unstable" the entries that expect it hold nowhere, which is not as expected.
    assert invoke().exit_code == 1
    asked = {(name, str(subject)) for name, subject, *_ in map(where, stage.tasks)}
    native = select_subjects(Library.built_in(), (), native_only=True)
    about = {name: case.subjects or tuple(map(str, native)) for name, case in hard_cases().items()}
    assert asked == {(name, str(subject)) for name in about for subject in native if str(subject) in about[name]}
    # Long chains take minutes.
    assert [made["time_limit"] for made in stage.made_with] == [600.0]
    stage.rounds.clear()
    result = invoke("stiff_mode", "--subject", "lagrange", "--motion", "--time-limit", "5")
    assert result.exit_code == 0, result.output
    names = [where(task)[1] for task in stage.tasks[1:]]
    assert names == [*hard_motions(), *STABILITY_LIMITS]
    assert stage.made_with[-1]["time_limit"] == 5.0


@pytest.mark.ci
def test_what_was_measured_is_kept_printed_and_written(stage: Stage, invoke: Callable[..., Result], tmp_path: Path) -> None:
    result = invoke("stiff_spring", "--motion", "--json", "atlas.json", "--out", "here")
    assert result.exit_code == 0, result.output
    for words in ("stiff_spring", "chaos", "mujoco RK4", "1 family, 3 subjects, 3 points: every verdict is as expected."):
        assert words in result.output
    run, atlas = latest(tmp_path / "here")
    assert run.profile == "atlas" and len(atlas.rows) == 3
    assert atlas.rows[0].points == [POINT] and PARTING in atlas.partings
    document = json.loads((tmp_path / "atlas.json").read_text(), parse_constant=pytest.fail)
    assert len(document["atlas"]["rows"]) == 3 and document["atlas"]["partings"][0]["rate"] == 1.1
    assert document["records"] == []
    assert "stiff_spring" in (tmp_path / "here" / "hard.html").read_text()


@pytest.mark.ci
def test_a_verdict_that_no_entry_expects_fails(stage: Stage, invoke: Callable[..., Result]) -> None:
    stage.answers = unstable
    result = invoke("stiff_spring", "--subject", "mujoco/mjcf")
    assert result.exit_code == 1
    assert "not as expected: stiff_spring, mujoco/mjcf: unstable at 1 points, which no entry expects" in result.output


def test_a_verdict_that_is_expected_comes_with_its_reason(stage: Stage, invoke: Callable[..., Result]) -> None:
    stage.answers = unstable
    result = invoke("vanishing_wrist", "--subject", "mujoco/mjcf", "--subject", "lagrange")
    assert result.exit_code == 0, result.output
    assert "every verdict is as expected" in result.output
    [reason] = re.findall(r"^vanishing_wrist, lagrange, mujoco/mjcf: unstable is expected: (.*)$", result.output, re.MULTILINE)
    assert "nothing between them weighs; give every joint its rotor's reflected inertia" in reason and "section 10.1" in reason


def test_a_step_beyond_theory_fails(stage: Stage, invoke: Callable[..., Result]) -> None:
    stage.answers = lambda task: Outcome(task, value=[STEP]) if where(task)[1] == "mujoco Euler" else answer(task)
    result = invoke("stiff_spring", "--motion")
    assert result.exit_code == 1
    assert "mujoco Euler, 1 rad/s: stable up to inf over the frequency, expected 2" in result.output


def test_a_crash_costs_its_part_alone(stage: Stage, invoke: Callable[..., Result], tmp_path: Path) -> None:
    def crashing(task: Task) -> Outcome:
        if str(where(task)[1]) == "pinocchio/urdf":
            note = json.dumps({"knob": 1e6, "system": "spring_damper"})
            return Outcome(task, crash=Crash("crashed by signal 11 (SIGSEGV)", note, ""))
        return answer(task)

    stage.answers = crashing
    result = invoke("stiff_spring")
    assert result.exit_code == 3
    _, atlas = latest(tmp_path / "reports")
    crashed = next(row for row in atlas.rows if row.subject == "pinocchio/urdf")
    assert crashed.crashed and crashed.points[0].knob == 1e6 and "SIGSEGV" in crashed.points[0].reason
    assert [row.verdict for row in atlas.rows].count("agrees") == 2


def test_a_motion_that_fails_is_told(stage: Stage, invoke: Callable[..., Result]) -> None:
    stage.answers = lambda task: Outcome(task, exception=ZeroDivisionError("no step")) if where(task)[1] == "chaos" else answer(task)
    result = invoke("stiff_spring", "--motion")
    assert result.exit_code == 1 and "not measured: chaos: ZeroDivisionError: no step" in result.output


def test_parts_of_an_atlas_come_back_as_they_were(tmp_path: Path) -> None:
    unfinished = replace(POINT, backward_error=None, unstable_bound=math.inf, verdict="unsupported", reason="refused")
    atlas = Atlas(rows=[row("stiff_spring", "lagrange", POINT, unfinished)], partings=[PARTING], stable_steps=[STEP], problems=["a"])
    with History(tmp_path / "history.sqlite") as history:
        number = history.begin(RUN, Atlas)
        assert history.latest(Atlas, "built-in") is None
        history.append(number, atlas)
        assert history.latest(Atlas, "built-in") == (RUN, atlas)
        assert history.latest(Atlas, "another") is None
        with pytest.raises(ValueError, match="there is no study 7"):
            history.append(7, atlas)


@pytest.mark.ci
def test_one_family_for_real(invoke: Callable[..., Result], tmp_path: Path) -> None:
    result = invoke("stiff_mode", "--subject", "lagrange", "--workers", "1")
    assert result.exit_code == 0, result.output
    assert "1 family, 1 subject, 30 points: every verdict is as expected." in result.output
    assert (tmp_path / "reports" / "index.html").is_file()
