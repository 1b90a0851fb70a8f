"""``harness compare-runs``: runs by number and by name, exit status, and JSON."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from support import harness
from support_results import RECORD, RUN

from harness.results.cross_check import CrossCheckResult
from harness.results.history import History
from harness.results.night import BegunStage, Night, NightSettings

GOOD = replace(RECORD, verdict="agrees", backward_error=1.0, message="")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A history of a good run, a bad one, one of another library, one that found nothing, and a night that is good."""
    with History(tmp_path / "reports" / "history.sqlite") as history:
        for run, records in (
            (RUN, [GOOD]),
            (replace(RUN, versions={"mujoco": "5.0"}), [RECORD]),
            (replace(RUN, library="mine"), [GOOD]),
            (RUN, []),
        ):
            history.append(history.begin(run, CrossCheckResult), CrossCheckResult(records=records))
        night = history.begin(RUN, Night)
        study = history.begin(RUN, CrossCheckResult)
        history.append(study, CrossCheckResult(records=[GOOD]))
        begun = BegunStage(stage="cross-check", study=study)
        history.append(night, Night(settings=[NightSettings(stages=["cross-check"], states=1, seed=0)], begun=[begun]))
    return tmp_path


def test_the_last_two_runs_are_compared_by_default(folder: Path) -> None:
    done = harness("compare-runs", "--json", "out.json", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "before: run 2" in done.stdout and "now: run 6" in done.stdout
    assert "0 changes for the worse" in done.stdout
    found = json.loads((folder / "out.json").read_text())
    assert [found["compared"][name]["number"] for name in ("before", "now")] == [2, 6]
    assert {one["what"] for one in found["changes"]} >= {"verdict"}


@pytest.mark.parametrize(
    ("before", "now", "status", "said"),
    [
        ("latest", "previous", 1, ""),
        ("1", "2", 1, "mujoco   4.0     5.0"),
        ("2", "1", 0, ""),
        ("1", "5", 0, ""),
        ("6", "2", 1, ""),
        ("1", "6", 0, "nothing changed"),
    ],
)
def test_a_run_that_became_worse_is_exit_status_1(folder: Path, before: str, now: str, status: int, said: str) -> None:
    done = harness("compare-runs", before, now, cwd=folder)
    assert done.returncode == status and said in done.stdout, done.stdout + done.stderr
    assert ("disagrees (expected agrees)  worse" in done.stdout) == bool(status)


def test_runs_are_listed(folder: Path) -> None:
    done = harness("compare-runs", "--list", cwd=folder)
    assert done.returncode == 0
    assert [line.split()[0] for line in done.stdout.splitlines()[3:]] == ["6", "2", "1"]
    assert "mujoco 5.0" in done.stdout


def test_a_history_without_runs_is_exit_status_1(tmp_path: Path) -> None:
    History(tmp_path / "reports" / "history.sqlite").close()
    done = harness("compare-runs", "--list", cwd=tmp_path)
    assert (done.returncode, done.stdout.splitlines()[0]) == (1, "no run of this library is in the history; harness report adds one")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["1", "3"], "no run is called '3'; expected latest, previous or a number; there are 6, 2, 1"),
        (["first"], "no run is called 'first'"),
        (["latest", "6"], "latest and 6 are one run"),
        (["--out", "gone"], "gone holds no history"),
    ],
)
def test_what_is_no_run_is_named(folder: Path, arguments: list[str], said: str) -> None:
    done = harness("compare-runs", *arguments, cwd=folder)
    assert (done.returncode, done.stdout) == (2, "")
    assert said in done.stderr
    assert not (folder / "gone").exists()
