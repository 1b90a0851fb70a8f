"""Kills at random moments: no record that was written is lost, and nothing of the run is left behind."""

from __future__ import annotations

import json
import os
import random
import signal
import sqlite3
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import psutil
import pytest
from support import make_library, without_progress

from harness.engines import load_engine
from harness.library import Library
from harness.workers import Task, Workers

SIGNALS = {signal.SIGKILL: -signal.SIGKILL, signal.SIGTERM: 143, signal.SIGINT: 130}
KILLS = [pytest.param(seed, marks=[] if seed == 1 else [pytest.mark.nightly]) for seed in range(10)]


def written(history: Path) -> int:
    """Records in a history, each of which can be read."""
    if not history.is_file():
        return 0
    try:
        # One that may write plays back the journal of a commit that was killed.
        with sqlite3.connect(f"file:{history}?mode=rw", uri=True) as connection:
            rows = connection.execute("SELECT content FROM parts WHERE part = 'records'").fetchall()
    except sqlite3.OperationalError:
        return 0
    return len([json.loads(content) for (content,) in rows])


def of_run(folder: Path) -> list[int]:
    """Processes that were started in an environment which names ``folder``."""
    found = []
    for process in psutil.process_iter():
        try:
            if process.environ().get("TMPDIR") == str(folder) and process.status() != psutil.STATUS_ZOMBIE:
                found.append(process.pid)
        except psutil.Error:
            continue
    return found


@pytest.mark.ci
@pytest.mark.parametrize("seed", KILLS)
def test_a_kill_leaves_the_records_and_nothing_else(seed: int, tmp_path: Path) -> None:
    moment, number = random.Random(seed).uniform(0.0, 4.0), list(SIGNALS)[seed % 3]
    library, folder = make_library(tmp_path / "library", ["bar_pendulum", "spring_damper"]), tmp_path / "temporary"
    folder.mkdir()
    command = [sys.executable, "-m", "harness", "report", "--library", str(library), "--out", "out", "--json", "out.json", "--workers", "2"]
    process = subprocess.Popen(
        command, cwd=tmp_path, env={**os.environ, "TMPDIR": str(folder)}, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    with process:
        until = time.monotonic() + 60
        while not (tmp_path / "out" / "history.sqlite").is_file() and time.monotonic() < until:
            time.sleep(0.02)
        time.sleep(moment)
        before = written(tmp_path / "out" / "history.sqlite")
        process.send_signal(number)
        errors = without_progress(process.communicate(timeout=60)[1])
    assert process.returncode in (SIGNALS[number], 0), errors
    assert len(errors.splitlines()) <= 3, errors
    assert written(tmp_path / "out" / "history.sqlite") >= before
    if (tmp_path / "out.json").is_file():
        # It is written when a twentieth of the records is new.
        assert len(json.loads((tmp_path / "out.json").read_text())["records"]) >= before - 1 - before // 20
    deadline = time.monotonic() + 10
    while of_run(folder) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert of_run(folder) == []
    assert list(folder.iterdir()) == []


def read_and_die(note: object) -> None:
    """Die inside of Pinocchio's reader of MJCF, where a file for it is open."""
    import pinocchio

    pinocchio.buildModelFromMJCF = lambda path: os.kill(os.getpid(), signal.SIGKILL if Path(path).read_text() else 0)
    library = replace(Library.built_in(), calls_engines_here=True)
    from harness.files.model_file import read_model

    load_engine(library, "pinocchio").load(read_model(library.model_path("bar_pendulum", "mjcf"), "mjcf"), ["pin"], 9.81)


@pytest.mark.ci
def test_a_death_inside_of_a_reader_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    with Workers(1) as workers:
        [outcome] = workers.run([Task(0, read_and_die, ())])
    assert "SIGKILL" in str(outcome.crash)
    assert list(tmp_path.iterdir()) == []


SLEEPING_ENGINE = """
import time

from harness.engines.adapters.mujoco import MujocoEngine


class Engine(MujocoEngine):
    def load(self, source, joints, gravity):
        if source.path.stem == "spring_damper":
            time.sleep(1000)
        return super().load(source, joints, gravity)


ENGINE = Engine()
"""


@pytest.mark.ci
def test_records_survive_a_kill(tmp_path: Path) -> None:
    """Kill the whole process group while an engine hangs on one system: the records of the other stay."""
    library = make_library(tmp_path / "library", ["bar_pendulum", "spring_damper"], {"sleeping": SLEEPING_ENGINE})
    out = library / "out"
    command = [sys.executable, "-m", "harness", "report", "--library", str(library), "--out", str(out), "--json", str(library / "out.json")]
    command += ["--workers", "2"]
    with subprocess.Popen(command, cwd=library, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        deadline = time.monotonic() + 120
        while time.monotonic() < deadline and written(out / "history.sqlite") < 6:
            time.sleep(0.1)
        os.killpg(process.pid, signal.SIGKILL)
    # The engine reads two formats.
    assert 6 <= written(out / "history.sqlite") <= 7
    records = json.loads((library / "out.json").read_text())["records"]
    assert len(records) >= 5
    assert {(record["system"], record["verdict"]) for record in records} == {("bar_pendulum", "agrees")}
