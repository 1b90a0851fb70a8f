"""The base is enough for robots: compare, check and pytest need no package of an extra, and other commands say what to install."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib.metadata import packages_distributions
from pathlib import Path

import numpy as np
import pytest
from packaging.requirements import Requirement
from rooms import PACKAGE, REPOSITORY
from support import harness

from harness import load
from harness.engines import describe_engines
from harness.errors import DISTRIBUTION, EXTRAS, InvalidRequest, require
from harness.lagrange.derivation import load_mechanism
from harness.library import Library
from harness.workers import Workers

PROJECT = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
ROBOTS = PACKAGE / "robots"
# Every process of a command imports this first.
BLOCK = f"""
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {sorted([*EXTRAS, "dask"])}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Blocked())
"""


@pytest.fixture
def without_extras(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    for module in EXTRAS:
        monkeypatch.setitem(sys.modules, module, None)
    yield
    monkeypatch.undo()
    # A process keeps what it has found of engines.
    describe_engines(Library.built_in(), Workers)


def in_a_base_install(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """A command of Python in ``folder``, in whose processes no package of an extra can be imported."""
    (folder / "sitecustomize.py").write_text(BLOCK)
    paths = {"PYTHONPATH": os.pathsep.join([str(folder), str(REPOSITORY)])}
    return subprocess.run(
        [sys.executable, "-m", *command], cwd=folder, env=os.environ | paths, capture_output=True, text=True, timeout=300, check=False
    )


@pytest.mark.ci
@pytest.mark.parametrize("command", ["compare", "check", "diagnose", "bench", "survey"])
def test_a_robot_s_file_needs_no_extra(tmp_path: Path, command: str) -> None:
    given = str(ROBOTS / "gripper.urdf")
    done = in_a_base_install(tmp_path, "harness", command, given, *(["--urdf", given] if command == "diagnose" else []))
    assert done.returncode == 0, done.stdout + done.stderr
    assert "not installed" not in done.stdout + done.stderr


@pytest.mark.ci
def test_a_mechanism_is_checked_without_the_harness_s_own_code(tmp_path: Path) -> None:
    done = in_a_base_install(tmp_path, "harness", "check", "double_pendulum", "--states", "20")
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.startswith("double_pendulum: all 4 subjects agree")


@pytest.mark.ci
def test_the_pytest_plugin_needs_no_extra(tmp_path: Path) -> None:
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "arm.urdf").write_text((ROBOTS / "arm.urdf").read_text())
    done = in_a_base_install(tmp_path, "pytest", "-p", "no:xdist", "-q", "--harness-robots", "robots")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 passed" in done.stdout


@pytest.mark.parametrize(
    ("command", "extras"),
    [
        ("report", "report"),
        ("search double_pendulum", "search"),
        ("nightly", "lagrange,report,search"),
        ("bench", "lagrange,report"),
        ("bench {robot} --motion", "lagrange"),
        ("atlas", "report"),
        ("atlas --motion", "lagrange,report"),
        ("check double_pendulum --scheduler tcp://127.0.0.1:1", "cluster"),
    ],
)
def test_a_command_says_at_once_what_to_install(without_extras: None, tmp_path: Path, command: str, extras: str) -> None:
    done = harness(*command.format(robot=ROBOTS / "arm.urdf").split(), cwd=tmp_path, isolated=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch(rf"harness: .+ (is|are) not installed; pip install '{DISTRIBUTION}\[{extras}\]', or .* in a clone\n", done.stderr)
    assert list(tmp_path.iterdir()) == []


def test_an_engine_s_extra_is_named_where_it_is_asked(without_extras: None, tmp_path: Path) -> None:
    done = harness("check", "double_pendulum", "--subject", "lagrange", "--states", "10", cwd=tmp_path)
    assert done.returncode == 1
    assert f"heyoka is not installed; pip install '{DISTRIBUTION}[lagrange]'" in done.stdout


def test_a_motion_in_python_says_what_to_install(without_extras: None) -> None:
    with pytest.raises(InvalidRequest, match=r"heyoka is not installed; pip install .*\[lagrange\]"):
        load("double_pendulum").simulate(q=[0.1, 0.2], v=[0.0, 0.0], seconds=1)


def test_where_heyoka_has_no_wheels_its_source_is_named(without_extras: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "darwin")
    with pytest.raises(InvalidRequest, match=r"wheels are for Linux alone, and conda-forge has heyoka\.py"):
        load_mechanism(Library.built_in(), "double_pendulum").float64().terms(*np.zeros((3, 1, 2)))


# What is declared


def distribution_of(module: str) -> str:
    """The one distribution that is not called as its module."""
    return {"pxr": "usd-core"}.get(module, module)


def declared(requirements: list[str]) -> set[str]:
    return {Requirement(one).name for one in requirements}


def test_the_extra_that_is_named_installs_its_module() -> None:
    for module, extra in EXTRAS.items():
        assert distribution_of(module) in declared(PROJECT["optional-dependencies"][extra])
    assert not declared(PROJECT["dependencies"]) & set(map(distribution_of, EXTRAS))
    assert PROJECT["name"] == DISTRIBUTION


def test_what_extras_install_the_tests_have_in_the_same_versions() -> None:
    for extra in EXTRAS.values():
        assert set(PROJECT["optional-dependencies"][extra]) <= set(PROJECT["optional-dependencies"]["test"])


def imported(file: Path) -> set[str]:
    """The packages that a module imports, wherever in it, without those for type checkers alone."""
    found: set[str] = set()
    nodes = [ast.parse(file.read_text(encoding="utf-8"))]
    while nodes:
        node = nodes.pop()
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            found.add((node.module or "").partition(".")[0])
        nodes += ast.iter_child_nodes(node)
    return found - set(sys.stdlib_module_names) - {"harness"}


@pytest.mark.ci
def test_everything_that_is_imported_is_declared() -> None:
    """Outside the files of engines, each of which declares its own program."""
    everywhere = {name: file for file in PACKAGE.rglob("*.py") if not {"adapters", "systems"} & set(file.parts) for name in imported(file)}
    known = packages_distributions()
    base, extras = declared(PROJECT["dependencies"]), set(EXTRAS)
    # Pinocchio's and MuJoCo's distributions have parts that hold their modules.
    named = {"pinocchio": "pin", "mujoco": "mujoco", "flint": "python-flint"}
    missing = {name: file for name, file in everywhere.items() if not {named.get(name, ""), name, *known.get(name, [])} & (base | extras)}
    assert missing == {}
    used = {one for name in everywhere for one in (named.get(name, ""), name, *known.get(name, []))} | {"mujoco", "pin"}
    assert base - used == set()


def test_a_module_inside_a_package_that_is_not_there_is_not_installed() -> None:
    require("numbers have arrays", "numpy", "numpy.linalg")
    with pytest.raises(InvalidRequest, match=r"^a report has charts: no_such_package\.inner is not installed$"):
        require("a report has charts", "numpy", "no_such_package.inner")
