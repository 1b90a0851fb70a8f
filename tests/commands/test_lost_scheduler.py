"""A cluster whose scheduler ends while a command is at work: what was answered is told and written, and nothing passes for complete."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from support import Done, harness, losing_after, make_library

from harness.results.cross_check import CrossCheckResult
from harness.results.history import History
from harness.results.night import Night

ADDRESS = "tcp://cluster:8786"
LOST = f"The scheduler at {ADDRESS} is gone: "
COMMANDS: dict[str, list[str]] = {
    "check": ["check"],
    "report": ["report", "--out", "out"],
    "atlas": ["atlas", "far_base", "--out", "out"],
    "search": ["search", "bar_pendulum", "--no-keep", "--budget", "50"],
    "faults": ["faults", "bar_pendulum", "--kind", "sign"],
    "nightly": ["nightly", "--stage", "cross-check", "--faults", "0", "--states", "40", "--out", "out"],
}


def lose(command: str, answers: int, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Done:
    make_library(folder / "library", ["bar_pendulum", "spring_damper"])
    monkeypatch.setattr("support.InThisProcess", losing_after(answers))
    return harness(*COMMANDS[command], "--library", "library", "--json", "found.json", "--scheduler", ADDRESS, cwd=folder)


@pytest.mark.usefixtures("without_charts")
@pytest.mark.parametrize("answers", [0, 1])
@pytest.mark.parametrize("command", [*(name for name in COMMANDS if name != "faults"), pytest.param("faults", marks=pytest.mark.ci)])
def test_what_was_answered_is_told_and_written(command: str, answers: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done = lose(command, answers, tmp_path, monkeypatch)
    assert done.returncode == 3, done.stdout + done.stderr
    assert done.stdout.startswith(LOST), done.stdout
    assert json.loads((tmp_path / "found.json").read_text())["incomplete"] == f"the scheduler at {ADDRESS} is gone"


@pytest.mark.ci
@pytest.mark.usefixtures("without_charts")
def test_records_before_the_loss_are_in_json_history_and_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done = lose("report", 25, tmp_path, monkeypatch)
    records = json.loads((tmp_path / "found.json").read_text())["records"]
    assert records, done.stdout
    assert done.stdout.splitlines()[0].startswith(f"{LOST}{len(records)} of 10 parts of the cross-check were complete")
    with History(tmp_path / "out" / "history.sqlite") as history:
        [number] = history.studies(CrossCheckResult)
        stored = history.read(number, CrossCheckResult).records
    assert sorted((one.system, one.subject) for one in stored) == sorted((one["system"], one["subject"]) for one in records)
    assert records[0]["system"] in (tmp_path / "out" / "index.html").read_text()


@pytest.mark.ci
@pytest.mark.usefixtures("without_charts")
def test_a_night_goes_on_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HARNESS_CACHE", str(tmp_path / "cache"))
    done = lose("nightly", 30, tmp_path, monkeypatch)
    assert "--resume goes on with the others" in done.stdout.splitlines()[0]
    with History(tmp_path / "out" / "history.sqlite") as history:
        [number] = history.studies(Night)
        assert not history.read(number, Night).ended
    monkeypatch.undo()
    monkeypatch.setenv("HARNESS_CACHE", str(tmp_path / "cache"))
    done = harness(*COMMANDS["nightly"], "--library", "library", "--resume", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "goes on: it has" in done.stderr


@pytest.mark.ci
def test_a_scheduler_that_is_killed_costs_nothing_that_was_answered(tmp_path: Path) -> None:
    """One in a process of its own, with a worker, which is killed once the JSON has a record."""
    make_library(tmp_path / "library", ["bar_pendulum", "spring_damper", "simple_pendulum", "double_pendulum"])
    environment = {**os.environ, "PYTHONPATH": ":".join(filter(None, sys.path))}
    address = tmp_path / "scheduler.json"
    dask = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", str(address)]
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", "--scheduler-file", str(address), "--nthreads", "1", "--no-dashboard"]
    started = [subprocess.Popen(words, stderr=subprocess.DEVNULL, env=environment) for words in (dask, [*worker, "--no-nanny"])]
    found, until = tmp_path / "found.json", time.monotonic() + 240
    try:
        while not address.is_file() and time.monotonic() < until:
            time.sleep(0.05)
        where = json.loads(address.read_text())["address"]
        words = ["check", "--states", "4000", "--library", "library", "--json", str(found), "--scheduler", where]
        options: dict[str, Any] = {"cwd": tmp_path, "text": True, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        with subprocess.Popen([sys.executable, "-m", "harness", *words], **options) as process:
            while not found.is_file() and process.poll() is None and time.monotonic() < until:
                time.sleep(0.02)
            before = json.loads(found.read_text())["records"]
            started[0].send_signal(signal.SIGKILL)
            said, errors = process.communicate(timeout=240)
    finally:
        for one in started:
            one.kill()
            one.wait()
    records = json.loads(found.read_text())["records"]
    assert process.returncode == 3, errors
    assert said.startswith(f"The scheduler at {where} is gone: {len(records)} of 20 parts of the cross-check were complete"), said
    assert len(before) <= len(records) < 20
    assert {record["verdict"] for record in records} == {"agrees"}
    assert "Traceback" not in errors and "distributed" not in errors
