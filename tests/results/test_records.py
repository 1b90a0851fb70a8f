"""Records survive kills and damage, and their JSON is strict."""

from __future__ import annotations

import json
import math
import os
import signal
import sqlite3
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from harness.errors import InvalidInput
from harness.results.benchmark import AccelerationCost, Benchmark, Cheapest, Drift, Growth, MotionCost, Order, Truth
from harness.results.causes import Cause
from harness.results.history import History
from harness.results.records import Record, Run, SystemCard, dumps, half_decade, to_json, write_json
from harness.results.superfluous import SuperfluousPart
from harness.storage import write_atomically

RUN = Run(
    started="2026-01-31T02:00:00+00:00", versions={"harness": "0.1.0", "mujoco": "4.0"}, machine={"processor": "16 cores"}, seed=7,
    profile="nightly", states=1000, library="built-in", command="harness report --profile nightly",
)  # fmt: skip
RECORD = Record(
    system="arm_2r", subject="mujoco/mjcf", states=1000, verdict="disagrees", expected="agrees", backward_error=math.inf,
    relative_error=1e-17, worst_state={"q": [0.1, -2.5], "v": [1e300, 5e-324], "tau": [0.0, -0.0]}, seconds_per_state=2e-6,
    message="two\nlines", median_backward_error=0.3, distribution={"exact": 1, "-3": 990, "inf": 9},
    verdict_counts={"agrees": 991, "disagrees": 9}, replay="harness check arm_2r",
)  # fmt: skip
CARD = SystemCard(
    name="arm_2r", description="Planar two-link arm", source="Spong 7.3", coordinates=[{"name": "q1", "joint": "shoulder"}],
    parameters=[{"name": "m1", "value": 3.0, "unit": "kg"}], equations_mathml="<math><mi>x</mi></math>", equations_text="x",
    operations=12, derivation_seconds=0.5, reference_seconds_per_state=4e-5, compilation_seconds=0.25,
)  # fmt: skip
FINDING = SuperfluousPart("arm_2r", "mujoco/mjcf", "mjcf/arm_2r.xml", 7, "joint", "armature", "0", "is not felt; leave it out")
CAUSE = Cause(
    system="arm_2r", subject="mujoco/mjcf", inference="the mjcf model is at fault", first_line="why", diagnosed="mujoco/mjcf",
    found={"model": {"before": None, "first": {"residual": 1.5}}},
)  # fmt: skip
BENCHMARK = Benchmark(
    accelerations=[AccelerationCost(system="arm_2r", method="pinocchio aba", threads=1, states=5, seconds_per_state=1e-6,
                                    backward_error=math.inf)],
    growth=[Growth(family="chain", method="pinocchio aba", sizes=[1, 2], seconds_per_state=[1e-6, None],
                   backward_errors=[math.inf, 1.0], exponent=None, expected="1")],
    truths=[Truth(system="arm_2r", start={"q": [0.1, -2.5], "v": [0.0, 5e-324]}, horizon=20.0, trusted=3.5, error=1e-15, precision="",
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
from harness.results.history import History
from harness.results.benchmark import AccelerationCost, Benchmark, Cheapest, Drift, Growth, MotionCost, Order, Truth
from harness.results.superfluous import SuperfluousPart
from harness.results.records import Record
with History(sys.argv[1]) as history:
    for index in range(int(sys.argv[3])):
        history.append(int(sys.argv[2]), Record(
            system=f"{sys.argv[4]}_{index}", subject="lagrange", states=1, verdict="agrees", expected="agrees", backward_error=1.0,
            relative_error=0.0, worst_state=None, seconds_per_state=None, message="x" * 5000))
        print(index, flush=True)
"""


def start_appending(path: Path, run_id: int, count: int, name: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", APPENDER, str(path), str(run_id), str(count), name]
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[1])}
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "reports" / "history.sqlite"


def test_round_trip(path: Path) -> None:
    with History(path) as history:
        run_id = history.begin(RUN)
        history.append(run_id, RECORD)
        history.append(run_id, replace(RECORD, subject="lagrange", backward_error=None, worst_state=None))
        history.append_system(run_id, CARD)
    with History(path) as history:
        assert history.runs() == [(run_id, RUN)]
        assert history.records(run_id) == [RECORD, replace(RECORD, subject="lagrange", backward_error=None, worst_state=None)]
        assert history.systems(run_id) == [CARD]
        worst = history.records(run_id)[0].worst_state
        assert worst is not None and math.copysign(1, worst["tau"][1]) == -1


def same(first: Any, second: Any) -> bool:
    """Equality in which NaN equals NaN."""
    return repr(first) == repr(second)


def test_findings_and_benchmarks_come_back_as_they_were(path: Path) -> None:
    broken = replace(BENCHMARK.motion[0], energy_error=math.nan, state_error=-math.inf)
    measured = replace(BENCHMARK, motion=[*BENCHMARK.motion, broken])
    with History(path) as history:
        history.append_finding(history.begin(RUN), FINDING)
        number = history.begin_benchmark(RUN)
        history.append_measurements(number, replace(measured, problems=[]))
        history.append_measurements(number, Benchmark(problems=measured.problems))
    with History(path) as history:
        assert history.findings(1) == [FINDING]
        assert same(history.latest_benchmark("built-in"), (RUN, measured))


def test_the_latest_of_a_library_is_the_last_that_holds_anything(path: Path) -> None:
    with History(path) as history:
        assert history.latest_run("built-in") is None and history.latest_benchmark("built-in") is None
        for library in ("built-in", "mine", "built-in"):
            history.append(history.begin(replace(RUN, library=library)), RECORD)
            history.append_measurements(history.begin_benchmark(replace(RUN, library=library)), BENCHMARK)
        history.begin(RUN)
        history.begin_benchmark(replace(RUN, seed=8))
        assert (history.latest_run("built-in"), history.latest_run("mine")) == (3, 2)
        found = history.latest_benchmark("built-in")
        assert found is not None and found[0].seed == RUN.seed and found[1] == BENCHMARK
        history.append_measurements(history.begin_benchmark(replace(RUN, seed=9)), Benchmark(problems=["all of it crashed"]))
        found = history.latest_benchmark("built-in")
        assert found is not None and found[0].seed == 9


def test_what_follows_from_measurements_is_not_stored(path: Path) -> None:
    entry = Cheapest(system="arm_2r", kind="motion", error=1e-3, way=None, cost=None)
    with History(path) as history:
        history.append_measurements(history.begin_benchmark(RUN), replace(BENCHMARK, cheapest=[entry]))
        found = history.latest_benchmark("built-in")
        assert found is not None and found[1] == BENCHMARK


def test_a_part_is_stored_whole_or_not_at_all(path: Path) -> None:
    spoilt = replace(BENCHMARK.motion[0], energy_error=object())  # type: ignore[arg-type]
    with History(path) as history:
        with pytest.raises(ValueError, match="no benchmark 5"):
            history.append_measurements(5, BENCHMARK)
        number = history.begin_benchmark(RUN)
        with pytest.raises(TypeError):
            history.append_measurements(number, replace(BENCHMARK, motion=[spoilt]))
        assert history.latest_benchmark("built-in") is None
        history.append(history.begin(RUN), RECORD)


FIRST_VERSION = """
CREATE TABLE runs (id INTEGER PRIMARY KEY, content TEXT NOT NULL);
CREATE TABLE records (id INTEGER PRIMARY KEY, run_id INTEGER NOT NULL REFERENCES runs, content TEXT NOT NULL);
CREATE TABLE systems (id INTEGER PRIMARY KEY, run_id INTEGER NOT NULL REFERENCES runs, content TEXT NOT NULL);
CREATE INDEX records_of_run ON records (run_id);
CREATE INDEX systems_of_run ON systems (run_id);
PRAGMA application_id = 0x52424856;
PRAGMA user_version = 1;
"""


def test_a_history_of_the_first_version_stays_readable_and_can_be_added_to(path: Path) -> None:
    path.parent.mkdir()
    card = asdict(CARD)
    del card["compilation_seconds"]
    connection = sqlite3.connect(path)
    with connection:
        connection.executescript(FIRST_VERSION)
        connection.execute("INSERT INTO runs (content) VALUES (?)", (dumps(asdict(RUN)),))
        connection.execute("INSERT INTO records (run_id, content) VALUES (1, ?)", (dumps(asdict(RECORD)),))
        connection.execute("INSERT INTO systems (run_id, content) VALUES (1, ?)", (dumps(card),))
    connection.close()
    for _ in range(2):
        with History(path) as history:
            assert history.records(1) == [RECORD]
            assert history.systems(1) == [replace(CARD, compilation_seconds=None)]
    with History(path) as history:
        history.append_finding(1, FINDING)
        history.append_cause(1, CAUSE)
        history.append_measurements(history.begin_benchmark(RUN), BENCHMARK)
        assert history.findings(1) == [FINDING]
        assert history.causes(1) == [CAUSE]
        assert history.latest_benchmark("built-in") == (RUN, BENCHMARK)


def test_earlier_runs_are_of_the_same_library_and_profile(path: Path) -> None:
    with History(path) as history:
        first = history.begin(RUN)
        history.append(first, RECORD)
        history.begin(replace(RUN, profile="quick"))
        history.begin(replace(RUN, library="mine"))
        this = history.begin(replace(RUN, seed=8))
        history.begin(replace(RUN, seed=9))
        assert history.earlier(this) == [(RUN, [RECORD])]
        assert [run.seed for _, run in history.runs(2)] == [9, 8]


def test_unknown_run(path: Path) -> None:
    with History(path) as history, pytest.raises(ValueError, match="no run 5"):
        history.append(5, RECORD)


def test_every_acknowledged_record_survives_a_kill(path: Path) -> None:
    with History(path) as history:
        run_id = history.begin(RUN)
    process = start_appending(path, run_id, 100_000, "killed")
    assert process.stdout is not None
    acknowledged = [int(process.stdout.readline()) for _ in range(25)]
    process.send_signal(signal.SIGKILL)
    rest = process.stdout.read().split()
    assert process.wait() == -signal.SIGKILL
    with History(path) as history:
        kept = [record.system for record in history.records(run_id)]
        assert len(kept) >= len(acknowledged) + len(rest)
        assert kept == [f"killed_{index}" for index in range(len(kept))]
        history.append(run_id, RECORD)


def test_two_processes_append_at_once(path: Path) -> None:
    with History(path) as history:
        run_id = history.begin(RUN)
        processes = [start_appending(path, run_id, 40, name) for name in ("one", "two")]
        for process in processes:
            process.communicate(timeout=60)
            assert process.returncode == 0
        assert len(history.records(run_id)) == 80


def test_a_history_may_be_created_by_several_at_once(path: Path) -> None:
    def create(_: int) -> int:
        with History(path) as history:
            return history.begin(RUN)

    with ThreadPoolExecutor(8) as threads:
        assert sorted(threads.map(create, range(8))) == list(range(1, 9))


def damaged(path: Path) -> None:
    with History(path) as history:
        run_id = history.begin(RUN)
        for _ in range(50):
            history.append(run_id, RECORD)
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
        history.begin(RUN)
    change(path, "UPDATE runs SET content = '{}'")


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
        history.runs()
    assert (path.read_bytes() if path.is_file() else None) == before


def test_json_is_strict_and_keeps_the_contract() -> None:
    document = json.loads(to_json(RUN, [RECORD, replace(RECORD, relative_error=math.nan)], [CARD]), parse_constant=pytest.fail)
    assert document["harness"] == RUN.versions
    assert document["run"]["seed"] == 7
    first, second = document["records"]
    contract = "system subject states verdict expected backward_error relative_error worst_state seconds_per_state message"
    assert set(contract.split()) <= set(first)
    assert (first["backward_error"], second["relative_error"]) == ("inf", "nan")
    assert first["worst_state"] == RECORD.worst_state
    assert not first["as_expected"]
    assert document["systems"][0]["name"] == "arm_2r"


def test_json_takes_numpy_numbers() -> None:
    import numpy as np

    values: dict[str, Any] = {"states": np.int64(3), "backward_error": np.float32(0.5)}
    record = replace(RECORD, worst_state={"q": [np.float64(0.1)], "v": [], "tau": []}, **values)
    data = json.loads(to_json(RUN, [record]))["records"][0]
    assert (data["states"], data["backward_error"], data["worst_state"]["q"]) == (3, 0.5, [0.1])


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path: Path) -> None:
    target = tmp_path / "records.json"
    target.write_text("old")
    with pytest.raises(TypeError):
        write_json(target, RUN, [replace(RECORD, message=object())])  # type: ignore[arg-type]
    assert target.read_text() == "old"
    write_json(target, RUN, [RECORD])
    assert json.loads(target.read_text())["records"]
    assert list(tmp_path.iterdir()) == [target]


def test_writing_follows_links_and_spares_devices(tmp_path: Path) -> None:
    (tmp_path / "real").write_text("old")
    (tmp_path / "link").symlink_to("real")
    write_atomically(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink() and (tmp_path / "real").read_text() == "new"
    write_atomically("/dev/null", "nothing")
    assert not Path("/dev/null").is_file()
    with pytest.raises(InvalidInput, match="folder that exists"):
        write_atomically(tmp_path / "absent" / "file", "text")


@pytest.mark.parametrize(
    ("value", "key"), [(0.0, "exact"), (1.0, "0"), (3.2, "1"), (0.9, "-1"), (64.0, "3"), (math.inf, "inf"), (5e-324, "-647")]
)
def test_half_decades(value: float, key: str) -> None:
    assert half_decade(value) == key


def test_records_and_runs_reject_what_a_report_could_not_show() -> None:
    with pytest.raises(ValueError, match="no verdict"):
        replace(RECORD, verdict="fine")
    with pytest.raises(ValueError, match="expected UTC"):
        replace(RUN, started="2026-01-31T02:00:00")
    with pytest.raises(ValueError, match="without a path"):
        replace(RUN, library="some/where")
