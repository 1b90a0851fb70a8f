"""The way over a Dask cluster, measured: ``pytest -n 0 -s tests/cluster_benchmarks.py``. Not collected by a plain ``pytest``.

Ratios and CPU seconds within one run. The scheduler of each cluster is in this process, so that its work and the harness' own are
measured together, as what does not grow with the number of workers.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import psutil
import pytest
import worker_tasks as work

from harness.crosscheck.run import CrossCheck
from harness.crosscheck.settings import Settings
from harness.crosscheck.stages import compare_all
from harness.library import Library
from harness.truth.sampling import BLOCK
from harness.workers import Scheduler, Task, Workers

SYSTEMS = ("double_pendulum", "cart_pendulum", "spring_damper", "arm_3r")
STATES = 1_000_000
QUIET: dict[str, Any] = {"threads_per_worker": 1, "dashboard_address": None, "silence_logs": 50}
# Of systems with up to three degrees of freedom and five subjects: nine numbers a state go out, and a few for each subject come back.
MOST_BYTES_OUT, MOST_BYTES_BACK = 128, 512
# A tenth of what a state costs its worker.
MOST_OWN_SECONDS = 1e-5
# CPU seconds of the run with one worker over those of the run with several.
LEAST_EFFICIENCY = 0.75
# Of a task's time.
MANY, LARGEST_OVERHEAD = 64, 0.1
# Of a task that compares a block: how long it takes here, and what goes out and comes back, as the tests print them.
SLEEP_SECONDS, SIZES = 0.25, (60 * BLOCK, 271 * BLOCK)


@dataclass
class Blocks:
    """Of the first block of each system: states, and bytes of its task on the way out and back."""

    states: int = 0
    bytes_out: int = 0
    bytes_back: int = 0


def cross_check(workers: Workers, states: int) -> tuple[list[tuple[Any, ...]], Blocks]:
    """The records of ``states`` states in all, and the size of their tasks."""
    study = CrossCheck(Settings(library=Library.built_in(), names=SYSTEMS, states=states // len(SYSTEMS), examples=None))
    blocks, measured = Blocks(), set()
    for outcome in workers.run(study.tasks(), study.tasks):
        task = outcome.task
        if task.function is compare_all and task.affinity not in measured:
            measured.add(task.affinity)
            blocks.states += len(task.arguments[1])
            blocks.bytes_out += len(pickle.dumps((task.function, task.arguments), protocol=5))
            blocks.bytes_back += len(pickle.dumps(outcome.value, protocol=5))
        list(study.take(outcome))
    assert measured == set(SYSTEMS)
    records = [(one.system, one.subject, one.verdict, one.states, one.backward_error) for one in study.result().records]
    return sorted(records), blocks


def cpu_seconds() -> tuple[float, float]:
    """User and system time [s] of this process, and of the processes below it that live."""
    below = 0.0
    for process in psutil.Process().children(recursive=True):
        times = process.cpu_times()
        below += times.user + times.system
    return time.process_time(), below


def test_bytes_of_a_state() -> None:
    with Workers(1) as workers:
        _, blocks = cross_check(workers, len(SYSTEMS) * 2 * BLOCK)
    out, back = blocks.bytes_out / blocks.states, blocks.bytes_back / blocks.states
    print(f"\na state has {out:.0f} bytes on its way out and {back:.0f} on its way back, pickled in blocks of {BLOCK}")
    assert out <= MOST_BYTES_OUT and back <= MOST_BYTES_BACK


def test_the_harness_own_cost_of_a_state() -> None:
    """Of samples, messages and judgements, which are made in one process for all workers: what more states cost more."""
    few, many = len(SYSTEMS) * 3 * BLOCK, len(SYSTEMS) * 8 * BLOCK
    seconds = []
    with Workers(1) as workers:
        # Points of the sample that the cache does not have are drawn once, by a part of SciPy that takes a second to import.
        cross_check(workers, many)
        for states in (few, many):
            started = time.process_time()
            cross_check(workers, states)
            seconds.append(time.process_time() - started)
    own = (seconds[1] - seconds[0]) / (many - few)
    print(f"\n{1e6 * own:.1f} us of the harness' own process a state, {1 / own:,.0f} states a second whatever the number of workers")
    assert own <= MOST_OWN_SECONDS


def test_a_million_states_over_one_two_and_four_workers() -> None:
    from distributed import LocalCluster

    found, cost = {}, {}
    for count in (1, 2, 4):
        with LocalCluster(n_workers=count, processes=True, **QUIET) as cluster:
            started, before = time.perf_counter(), cpu_seconds()
            with Workers(scheduler=Scheduler(cluster.scheduler_address)) as workers:
                found[count], _ = cross_check(workers, STATES)
                after = cpu_seconds()
            wall = time.perf_counter() - started
        own, theirs = (b - a for a, b in zip(before, after, strict=True))
        cost[count] = own + theirs
        print(
            f"\n{count} workers: {wall:.0f} s, {theirs:.0f} CPU s of workers and {own:.0f} of scheduler and harness; "
            f"{1e6 * theirs / STATES:.0f} and {1e6 * own / STATES:.0f} us a state, {STATES / theirs:,.0f} states a second and core; "
            f"efficiency {cost[1] / cost[count]:.2f} in CPU time"
        )
    assert found[1] == found[2] == found[4]
    assert all(cost[1] >= LEAST_EFFICIENCY * cost[count] for count in (2, 4))


def test_empty_tasks_a_second() -> None:
    from distributed import LocalCluster

    count = 1000
    with LocalCluster(n_workers=2, processes=True, **QUIET) as cluster, Workers(scheduler=Scheduler(cluster.scheduler_address)) as workers:
        list(workers.run([Task(number, work.echo, (number,)) for number in range(4)]))
        started, before = time.perf_counter(), time.process_time()
        assert sum(outcome.value for outcome in workers.run([Task(number, work.echo, (1,)) for number in range(count)])) == count
        wall, own = time.perf_counter() - started, time.process_time() - before
    print(f"\n{count / wall:.0f} empty tasks a second; {1e3 * own / count:.1f} ms of CPU time each of scheduler and harness")


# Workers whose tasks run in their own threads, all in a process of their own.
MANY_WORKERS = """
import asyncio, sys
from distributed import Worker
from harness.workers import cluster
import worker_tasks
cluster._run_here = worker_tasks.run_in_thread

async def serve(address, count):
    workers = [Worker(address, nthreads=1, dashboard=False) for _ in range(count)]
    await asyncio.gather(*workers)
    await asyncio.gather(*(worker.finished() for worker in workers))

asyncio.run(serve(sys.argv[1], int(sys.argv[2])))
"""


@pytest.fixture
def many() -> Iterator[str]:
    """The address of a scheduler in this process with ``MANY`` workers, whose tasks sleep."""
    from distributed import Client, LocalCluster

    with LocalCluster(n_workers=0, processes=True, **QUIET) as cluster:
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        command = [sys.executable, "-c", MANY_WORKERS, cluster.scheduler_address, str(MANY)]
        process = subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL)
        try:
            with Client(cluster.scheduler_address) as client:
                client.wait_for_workers(MANY)
            yield cluster.scheduler_address
        finally:
            process.kill()
            process.wait()


@pytest.mark.parametrize("sizes", [(0, 0), SIZES], ids=["empty", "as large as a block's"])
def test_the_schedulers_share_of_many_workers(many: str, sizes: tuple[int, int]) -> None:
    """CPU time of scheduler and harness, for a task: its share of the task's time, and with how many workers it is all of its own time.

    Wall time would be that of the workers too, which share one process here.
    """
    count = MANY * 4
    tasks = [Task(number, work.sleep_and_answer, (SLEEP_SECONDS, bytes(sizes[0]), sizes[1])) for number in range(count)]
    with Workers(scheduler=Scheduler(many)) as workers:
        started, before = time.perf_counter(), time.process_time()
        outcomes = list(workers.run(tasks))
        wall, own = time.perf_counter() - started, (time.process_time() - before) / count
    assert [len(outcome.value) for outcome in outcomes] == [sizes[1]] * count
    share = own / SLEEP_SECONDS
    print(
        f"\n{MANY} workers, {sum(sizes):,} bytes a task: {1e3 * own:.1f} ms of CPU time of scheduler and harness for a task of "
        f"{SLEEP_SECONDS:g} s, {100 * share:.1f} % of it; busy {100 * MANY * share:.0f} % of the time with {MANY} workers, "
        f"all of it with {1 / share:.0f}; {count / wall:.0f} tasks a second here"
    )
    assert own <= LARGEST_OVERHEAD * SLEEP_SECONDS
