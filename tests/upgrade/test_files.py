"""Robots' files under two versions of an engine: a stand-in that reads URDFs of one joint, each version in an environment of its own."""

from __future__ import annotations

import importlib
import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import toy_engine
from support import BUILT_IN, Done, harness

RIGHT = toy_engine.RIGHT + "GAINS = (0.0, -5.0)\n"
VERSIONS = {
    "1.0": RIGHT,
    "1.1": RIGHT,
    # Another meaning of a servo's damping, which no acceleration without actuators feels.
    "1.2": RIGHT + "GAINS = (0.0, -3.05)\n",
    "1.3": toy_engine.HEAVIER + "GAINS = (0.0, -5.0)\n",
    # Before 2.0 it left dampers out.
    "1.4": RIGHT.replace("-0.3 * v", "0.0 * v"),
    "1.6": RIGHT.replace("-0.3 * v", "0.0 * v").replace("-5.0", "-3.05"),
    "1.7": RIGHT.replace("-0.3 * v", "0.0 * v"),
    "1.5": toy_engine.LACKING.replace("def mass", "def masses"),
}
READINGS = """
from dataclasses import replace
from harness.explain.changes.readings import _left_out, readings_of
said = ("The toy before 1.5 applies no damping", "add it to tau", "its own text, in a test")
READINGS = readings_of("toy", {("urdf",): {_left_out.dampers: said}}, ">=1.4,<1.7,!=1.5")
said = ("The toy 1.7 takes dampers for nothing", "take 1.4", "its own text, in a test")
MISREAD = readings_of("toy", {("urdf",): {replace(_left_out.dampers, name="dampers of 1.7"): said}}, "==1.7", is_misread=True)
"""
BAR = BUILT_IN.model_path("bar_pendulum", "urdf").read_text()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with bar.urdf, where the toy reads files of users."""
    root = tmp_path_factory.mktemp("toy")
    robots = root / "robots"
    robots.mkdir()
    (robots / "bar.urdf").write_text(BAR)
    with toy_engine.reading_files(root, VERSIONS) as declared:
        (declared / "toy_dampers_of_a_version.py").write_text(READINGS)
        importlib.invalidate_caches()
        yield robots


def upgraded(folder: Path, before: str, now: str, *arguments: str) -> Done:
    return harness("upgrade", "toy", before, now, *(arguments or ["bar.urdf"]), "--states", "60", "--json", "out.json", cwd=folder)


@pytest.mark.ci
def test_alike_to_rounding_is_no(folder: Path) -> None:
    done = upgraded(folder, "1.0", "1.1")
    same = "accelerations and compiled numbers are the same to rounding"
    assert (done.returncode, done.stdout) == (0, f"No: toy 1.1 does not change bar.urdf against 1.0; {same}\n")


@pytest.mark.ci
def test_a_number_that_no_acceleration_feels_is_told_and_ends_with_1(folder: Path) -> None:
    done = upgraded(folder, "1.1", "1.2")
    assert done.returncode == 1
    first, *others = done.stdout.splitlines()
    assert first == (
        "Yes: toy 1.2 changes bar.urdf against 1.1: compiled numbers by up to 39 % (gains); "
        "the accelerations that are compared are the same to rounding"
    )
    assert any(re.fullmatch(r"  gains\[1\] of servo +-5 +-3\.05 +39 %", line) for line in others), others
    [number] = json.loads((folder / "out.json").read_text())["compiled"]
    assert (number["quantity"], number["owners"], number["before"], number["now"], number["felt"]) == ("gains", ["servo"], -5, -3.05, False)


@pytest.mark.ci
def test_a_reading_that_a_version_lost_or_got_is_told_with_its_effect_and_remedy(folder: Path) -> None:
    done = upgraded(folder, "1.4", "1.0")
    assert done.returncode == 0
    assert done.stdout.startswith("Yes, for the better: toy 1.0 changes bar.urdf against 1.4: accelerations by up to ")
    line = 1 + BAR[: BAR.index("damping=")].count("\n")
    assert re.search(
        rf"^  no longer: The toy before 1.5 applies no damping: 1 joint, line {line}; \d+ % of qdd$", done.stdout, re.MULTILINE
    )
    done = upgraded(folder, "1.0", "1.4")
    assert done.returncode == 1 and done.stdout.startswith("Yes, for the worse: toy 1.4 changes bar.urdf against 1.0")
    assert "  new: The toy before 1.5 applies no damping: 1 joint" in done.stdout and "; add it to tau\n" in done.stdout


@pytest.mark.ci
def test_a_misreading_that_a_version_lost_or_got_is_told(folder: Path) -> None:
    done = upgraded(folder, "1.7", "1.0")
    assert done.returncode == 0 and "; 1.7 misreads by up to " in done.stdout
    assert "  no longer: The toy 1.7 takes dampers for nothing: 1 joint" in done.stdout
    done = upgraded(folder, "1.0", "1.7")
    assert done.returncode == 1
    assert "  new: The toy 1.7 takes dampers for nothing: 1 joint" in done.stdout and "; take 1.4\n" in done.stdout


@pytest.mark.ci
def test_what_becomes_better_beside_what_nobody_judges_is_no_improvement(folder: Path) -> None:
    done = upgraded(folder, "1.6", "1.0")
    assert done.returncode == 1
    assert done.stdout.startswith("Yes: toy 1.0 changes bar.urdf against 1.6: ") and "\nbar.urdf, toy/urdf: changed\n" in done.stdout


@pytest.mark.ci
def test_a_wrong_number_is_for_the_worse(folder: Path) -> None:
    done = upgraded(folder, "1.0", "1.3")
    assert done.returncode == 1
    assert done.stdout.startswith("Yes, for the worse: toy 1.3 changes bar.urdf against 1.0: accelerations by up to ")
    assert "  1.3 is off by up to " in done.stdout


@pytest.mark.ci
def test_what_was_not_asked_about_stands_in_the_first_lines_and_must_be_allowed(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "bar.urdf"
    ball = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    path.write_text(BAR.replace("<inertial>", f"{ball}\n<inertial>"))
    line = 1 + path.read_text()[: path.read_text().index(ball)].count("\n")
    done = upgraded(folder, "1.0", "1.1", str(path))
    assert done.returncode == 1
    assert done.stdout.splitlines()[:2] == [
        "No: toy 1.1 does not change bar.urdf against 1.0; accelerations and compiled numbers are the same to rounding",
        f"not compared: contacts, line {line} (exit status 1; --allow-uncompared accepts it)",
    ]
    [left_out] = json.loads((folder / "out.json").read_text())["not_compared"]
    assert left_out == {"name": "bar.urdf", "what": "contacts", "lines": [line]}
    done = upgraded(folder, "1.0", "1.1", str(path), "--allow-uncompared")
    assert (done.returncode, done.stdout.splitlines()[1]) == (0, f"not compared: contacts, line {line}")
    assert upgraded(folder, "1.1", "1.2", str(path), "--allow-uncompared").returncode == 1


@pytest.mark.ci
def test_robots_of_several_folders_and_of_one_name_are_told_apart(folder: Path, tmp_path: Path) -> None:
    for place in ("old", "new"):
        (tmp_path / place).mkdir()
        (tmp_path / place / "bar.urdf").write_text(BAR if place == "old" else BAR.replace('damping="0.3"', 'damping="0"'))
    paths = [str(tmp_path / place / "bar.urdf") for place in ("old", "new")]
    done = upgraded(folder, "1.4", "1.0", *paths)
    # What the second says is what 1.4 takes of either, and 1.0 has the damper of the first in its program.
    assert "toy 1.0 changes 2 of 2 files against 1.4 (new/bar.urdf, old/bar.urdf): " in done.stdout.splitlines()[0]
    assert "old/bar.urdf, toy/urdf: better" in done.stdout and "new/bar.urdf, toy/urdf: worse" in done.stdout


@pytest.mark.ci
def test_files_of_which_the_same_is_said_are_told_together_and_those_without_an_answer_named(folder: Path, tmp_path: Path) -> None:
    for name in ("one", "other"):
        (tmp_path / f"{name}.urdf").write_text(BAR)
    (tmp_path / "mute.urdf").write_text(BAR.replace('"pin"', '"mute"'))
    paths = [str(tmp_path / f"{name}.urdf") for name in ("one", "other", "mute")]
    done = upgraded(folder, "1.1", "1.2", *paths)
    assert done.stdout.startswith("Yes: toy 1.2 changes 2 of 2 files against 1.1 (one.urdf, other.urdf): ")
    assert "\nnot compared: neither version answers about mute.urdf (exit status 1; --allow-uncompared accepts it)\n" in done.stdout
    assert done.stdout.count("compiled number ") == 1 and "\none.urdf, other.urdf, toy/urdf: changed\n" in done.stdout
    done = upgraded(folder, "1.0", "1.1", *paths)
    assert done.returncode == 1 and done.stdout.startswith("No: toy 1.1 changes none of 2 files against 1.0; accelerations and compiled ")
    assert upgraded(folder, "1.0", "1.1", *paths, "--allow-uncompared").returncode == 0


@pytest.mark.ci
def test_a_refusal_of_one_is_no_agreement(folder: Path) -> None:
    done = upgraded(folder, "1.5", "1.0")
    assert done.returncode == 0 and "for the better" in done.stdout and "1.5 refuses it: toy_engine 1.5 has no mass" in done.stdout
