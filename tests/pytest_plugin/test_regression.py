"""The regression plugin as somebody else's project meets it."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from support import HEAVY_ENGINE, make_library, pytest_in_this_process

from harness.truth.quantities import further_quantities


@pytest.fixture
def library(tmp_path: Path) -> Path:
    """A library whose MJCF of the bar pendulum is wrong and whose spring-damper is right."""
    root = make_library(tmp_path / "mechanisms", ["bar_pendulum", "spring_damper"])
    model = root / "mjcf" / "bar_pendulum.xml"
    model.write_text(model.read_text().replace('mass="2"', 'mass="2.0000001"'))
    return root


OPTIONS = ("-p", "no:cacheprovider")


def settle(library: Path, **settings: str) -> Path:
    """The folder of a project whose settings name the library and give the others besides."""
    lines = "".join(f"{name} = {value}\n" for name, value in {"testpaths": library.name, **settings}.items())
    (library.parent / "pytest.ini").write_text(f"[pytest]\nharness_library = {library.name}\n{lines}")
    return library.parent


def run_in_a_process(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """pytest as users run it."""
    command = [sys.executable, "-m", "pytest", *OPTIONS, *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=cwd, check=False)


@pytest.mark.ci
def test_any_library_from_an_empty_folder(library: Path) -> None:
    empty = library.parent / "empty"
    empty.mkdir()
    done = run_in_a_process("--harness-library", "../mechanisms", "-v", cwd=empty)
    assert done.returncode == 1
    assert "2 failed, 8 passed" in done.stdout
    assert "harness: library mechanisms, 1000 states per system, seed 0" in done.stdout
    # Whatever engine reads the wrong file, and none that reads the other.
    for subject in ("mujoco/mjcf", "pinocchio/mjcf"):
        assert f"bar_pendulum.py::{subject} FAILED" in done.stdout
        assert f"bar_pendulum {subject}: disagrees, expected agrees" in done.stdout
    assert "cause: " in done.stdout
    assert "replay: harness check bar_pendulum --subject mujoco/mjcf --library ../mechanisms --state" in done.stdout
    assert "Traceback" not in done.stdout


WATCHED_ENGINE = """
import os
from harness.engines.adapters.mujoco import MujocoEngine

class Engine(MujocoEngine):
    def load(self, source, joints, gravity):
        with open({log!r}, "a") as log:
            log.write(f"{{source.path.name}} {{os.environ['PYTEST_XDIST_WORKER']}}\\n")
        return super().load(source, joints, gravity)

ENGINE = Engine()
"""


@pytest.mark.ci
def test_processes_share_the_systems_and_none_runs_those_of_another(library: Path) -> None:
    log = library / "log"
    (library / "engines").mkdir()
    (library / "engines" / "watched.py").write_text(WATCHED_ENGINE.format(log=str(log)))
    subjects = [f"--harness-subject={subject}" for subject in ("watched/mjcf", "mujoco/mjcf", "pinocchio/urdf")]
    options = ("--harness-states", "40", *subjects, "-n", "2", "--dist", "loadfile", "-v")
    done = run_in_a_process("--harness-library", str(library), *options, cwd=library)
    assert done.returncode == 1
    assert "2 failed, 4 passed" in done.stdout
    assert "bar_pendulum mujoco/mjcf: disagrees, expected agrees" in done.stdout
    assert {"[gw0]", "[gw1]"} <= set(done.stdout.split())
    loaded = {tuple(line.split()) for line in log.read_text().splitlines()}
    assert {name for name, _ in loaded} == {"bar_pendulum.xml", "spring_damper.xml"}
    # Each file has one process, and each process one file.
    assert {process for _, process in loaded} == {"gw0", "gw1"} and len(loaded) == 2


@pytest.mark.ci
def test_options_select_subjects_systems_and_states(library: Path) -> None:
    common = ("--harness-library", str(library), "--harness-states", "40")
    done = pytest_in_this_process(*common, "--harness-subject", "pinocchio/urdf", cwd=library)
    assert done.returncode == 0
    assert "2 passed" in done.stdout
    done = pytest_in_this_process(*common, "-k", "spring_damper and lagrange", cwd=library)
    assert done.returncode == 0
    assert "1 passed, 9 deselected" in done.stdout


@pytest.mark.ci
def test_a_project_names_its_library_in_its_settings(library: Path) -> None:
    project = settle(library, testpaths="mechanisms own")
    (project / "own").mkdir()
    (project / "own" / "test_own.py").write_text("def test_own(): pass\n")
    done = pytest_in_this_process("--harness-states", "40", cwd=project)
    assert "2 failed, 9 passed" in done.stdout


@pytest.mark.ci
@pytest.mark.parametrize(
    ("states", "options", "said"),
    [
        ("30", (), "30 states per system"),
        ("30", ("--harness-states=20",), "20 states per system"),
        ("none", (), "harness_states in the settings is 'none'"),
    ],
)
def test_a_project_names_its_number_of_states_in_its_settings(library: Path, states: str, options: tuple[str, ...], said: str) -> None:
    done = pytest_in_this_process(*options, "-k", "spring_damper and lagrange", cwd=settle(library, harness_states=states))
    assert done.returncode == (pytest.ExitCode.USAGE_ERROR if states == "none" else 0)
    assert said in done.stdout + done.stderr and ("1 passed" in done.stdout) == (states != "none")


@pytest.mark.ci
def test_each_quantity_is_a_test_that_carries_its_name(tmp_path: Path) -> None:
    make_library(tmp_path / "mechanisms", ["spring_damper"], {"heavy": HEAVY_ENGINE})
    common = ("--harness-library", "mechanisms", "--harness-states", "20", "--harness-subject", "heavy/mjcf", "-v")
    wanted = [f"--harness-quantity={name}" for name in ("mass_matrix", "position", "accelerations")]
    done = pytest_in_this_process(*common, *wanted, cwd=tmp_path)
    assert ", mass_matrix position accelerations" in done.stdout
    outcomes = [line.partition("::")[2].split(" ")[:2] for line in done.stdout.splitlines() if "spring_damper.py::heavy" in line]
    expected = [["heavy/mjcf", "PASSED"], ["heavy/mjcf[mass_matrix]", "FAILED"], ["heavy/mjcf[position]", "PASSED"]]
    assert sorted(outcomes[:3]) == sorted(expected)
    assert "replay: harness check spring_damper --subject heavy/mjcf --library mechanisms --quantity mass_matrix --state" in done.stdout


@pytest.mark.ci
def test_a_project_names_its_quantities_in_its_settings(library: Path) -> None:
    project, chosen = settle(library, harness_quantity="accelerations energy"), ("-k", "spring_damper and mujoco", "--harness-states", "20")
    done = pytest_in_this_process(*chosen, "-v", cwd=project)
    assert "4 passed" in done.stdout and "spring_damper.py::mujoco/urdf[energy] PASSED" in done.stdout
    done = pytest_in_this_process(*chosen, "--harness-quantity", "all", "--collect-only", "-q", cwd=project)
    names = [line.partition("::")[2] for line in done.stdout.splitlines() if "::mujoco/mjcf" in line]
    assert names == ["mujoco/mjcf", *(f"mujoco/mjcf[{one.name}]" for one in further_quantities())]


@pytest.mark.ci
def test_nothing_is_collected_unless_asked_for(library: Path) -> None:
    done = pytest_in_this_process(cwd=library)
    assert done.returncode == pytest.ExitCode.NO_TESTS_COLLECTED


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--harness-library", "nowhere"], "no such directory"),
        (["--harness-library", ".", "--harness-subject", "mujoco/mjfc"], "did you mean 'mujoco/mjcf'"),
        (["--harness-library", ".", "--harness-states", "0"], "--harness-states"),
        (["--harness-library", ".", "--harness-time-limit", "0"], "--harness-time-limit: 0.0 is not above zero"),
        (["--harness-library", ".", "--harness-time-limit", "nan"], "--harness-time-limit: nan is not above zero"),
        (["--harness-library", ".", "--harness-memory-limit", "much"], "--harness-memory-limit: 'much'"),
        (["--harness-library", ".", "--harness-quantity", "mass_matrx"], "did you mean 'mass_matrix'"),
    ],
)
def test_bad_usage_is_a_usage_error(library: Path, arguments: list[str], message: str) -> None:
    done = pytest_in_this_process(*arguments, cwd=library)
    assert done.returncode != 0
    assert message in done.stdout + done.stderr
    assert "Traceback" not in done.stdout + done.stderr
    assert "INTERNALERROR" not in done.stdout + done.stderr


@pytest.mark.ci
def test_a_broken_system_fails_its_own_tests_only(library: Path) -> None:
    (library / "systems" / "bad.py").write_text("x = 1 / 0\n")
    done = pytest_in_this_process("--harness-library", str(library), "--harness-states", "40", cwd=library)
    assert "7 failed, 8 passed" in done.stdout
    assert "bad.py:1: raises ZeroDivisionError" in done.stdout


@pytest.mark.ci
def test_loading_the_plugin_imports_no_engine() -> None:
    code = "import sys, harness.pytest_plugin; print(sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    for heavy in ("mujoco", "pinocchio", "heyoka", "sympy", "numpy", "distributed"):
        assert f"'{heavy}'" not in done.stdout


@pytest.mark.ci
def test_a_variant_has_a_test_for_each_of_its_readers(library: Path) -> None:
    model = library / "mjcf" / "bar_pendulum.xml"
    model.with_name("bar_pendulum.twin.xml").write_text(model.read_text())
    done = pytest_in_this_process("--harness-library", str(library), "--collect-only", "-q", cwd=library)
    names = [line.partition("bar_pendulum.py::")[2] for line in done.stdout.splitlines() if "bar_pendulum.py::" in line]
    assert len(names) == 5 + 2
    assert names[5:] == ["bar_pendulum.twin:mujoco/mjcf", "bar_pendulum.twin:pinocchio/mjcf"]
    done = pytest_in_this_process("--harness-library", str(library), "-k", "twin or (bar_pendulum and lagrange)", cwd=library)
    assert "2 failed, 1 passed" in done.stdout and "bar_pendulum.twin mujoco/mjcf: disagrees" in done.stdout


@pytest.mark.ci
def test_a_system_that_shares_a_module_with_others_can_be_named(library: Path) -> None:
    system = library / "systems" / "spring_damper.py"
    system.with_name("_shared.py").write_text("SHARED = 1\n")
    system.write_text(system.read_text() + "\nfrom _shared import SHARED  # noqa\n")
    done = pytest_in_this_process("--harness-library", str(library), "--collect-only", "-q", str(system), cwd=library)
    names = [line.partition("spring_damper.py::")[2] for line in done.stdout.splitlines() if "spring_damper.py::" in line]
    assert done.returncode == 0 and names == ["lagrange", "mujoco/mjcf", "mujoco/urdf", "pinocchio/mjcf", "pinocchio/urdf"]


@pytest.mark.ci
def test_each_robot_and_engine_is_a_test(tmp_path: Path) -> None:
    files = Path(__file__).parents[1] / "comparison" / "files"
    robots = tmp_path / "robots"
    robots.mkdir()
    for name in ("arm.urdf", "impossible.urdf"):
        shutil.copy(files / name, robots)
    options = ("--harness-robots", "robots", "--harness-states", "8", "-v", "-n", "0")
    done = pytest_in_this_process(*options, cwd=tmp_path)
    assert done.returncode == 1 and "1 failed, 3 passed" in done.stdout and "mujoco/urdf, plain: refused" in done.stdout, done.stdout
    entry = '[[expected]]\nfile = "impossible.urdf"\nsubject = "mujoco/urdf"\noutcome = "agrees"\nreason = "a test"\n'
    (robots / "expected_robots.toml").write_text(entry.replace("agrees", "refused"))
    done = pytest_in_this_process(*options, cwd=tmp_path)
    assert done.returncode == 0 and "4 passed" in done.stdout, done.stdout
    (robots / "expected_robots.toml").write_text(entry)
    done = pytest_in_this_process(*options, cwd=tmp_path)
    assert done.returncode == 1 and "refused, expected agrees because a test" in done.stdout
    (robots / "expected_robots.toml").write_text(entry.replace("impossible", "missing"))
    assert "not in the folder" in pytest_in_this_process(*options, cwd=tmp_path).stderr
