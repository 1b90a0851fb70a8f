"""``harness new`` writes a mechanism that agrees from the start, and ``harness show`` shows it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

SIZES = (1, 2, 3, 6)


def harness(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "harness", *arguments], capture_output=True, text=True, timeout=300, cwd=cwd, check=False)


def written(directory: Path, sizes: range | tuple[int, ...]) -> Path:
    for size in sizes:
        done = harness("new", f"mechanism_of_{size}", "--dof", str(size), "--library", ".", cwd=directory)
        assert done.returncode == 0, done.stderr
    return directory


@pytest.mark.parametrize("sizes", [SIZES, pytest.param(range(1, 13), marks=pytest.mark.nightly)], ids=["few", "all"])
def test_a_new_mechanism_agrees_and_holds_nothing_superfluous(tmp_path: Path, sizes: range | tuple[int, ...]) -> None:
    directory = written(tmp_path, sizes)
    done = harness("check", "--library", ".", "--json", "out.json", cwd=directory)
    assert done.returncode == 0, done.stdout + done.stderr
    records = json.loads((directory / "out.json").read_text())["records"]
    assert len(records) == 3 * len(sizes)
    assert {record["verdict"] for record in records} == {"agrees"}
    for path in (directory / "systems").glob("*.py"):
        assert "EDIT:" in path.read_text()


def test_nothing_is_overwritten_and_no_bad_name_is_taken(tmp_path: Path) -> None:
    directory = written(tmp_path, (1,))
    system = directory / "systems" / "mechanism_of_1.py"
    system.write_text("mine\n")
    for name, fragment in (("mechanism_of_1", "exists already"), ("2nd", "identifier"), ("_hidden", "_hidden"), ("../x", "../x")):
        done = harness("new", name, "--library", ".", cwd=directory)
        assert done.returncode == 2
        assert fragment in done.stderr
        assert "Traceback" not in done.stderr
    assert system.read_text() == "mine\n"


@pytest.mark.parametrize("name", ["cart_pendulum", "stanford_arm", "heavy_top", "chain_3"])
def test_show_tells_joints_and_what_engines_hold(tmp_path: Path, name: str) -> None:
    done = harness("show", name, "--html", "page.html", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    for fragment in ("Equations of motion", "Parameters:", "After loading:", "mujoco/mjcf", "as the system says"):
        assert fragment in done.stdout
    page = (tmp_path / "page.html").read_text()
    assert "<svg" in page
    assert 'src="http' not in page and 'href="http' not in page


def test_show_copes_with_a_missing_model(tmp_path: Path) -> None:
    directory = written(tmp_path, (1,))
    (directory / "urdf" / "mechanism_of_1.urdf").unlink()
    done = harness("show", "mechanism_of_1", "--library", ".", cwd=directory)
    assert done.returncode == 2
    assert "mechanism_of_1.urdf" in done.stderr
    assert "Equations of motion" in done.stdout
    assert "Traceback" not in done.stderr
