"""The robots that come with the harness: public, the same in both formats, and answered by every plain engine."""

from __future__ import annotations

from pathlib import Path

import pytest
from support import InThisProcess, completed

from harness.comparison.collection import find_files
from harness.comparison.study import ComparisonSettings, RobotComparison
from harness.library import Library, Stance, robots_folder
from harness.results.comparison import FilesComparison

FOLDER = robots_folder(Library.built_in())
FILES = find_files([str(FOLDER)])


@pytest.fixture(scope="module")
def found() -> FilesComparison:
    settings = ComparisonSettings(FILES, states=16, pairs=(), stances=(Stance.PLAIN,), subjects=SUBJECTS)
    return completed(RobotComparison(settings), InThisProcess())


# Those that are installed with the harness.
SUBJECTS = [f"{engine}/{form}" for engine in ("mujoco", "pinocchio") for form in ("mjcf", "urdf")]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_each_file_says_that_it_is_in_the_public_domain(path: Path) -> None:
    assert "Licence: CC0 1.0" in path.read_text()


@pytest.mark.ci
def test_every_file_means_a_robot_that_a_body_can_be_and_every_engine_answers_on_it(found: FilesComparison) -> None:
    assert {Path(file.path).name for file in found.files} == {path.name for path in FILES} and len(FILES) == 5
    assert not any(file.problem or file.impossible or file.undecided for file in found.files)
    assert {Path(file.path).name: file.degrees_of_freedom for file in found.files if file.format == "urdf"} == {
        "arm.urdf": 6, "gripper.urdf": 2, "quadruped.urdf": 18,
    }  # fmt: skip
    assert found.as_expected and len(found.subjects) == 2 * len(FILES)


def test_what_an_engine_reads_otherwise_is_named(found: FilesComparison) -> None:
    readings = {(Path(one.path).name, one.engine): [reading.name for reading in one.readings] for one in found.subjects}
    assert readings["arm.urdf", "pinocchio"] == readings["arm.xml", "pinocchio"] == ["joint damping"]
    assert readings["gripper.urdf", "mujoco"] == readings["gripper.urdf", "pinocchio"] == ["mimic joints"]
    assert not any(names for (name, engine), names in readings.items() if "quadruped" in name or (engine == "mujoco" and "arm" in name))


@pytest.mark.parametrize("name", ["arm", "quadruped"])
def test_the_formats_of_a_robot_say_the_same(name: str) -> None:
    paths = [FOLDER / f"{name}.urdf", FOLDER / f"{name}.xml"]
    [pair] = completed(RobotComparison(ComparisonSettings(paths, states=16, stances=())), InThisProcess()).pairs
    assert pair.same and (pair.backward_error or 0.0) < 1 and not [one for one in pair.differences if one.alone]
