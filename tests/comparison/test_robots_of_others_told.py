"""What is said of robots of others, files and pairs of them: the answer first, and how long it is. Needs the extra ``robots``."""

from __future__ import annotations

import re
from importlib.metadata import distribution
from pathlib import Path

import pytest
from support import harness

pytestmark = [pytest.mark.nightly, pytest.mark.robots]

# Files that every engine takes alike, that engines take otherwise or refuse, of which nothing moves, and that nobody can read.
# The first fragment is how the sentence begins.
FILES: dict[str, tuple[str, ...] | None] = {
    "panda.urdf": (
        "With the file's 1 equality, 9 joint limits and contacts on MuJoCo agrees with its documentation, ",
        "With all of it off MuJoCo and Pinocchio disagree with each other and with the file.",
        "Pinocchio's ABA applies no joint damping (47 % of qdd)",
    ),
    "ur5_robot.urdf": ("MuJoCo and Pinocchio agree with the file to rounding",),
    "bolt.urdf": ("Pinocchio agrees with the file, and MuJoCo does not. MuJoCo drops the inertia of a link of mass 0",),
    "talos_reduced.urdf": (
        "With the file's dry friction in 20 places, 32 joint limits and contacts on MuJoCo agrees with its documentation, ",
        "With all of it off MuJoCo agrees with the file, and Pinocchio does not. pin.aba applies no dry friction (",
        "Pinocchio's ABA applies no joint damping (",
    ),
    "baxter.urdf": (
        "With the file's 2 equalities, 19 joint limits and contacts on MuJoCo agrees with its documentation, ",
        "With all of it off MuJoCo and Pinocchio disagree with each other and with the file.",
    ),
    "hyq_no_sensors.urdf": (
        "Pinocchio does not agree with the file. Off: contacts and joint limits. Pinocchio's ABA applies no joint damping (",
    ),
    "icub.urdf": ("Pinocchio does not agree with the file.",),
    "human.urdf": ("Pinocchio agrees with the file to rounding",),
    "romeo.urdf": ("no engine gives an answer that can be judged. Off: contacts and joint limits. MuJoCo refuses the file: ",),
    "iris_simple.urdf": ("no engine was asked, for no joint moves",),
    "ur3.urdf": None,
}
PAIRS = {
    ("ur5_robot.urdf", "ur10_robot.urdf"): "differ: ",
    ("ur5_robot.urdf", "ur5_joint_limited_robot.urdf"): "move alike (",
    ("talos_reduced.urdf", "talos_full_v2.urdf"): "differ: ",
    ("panda.urdf", "panda_collision.urdf"): "move alike (",
}


def robot(name: str) -> str:
    files = distribution("example-robot-data").files or []
    return next(str(file.locate()) for file in files if Path(str(file)).name == name)


@pytest.mark.parametrize("name", FILES)
def test_a_file_is_answered_first_and_in_15_lines(name: str, tmp_path: Path) -> None:
    done = harness("compare", robot(name), "--states", "8", cwd=tmp_path)
    first, *rows = done.stdout.splitlines()
    said = FILES[name]
    begins, *fragments = [f"{name} cannot be read: line "] if said is None else [f"{name}: {said[0]}", *said[1:]]
    assert first.startswith(begins)
    assert [fragment for fragment in fragments if fragment not in first] == []
    assert len(rows) <= 14
    assert not re.search(r"\[\d+\]|\de-[34]\d", done.stdout), "internal names, and numbers that are none"


@pytest.mark.parametrize("names", PAIRS)
def test_a_pair_is_answered_first_and_in_30_lines(names: tuple[str, str], tmp_path: Path) -> None:
    done = harness("compare", *map(robot, names), "--states", "8", cwd=tmp_path)
    first, *rows = done.stdout.splitlines()
    assert first.startswith(f"{' and '.join(names)} {PAIRS[names]}")
    assert len(rows) <= 29
    assert not re.search(r"\[\d+\]|\de-[34]\d", done.stdout)
