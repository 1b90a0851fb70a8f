"""The history keeps what was appended, through kills, damage and changes of its schema."""

from __future__ import annotations

import math
import os
import signal
import sqlite3
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support_results import CARD, RECORD, RUN

from harness.errors import InvalidInput
from harness.results.atlas import Atlas
from harness.results.benchmark import AccelerationCost, Benchmark, Cheapest, Growth
from harness.results.cross_check import Cause, CrossCheckResult, SuperfluousPart
from harness.results.hard_states import RankedCase
from harness.results.history import History
from harness.results.motion_benchmark import Drift, MotionCost, MotionTruth, Order
from harness.results.plain_json import dumps

FINDING = SuperfluousPart("arm_2r", "mujoco/mjcf", "mjcf/arm_2r.xml", 7, "joint", "armature", "0", "is not felt; leave it out")
CAUSE = Cause(
    system="arm_2r", subject="mujoco/mjcf", inference="the mjcf model is at fault", first_line="why", diagnosed="mujoco/mjcf",
    found={"model": {"before": None, "first": {"residual": 1.5}}},
)  # fmt: skip
CASE = RankedCase(
    system="arm_2r", subject="mujoco/mjcf", verdict="disagrees", backward_error=math.inf, state={"q": [5e-324], "v": [], "tau": []},
    statement="", replay="harness check arm_2r",
)  # fmt: skip
FOUND = CrossCheckResult(records=[RECORD], systems=[CARD], superfluous=[FINDING], causes=[CAUSE], worst_cases=[CASE])
BENCHMARK = Benchmark(
    accelerations=[AccelerationCost(system="arm_2r", method="pinocchio aba", threads=1, states=5, seconds_per_state=1e-6,
                                    backward_error=math.inf)],
    growth=[Growth(family="chain", method="pinocchio aba", sizes=[1, 2], seconds_per_state=[1e-6, None],
                   backward_errors=[math.inf, 1.0], exponent=None, expected="1")],
    truths=[MotionTruth(system="arm_2r", start={"q": [0.1, -2.5], "v": [0.0, 5e-324]}, horizon=20.0, trusted=3.5, error=1e-15, precision="",
                  seconds=0.1)],
    motion=[MotionCost(system="arm_2r", integrator="mujoco RK4", step=None, tolerance=1e-9, steps=3, evaluations=12, seconds=0.5,
                       state_error=math.inf, energy_error=None, duration=2.0)],
    orders=[Order(system="arm_2r", integrator="mujoco RK4", measured=3.99, expected=4.0, verdict="as expected", steps=[0.1, 0.01])],
    drifts=[Drift(system="arm_2r", integrator="mujoco RK4", step=1e-3, steps=10, seconds=0.1, largest=math.inf, growth=None,
                  verdict="secular", expected="")],
    problems=["collar, motion: crashed"],
)  # fmt: skip

APPENDER = """
import sys
from harness.results.cross_check import CrossCheckResult
from harness.results.history import History
from harness.results.records import Record
with History(sys.argv[1]) as history:
    for index in range(int(sys.argv[3])):
        history.append(int(sys.argv[2]), CrossCheckResult(records=[Record(
            system=f"{sys.argv[4]}_{index}", subject="lagrange", states=1, verdict="agrees", expected="agrees", backward_error=1.0,
            relative_error=0.0, worst_state=None, seconds_per_state=None, message="x" * 5000)]))
        print(index, flush=True)
"""


def start_appending(path: Path, run_id: int, count: int, name: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", APPENDER, str(path), str(run_id), str(count), name]
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "reports" / "history.sqlite"


def test_round_trip(path: Path) -> None:
    other = replace(RECORD, subject="lagrange", backward_error=None, worst_state=None)
    with History(path) as history:
        study = history.begin(RUN, CrossCheckResult)
        history.append(study, CrossCheckResult(records=[RECORD]))
        history.append(study, replace(FOUND, records=[other]))
    with History(path) as history:
        assert history.studies(CrossCheckResult) == {study: RUN}
        assert history.read(study, CrossCheckResult) == replace(FOUND, records=[RECORD, other])
        assert history.read(study, CrossCheckResult, "systems") == CrossCheckResult(systems=[CARD])
        worst = history.read(study, CrossCheckResult).records[0].worst_state
        assert worst is not None and math.copysign(1, worst["tau"][1]) == -1


# Pages are written before the commit, as in the middle of one, and the process dies there.
_DYING = """
import os, signal, sys
from harness.results.cross_check import CrossCheckResult
from harness.results.history import History
history = History(sys.argv[1])
run = history._connection.execute
run("PRAGMA cache_size = 1")
run("BEGIN IMMEDIATE")
for _ in range(300):
    run("INSERT INTO parts (study_id, part, content) VALUES (1, 'records', ?)", ("x" * 5000,))
run("UPDATE parts SET content = content || ' '")
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture
def killed(path: Path) -> Path:
    """A history of one record whose writer was killed in the middle of the next commit."""
    with History(path) as history:
        history.append(history.begin(RUN, CrossCheckResult), CrossCheckResult(records=[RECORD]))
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    died = subprocess.run([sys.executable, "-c", _DYING, str(path)], env=environment, capture_output=True, text=True, check=False)
    assert died.returncode == -signal.SIGKILL, died.stderr
    assert path.with_name(f"{path.name}-journal").is_file()
    with sqlite3.connect(f"file:{path}?mode=ro", uri=True) as connection, pytest.raises(sqlite3.OperationalError, match="readonly"):
        connection.execute("SELECT count(*) FROM parts")
    return path


def test_a_commit_that_was_killed_is_taken_back_by_the_next_to_open_it(killed: Path) -> None:
    with History(killed) as history:
        assert history.read(1, CrossCheckResult).records == [RECORD]
    assert [file.name for file in killed.parent.iterdir()] == [killed.name]


def test_a_commit_that_was_killed_is_taken_back_in_a_copy_where_nothing_may_be_written(
    killed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files, connect = {file: file.read_bytes() for file in killed.parent.iterdir()}, sqlite3.connect

    def connect_reading(database: Path, **options: Any) -> sqlite3.Connection:
        return connect(f"file:{database}?mode=ro", uri=True, **options) if database == killed else connect(database, **options)

    monkeypatch.setattr(sqlite3, "connect", connect_reading)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "elsewhere"))
    (tmp_path / "elsewhere").mkdir()
    with History(killed) as history:
        found = history.read(1, CrossCheckResult)
        assert found.records == [RECORD]
        with pytest.raises(InvalidInput, match="attempt to write a readonly database"):
            history.append(1, found)
    assert not list((tmp_path / "elsewhere").iterdir())
    assert {file: file.read_bytes() for file in killed.parent.iterdir()} == files


def same(first: Any, second: Any) -> bool:
    """Equality in which NaN equals NaN."""
    return repr(first) == repr(second)


def test_benchmarks_come_back_as_they_were(path: Path) -> None:
    broken = replace(BENCHMARK.motion[0], energy_error=math.nan, state_error=-math.inf)
    measured = replace(BENCHMARK, motion=[*BENCHMARK.motion, broken])
    with History(path) as history:
        number = history.begin(RUN, Benchmark)
        history.append(number, replace(measured, problems=[]))
        history.append(number, Benchmark(problems=measured.problems))
    with History(path) as history:
        assert same(history.latest(Benchmark, "built-in"), (RUN, measured))


def test_the_latest_of_a_library_is_the_last_that_holds_anything(path: Path) -> None:
    with History(path) as history:
        assert history.latest(CrossCheckResult, "built-in") is None and history.latest(Benchmark, "built-in") is None
        for seed, library in enumerate(("built-in", "mine", "built-in")):
            run = replace(RUN, library=library, seed=seed)
            history.append(history.begin(run, CrossCheckResult), FOUND)
            history.append(history.begin(run, Benchmark), BENCHMARK)
        history.begin(replace(RUN, seed=8), CrossCheckResult)
        history.begin(replace(RUN, seed=8), Benchmark)
        for library, seed in (("built-in", 2), ("mine", 1)):
            run = replace(RUN, library=library, seed=seed)
            assert history.latest(CrossCheckResult, library) == (run, FOUND)
            assert history.latest(Benchmark, library) == (run, BENCHMARK)
        history.append(history.begin(replace(RUN, seed=9), Benchmark), Benchmark(problems=["all of it crashed"]))
        found = history.latest(Benchmark, "built-in")
        assert found is not None and found[0].seed == 9


def test_what_follows_from_measurements_is_not_stored(path: Path) -> None:
    entry = Cheapest(system="arm_2r", kind="motion", error=1e-3, way=None, cost=None)
    with History(path) as history:
        history.append(history.begin(RUN, Benchmark), replace(BENCHMARK, cheapest=[entry]))
        assert history.latest(Benchmark, "built-in") == (RUN, BENCHMARK)


def test_a_part_is_stored_whole_or_not_at_all(path: Path) -> None:
    spoilt = replace(BENCHMARK.motion[0], energy_error=object())  # type: ignore[arg-type]
    with History(path) as history:
        with pytest.raises(ValueError, match="no study 5"):
            history.append(5, BENCHMARK)
        number = history.begin(RUN, Benchmark)
        with pytest.raises(TypeError):
            history.append(number, replace(BENCHMARK, motion=[spoilt]))
        assert history.latest(Benchmark, "built-in") is None
        history.append(history.begin(RUN, CrossCheckResult), FOUND)


def test_a_row_of_another_harness_is_read_where_it_can_be(path: Path) -> None:
    """Absent fields take their defaults and unknown ones are passed over; a row without what a record needs is refused."""
    with History(path) as history:
        history.append(history.begin(RUN, CrossCheckResult), FOUND)
    change(path, """UPDATE parts SET content = json_set(json_remove(content, '$.replay'), '$.invented', 3) WHERE part = 'records'""")
    with History(path) as history:
        assert history.read(1, CrossCheckResult).records == [replace(RECORD, replay="")]
    change(path, "UPDATE parts SET content = json_set(content, '$.states', 'many') WHERE part = 'records'")
    with History(path) as history, pytest.raises(InvalidInput, match=r"no record.*Expected `int`.*states"):
        history.read(1, CrossCheckResult)


# The tables of version 4; those of version 1 are the first three, and their card lacks ``compilation_seconds``.
OLDER_TABLES = {
    "runs": "content", "records": "run_id, content", "systems": "run_id, content", "findings": "run_id, content",
    "benchmarks": "content", "measurements": "benchmark_id, part, content", "atlases": "content",
    "atlas_parts": "atlas_id, part, content", "worst_cases": "run_id, content", "causes": "run_id, content",
}  # fmt: skip


def write_older(path: Path, version: int, tables: int) -> None:
    path.parent.mkdir()
    run, other = dumps(RUN), dumps(replace(RUN, seed=8))
    card = {key: value for key, value in vars(CARD).items() if key != "compilation_seconds"}
    rows: dict[str, list[tuple[Any, ...]]] = {
        "runs": [(run,), (other,)], "records": [(1, dumps(RECORD)), (2, dumps(RECORD))], "systems": [(1, dumps(card))],
        "findings": [(1, dumps(FINDING))], "benchmarks": [(other,), (run,)],
        "measurements": [(2, part, dumps(item)) for part, item in BENCHMARK.stored_parts()],
        "atlases": [(run,)], "atlas_parts": [(1, "problems", '"one"'), (1, "problems", '"two"')],
        "worst_cases": [(1, dumps(CASE))], "causes": [(2, dumps(CAUSE)), (1, dumps(CAUSE))],
    }  # fmt: skip
    connection = sqlite3.connect(path)
    with connection:
        for name, columns in list(OLDER_TABLES.items())[:tables]:
            connection.execute(f"CREATE TABLE {name} (id INTEGER PRIMARY KEY, {columns})")
            connection.executemany(f"INSERT INTO {name} ({columns}) VALUES ({', '.join('?' * len(columns.split()))})", rows[name])
        connection.execute(f"PRAGMA user_version = {version}")
        connection.execute("PRAGMA application_id = 0x52424856")
    connection.close()


@pytest.mark.parametrize(("version", "tables"), [(1, 3), (4, 10)])
def test_an_older_history_stays_readable_and_can_be_added_to(path: Path, version: int, tables: int) -> None:
    write_older(path, version, tables)
    found = replace(FOUND, systems=[replace(CARD, compilation_seconds=None)])
    for _ in range(2):
        with History(path) as history:
            assert history.studies(CrossCheckResult) == {2: replace(RUN, seed=8), 1: RUN}
            if version == 1:
                assert history.read(1, CrossCheckResult) == CrossCheckResult(records=[RECORD], systems=found.systems)
            else:
                assert history.read(1, CrossCheckResult) == found
                assert history.latest(Benchmark, "built-in") == (RUN, BENCHMARK)
                assert history.latest(Atlas, "built-in") == (RUN, Atlas(problems=["one", "two"]))
    with History(path) as history:
        history.append(history.begin(RUN, Benchmark), replace(BENCHMARK, problems=["added"]))
        history.append(1, CrossCheckResult(causes=[CAUSE]))
        assert history.latest(Benchmark, "built-in") == (RUN, replace(BENCHMARK, problems=["added"]))
        assert history.read(1, CrossCheckResult).causes[-1] == CAUSE


def test_earlier_runs_are_of_the_same_library_and_profile(path: Path) -> None:
    with History(path) as history:
        first = history.begin(RUN, CrossCheckResult)
        history.append(first, FOUND)
        history.begin(RUN, Benchmark)
        history.begin(replace(RUN, profile="quick"), CrossCheckResult)
        history.begin(replace(RUN, library="mine"), CrossCheckResult)
        this = history.begin(replace(RUN, seed=8), CrossCheckResult)
        history.begin(replace(RUN, seed=9), CrossCheckResult)
        assert list(history.earlier(this, CrossCheckResult)) == [(RUN, FOUND)]
        assert list(history.earlier(this, CrossCheckResult, "records")) == [(RUN, CrossCheckResult(records=[RECORD]))]
        assert list(history.earlier(this, Benchmark)) == [] == list(history.earlier(first, CrossCheckResult))
        assert [run.seed for run in history.studies(CrossCheckResult, "built-in").values()] == [9, 8, RUN.seed, RUN.seed]


def test_every_acknowledged_record_survives_a_kill(path: Path) -> None:
    with History(path) as history:
        run_id = history.begin(RUN, CrossCheckResult)
    process = start_appending(path, run_id, 100_000, "killed")
    assert process.stdout is not None
    acknowledged = [int(process.stdout.readline()) for _ in range(25)]
    process.send_signal(signal.SIGKILL)
    rest = process.stdout.read().split()
    assert process.wait() == -signal.SIGKILL
    with History(path) as history:
        kept = [record.system for record in history.read(run_id, CrossCheckResult).records]
        assert len(kept) >= len(acknowledged) + len(rest)
        assert kept == [f"killed_{index}" for index in range(len(kept))]
        history.append(run_id, CrossCheckResult(records=[RECORD]))


@pytest.mark.ci
def test_two_processes_append_at_once(path: Path) -> None:
    with History(path) as history:
        run_id = history.begin(RUN, CrossCheckResult)
        processes = [start_appending(path, run_id, 40, name) for name in ("one", "two")]
        for process in processes:
            process.communicate(timeout=60)
            assert process.returncode == 0
        assert len(history.read(run_id, CrossCheckResult).records) == 80


def test_a_history_may_be_created_by_several_at_once(path: Path) -> None:
    def create(_: int) -> int:
        with History(path) as history:
            return history.begin(RUN, CrossCheckResult)

    with ThreadPoolExecutor(8) as threads:
        assert sorted(threads.map(create, range(8))) == list(range(1, 9))


def damaged(path: Path) -> None:
    with History(path) as history:
        run_id = history.begin(RUN, CrossCheckResult)
        for _ in range(50):
            history.append(run_id, CrossCheckResult(records=[RECORD]))
    content = path.read_bytes()
    path.write_bytes(content[:8192] + b"\xff" * 4096 + content[12288:])


def newer(path: Path) -> None:
    History(path).close()
    change(path, "PRAGMA user_version = 99")


def foreign(path: Path) -> None:
    change(path, "CREATE TABLE mail (text)")


def no_database(path: Path) -> None:
    path.write_text("a shopping list, long enough to have a header\n" * 50)


def strange_row(path: Path) -> None:
    with History(path) as history:
        history.begin(RUN, CrossCheckResult)
    change(path, "UPDATE studies SET content = '{}'")


def change(path: Path, statement: str) -> None:
    connection = sqlite3.connect(path)
    with connection:
        connection.execute(statement)
    connection.close()


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (damaged, "damaged"),
        (newer, "schema version 99"),
        (foreign, "another program"),
        (no_database, "no SQLite database"),
        (strange_row, "no record"),
        (Path.mkdir, "cannot be used"),
    ],
)
def test_an_unusable_file_is_explained_and_left_alone(path: Path, spoil: object, words: str) -> None:
    path.parent.mkdir()
    assert callable(spoil)
    spoil(path)
    before = path.read_bytes() if path.is_file() else None
    with pytest.raises(InvalidInput, match=words), History(path) as history:
        history.studies(CrossCheckResult)
    assert (path.read_bytes() if path.is_file() else None) == before
