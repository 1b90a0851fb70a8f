"""Workers of a cluster that are killed or join while a run is under way cost no outcome."""

from __future__ import annotations

import os
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import worker_tasks as work

from harness.workers import Scheduler, Task, Workers
from harness.workers.cluster import LOST
from harness.workers.tasks import TaskQueue

QUIET: dict[str, Any] = {"processes": True, "dashboard_address": None, "silence_logs": 50}
Starter = Callable[[int], "subprocess.Popen[bytes]"]


@pytest.fixture(params=[0, 3], ids=lambda failures: f"the scheduler allows {failures} failures")
def cluster(request: pytest.FixtureRequest) -> Iterator[Any]:
    """A scheduler without workers, which gives a task up after as many workers of it have died, or gives it to another."""
    import dask
    from distributed import LocalCluster

    with (
        dask.config.set({"distributed.scheduler.allowed-failures": request.param}),
        LocalCluster(n_workers=0, **QUIET) as cluster,
    ):
        yield cluster


@pytest.fixture
def start(cluster: Any) -> Iterator[Starter]:
    """Starts workers that nothing starts again, and waits until the scheduler has so many."""
    from distributed import Client

    started = []

    def start(count: int) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "distributed.cli.dask_worker", cluster.scheduler_address, "--no-nanny", "--nthreads", "1"]
        environment = {"PYTHONPATH": ":".join(filter(None, sys.path))}
        process = subprocess.Popen([*command, "--no-dashboard"], stderr=subprocess.DEVNULL, env={**os.environ, **environment})
        started.append(process)
        with Client(cluster.scheduler_address) as client:
            client.wait_for_workers(count)
        return process

    yield start
    for process in started:
        process.kill()
        process.wait()


@pytest.mark.ci
def test_workers_killed_and_joined_lose_nothing(cluster: Any, start: Starter) -> None:
    doomed, _ = start(1), start(2)
    tasks = [Task(number, work.worker_of_the_cluster, (0.1,), affinity=(None, "a", "b")[number % 3]) for number in range(30)]
    with Workers(scheduler=Scheduler(cluster.scheduler_address)) as workers:
        coming = workers.run(tasks)
        outcomes = [next(coming) for _ in range(5)]
        doomed.kill()
        doomed.wait()
        joined = start(2)
        outcomes += coming
    assert Counter(outcome.task.key for outcome in outcomes) == Counter(range(30))
    assert not any(outcome.crash or outcome.exception for outcome in outcomes)
    assert {outcome.value for outcome in outcomes[:5]} & {doomed.pid}
    assert joined.pid in {outcome.value for outcome in outcomes[5:]}
    for affinity in "ab":
        order = [outcome.task.key for outcome in outcomes if outcome.task.affinity == affinity]
        assert order == sorted(order)


@pytest.mark.ci
def test_a_task_is_asked_again_on_another_worker(cluster: Any, start: Starter, tmp_path: Path) -> None:
    first, second = start(1), start(2)
    tasks = [Task(0, work.lose_worker, (str(tmp_path), 1), "a"), *(Task(number, work.echo, (number,), "a") for number in range(1, 6))]
    with Workers(scheduler=Scheduler(cluster.scheduler_address)) as workers:
        outcomes = list(workers.run(tasks))
    assert [(outcome.task.key, outcome.value) for outcome in outcomes] == [(0, 1), *((number, number) for number in range(1, 6))]
    assert sorted([first.poll() is None, second.poll() is None]) == [False, True]


@pytest.mark.ci
def test_a_task_that_kills_its_workers_costs_itself(tmp_path: Path) -> None:
    """Those beside it, on workers of two threads which are started again, are asked again until they answer."""
    from distributed import LocalCluster

    harmful = Task("harmful", work.lose_worker, (str(tmp_path), 99), "a")
    harmless = [Task(number, work.slow_process, (0.3,)) for number in range(12)]
    with (
        LocalCluster(n_workers=2, threads_per_worker=2, **QUIET) as cluster,
        Workers(scheduler=Scheduler(cluster.scheduler_address)) as workers,
    ):
        outcomes = list(workers.run([*harmless[:2], harmful, *harmless[2:]]))
    assert Counter(outcome.task for outcome in outcomes) == Counter([harmful, *harmless])
    assert {outcome.task.key: str(outcome.crash) for outcome in outcomes if outcome.value is None} == {"harmful": LOST}
    assert len(list(tmp_path.iterdir())) == 2


def test_a_task_that_is_put_back_goes_first_and_a_barred_one_waits_with_its_affinity() -> None:
    tasks = [Task(number, work.own_process, (), affinity) for number, affinity in enumerate([None, "a", "a", "b"])]
    queue = TaskQueue(tasks)
    assert [queue.take("me", {}), queue.take("me", {})] == tasks[:2]
    queue.put_back(tasks[1])
    assert queue.take("me", {}, barred={tasks[1]}) is tasks[3]
    assert queue.take("me", {}, barred={tasks[1]}) is None
    assert [queue.take("me", {}), queue.take("me", {}), queue.take("me", {})] == [tasks[1], tasks[2], None]
