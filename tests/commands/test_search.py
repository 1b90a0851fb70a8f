"""``harness search``, and how what it finds reaches the report."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result
from support import Stage, harness, make_library

from harness.errors import InvalidRequest
from harness.hard import search
from harness.hard.search import DEFAULT_BUDGET, SearchSettings, StateSearch
from harness.library import Library
from harness.results.cross_check import CrossCheckResult
from harness.results.hard_states import FoundCase, FoundState, SearchResult, keep, path_of
from harness.results.history import History
from harness.results.records import ACCELERATIONS
from harness.study import Inquiry
from harness.workers import Outcome

FOUND = FoundState(
    state={"q": [1.0], "v": [0.0], "tau": [0.0]}, subject="mujoco/mjcf", backward_error=1e4, digits_lost=4.0, verdict="unstable",
    term="mass matrix", statement="M is ill-conditioned", versions={}, date="2026-01-31",
)  # fmt: skip


def stand_in(monkeypatch: pytest.MonkeyPatch, **outcome: Any) -> list[SearchSettings]:
    """Replace the search by its outcome; the settings it was called with."""
    asked: list[SearchSettings] = []

    class Answered(StateSearch):
        def __init__(self, settings: SearchSettings) -> None:
            super().__init__(settings)
            asked.append(settings)

        def inquiries(self) -> Iterator[list[Inquiry[None]]]:
            self.found = SearchResult(place=Path("hard_states/simple_pendulum.json"), **outcome)
            yield from ()

    monkeypatch.setattr(search, "StateSearch", Answered)
    monkeypatch.setattr("harness.workers.Workers", Stage(Outcome))
    return asked


def case(as_expected: bool) -> FoundCase:
    return FoundCase(
        found=FOUND, expected="agrees", as_expected=as_expected, replay="harness check simple_pendulum", reproducer="import mujoco"
    )


def test_options_reach_the_search(invoke: Callable[..., Result], monkeypatch: pytest.MonkeyPatch) -> None:
    asked = stand_in(monkeypatch, cases=[case(True)])
    assert invoke("simple_pendulum").exit_code == 0
    assert invoke("arm_2r", "--subject", "lagrange", "--budget", "50", "--seed", "3", "--no-keep").exit_code == 0
    plain, chosen = asked
    assert (plain.name, plain.subjects, plain.budget, plain.seed, plain.keep) == ("simple_pendulum", (), DEFAULT_BUDGET, 0, True)
    assert (chosen.name, chosen.subjects, chosen.budget, chosen.seed, chosen.keep) == ("arm_2r", ("lagrange",), 50, 3, False)
    assert f"default: ({DEFAULT_BUDGET})" in invoke("--help").output


@pytest.mark.parametrize(
    ("outcome", "status"),
    [
        ({}, 1),
        ({"cases": [case(True)]}, 0),
        ({"cases": [case(True), case(False)]}, 1),
        ({"failures": {"lagrange": "ValueError: no"}}, 1),
        ({"cases": [case(False)], "crashed": True}, 3),
    ],
)
def test_exit_statuses(outcome: dict[str, Any], status: int, invoke: Callable[..., Result], monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in(monkeypatch, **outcome)
    result = invoke("simple_pendulum", "--json", "found.json")
    assert result.exit_code == status
    document = json.loads(Path("found.json").read_text(), parse_constant=pytest.fail)
    assert len(document["search"]["found"]) == len(outcome.get("cases", []))
    assert "mujoco" in document["harness"] and document["run"]["command"].startswith("harness")
    if "cases" in outcome:
        assert "4.0 digits lost (mass matrix)" in result.output and "replay: harness check simple_pendulum" in result.output


def test_what_cannot_be_searched_is_bad_usage(invoke: Callable[..., Result], monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: Any) -> StateSearch:
        raise InvalidRequest("pinocchio/urdf cannot be searched")

    monkeypatch.setattr(search, "StateSearch", refuse)
    result = invoke("simple_pendulum")
    assert result.exit_code == 2 and "harness: pinocchio/urdf cannot be searched" in result.output


@pytest.fixture
def library(tmp_path: Path) -> Path:
    return make_library(tmp_path / "library", ["simple_pendulum"])


@pytest.mark.ci
def test_a_search_for_real(library: Path, invoke: Callable[..., Result]) -> None:
    result = invoke("simple_pendulum", "--subject", "lagrange", "--budget", "60", "--library", str(library), "--workers", "1")
    assert result.exit_code == 0, result.output
    assert re.search(r"lagrange: \d+ states tried", result.output)
    # A pendulum has no state at which its own equations do badly, and what agrees is not kept.
    assert "not stored: every state agrees" in result.output and not path_of(Library.at(library), "simple_pendulum").exists()


@pytest.mark.ci
def test_worst_cases_are_ranked_in_the_report_with_programs_that_run(library: Path, tmp_path: Path) -> None:
    """A stored state of another version is compared anew, so its old error is not shown."""
    stale = FoundState(**{**vars(FOUND), "backward_error": 1e9, "versions": {"mujoco": "0.0"}})
    keep(Library.at(library), "simple_pendulum", [stale])
    reports = tmp_path / "reports"
    result = harness("report", "--library", str(library), "--out", str(reports), "--workers", "1", cwd=tmp_path)
    assert result.returncode == 0, result.stdout + result.stderr
    with History(reports / "history.sqlite") as history:
        [number] = history.studies(CrossCheckResult)
        found = history.read(number, CrossCheckResult)
    cases = {case.subject: case for case in found.worst_cases}
    records = {record.subject: record for record in found.records if record.quantity == ACCELERATIONS}
    assert set(cases) == set(records)
    for subject, case in cases.items():
        assert case.backward_error == records[subject].backward_error
        assert "data roundoffs" in case.statement and case.replay.startswith("harness check simple_pendulum")
        assert str(library) in case.replay
    assert cases["lagrange"].reproducer == ""
    for subject in sorted(set(cases) - {"lagrange"}):
        program = cases[subject].reproducer
        answer, certified = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.splitlines()
        assert json.loads(answer) == pytest.approx(json.loads(certified), rel=1e-9)
    for engine in ("mujoco", "pinocchio"):
        page = (reports / "engines" / f"{engine}.html").read_text()
        assert "Worst cases" in page and "Worst backward error" not in page
    assert len(json.loads((reports / "report.json").read_text())["worst_cases"]) == 5
