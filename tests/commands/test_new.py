"""``harness new`` writes a mechanism and an engine that agree from the start, and nothing else."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from catalogue import STATES
from support import harness, records_of

from harness.commands.new import write_example
from harness.errors import InvalidInput, InvalidRequest
from harness.library import Library

SIZES = (1, 3)


def written(directory: Path, sizes: range | tuple[int, ...]) -> Path:
    for size in sizes:
        done = harness("new", f"mechanism_of_{size}", "--dof", str(size), "--library", ".", cwd=directory)
        assert done.returncode == 0, done.stderr
    return directory


@pytest.mark.ci
@pytest.mark.parametrize("sizes", [SIZES, pytest.param(range(1, 13), marks=pytest.mark.nightly)], ids=["few", "all"])
def test_a_new_mechanism_agrees_and_holds_nothing_superfluous(tmp_path: Path, sizes: range | tuple[int, ...]) -> None:
    directory = written(tmp_path, sizes)
    done = harness("check", "--library", ".", "--states", str(STATES), "--json", "out.json", cwd=directory)
    assert done.returncode == 0, done.stdout + done.stderr
    assert json.loads((directory / "out.json").read_text())["superfluous"] == []
    records = records_of(directory / "out.json")
    assert len(records) == 5 * len(sizes)
    assert {record["verdict"] for record in records} == {"agrees"}
    for path in (directory / "systems").glob("*.py"):
        assert "EDIT:" in path.read_text()


@pytest.mark.ci
def test_a_new_engine_agrees_on_a_new_mechanism(tmp_path: Path) -> None:
    # Of a name of those above, so that it is not derived again.
    done = harness("new", "mechanism_of_3", "--dof", "3", "--engine", "solver", "--library", "mine", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "EDIT:" in (tmp_path / "mine" / "engines" / "solver.py").read_text()
    done = harness("check", "--library", "mine", "--subject", "solver/urdf", "--states", str(STATES), "--json", "out.json", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    [record] = records_of(tmp_path / "out.json")
    assert (record["subject"], record["verdict"]) == ("solver/urdf", "agrees")


@pytest.mark.ci
def test_a_fault_in_a_new_engine_is_caught(tmp_path: Path) -> None:
    *_, engine = write_example(tmp_path, "plate", engine="solver")
    text = engine.read_text()
    engine.write_text(text.replace("element.damping * v", "element.damping * 1.000001 * v"))
    assert engine.read_text() != text
    state = '{"q": [0.5], "v": [1.0], "tau": [0.0]}'
    done = harness("check", "plate", "--library", ".", "--subject", "solver/urdf", "--state", state, cwd=tmp_path)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "plate solver/urdf: disagrees" in done.stdout


def test_nothing_is_overwritten_and_no_bad_name_is_taken(tmp_path: Path) -> None:
    directory = written(tmp_path, (1,))
    system = directory / "systems" / "mechanism_of_1.py"
    system.write_text("mine\n")
    for name, fragment in (("mechanism_of_1", "exists already"), ("2nd", "identifier")):
        done = harness("new", name, "--library", ".", cwd=directory)
        assert done.returncode == 2
        assert fragment in done.stderr
        assert "Traceback" not in done.stderr
    assert system.read_text() == "mine\n"


@pytest.mark.parametrize(
    ("name", "engine", "fragment"),
    [
        ("class", None, "identifier"),
        ("café", None, "identifier"),
        ("_hidden", None, "_hidden"),
        ("../x", None, "../x"),
        ("sympy", None, "Python module"),
        ("json", None, "Python module"),
        ("twin_7", None, "has a system called"),
        ("twin_9", None, "has a system called"),
        ("plates", "mujoco", "would hide"),
        ("plates", "2nd", "identifier"),
        (None, "solver", "no mechanism"),
    ],
)
def test_names_that_cannot_be_are_refused_and_nothing_is_written(
    tmp_path: Path, name: str | None, engine: str | None, fragment: str
) -> None:
    before = []
    if name is not None:
        (tmp_path / "systems").mkdir()
        (tmp_path / "systems" / "twin.py").write_text("SIZES = (7,)\n")
        before = ["systems", "twin.py"]
    with pytest.raises((InvalidInput, InvalidRequest), match=fragment):
        write_example(tmp_path, name, engine=engine)
    assert sorted(path.name for path in tmp_path.rglob("*")) == before


def test_the_harness_itself_is_left_alone() -> None:
    built_in = Library.built_in()
    for directory in (built_in.models, built_in.systems, built_in.systems.parent):
        with pytest.raises(InvalidInput, match="library of your own"):
            write_example(directory, "never_written")


def test_all_three_files_are_written_or_none(tmp_path: Path) -> None:
    (tmp_path / "urdf").write_text("a file where a folder should be")
    with pytest.raises(InvalidInput, match="nothing was made"):
        write_example(tmp_path, "partial", engine="solver")
    assert list(tmp_path.rglob("partial.*")) == []


@pytest.mark.parametrize("size", [*SIZES, 12])
def test_the_example_is_python_of_our_own_style(tmp_path: Path, size: int) -> None:
    system, *models, engine = write_example(tmp_path, "example", size, "solver")
    settings = Path(__file__).resolve().parents[2] / "pyproject.toml"
    for command in (["check", "--config", 'lint.isort.known-first-party=["harness"]'], ["format", "--check"]):
        done = subprocess.run(
            [sys.executable, "-m", "ruff", *command, "--config", str(settings), str(system), str(engine)], capture_output=True, text=True
        )
        assert done.returncode == 0, done.stdout
    for model in models:
        assert "EDIT:" in model.read_text()
