"""Engines that abort, hang, raise or answer NaN cost their own record and nothing else."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
import support
import trustme
import worker_tasks as work
from click.testing import CliRunner
from support import engine_source, heeding_interrupts, make_library

from harness import cli
from harness.errors import InvalidRequest
from harness.workers import Crash, Outcome, Scheduler, Task, Workers
from harness.workers.tasks import MORE_MEMORY, MORE_TIME, TaskQueue


def failing_library(directory: Path, engines: dict[str, str]) -> Path:
    """A library of the bar pendulum with engines whose ``forward_dynamics`` has the given body."""
    return make_library(directory, ["bar_pendulum"], {name: engine_source(body) for name, body in engines.items()})


def check(library: Path, *options: str) -> tuple[int, dict[str, dict[str, object]], str]:
    """Exit status, records by subject, and standard error of ``harness check``."""
    out = library / "out.json"
    arguments = ("--library", str(library), "--json", str(out), "--quantity", "accelerations", "--states", "40")
    done = support.harness("check", *arguments, *options, isolated=True, cwd=library)
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


@pytest.mark.ci
def test_a_crash_is_exit_status_3(crashing: tuple[int, dict[str, dict[str, object]], str]) -> None:
    status, _, errors = crashing
    assert status == 3
    assert "Traceback" not in errors


@pytest.mark.ci
@pytest.mark.parametrize("subject", ["lagrange", "mujoco/mjcf", "pinocchio/urdf"])
def test_healthy_engines_lose_nothing(crashing: tuple[int, dict[str, dict[str, object]], str], subject: str) -> None:
    record = crashing[1][subject]
    assert record["verdict"] == "agrees"
    assert record["states"] == 40


@pytest.mark.ci
@pytest.mark.parametrize(
    ("subject", "message"),
    [
        ("aborting/mjcf", "crashed by signal 6 (SIGABRT)"),
        ("aborting/mjcf", "the cow jumped over the moon"),
        ("aborting_later/mjcf", "crashed by signal 6 (SIGABRT)"),
        ("sleeping/mjcf", "exceeded its time limit of 4 s; --time-limit (pytest: --harness-time-limit) allows more"),
        ("raising/mjcf", "RuntimeError: no can do"),
        ("silent/mjcf", "answers are not finite"),
        ("exiting/mjcf", "ended its process with status 7"),
    ],
)
def test_a_failing_engine_says_why(crashing: tuple[int, dict[str, dict[str, object]], str], subject: str, message: str) -> None:
    record = crashing[1][subject]
    assert record["verdict"] == "error"
    assert message in str(record["message"])


@pytest.mark.ci
@pytest.mark.parametrize("subject", ["aborting/mjcf", "aborting_later/mjcf", "sleeping/mjcf", "silent/mjcf"])
def test_a_failing_engine_has_its_state_and_a_replay(crashing: tuple[int, dict[str, dict[str, object]], str], subject: str) -> None:
    record = crashing[1][subject]
    state = record["worst_state"]
    assert isinstance(state, dict)
    assert sorted(state) == ["q", "tau", "v"]
    assert f"--state '{json.dumps(state)}'" in str(record["replay"])
    if subject == "aborting_later/mjcf":
        assert state["q"][0] > 2.5


@pytest.mark.ci
def test_an_engine_that_raises_or_answers_nan_is_exit_status_1(tmp_path: Path) -> None:
    library = failing_library(tmp_path / "library", {"silent": "return np.full_like(q, math.nan)", "raising": "raise OSError('x')"})
    status, records, _ = check(library, "--subject", "silent/mjcf", "--subject", "raising/mjcf")
    assert status == 1
    assert {record["verdict"] for record in records.values()} == {"error"}


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50) as cluster:
        yield cluster


@pytest.mark.ci
def test_an_existing_cluster_is_used_and_survives(tmp_path: Path, cluster: Any) -> None:
    library = failing_library(tmp_path / "library", {"aborting": "os.abort() if (q > 2.5).any() else None; return np.zeros_like(q)"})
    before = cluster.scheduler_info["workers"].keys()
    status, records, _ = check(library, "--scheduler", cluster.scheduler_address)
    assert status == 3
    aborting = records["aborting/mjcf"]
    assert aborting["verdict"] == "error"
    assert "crashed by signal 6 (SIGABRT)" in str(aborting["message"])
    assert aborting["worst_state"]["q"][0] > 2.5  # type: ignore[index]
    assert {records[subject]["verdict"] for subject in ("lagrange", "mujoco/mjcf", "pinocchio/urdf")} == {"agrees"}
    assert cluster.scheduler_info["workers"].keys() == before
    with Workers(scheduler=Scheduler(cluster.scheduler_address)) as workers:
        assert [outcome.value for outcome in workers.run([Task(0, work.echo, (1,))])] == [1]


@pytest.mark.ci
def test_a_cluster_runs_an_affinity_in_one_process_that_ends_with_the_session(cluster: Any) -> None:
    with Workers(scheduler=Scheduler(cluster.scheduler_address)) as workers:
        tasks = [Task(number, work.own_process, (), affinity=number % 3) for number in range(12)]
        processes = ran_in(workers, tasks)
    assert all(len(set(processes[affinity])) == 1 for affinity in range(3))
    assert not any(map(psutil.pid_exists, set().union(*processes.values())))


@pytest.mark.ci
def test_tasks_of_a_cluster_without_workers_are_reported_as_crashed(monkeypatch: pytest.MonkeyPatch) -> None:
    from distributed import LocalCluster

    monkeypatch.setattr("harness.workers.cluster.PATIENCE_SECONDS", 1.0)
    empty = LocalCluster(n_workers=0, processes=True, dashboard_address=None, silence_logs=50)
    with empty as cluster, Workers(scheduler=Scheduler(cluster.scheduler_address)) as workers:
        outcomes = list(workers.run([Task(number, work.own_process, ()) for number in range(3)]))
    assert [outcome.task.key for outcome in outcomes] == [0, 1, 2]
    assert all("no worker" in str(outcome.crash) for outcome in outcomes)


@pytest.mark.ci
def test_a_cluster_over_tls_wants_a_certificate(tmp_path: Path) -> None:
    from distributed import LocalCluster
    from distributed.security import Security

    authority = trustme.CA()
    certificate = authority.issue_cert("localhost", "127.0.0.1")
    ca_file, cert_file, key_file = (str(tmp_path / name) for name in ("ca.pem", "cert.pem", "key.pem"))
    authority.cert_pem.write_to_path(ca_file)
    certificate.cert_chain_pems[0].write_to_path(cert_file)
    certificate.private_key_pem.write_to_path(key_file)
    files = (("cert", cert_file), ("key", key_file))
    of_roles = {f"tls_{role}_{kind}": file for role in ("client", "scheduler", "worker") for kind, file in files}
    security = Security(tls_ca_file=ca_file, require_encryption=True, **of_roles)
    quiet = {"processes": False, "dashboard_address": None, "silence_logs": 50}
    with LocalCluster(n_workers=1, threads_per_worker=1, security=security, protocol="tls://", **quiet) as cluster:
        address = cluster.scheduler_address
        with Workers(scheduler=Scheduler(address, ca_file, cert_file, key_file)) as workers:
            [outcome] = workers.run([Task(0, work.own_process, ())])
        assert outcome.value not in (None, os.getpid())
        with pytest.raises(InvalidRequest, match=r"no cluster at tls://.*--tls-ca-file"):
            Workers(scheduler=Scheduler(address)).__enter__()


def test_a_certificate_without_a_cluster_is_bad_usage(tmp_path: Path) -> None:
    (tmp_path / "ca.pem").write_text("")
    done = CliRunner().invoke(cli.main, ["check", "collar", "--tls-ca-file", str(tmp_path / "ca.pem")])
    assert done.exit_code == 2
    assert "belong to --scheduler" in done.output


def outcomes_of(*tasks: Task, count: int = 1, time_limit: float = 60.0) -> dict[Any, Outcome]:
    """The outcomes of tasks by their keys, from workers of their own."""
    with Workers(count, time_limit=time_limit) as workers:
        return {outcome.task.key: outcome for outcome in workers.run(tasks)}


KILLED = f"crashed by signal 9 (SIGKILL); if memory ran out, {MORE_MEMORY}"
CONTAINED = {
    work.segfault: "crashed by signal 11 (SIGSEGV)",
    work.hang_holding_the_lock: f"exceeded its time limit of 3 s; {MORE_TIME}",
    work.exit_at_once: "ended its process with status 3",
    work.exit_by_exception: "ended its process with status 3",
    work.be_killed: KILLED,
    work.raise_peculiar: "Peculiar: 1 beside 2",
    work.raise_with_a_function: "ValueError: no can do",
    work.return_a_generator: "TypeError: cannot pickle 'generator' object",
    work.recurse: "RecursionError: maximum recursion depth exceeded",
    work.exhaust_memory: "MemoryError: ",
}


@pytest.fixture(scope="module")
def contained() -> dict[Any, Outcome]:
    """Outcomes of all that goes wrong, by function; each stands between tasks that do not."""
    tasks = [Task(None, work.echo, (0,))]
    for function in CONTAINED:
        tasks += [Task(function, function, ()), Task(None, work.echo, (1,))]
    with Workers(2, time_limit=3) as workers:
        outcomes = list(workers.run(tasks))
    assert len(outcomes) == len(tasks)
    assert all(outcome.value in (0, 1) for outcome in outcomes if outcome.task.key is None)
    return {outcome.task.key: outcome for outcome in outcomes if outcome.task.key is not None}


@pytest.mark.ci
@pytest.mark.parametrize("function", CONTAINED, ids=lambda function: function.__name__)
def test_a_task_that_fails_costs_its_own_outcome(contained: dict[Any, Outcome], function: Any) -> None:
    outcome = contained[function]
    assert outcome.value is None
    error = outcome.exception
    assert (f"{type(error).__name__}: {error}" if error is not None else str(outcome.crash)) == CONTAINED[function]


def test_a_crash_has_its_note_and_standard_error_and_no_others() -> None:
    outcomes = outcomes_of(Task(0, work.chatter, ()), Task(1, work.abort, (1,)), Task(2, work.be_killed, ()))
    assert outcomes[1].crash == Crash("crashed by signal 6 (SIGABRT)", "at 1", "the cow jumped over the moon")
    assert outcomes[2].crash == Crash(KILLED, "", "")


@pytest.mark.ci
def test_of_very_much_that_a_crash_wrote_the_end_is_kept() -> None:
    written = str(outcomes_of(Task(0, work.babble, ()))[0].crash)
    assert len(written) < 2100
    assert written.endswith("99998\n99999")


def test_a_task_that_cannot_be_sent_costs_its_own_outcome() -> None:
    outcomes = outcomes_of(Task(0, work.echo, (lambda: 0,)), Task(1, work.echo, (1,)), Task(2, lambda note: 0, ()))
    assert outcomes[1].value == 1
    assert re.search("pickle|local object", str(outcomes[0].exception))
    assert re.search("pickle|local object", str(outcomes[2].exception))


def test_what_a_task_prints_stays_in_its_process(capfd: pytest.CaptureFixture[str]) -> None:
    outcomes = outcomes_of(Task(0, work.chatter, ()), Task(1, work.chatter, ()))
    assert (outcomes[0].crash, outcomes[1].crash) == (None, None)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("own", [None, "3"])
def test_a_process_computes_with_one_thread_unless_its_user_says_otherwise(own: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    if own is None:
        monkeypatch.delenv("OPENBLAS_NUM_THREADS")
    else:
        monkeypatch.setenv("OPENBLAS_NUM_THREADS", own)
    assert outcomes_of(Task("threads", os.getenv, ("OPENBLAS_NUM_THREADS",)))["threads"].value == (own or "1")


def test_large_arguments_and_values_come_through() -> None:
    many = np.arange(1_000_000.0)
    assert np.array_equal(outcomes_of(Task(0, work.echo, (many,)))[0].value, many)


@pytest.mark.ci
def test_time_spent_by_the_caller_is_not_the_tasks() -> None:
    with Workers(2, time_limit=1) as workers:
        coming = workers.run([Task(0, work.slow_process, (0.3,)), Task(1, work.slow_process, (0.6,))])
        assert next(coming).task.key == 0
        time.sleep(1.5)
        assert next(coming).crash is None


@pytest.mark.ci
@pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="only the kernel knows how long a process waited")
@pytest.mark.parametrize("compute", [work.compute, work.let_compute])
def test_time_spent_waiting_for_a_processor_is_not_the_tasks(compute: Callable[..., None]) -> None:
    processor = min(os.sched_getaffinity(0))
    busy = f"import os\nos.sched_setaffinity(0, [{processor}])\nprint(flush=True)\nwhile True: pass"
    # Linux shares a processor among sessions first.
    others = [subprocess.Popen([sys.executable, "-c", busy], stdout=subprocess.PIPE, start_new_session=True) for _ in range(4)]
    try:
        for other in others:
            assert other.stdout is not None
            other.stdout.readline()
        started = time.monotonic()
        outcomes = outcomes_of(Task(0, compute, (0.5, processor)), time_limit=1)
        waited = time.monotonic() - started
        assert outcomes[0].crash is None
        assert waited > 1.5, "the others did not take the processor"
    finally:
        for other in others:
            other.kill()
            other.communicate()


@pytest.mark.ci
def test_a_process_that_hangs_gets_no_further_task() -> None:
    outcomes = outcomes_of(Task(0, work.hang_holding_the_lock, ()), Task(1, work.own_process, ()), time_limit=0.5)
    assert str(outcomes[0].crash) == f"exceeded its time limit of 0.5 s; {MORE_TIME}"
    assert outcomes[1].value is not None


def test_a_worker_takes_its_own_affinity_then_a_free_one_then_one_not_begun() -> None:
    owners = {"theirs": "them", "mine": "me"}
    queue = TaskQueue([Task(index, work.own_process, (), name) for index, name in enumerate(["theirs", None, "free", "mine", "mine"])])
    taken = [queue.take("me", owners) for _ in range(5)]
    assert [task.key for task in taken if task is not None] == [3, 4, 1, 2, 0]
    queue = TaskQueue([Task(index, work.own_process, (), "theirs") for index in range(2)])
    assert queue.take("them", owners) is not None
    assert queue.take("me", owners) is None
    assert queue.take(None, owners) is None


def ran_in(workers: Workers, tasks: list[Task]) -> dict[Any, list[int]]:
    """The processes that ran the tasks, in the order of the outcomes, by affinity."""
    found: dict[Any, list[int]] = {}
    for outcome in workers.run(tasks):
        found.setdefault(outcome.task.affinity, []).append(outcome.value)
    return found


def test_an_affinity_stays_in_one_process_and_in_order() -> None:
    tasks = [Task(number, work.slow_process, (0.02,), affinity="abc"[number % 3]) for number in range(18)]
    with Workers(2) as workers:
        order = [(outcome.task.affinity, outcome.task.key, outcome.value) for outcome in workers.run(tasks)]
        again = ran_in(workers, tasks[:1])
    processes = {affinity: {process for name, _, process in order if name == affinity} for affinity in "abc"}
    assert all(len(found) == 1 for found in processes.values())
    assert len(set().union(*processes.values())) == 2
    for affinity in "abc":
        assert [key for name, key, _ in order if name == affinity] == list(range("abc".index(affinity), 18, 3))
    assert set(again["a"]) == processes["a"]


@pytest.mark.ci
def test_an_idle_process_takes_over_an_affinity_that_its_owner_has_not_begun() -> None:
    with Workers(2) as workers:
        first = ran_in(workers, [Task(0, work.own_process, (), "a"), Task(1, work.own_process, (), "a")])
        assert len(workers._pool._processes) == 1  # type: ignore[union-attr]
        own = ran_in(workers, [Task(0, work.own_process, (), "b")])
        assert own["b"] == first["a"][:1]
        tasks = [Task(number, work.slow_process, (0.3,), affinity) for number, affinity in enumerate("aaaabb")]
        both = ran_in(workers, tasks)
        last = [ran_in(workers, tasks[-1:]), ran_in(workers, tasks[:1])]
    assert last == [{"b": both["b"][:1]}, {"a": both["a"][:1]}]
    assert set(both["a"]) == set(first["a"])
    assert len(set(both["b"])) == 1
    assert set(both["b"]) != set(first["a"])


def test_an_affinity_whose_process_died_goes_on_in_another() -> None:
    outcomes = outcomes_of(Task(0, work.abort, (0,), "a"), *(Task(number, work.echo, (number,), "a") for number in (1, 2)), count=2)
    assert outcomes[0].crash is not None
    assert [outcomes[1].value, outcomes[2].value] == [1, 2]


def test_processes_start_as_tasks_need_them() -> None:
    with Workers(8) as workers:
        pool: Any = workers._pool
        assert not pool._processes
        list(workers.run([Task(0, work.own_process, ())]))
        list(workers.run([Task(0, work.own_process, ())]))
        assert len(pool._processes) == 1
        list(workers.run([Task(number, work.slow_process, (0.2,)) for number in range(3)]))
        assert len(pool._processes) == 3


def test_two_runs_may_be_under_way() -> None:
    with Workers(1) as workers:
        first = workers.run([Task(number, work.echo, (number,)) for number in range(3)])
        assert next(first).value == 0
        assert [outcome.value for outcome in workers.run([Task(9, work.echo, (9,))])] == [9]
        assert [outcome.value for outcome in first] == [1, 2]


def test_what_runs_is_known_by_name_while_it_runs() -> None:
    with Workers(2) as workers:
        waiting = [Task(1, work.slow_process, (1000.0,), affinity=name) for name in ("arm_7r", Path("/robots/model.urdf"))]
        coming = workers.run([Task(0, work.slow_process, (0.0,)), *waiting])
        assert next(coming).task.key == 0 and workers.under_way == ["arm_7r"]
        assert isinstance(coming, Generator)
        coming.close()
        assert workers.under_way == []


def test_a_run_that_is_given_up_ends_its_tasks() -> None:
    with Workers(2) as workers:
        coming = workers.run([Task(0, work.own_process, ()), Task(1, work.slow_process, (1000.0,))])
        assert next(coming).value
        coming.close()  # type: ignore[attr-defined]
        assert [outcome.value for outcome in workers.run([Task(2, work.echo, (2,))])] == [2]
        assert all(process.run is None for process in workers._pool._processes)  # type: ignore[union-attr]
        late = workers.run([Task(3, work.own_process, ())])
    with pytest.raises(RuntimeError, match="has ended"):
        next(late)


def test_a_fork_that_returns_from_its_task_does_not_answer() -> None:
    outcomes = outcomes_of(*(Task(number, work.return_twice, ()) for number in range(4)))
    assert len({outcome.value for outcome in outcomes.values()}) == 1


def gone(process: int) -> bool:
    """True once the process has ended, within five seconds."""
    for _ in range(100):
        if not psutil.pid_exists(process) or psutil.Process(process).status() == psutil.STATUS_ZOMBIE:
            return True
        time.sleep(0.05)
    return False


@pytest.mark.parametrize("leave_group", [False, True])
@pytest.mark.parametrize("hang", [False, True])
def test_what_a_task_forked_ends_with_its_process(leave_group: bool, hang: bool) -> None:
    with Workers(1, time_limit=1) as workers:
        [outcome] = workers.run([Task(0, work.fork, (leave_group, hang))])
        child = int(outcome.crash.note) if outcome.crash is not None else outcome.value
        assert (outcome.crash is not None) == hang
        assert hang or psutil.pid_exists(child)
    assert gone(child)


HARNESS = """
import sys
sys.path.insert(0, {tests!r})
from worker_tasks import fork, hang_holding_the_lock, own_process, slow_process
from harness.workers import Task, Workers
print("begun", flush=True)
with Workers(2) as workers:
    for outcome in workers.run([Task(0, own_process, ()), Task(1, {function}, {arguments})]):
        print(outcome.value, flush=True)
"""


@pytest.fixture
def harness(tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Starts a script without a guard of ``__main__`` that hands a short and a long task to two workers."""
    started = []

    def start(function: str, arguments: tuple[Any, ...]) -> subprocess.Popen[str]:
        script = tmp_path / "script.py"
        script.write_text(HARNESS.format(tests=str(Path(work.__file__).parent), function=function, arguments=arguments))
        command, pipe = [sys.executable, script], subprocess.PIPE
        with heeding_interrupts():
            started.append(subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.communicate()


@pytest.mark.parametrize(("function", "arguments"), [("slow_process", (1000.0,)), ("hang_holding_the_lock", ()), ("fork", (False, True))])
def test_workers_end_with_a_harness_that_is_killed(harness: Any, function: str, arguments: tuple[Any, ...]) -> None:
    process = harness(function, arguments)
    assert process.stdout.readline() == "begun\n"
    assert int(process.stdout.readline())
    time.sleep(0.5)
    workers = psutil.Process(process.pid).children(recursive=True)
    assert len(workers) == (3 if function == "fork" else 2)
    process.kill()
    process.wait()
    assert all(gone(worker.pid) for worker in workers)


@pytest.mark.ci
def test_an_interrupt_ends_workers_without_a_word_of_theirs(harness: Any) -> None:
    process = harness("slow_process", (1000.0,))
    process.stdout.readline()
    process.stdout.readline()
    workers = psutil.Process(process.pid).children(recursive=True)
    process.send_signal(signal.SIGINT)
    written = process.communicate()[1]
    assert all(gone(worker.pid) for worker in workers)
    assert written.count("Traceback") == 1
    assert written.endswith("KeyboardInterrupt\n")


def test_a_script_without_a_guard_is_not_run_again(harness: Any) -> None:
    written, errors = harness("slow_process", (0.0,)).communicate(timeout=60)
    assert written.splitlines().count("begun") == 1
    assert len(written.splitlines()) == 3
    assert errors == ""


def test_workers_listen_on_no_socket_and_leave_no_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with Workers(2) as workers:
        tasks = [Task(number, work.slow_process, (0.3,)) for number in range(2)]
        processes = [outcome.value for outcome in workers.run(tasks)]
        assert len(set(processes)) == 2
        assert [psutil.Process(process).net_connections("all") for process in processes] == [[], []]
        for process in processes:
            assert not [link for link in Path(f"/proc/{process}/fd").iterdir() if "socket:" in str(link.readlink())]
        assert not list(tmp_path.iterdir())


def test_a_scheduler_without_dask_is_refused_with_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InvalidRequest, match=r"--scheduler asks for a Dask cluster: distributed is not installed.*\[cluster\]"):
        Workers(scheduler=Scheduler("tcp://127.0.0.1:1")).__enter__()
