"""The machinery of the benchmarks, on benchmarks that are planted; the benchmarks themselves are run by ``python -m benchmarks``."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from rooms import REPOSITORY

from benchmarks import solvers
from benchmarks.benchmark import Benchmark, benchmarks_of, cpu, suites
from benchmarks.comparison import Verdict, first_line, last_measured, lines, row, rows
from benchmarks.history import Measured, append, read, run_of
from benchmarks.page import page
from benchmarks.suites.commands import COMMANDS, WHOLE, name_of

SUITE = """
import time
from benchmarks.benchmark import Benchmark

WORK = 1

def burn(seconds):
    def measure():
        started = time.process_time()
        while time.process_time() < started + seconds:
            pass
        return time.process_time() - started
    return measure

def fail():
    raise ValueError("no such thing")

def benchmarks():
    yield Benchmark("planted/steady", lambda: (burn(0.01 * WORK), burn(0.01)), "as much", 5.0, rounds=6)
    yield Benchmark("planted/tight", lambda: (burn(0.01), burn(0.02)), "twice as much", 0.1, rounds=1)
    yield Benchmark("planted/broken", fail, "nothing")
"""


def measured(*values: float, name: str = "a/b", beside: float = 1.0, most: float | None = None, unit: str = "s") -> Measured:
    return Measured(name, list(values), [beside] * len(values), unit, "the other", most)


# Rounds


def test_rounds_are_taken_in_turns_and_the_first_is_left_out() -> None:
    order: list[str] = []

    def note(name: str) -> float:
        order.append(name)
        return float(len(order))

    found = Benchmark("a/b", lambda: (lambda: note("own"), lambda: note("other")), "other", rounds=2).measured()
    assert order == ["own", "other"] * 3
    assert (found.values, found.besides, found.most) == ([3.0, 5.0], [4.0, 6.0], None)
    assert found.ratio == 3 / 4


def test_cpu_time_is_that_of_a_unit_and_has_no_waiting_in_it() -> None:
    def call() -> None:
        started = time.process_time()
        while time.process_time() < started + 0.002:
            pass
        time.sleep(0.002)

    assert cpu(call, units=4, least=0.01)() == pytest.approx(0.0005, rel=0.5)


PROCESSES = """
import sys
from pathlib import Path
from benchmarks.processes import cpu_seconds

burn = "import time\\nwhile time.process_time() < 0.3: pass"
alone = cpu_seconds("-c", "pass", cwd=Path.cwd())
child = cpu_seconds("-c", f"import subprocess, sys; subprocess.run([sys.executable, '-c', {burn!r}])", cwd=Path.cwd())
orphan = cpu_seconds("-c", f"import subprocess, sys; subprocess.Popen([sys.executable, '-c', {burn!r}])", cwd=Path.cwd())
try:
    cpu_seconds("-c", "import sys; sys.exit('enough')", cwd=Path.cwd())
except RuntimeError as error:
    print(alone, child, orphan, error, sep="\\n")
"""


@pytest.mark.ci
@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not give orphans to another parent")
def test_processes_that_nobody_waits_for_are_counted() -> None:
    done = subprocess.run([sys.executable, "-c", PROCESSES], cwd=REPOSITORY, capture_output=True, text=True, timeout=60, check=True)
    alone, child, orphan, error = done.stdout.splitlines()
    assert float(alone) < 0.25 and all(0.3 <= float(one) < 0.3 + 3 * float(alone) + 0.2 for one in (child, orphan))
    assert error.startswith("exit status 1 of -c") and error.endswith("its last words: enough")


# Verdicts


@pytest.mark.parametrize(
    ("before", "after", "verdict"),
    [
        (measured(*[1.0] * 6), measured(*[1.05] * 6), Verdict.SAME),
        (measured(*[1.0] * 6), measured(*[1.2, 1.21, 1.22, 1.23, 1.24, 1.25]), Verdict.SLOWER),
        (measured(*[1.2, 1.21, 1.22, 1.23, 1.24, 1.25]), measured(*[1.0] * 6), Verdict.FASTER),
        # A machine that is slower by half for both is none.
        (measured(*[1.0] * 6), measured(*[1.5, 1.51, 1.52, 1.53, 1.54, 1.55], beside=1.5), Verdict.SAME),
        # Rounds that lie among one another are noise.
        (measured(1.0, 1.9, 1.4, 1.7, 1.6, 1.5), measured(1.15, 1.3, 1.8, 1.75, 1.65, 1.45), Verdict.SAME),
        (measured(*[1.0] * 6), measured(*[1.2] * 6, most=1.1), Verdict.ABOVE_ITS_BAR),
        (None, measured(1.2, most=1.1), Verdict.ABOVE_ITS_BAR),
        (None, measured(1.0, most=1.1), Verdict.NEW),
        (Measured("a/b", failure="lost"), measured(1.0), Verdict.NEW),
        (measured(1.0), Measured("a/b", failure="lost"), Verdict.FAILED),
        (measured(1.0), None, Verdict.NOT_RUN),
        (measured(100, unit="bytes"), measured(120, unit="bytes"), Verdict.MORE),
        (measured(100, unit="bytes"), measured(80, unit="bytes"), Verdict.LESS),
    ],
)  # fmt: skip
def test_verdicts(before: Measured | None, after: Measured | None, verdict: Verdict) -> None:
    assert row("a/b", before, after).verdict == verdict


def test_what_was_measured_beside_something_else_is_no_comparison() -> None:
    other = Measured("a/b", [1.0], [1.0], beside="another")
    assert row("a/b", other, measured(9.0)).verdict == Verdict.NEW


def test_a_comparison_says_what_became_slower_and_by_how_much() -> None:
    before = [measured(0.002, name="a/slow"), measured(3.25e-6, name="a/same"), measured(100, name="a/bytes", unit="bytes")]
    after = [measured(0.004, name="a/slow"), measured(3.1e-6, name="a/same"), measured(1, name="a/new", most=0.5)]
    found = rows(before, after)
    assert first_line(found, "1234567", "89abcde") == (
        "4 benchmarks at 89abcde, 2 of them beside 1234567: 1 slower, 1 above its bar."
    )  # fmt: skip
    assert lines(found) == [
        "benchmark     before   after  ratio  verdict",
        "a/slow          2 ms    4 ms   2.00  SLOWER",
        "a/same       3.25 us  3.1 us   0.95  same",
        "a/new                    1 s         ABOVE ITS BAR",
        "a/bytes    100 bytes                 not run",
        "a/slow: 0.002 times the other before, 0.004 now",
        "a/new: 1 times the other, of which 0.5 are allowed",
    ]


# History


def test_a_run_comes_back_from_the_history_and_names_no_host(tmp_path: Path) -> None:
    path = tmp_path / "folder" / "runs.jsonl"
    assert read(path) == []
    runs = [run_of([measured(1.0, most=2.0)], "1234567"), run_of([Measured("a/b", failure="lost")], "89abcde+")]
    for run in runs:
        append(run, path)
    assert read(path) == runs and len(path.read_text().splitlines()) == 2
    assert not re.search(rf"\b({re.escape(os.uname().nodename)}|{re.escape(str(Path.home()))})\b", path.read_text())
    assert last_measured(runs) == runs[0].measured


def test_a_line_that_is_no_run_is_named(tmp_path: Path) -> None:
    path = tmp_path / "runs.jsonl"
    append(run_of([], "1234567"), path)
    path.write_text(path.read_text() + '{"commit": 3}\n')
    with pytest.raises(ValueError, match=rf"^{re.escape(str(path))}:2: .*expected one run a line"):
        read(path)


# The command


@pytest.fixture
def planted(tmp_path: Path) -> Path:
    """A git repository with the machinery and one suite."""
    shutil.copytree(REPOSITORY / "benchmarks", tmp_path / "benchmarks", ignore=shutil.ignore_patterns("__pycache__"))
    for file in (tmp_path / "benchmarks" / "suites").glob("*.py"):
        if file.name != "__init__.py":
            file.unlink()
    (tmp_path / "benchmarks" / "suites" / "planted.py").write_text(SUITE)
    (tmp_path / ".gitignore").write_text("__pycache__\nreports\n")
    for words in (["init", "-q"], ["add", "."], ["-c", "user.name=a", "-c", "user.email=a@b", "commit", "-qm", "first"]):
        subprocess.run(["git", *words], cwd=tmp_path, check=True)
    return tmp_path


def asked(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(folder)}
    command = [sys.executable, "-m", "benchmarks", *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=3600, check=False)


@pytest.mark.ci
def test_a_change_that_costs_is_seen_beside_the_last_run_in_the_history_and_against_a_commit(planted: Path) -> None:
    first = asked(planted, "planted/steady")
    assert first.returncode == 0, first.stdout + first.stderr
    assert re.match(r"1 benchmark at [0-9a-f]{10}: nothing to compare with, and each is below its bar\.\n", first.stdout)
    assert re.search(r"^planted/steady +\d+(\.\d+)? ms +new$", first.stdout, re.MULTILINE)
    suite = planted / "benchmarks" / "suites" / "planted.py"
    # Of another length: written within a second, a file of the same length would be taken for the one that is compiled.
    suite.write_text(SUITE.replace("WORK = 1", "WORK = 1 + 1"))
    second = asked(planted, "planted/steady")
    assert second.returncode == 1
    assert re.match(r"1 benchmark at [0-9a-f]{10}\+, 1 of them beside the last run: 1 slower\.\n", second.stdout)
    assert asked(planted, "compare").stdout.splitlines()[2:] == second.stdout.splitlines()[2:]
    commits = [json.loads(line)["commit"] for line in (planted / "reports" / "benchmarks.jsonl").read_text().splitlines()]
    assert commits == [commits[0], f"{commits[0]}+"]
    assert asked(planted, "compare", commits[0], commits[1]).returncode == 1
    back = asked(planted, "compare", commits[1], commits[0])
    assert back.returncode == 0 and re.search(r" 0\.[45]\d +faster$", back.stdout, re.MULTILINE), back.stdout


@pytest.mark.ci
def test_both_states_of_the_code_are_measured_with_today_s_benchmarks(planted: Path) -> None:
    (planted / "work.py").write_text("WORK = 1\n")
    suite = planted / "benchmarks" / "suites" / "planted.py"
    suite.write_text(SUITE.replace("WORK = 1", "from work import WORK"))
    for words in (["add", "."], ["-c", "user.name=a", "-c", "user.email=a@b", "commit", "-qm", "second"]):
        subprocess.run(["git", *words], cwd=planted, check=True)
    (planted / "work.py").write_text("WORK = 2\n")
    done = asked(planted, "planted/steady", "--against", "HEAD")
    assert done.returncode == 1, done.stdout + done.stderr
    assert re.search(r"^planted/steady +\d+(\.\d+)? ms +\d+(\.\d+)? ms +(1\.[5-9]|2\.)\d* +SLOWER$", done.stdout, re.MULTILINE)
    assert subprocess.check_output(["git", "worktree", "list"], cwd=planted, text=True).count("\n") == 1
    refused = asked(planted, "--against", "no-such-commit")
    assert refused.returncode == 2 and "git gives no state of the code for no-such-commit" in refused.stderr


@pytest.mark.ci
def test_a_benchmark_above_its_bar_and_one_that_fails_end_with_status_1(planted: Path) -> None:
    done = asked(planted, "planted", "--rounds", "1")
    assert done.returncode == 1
    assert re.match(r"3 benchmarks at [0-9a-f]{10}: 1 above its bar, 1 failed\.\n", done.stdout)
    assert re.search(r"^planted/tight: 0\.\d+ times twice as much, of which 0\.1 are allowed$", done.stdout, re.MULTILINE)
    assert "planted/broken: ValueError: no such thing" in done.stdout
    lost = SUITE.replace(
        'raise ValueError("no such thing")', 'import os, sys; sys.stderr.write("out of luck"); sys.stderr.flush(); os._exit(3)'
    )
    (planted / "benchmarks" / "suites" / "planted.py").write_text(lost)
    died = asked(planted, "planted/broken")
    assert died.returncode == 1 and "planted/broken: its process ended with status 3: out of luck" in died.stdout


@pytest.mark.ci
def test_bad_usage_says_what_to_do(planted: Path) -> None:
    for arguments, words in (
        (["nothing/*"], "no benchmark matches nothing/*; python -m benchmarks list names them"),
        (["compare"], "has 0 runs on this machine; two are compared"),
        (["page"], "not measured on this machine: list, "),
    ):
        done = asked(
            planted if arguments != ["page"] else REPOSITORY, *arguments, *(["--history", "none.jsonl"] if arguments == ["page"] else [])
        )
        assert done.returncode == 2 and words in " ".join(done.stderr.split()), done.stdout + done.stderr


# The benchmarks that there are


def test_every_benchmark_has_a_name_of_its_own_below_its_suite() -> None:
    names = [one.name for suite in suites() for one in benchmarks_of(suite)]
    assert len(names) == len(set(names)) > 80
    assert all(one.name.startswith(f"{suite}/") for suite in suites() for one in benchmarks_of(suite))
    assert sum(not math.isinf(one.most) for suite in suites() for one in benchmarks_of(suite)) > 60


def test_the_page_on_costs_is_made_of_measurements_of_every_command() -> None:
    known = [measured(1.234, name=name_of(command)) for command in COMMANDS]
    with pytest.raises(LookupError, match="not measured on this machine: check; run python -m benchmarks commands"):
        page(known)
    text = page([*known, measured(77.7, name=name_of(WHOLE))])
    assert "| `harness list` | mechanisms and engines | 1.2 |" in text and "catalogue in 78 CPU seconds" in text


@pytest.mark.ci
def test_benchmarks_of_commands_kernels_and_truth_can_be_measured(tmp_path: Path) -> None:
    names = ["commands/list", "kernels/accelerations/double_pendulum", "kernels/of abaInParallel/arm_3r", "certified/of pin.aba/arm_7r"]
    done = asked(REPOSITORY, *names, "--rounds", "1", "--history", str(tmp_path / "runs.jsonl"))
    assert done.returncode in {0, 1} and "FAILED" not in done.stdout, done.stdout + done.stderr
    assert done.stdout.startswith("4 benchmarks")


@pytest.mark.nightly
@pytest.mark.parametrize("suite", suites())
def test_every_benchmark_can_be_measured(suite: str, tmp_path: Path) -> None:
    """One round: a bar may be missed beside other tests, and nothing else."""
    done = asked(REPOSITORY, suite, "--rounds", "1", "--history", str(tmp_path / "runs.jsonl"))
    assert done.returncode in {0, 1} and "FAILED" not in done.stdout, done.stdout + done.stderr


def solver_cost(method: str, iterations: int | None, right: int, relative_error: float) -> dict[str, object]:
    about = {"system": "suite/hopper.xml", "states": 64, "touching": 27, "method": method, "iterations": iterations}
    return about | {"right": right, "relative_error": relative_error}


def test_the_page_on_solvers_says_what_each_needs_or_leaves() -> None:
    costs = [
        solver_cost("", None, 64, 3.7e-14),
        solver_cost("Newton", None, 64, 3.7e-14),
        solver_cost("CG", None, 20, 1.25e-7),
        solver_cost("PGS", None, 0, 0.81),
        solver_cost("Newton", 4, 62, 0.0178),
        solver_cost("Newton", 8, 64, 3.2e-14),
        solver_cost("CG", 256, 64, 4.2e-14),
        solver_cost("PGS", 1024, 63, 0.76),
        {"system": "suite/free.xml", "states": 0, "note": "nothing is left to a solver"},
    ]
    of_trays = [{**cost, "system": "/tmp/10 contacts, elliptic.xml", "seconds_per_state": 1.234e-5} for cost in costs[:-1]]
    run = {"versions": {"mujoco": "4.0.0"}}
    text = solvers.page(*({"benchmark": {"run": run, "solvers": own}} for own in (costs, of_trays)))
    assert "MuJoCo 4.0.0" in text and "free.xml" not in text
    cells = ["3.70e-14", "1.25e-07", "0.810", "8", "256", "0.760 left"]
    assert f"| 10 contacts, elliptic | 64 | 27 | {' | '.join(f'{cell}, 12.3 µs' for cell in cells)} |" in text
    assert f"| hopper.xml | 64 | 27 | {' | '.join(cells)} |" in text


@pytest.mark.parametrize("feet", solvers.FEET)
def test_all_feet_of_a_tray_touch(feet: int, tmp_path: Path) -> None:
    import mujoco

    for path in solvers.trays(tmp_path):
        assert path.read_text() in {solvers.tray(count, cone) for count in solvers.FEET for cone in solvers.CONES}
    model = mujoco.MjModel.from_xml_string(solvers.tray(feet, "elliptic"))
    data = mujoco.MjData(model)
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert data.ncon == feet
