"""Engine files of other people: what they do while they are loaded, and what they answer, costs their own records."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import psutil
import pytest
from support import Done, engine_source, harness, harness_in_a_process, make_library, records_of, without_progress

from harness import check
from harness.commands.frame.options import STATES_OF_PROFILE
from harness.engines import engine_paths, installed_version, load_engine
from harness.library import Library

# A server that leaves its parent's group and takes nothing of its environment along.
SERVER = "subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(1000)'], env={}, start_new_session=True)"
KEEP_NUMBER = "open(__file__.removesuffix('.py') + '.pid', 'a').write(f'{server.pid}\\n')"
CHATTER = "print('spoon'); os.write(1, b'spoon'); ctypes.CDLL(None).puts(b'spoon'); ctypes.CDLL(None).fflush(None)"
AT_IMPORT = {
    "exits": engine_source(top="sys.exit(0)"),
    "vanishes": engine_source(top="os._exit(0)"),
    "sleeps": engine_source(top="time.sleep(1000)"),
    "raises": engine_source(top="1 / 0"),
    "misspelt": "ENGINE = (",
    "nameless": "",
    "unknowing": engine_source(requires=""),
    "odd": engine_source(requires='requires = "numpy"'),
    "absent": engine_source(requires='requires = ("pydrake.all", "drake")'),
    "serving": engine_source(top=f"server = {SERVER}; {KEEP_NUMBER}; time.sleep(1000)"),
    "leaving": engine_source(top=f"server = {SERVER}; {KEEP_NUMBER}; os._exit(0)"),
    "talking": engine_source(answer=f"{CHATTER}; return np.zeros_like(v)", top=CHATTER),
}
INVALID = ("exits", "raises", "misspelt", "nameless", "unknowing", "odd")
DEAD = {"vanishes": "ended its process with status 0", "sleeps": "exceeded its time limit of 2.5 s", "serving": "exceeded its time limit"}
ANSWERS = {
    "short": ("v[1:]", "(39, 1) of float64"),
    "narrow": ("v[:, :0]", "(40, 0) of float64"),
    "flat": ("v[:, 0]", "(40,) of float64"),
    "deep": ("v[None]", "(1, 40, 1) of float64"),
    "listing": ("v.tolist()", "a list"),
    "objects": ("v.astype(object)", "(40, 1) of object"),
    "complex": ("v + 1j", "(40, 1) of complex128"),
    "whole": ("v.astype(int)", "(40, 1) of int64"),
    "nothing": ("None", "a NoneType"),
}


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A library whose engines misbehave while they are loaded."""
    return make_library(tmp_path_factory.mktemp("foreign") / "library", ["bar_pendulum"], AT_IMPORT)


@pytest.fixture(scope="module")
def checked(library: Path) -> tuple[int, dict[str, Any], str]:
    """Exit status, records by subject and standard error of a check of all, whose JSON goes to standard output."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("harness.engines.files.LOADING_SECONDS", 2.5)
        done = harness(
            "check", "--library", ".", "--quantity", "accelerations", "--states", "40", "--json", "-", isolated=True, cwd=library
        )
    return done.returncode, {record["subject"]: record for record in json.loads(done.stdout)["records"]}, done.stderr


@pytest.mark.ci
def test_what_engine_files_do_at_import_costs_their_own_records(checked: tuple[int, dict[str, Any], str]) -> None:
    status, records, errors = checked
    # Two of them end their process.
    assert status == 3
    assert "Traceback" not in errors
    for name in AT_IMPORT:
        assert {one for one in records if one.startswith(f"{name}/")} >= {f"{name}/mjcf"}
    for subject in ("lagrange", "mujoco/mjcf", "mujoco/urdf", "pinocchio/mjcf", "pinocchio/urdf"):
        assert (records[subject]["verdict"], records[subject]["states"]) == ("agrees", 40)


@pytest.mark.ci
@pytest.mark.parametrize("name", INVALID)
def test_an_engine_file_that_is_invalid_is_named(checked: tuple[int, dict[str, Any], str], library: Path, name: str) -> None:
    record = checked[1][f"{name}/mjcf"]
    assert record["verdict"] == "error"
    assert str(library / "engines" / f"{name}.py") in record["message"]
    assert record["message"].endswith("mend it, or ask others alone by --subject")


@pytest.mark.ci
@pytest.mark.parametrize(("name", "message"), DEAD.items())
def test_an_engine_file_that_ends_its_process_says_so(checked: tuple[int, dict[str, Any], str], name: str, message: str) -> None:
    record = checked[1][f"{name}/mjcf"]
    assert record["verdict"] == "error"
    assert message in record["message"]


@pytest.mark.ci
def test_an_engine_that_is_not_installed_is_unsupported(checked: tuple[int, dict[str, Any], str]) -> None:
    record = checked[1]["absent/mjcf"]
    assert (record["verdict"], record["message"]) == ("unsupported", "drake is not installed")


@pytest.mark.parametrize(
    ("module", "is_there"), [("broken", True), ("broken.part", True), ("broken.none", False), ("broken.part.none", False)]
)
def test_an_engine_that_cannot_be_imported_is_looked_for_all_the_same(
    module: str, is_there: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "__init__.py").write_text("raise ImportError('libGL.so.1: cannot open shared object file')")
    (tmp_path / "broken" / "part.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)
    engine: Any = SimpleNamespace(requires=(module, "numpy"), environment=None)
    assert (installed_version(engine) is not None) == is_there
    assert "broken" not in sys.modules


@pytest.mark.nightly
def test_what_an_engine_prints_is_not_in_standard_output(tmp_path: Path) -> None:
    root = make_library(tmp_path / "library", ["bar_pendulum"], {"talking": AT_IMPORT["talking"]})
    options = ["--states", "40", "--subject", "talking/mjcf", "--library", str(root)]
    done = harness_in_a_process("check", "bar_pendulum", *options, "--json", "-", cwd=tmp_path)
    [record] = [record for record in json.loads(done.stdout)["records"] if record["quantity"] == "accelerations"]
    assert record["verdict"] == "disagrees"
    assert "talking/mjcf" in done.stderr
    assert "spoon" not in done.stderr


def gone(process: int) -> bool:
    """True once the process has ended, within five seconds."""
    for _ in range(100):
        if not psutil.pid_exists(process) or psutil.Process(process).status() == psutil.STATUS_ZOMBIE:
            return True
        time.sleep(0.05)
    return False


@pytest.mark.ci
@pytest.mark.parametrize("name", ["serving", "leaving"])
def test_what_an_engine_file_starts_ends_with_its_process(checked: tuple[int, dict[str, Any], str], library: Path, name: str) -> None:
    servers = [int(line) for line in (library / "engines" / f"{name}.pid").read_text().split()]
    assert servers
    assert all(map(gone, servers))


@pytest.mark.ci
def test_what_a_system_file_starts_and_prints_stays_in_its_process(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    root = make_library(tmp_path / "library", ["bar_pendulum"])
    file = root / "systems" / "bar_pendulum.py"
    file.write_text(f"{file.read_text()}\nimport ctypes, os, subprocess, sys\nserver = {SERVER}\n{KEEP_NUMBER}\n{CHATTER}\n")
    for command in (["list", "--json", "-"], ["show", "bar_pendulum"]):
        done = harness(*command, "--library", str(root), isolated=True)
        assert done.returncode == 0, done.stderr
        assert "spoon" not in done.stdout + capfd.readouterr().out
        assert command[0] == "show" or json.loads(done.stdout)["systems"][0]["name"] == "bar_pendulum"
    servers = [int(line) for line in (root / "systems" / "bar_pendulum.pid").read_text().split()]
    assert len(servers) == 2
    assert all(map(gone, servers))


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A library with an engine file that is invalid and one that ends its process."""
    engines = {name: AT_IMPORT[name] for name in ("exits", "vanishes")}
    return make_library(tmp_path_factory.mktemp("small") / "library", ["bar_pendulum"], engines)


@pytest.mark.ci
@pytest.mark.parametrize(("name", "status"), [("vanishes", 3), ("exits", 1)])
def test_the_exit_status_is_that_of_the_subject_asked_for(small: Path, name: str, status: int) -> None:
    """The other is not its affair."""
    done = harness("check", "--library", str(small), "--states", "20", "--subject", f"{name}/mjcf", isolated=True)
    assert (done.returncode, without_progress(done.stderr)) == (status, "")
    assert f"{name}/mjcf" in done.stdout


MARKING = engine_source(top="open(__file__ + '.run', 'w')")


@pytest.mark.ci
@pytest.mark.parametrize("command", ["check", "diagnose", "search", "pytest", "api"])
def test_an_engine_file_that_nobody_asks_for_is_not_run(tmp_path: Path, command: str) -> None:
    root = make_library(tmp_path / "library", ["bar_pendulum"], {"marking": MARKING})
    states = ["--budget", "8", "--no-keep"] if command == "search" else ["--states", "4"]
    if command == "api":
        check("bar_pendulum", library=root, subjects="mujoco/mjcf", states=4, workers=1)
    elif command == "pytest":
        options = ["--harness-library", str(root), "--harness-subject", "mujoco/mjcf", "--harness-states", "4", "-p", "no:cacheprovider"]
        subprocess.run([sys.executable, "-m", "pytest", *options], capture_output=True, timeout=120, cwd=tmp_path, check=True)
    else:
        done = harness(command, "bar_pendulum", "--library", str(root), "--subject", "mujoco/mjcf", *states, isolated=True, cwd=tmp_path)
        assert done.returncode == 0, done.stdout + done.stderr
    assert not (root / "engines" / "marking.py.run").exists()


@pytest.fixture(scope="module")
def nonsense(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A library whose engines answer nonsense."""
    engines = {name: engine_source(f"return {answer}") for name, (answer, _) in ANSWERS.items()}
    return make_library(tmp_path_factory.mktemp("nonsense") / "library", ["bar_pendulum"], engines)


@pytest.fixture(scope="module")
def reported(nonsense: Path) -> Done:
    """A report of those engines."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(STATES_OF_PROFILE, "quick", 40)
        return harness("report", "--library", ".", "--out", "out", "--json", "out.json", cwd=nonsense)


@pytest.mark.ci
def test_a_report_is_written_whatever_engines_answer(nonsense: Path, reported: Done) -> None:
    assert reported.returncode == 1, reported.stderr
    assert (nonsense / "out" / "index.html").is_file()


@pytest.mark.ci
@pytest.mark.parametrize("name", ANSWERS)
def test_an_answer_that_is_no_array_of_accelerations_costs_its_own_record(nonsense: Path, reported: Done, name: str) -> None:
    records = {record["subject"]: record for record in records_of(nonsense / "out.json")}
    record, found = records[f"{name}/mjcf"], ANSWERS[name][1].replace("40", "1").replace("39", "0")
    assert record["verdict"] == "error"
    assert f"returned {'' if found.startswith('a ') else 'an array of shape '}{found}; expected" in record["message"]
    assert records["mujoco/mjcf"]["verdict"] == "agrees"


@pytest.mark.ci
def test_search_says_what_was_answered(nonsense: Path) -> None:
    done = harness("search", "bar_pendulum", "--library", ".", "--subject", "listing/mjcf", "--budget", "8", "--no-keep", cwd=nonsense)
    assert done.returncode == 1
    assert "listing/mjcf: InvalidAnswer: forward_dynamics returned a list; expected" in done.stdout


@pytest.mark.ci
def test_atlas_says_what_was_answered(nonsense: Path) -> None:
    done = harness("atlas", "stiff_spring", "--library", ".", "--subject", "listing/mjcf", "--json", "-", cwd=nonsense)
    assert done.returncode == 1
    [row] = json.loads(done.stdout)["atlas"]["rows"]
    assert row["verdict"] == "error"
    assert all("InvalidAnswer: forward_dynamics returned a list; expected" in point["reason"] for point in row["points"])


@pytest.mark.ci
def test_the_python_interface_gives_records_of_engine_files_that_fail(small: Path) -> None:
    [record] = check("bar_pendulum", library=small, subjects="vanishes/mjcf", states=20, workers=1)
    assert (record.verdict, record.message) == ("error", "ended its process with status 0")
    [record] = check("bar_pendulum", library=small, subjects="exits/mjcf", states=20, workers=1)
    assert record.verdict == "error" and re.search(r"exits\.py:\d+: raises SystemExit: 0", record.message)


@pytest.mark.nightly
def test_pytest_fails_the_tests_of_an_engine_that_ends_its_process(small: Path, tmp_path: Path) -> None:
    options = ["-p", "no:cacheprovider", "--harness-library", str(small), "--harness-states", "20"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *options], capture_output=True, text=True, timeout=120, cwd=tmp_path, check=False
    )
    assert done.returncode == 1, done.stdout + done.stderr
    assert "2 failed, 5 passed" in done.stdout
    assert "ended its process with status 0" in done.stdout
    assert "raises SystemExit: 0" in done.stdout


@pytest.mark.nightly
def test_a_benchmark_loses_only_the_method_that_was_answered_nonsense(tmp_path: Path) -> None:
    root = make_library(tmp_path / "library", ["bar_pendulum"], {"mujoco": engine_source("return v.tolist()")})
    methods = ["--methods", "harness check of mujoco", "--methods", "heyoka float64"]
    done = harness("bench", "bar_pendulum", "--library", str(root), *methods, "--json", "-", cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    costs = {cost["method"]: cost for cost in json.loads(done.stdout)["benchmark"]["accelerations"]}
    assert "returned a list; expected" in costs["harness check of mujoco"]["note"]
    assert costs["heyoka float64"]["states"] == 1000


@pytest.mark.parametrize(
    "command",
    [
        ["list"],
        ["show", "bar_pendulum"],
        pytest.param(["search", "bar_pendulum", "--budget", "8", "--no-keep"], marks=pytest.mark.nightly),
        pytest.param(["atlas", "far_base"], marks=pytest.mark.nightly),
        pytest.param(["diagnose", "bar_pendulum"], marks=pytest.mark.nightly),
        ["bench", "bar_pendulum", "--methods", "mujoco batch"],
        pytest.param(["faults", "bar_pendulum", "--kind", "axis"], marks=pytest.mark.nightly),
    ],
    ids=lambda command: command[0],
)
def test_every_command_survives_engine_files_and_names_them(small: Path, tmp_path: Path, command: list[str]) -> None:
    done = harness(*command, "--library", str(small), isolated=True, cwd=tmp_path)
    if command[0] == "bench":
        # It measures methods, which are the harness's own.
        assert done.returncode == 0, done.stderr
        return
    # A process died.
    assert (done.returncode, without_progress(done.stderr)) == (3, "")
    if command[0] != "faults":
        assert f"{small / 'engines' / 'exits.py'}" in done.stdout
        assert "ended its process with status 0" in done.stdout


def test_an_engine_of_a_library_wins_over_that_of_the_harness(tmp_path: Path) -> None:
    library = Library.at(make_library(tmp_path / "library", ["bar_pendulum"], {"mujoco": engine_source()}))
    assert load_engine(library, "mujoco").requires == ("numpy", "numpy")
    assert load_engine(Library.built_in(), "mujoco").requires[0] == "mujoco"
    assert engine_paths(library)["mujoco"].is_relative_to(tmp_path)
