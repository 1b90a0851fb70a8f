"""The way over a Dask cluster: bytes and CPU time of a state and of a task.

The scheduler of each cluster is in this process, so that its work and the harness' own are measured together, as what does not grow with
the number of workers.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import cache, partial
from typing import Any

from benchmarks.benchmark import Benchmark, Measure, alone

SYSTEMS = ("double_pendulum", "cart_pendulum", "spring_damper", "arm_3r")
# Of systems with up to three degrees of freedom and five subjects: nine numbers a state go out, and a few for each subject come back.
MOST_BYTES_OUT, MOST_BYTES_BACK = 128, 512
# A tenth of what a state costs its worker.
MOST_OWN_SECONDS = 1e-5
STATES, WORKERS, LEAST_EFFICIENCY = 200_000, (2, 4), 0.75
# Of a task that compares a block: how long it takes here, and what goes out and comes back for each of its 2,048 states.
MANY, SLEEP_SECONDS, BYTES = 64, 0.25, (60, 271)
MOST_OF_A_TASK = 0.1 * SLEEP_SECONDS
EMPTY_TASKS = 1000
QUIET: dict[str, Any] = {"threads_per_worker": 1, "dashboard_address": None, "silence_logs": 50}


def benchmarks() -> Iterator[Benchmark]:
    yield Benchmark("cluster/bytes of a state out", partial(bytes_of_a_state, 0), "", MOST_BYTES_OUT, rounds=1, warm=False, unit="bytes")
    yield Benchmark("cluster/bytes of a state back", partial(bytes_of_a_state, 1), "", MOST_BYTES_BACK, rounds=1, warm=False, unit="bytes")
    yield Benchmark("cluster/own process, a state", own_seconds, "", MOST_OWN_SECONDS, rounds=5)
    for count in WORKERS:
        yield Benchmark(
            f"cluster/a state on {count} workers", partial(on_workers, count), "one worker", 1 / LEAST_EFFICIENCY, rounds=2, warm=False
        )
    yield Benchmark("cluster/scheduler, an empty task", empty_task, "", rounds=5)
    yield Benchmark(f"cluster/scheduler, a task of {MANY} workers", partial(task_of_many, False), "", MOST_OF_A_TASK, rounds=2, warm=False)
    yield Benchmark(f"cluster/scheduler, a block of {MANY} workers", partial(task_of_many, True), "", MOST_OF_A_TASK, rounds=2, warm=False)


def cross_check(workers: Any, states: int) -> tuple[int, int, int]:
    """Run a check of ``states`` states in all; of the first block of each system: states, bytes of its task on the way out, and back."""
    from harness.crosscheck.run import CrossCheck
    from harness.crosscheck.settings import Settings
    from harness.crosscheck.stages import compare_all
    from harness.library import Library

    study = CrossCheck(Settings(library=Library.built_in(), names=SYSTEMS, states=states // len(SYSTEMS), examples=None))
    blocks, seen = [], set()
    for outcome in workers.run(study.tasks(), study.tasks):
        task = outcome.task
        if task.function is compare_all and task.affinity not in seen:
            seen.add(task.affinity)
            out, back = (len(pickle.dumps(part, protocol=5)) for part in ((task.function, task.arguments), outcome.value))
            blocks.append((len(task.arguments[1]), out, back))
        list(study.take(outcome))
    assert seen == set(SYSTEMS)
    states_of, out, back = map(sum, zip(*blocks, strict=True))
    return states_of, out, back


@cache
def first_blocks() -> tuple[float, float]:
    """Bytes of a state on its way out and back."""
    from harness.truth.sampling import BLOCK
    from harness.workers import Workers

    with Workers(1) as workers:
        states, out, back = cross_check(workers, len(SYSTEMS) * 2 * BLOCK)
    return out / states, back / states


def bytes_of_a_state(way: int) -> tuple[Measure, Measure]:
    return lambda: first_blocks()[way], alone


def own_seconds() -> tuple[Measure, Measure]:
    """Of samples, messages and judgements, which are made in one process for all workers: what more states cost more."""
    from harness.truth.sampling import BLOCK
    from harness.workers import Workers

    few, many = len(SYSTEMS) * 3 * BLOCK, len(SYSTEMS) * 8 * BLOCK

    def measure() -> float:
        seconds = []
        with Workers(1) as workers:
            for states in (few, many):
                started = time.process_time()
                cross_check(workers, states)
                seconds.append(time.process_time() - started)
        return (seconds[1] - seconds[0]) / (many - few)

    return measure, alone


def on_workers(count: int) -> tuple[Measure, Measure]:
    return partial(_on_workers, count), partial(_on_workers, 1)


def _on_workers(count: int) -> float:
    """CPU seconds of a state on so many workers, with the scheduler and the harness' own process."""
    from distributed import LocalCluster

    from harness.workers import Scheduler, Workers

    with LocalCluster(n_workers=count, processes=True, **QUIET) as cluster:
        before = _cpu_seconds()
        with Workers(scheduler=Scheduler(cluster.scheduler_address)) as workers:
            cross_check(workers, STATES)
            return (_cpu_seconds() - before) / STATES


def _cpu_seconds() -> float:
    """User and system time [s] of this process, and of the processes below it that live."""
    import psutil

    times = [process.cpu_times() for process in psutil.Process().children(recursive=True)]
    return time.process_time() + float(sum(one.user + one.system for one in times))


def empty_task() -> tuple[Measure, Measure]:
    def measure() -> float:
        from distributed import LocalCluster

        from harness.workers import Scheduler, Task, Workers

        with (
            LocalCluster(n_workers=2, processes=True, **QUIET) as cluster,
            Workers(scheduler=Scheduler(cluster.scheduler_address)) as workers,
        ):
            list(workers.run([Task(number, echo, (number,)) for number in range(4)]))
            started = time.process_time()
            answers = [outcome.value for outcome in workers.run([Task(number, echo, (1,)) for number in range(EMPTY_TASKS)])]
            assert answers == [1] * EMPTY_TASKS
            return (time.process_time() - started) / EMPTY_TASKS

    return measure, alone


# Workers whose tasks run in their own threads, all in a process of their own.
MANY_WORKERS = """
import asyncio, sys
from distributed import Worker
from harness.workers import cluster
from benchmarks.suites.cluster import run_in_thread
cluster._run_here = run_in_thread

async def serve(address, count):
    workers = [Worker(address, nthreads=1, dashboard=False) for _ in range(count)]
    await asyncio.gather(*workers)
    await asyncio.gather(*(worker.finished() for worker in workers))

asyncio.run(serve(sys.argv[1], int(sys.argv[2])))
"""


def task_of_many(block: bool) -> tuple[Measure, Measure]:
    """CPU time of scheduler and harness for a task of many workers; wall time would be that of the workers too, which share a process."""

    def measure() -> float:
        from distributed import Client, LocalCluster

        from harness.truth.sampling import BLOCK
        from harness.workers import Scheduler, Task, Workers

        sent, back = (BLOCK * size for size in BYTES) if block else (0, 0)
        tasks = [Task(number, sleep_and_answer, (SLEEP_SECONDS, bytes(sent), back)) for number in range(4 * MANY)]
        with LocalCluster(n_workers=0, processes=True, **QUIET) as cluster:
            environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
            command = [sys.executable, "-c", MANY_WORKERS, cluster.scheduler_address, str(MANY)]
            process = subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL)
            try:
                with Client(cluster.scheduler_address) as client:
                    client.wait_for_workers(MANY)
                with Workers(scheduler=Scheduler(cluster.scheduler_address)) as workers:
                    before = time.process_time()
                    sizes = [len(outcome.value) for outcome in workers.run(tasks)]
                    seconds = (time.process_time() - before) / len(tasks)
            finally:
                process.kill()
                process.wait()
        assert sizes == [back] * len(tasks)
        return seconds

    return measure, alone


# Tasks


def echo(value: Any, note: object) -> Any:
    return value


def sleep_and_answer(seconds: float, sent: bytes, size: int, note: object) -> bytes:
    time.sleep(seconds)
    return bytes(size)


def run_in_thread(session: str, number: int, time_limit: float, task: Any) -> tuple[Any, None, None]:
    """Instead of the way through a process of its own."""
    return task.function(*task.arguments, print), None, None
