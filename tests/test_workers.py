"""Engines that abort, hang, raise or answer NaN cost their own record and nothing else."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support import make_library

from harness.workers import Task, Workers

ENGINE = """
import math, os, time
import numpy as np

class Model:
    def loaded(self):
        return None

    def forward_dynamics(self, q, v, tau):
        {body}

class Engine:
    requires = ("numpy", "numpy")
    formats = ("mjcf",)

    def load(self, source, joints, gravity):
        return Model()

ENGINE = Engine()
"""


def failing_library(directory: Path, engines: dict[str, str]) -> Path:
    """A library of the bar pendulum with engines whose ``forward_dynamics`` has the given body."""
    return make_library(directory, ["bar_pendulum"], {name: ENGINE.format(body=body) for name, body in engines.items()})


def check(library: Path, *options: str) -> tuple[int, dict[str, dict[str, object]], str]:
    """Exit status, records by subject, and standard error of ``harness check``."""
    out = library / "out.json"
    command = [sys.executable, "-m", "harness", "check", "--library", str(library), "--json", str(out), "--states", "40", *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=library, check=False)
    records = {record["subject"]: record for record in json.loads(out.read_text())["records"]}
    return done.returncode, records, done.stderr


@pytest.fixture(scope="module")
def crashing(tmp_path_factory: pytest.TempPathFactory) -> tuple[int, dict[str, dict[str, object]], str]:
    bodies = {
        "aborting": "os.write(2, b'the cow jumped over the moon'); os.abort()",
        "aborting_later": "os.abort() if (q > 2.5).any() else None; return np.zeros_like(q)",
        "sleeping": "time.sleep(1000)",
        "raising": "raise RuntimeError('no can do')",
        "silent": "return np.full_like(q, math.nan)",
        "exiting": "os._exit(7)",
    }
    library = failing_library(tmp_path_factory.mktemp("crashing") / "library", bodies)
    return check(library, "--time-limit", "4")


def test_a_crash_is_exit_status_3(crashing: tuple[int, dict[str, dict[str, object]], str]) -> None:
    status, _, errors = crashing
    assert status == 3
    assert "Traceback" not in errors


@pytest.mark.parametrize("subject", ["lagrange", "mujoco/mjcf", "pinocchio/urdf"])
def test_healthy_engines_lose_nothing(crashing: tuple[int, dict[str, dict[str, object]], str], subject: str) -> None:
    record = crashing[1][subject]
    assert record["verdict"] == "agrees"
    assert record["states"] == 40


@pytest.mark.parametrize(
    ("subject", "message"),
    [
        ("aborting/mjcf", "crashed by signal 6 (SIGABRT)"),
        ("aborting/mjcf", "the cow jumped over the moon"),
        ("aborting_later/mjcf", "crashed by signal 6 (SIGABRT)"),
        ("sleeping/mjcf", "exceeded its time limit of 4 s"),
        ("raising/mjcf", "RuntimeError: no can do"),
        ("silent/mjcf", "answers are not finite"),
        ("exiting/mjcf", "ended its process with status 7"),
    ],
)
def test_a_failing_engine_says_why(crashing: tuple[int, dict[str, dict[str, object]], str], subject: str, message: str) -> None:
    record = crashing[1][subject]
    assert record["verdict"] == "error"
    assert message in str(record["message"])


@pytest.mark.parametrize("subject", ["aborting/mjcf", "aborting_later/mjcf", "sleeping/mjcf", "silent/mjcf"])
def test_a_failing_engine_has_its_state_and_a_replay(crashing: tuple[int, dict[str, dict[str, object]], str], subject: str) -> None:
    record = crashing[1][subject]
    state = record["worst_state"]
    assert isinstance(state, dict)
    assert sorted(state) == ["q", "tau", "v"]
    assert f"--state '{json.dumps(state)}'" in str(record["replay"])
    if subject == "aborting_later/mjcf":
        assert state["q"][0] > 2.5


def test_an_engine_that_raises_or_answers_nan_is_exit_status_1(tmp_path: Path) -> None:
    library = failing_library(tmp_path / "library", {"silent": "return np.full_like(q, math.nan)", "raising": "raise OSError('x')"})
    status, records, _ = check(library, "--subject", "silent/mjcf", "--subject", "raising/mjcf")
    assert status == 1
    assert {record["verdict"] for record in records.values()} == {"error"}


def test_an_existing_cluster_is_used_and_survives(tmp_path: Path) -> None:
    from distributed import LocalCluster

    library = failing_library(tmp_path / "library", {"aborting": "os.abort()"})
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50) as cluster:
        status, records, _ = check(library, "--scheduler", cluster.scheduler_address)
        assert status == 3
        assert records["aborting/mjcf"]["verdict"] == "error"
        assert {records[subject]["verdict"] for subject in ("lagrange", "mujoco/mjcf", "pinocchio/urdf")} == {"agrees"}
        status, _, _ = check(library, "--scheduler", cluster.scheduler_address, "--subject", "mujoco/mjcf")
        assert status == 0


def test_every_task_has_exactly_one_outcome() -> None:
    with Workers(count=2, time_limit=30) as workers:
        tasks = [Task(number, _abort if number % 7 == 3 else _double, (number,)) for number in range(15)]
        outcomes = {outcome.task.key: outcome for outcome in workers.run(tasks)}
    assert sorted(outcomes) == list(range(15))
    assert {number for number, outcome in outcomes.items() if outcome.crash is not None} == {3, 10}
    assert {number: outcome.value for number, outcome in outcomes.items() if outcome.crash is None} == {
        number: 2 * number for number in range(15) if number % 7 != 3
    }
    assert outcomes[3].crash is not None
    assert outcomes[3].crash.note == "at 3"


def _double(number: int, note: object) -> int:
    return 2 * number


def _abort(number: int, note: object) -> None:
    assert callable(note)
    note(f"at {number}")
    os.abort()


def test_a_cluster_that_lost_its_workers_gets_new_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("harness.workers.RESTART_SECONDS", 5.0)
    with Workers(count=1, time_limit=30) as workers:
        workers._client.cluster.scale(0)
        while workers._client.nthreads():
            time.sleep(0.1)
        outcomes = list(workers.run([Task(number, _double, (number,)) for number in range(3)]))
    assert [outcome.value for outcome in outcomes] == [0, 2, 4]


def test_tasks_of_a_cluster_without_workers_are_told_as_crashed(monkeypatch: pytest.MonkeyPatch) -> None:
    from distributed import LocalCluster

    monkeypatch.setattr("harness.workers.RESTART_SECONDS", 0.5)
    empty = LocalCluster(n_workers=0, processes=True, dashboard_address=None, silence_logs=50)
    with empty as cluster, Workers(scheduler=cluster.scheduler_address) as workers:
        outcomes = list(workers.run([Task(number, _double, (number,)) for number in range(3)]))
    assert [outcome.task.key for outcome in outcomes] == [0, 1, 2]
    assert all("no worker" in str(outcome.crash) for outcome in outcomes)
