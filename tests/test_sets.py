"""What the three sets of tests hold: the representative systems and robots, the whole catalogue, and the night."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from catalogue import (
    BUILT_IN,
    MODELS,
    REPRESENTATIVE,
    REPRESENTATIVE_ROBOTS,
    ROBOT_FEATURES,
    ROBOTS,
    SYSTEM_FEATURES,
    cover,
)

from harness.engines import NotOffered, load_engine
from harness.files.joint_kinds import JointKind
from harness.files.model_file import features_of, read_model
from harness.lagrange.derivation import load_mechanism
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import read_robot, robot_of
from harness.truth.quantities import TruthBasis, find_quantities


def test_every_feature_of_the_catalogue_is_in_a_representative_system() -> None:
    chosen = set().union(*(SYSTEM_FEATURES[name] for name in REPRESENTATIVE))
    assert chosen == set().union(*SYSTEM_FEATURES.values()) and 10 <= len(REPRESENTATIVE) <= 20


def test_what_robots_have_beyond_the_systems_is_in_a_representative_robot() -> None:
    known = set().union(*SYSTEM_FEATURES.values())
    assert set().union(*(ROBOT_FEATURES[path] for path in REPRESENTATIVE_ROBOTS)) - known == set().union(*ROBOT_FEATURES.values()) - known
    assert 4 <= len(REPRESENTATIVE_ROBOTS) <= 7


def test_every_name_that_a_report_gathers_verdicts_by_is_in_a_representative_model() -> None:
    named = {(name, form): set(features_of(read_model(BUILT_IN.model_path(name, form), form))) for name, form in MODELS}
    chosen = set().union(*(found for (name, _), found in named.items() if BUILT_IN.system_of(name) in REPRESENTATIVE))
    assert chosen == set().union(*named.values())


@pytest.mark.ci
def test_every_kind_of_joint_is_in_a_representative_model() -> None:
    kinds = {(name, form): _kinds(name, form) for name, form in MODELS}
    chosen = set().union(*(found for (name, _), found in kinds.items() if BUILT_IN.system_of(name) in REPRESENTATIVE))
    assert chosen == set().union(*kinds.values()) >= {JointKind.BALL, JointKind.FREE}


def _kinds(name: str, model_format: str) -> set[JointKind]:
    robot = robot_of(read_model(BUILT_IN.model_path(name, model_format), model_format), 9.81)
    return {joint.kind for joint in robot.tree.joints}


@pytest.mark.ci
def test_every_quantity_is_one_of_a_representative_system_or_robot() -> None:
    systems = [_basis_of_system(name) for name in REPRESENTATIVE if BUILT_IN.has_model(name, "mjcf")]
    robots = [TruthBasis(mechanism_of(read_robot(path)), None, None, False) for path in REPRESENTATIVE_ROBOTS if path.suffix == ".xml"]
    for quantity in find_quantities().values():
        assert any(_has(quantity.truth, basis) for basis in (*systems, *robots)), quantity.name


def _basis_of_system(name: str) -> TruthBasis:
    declared = read_model(BUILT_IN.model_path(name, "mjcf"), "mjcf")
    rules = load_engine(BUILT_IN, "mujoco").step_rules(declared)
    return TruthBasis(load_mechanism(BUILT_IN, name), declared, declared, linear_velocity_in_body=False, step_rules=rules)


def _has(truth: Callable[[TruthBasis], Any], basis: TruthBasis) -> bool:
    try:
        truth(basis)
    except NotOffered:
        return False
    return True


def test_a_cover_is_greedy_by_size_and_drops_what_later_ones_make_superfluous() -> None:
    features = {"wide": {"a", "b", "c"}, "left": {"a", "d"}, "right": {"b", "c", "e"}, "none": set()}
    sizes = dict.fromkeys(features, 1)
    assert cover(features, sizes) == ["left", "right"]
    assert cover(features, sizes, covered={"a", "b", "c", "e"}) == ["left"]


@pytest.mark.ci
def test_no_file_gives_the_name_of_a_shared_fixture_to_another_that_outlives_a_test() -> None:
    """pytest would hand what depends on it, made for the last test of another file, to the first test of this one."""
    long_lived: dict[str, list[str]] = defaultdict(list)
    for path in Path(__file__).parent.rglob("*.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef) and any(
                re.match("pytest.fixture.*scope=", ast.unparse(one)) for one in node.decorator_list
            ):
                long_lived[node.name].append(path.name)
    shared = {name: files for name, files in long_lived.items() if "conftest.py" in files}
    assert len(shared) > 5 and [name for name, files in shared.items() if len(files) > 1] == []


TESTS = """
import pytest
from catalogue import ROBOTS

def test_over(built_in_name):
    pass

@pytest.mark.parametrize("path", ROBOTS, ids=str)
def test_robots(path):
    pass

@pytest.mark.ci
def test_whole_command():
    pass

@pytest.mark.nightly(nights=3)
@pytest.mark.parametrize("number", range(7))
def test_in_turn(number):
    pass

@pytest.mark.nightly
def test_long():
    pass

def test_cheap():
    pass
"""


PUBLISHED = """
def test_of_a_representative():
    assert "acrobot"

def test_of_another():
    assert "scara"
"""


def _beside_the_conftest(folder: Path) -> list[str]:
    """Options of pytest for tests of a folder, which gets a copy of this suite's ``conftest.py``."""
    tests = Path(__file__).parent
    (folder / "conftest.py").write_text((tests / "conftest.py").read_text())
    options = ["-c", str(tests.parent / "pyproject.toml"), "--rootdir", str(folder)]
    return [*options, "-o", f"pythonpath={tests}", "-p", "no:cacheprovider", "-n", "0", "-q"]


@pytest.fixture
def collected(tmp_path: Path) -> Callable[..., set[str]]:
    """The tests that pytest would run of a file beside this suite's ``conftest.py``."""
    settings = _beside_the_conftest(tmp_path)
    (tmp_path / "test_it.py").write_text(TESTS)
    (tmp_path / "systems").mkdir()
    (tmp_path / "systems" / "test_published.py").write_text(PUBLISHED)

    def collect(*arguments: str) -> set[str]:
        where = [] if "::" in str(arguments) else ["."]
        command = [sys.executable, "-m", "pytest", *settings, "--collect-only", *arguments, *where]
        # CI asks for its own set there.
        bare = {name: value for name, value in os.environ.items() if name != "PYTEST_ADDOPTS"}
        done = subprocess.run(command, cwd=tmp_path, env=bare, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stdout + done.stderr
        return {line.partition("::")[2] for line in done.stdout.splitlines() if "::" in line}

    return collect


@pytest.mark.ci
def test_the_desk_takes_what_is_representative_ci_everything_and_nights_take_turns(collected: Callable[..., set[str]]) -> None:
    names, paths = BUILT_IN.system_names(), ROBOTS
    cheap = {
        "test_cheap",
        "test_of_a_representative",
        *(f"test_over[{name}]" for name in REPRESENTATIVE),
        *(f"test_robots[{path}]" for path in REPRESENTATIVE_ROBOTS),
    }
    every = {
        "test_cheap",
        "test_whole_command",
        "test_of_a_representative",
        "test_of_another",
        *(f"test_over[{name}]" for name in names),
        *(f"test_robots[{path}]" for path in paths),
    }
    assert collected() == cheap
    assert collected("-m", "not nightly") == every
    nights = [collected("-m", "nightly", "--night", str(night)) for night in (0, 1, 2, 3)]
    assert nights[0] == nights[3] == {"test_long", "test_in_turn[0]", "test_in_turn[3]", "test_in_turn[6]"}
    assert set().union(*nights) == {"test_long", *(f"test_in_turn[{number}]" for number in range(7))}
    assert collected("-k", "collar") == {"test_over[collar]"}
    assert collected("test_it.py::test_in_turn[1]") == {"test_in_turn[1]"}


OUTLIVING = """
import subprocess, sys, time
from costs import LOOK_SECONDS

def test_it():
    # A server that ends as soon as its pipe is closed, after the process that started it.
    server = "import sys, time\\nwhile time.process_time() < 1: pass\\nprint('served', flush=True); sys.stdin.read()"
    worker = f"import subprocess, sys; subprocess.Popen([sys.executable, '-c', {server!r}], stdin=subprocess.PIPE); sys.stdin.read()"
    with subprocess.Popen([sys.executable, "-c", worker], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as working:
        working.stdout.readline()
        time.sleep(2 * LOOK_SECONDS)
        working.communicate()
"""


@pytest.mark.ci
def test_costs_hold_what_outlives_the_process_that_started_it(tmp_path: Path) -> None:
    settings = _beside_the_conftest(tmp_path)
    (tmp_path / "test_it.py").write_text(OUTLIVING)
    command = [sys.executable, "-m", "pytest", *settings, "--costs", "test", "."]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    [costs] = re.findall(r"^ +([\d.]+)  test_it.py::test_it$", done.stdout, re.MULTILINE)
    assert 0.9 < float(costs) < 2, done.stdout + done.stderr
