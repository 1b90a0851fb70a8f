"""Why what a reader makes of a file has no accelerations at the states of the file."""

from __future__ import annotations

from pathlib import Path

import pytest
from catalogue import BUILT_IN

from harness.comparison.robot_library import RobotLibrary
from harness.engines import Unsupported
from harness.explain.as_read import FileAsRead, Folded, fold
from harness.explain.changes.readings import find_readings
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import Robot, read_robot

LINK = '<link name="{}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
JOINT = '<joint name="{}" type="continuous"><parent link="{}"/><child link="{}"/></joint>'


def robot(folder: Path, text: str) -> Robot:
    path = folder / "robot.urdf"
    path.write_text(f'<robot name="robot">{text}</robot>')
    return read_robot(path)


@pytest.mark.parametrize(
    ("read", "why"),
    [
        (LINK.format("a") + LINK.format("b") + JOINT.format("pin", "a", "b"), ""),
        (LINK.format("a"), "no joint is left"),
        (LINK.format("a") + LINK.format("b") + JOINT.format("other", "a", "b"), "it has joints that the file does not have: other"),
        (LINK.format("a") + '<link name="b"/>' + JOINT.format("pin", "a", "b"), "no acceleration is determined"),
    ],
)
def test_one_reason_is_enough(read: str, why: str, tmp_path: Path) -> None:
    original = robot(tmp_path, LINK.format("a") + LINK.format("b") + JOINT.format("pin", "a", "b"))
    found = FileAsRead(BUILT_IN, "pinocchio", mechanism_of(original), original, Folded(robot(tmp_path, read), ()))
    assert found.why_not.startswith(why) and bool(found.why_not) == bool(why)


def test_a_reading_that_leaves_nothing_is_told_with_its_remedy() -> None:
    """PhysX lets the first body float by a joint that is none of the file's: whoever checks the file learns what to write."""
    path = Path(__file__).parents[2] / "docs" / "examples" / "roots-on-bodies.usda"
    mechanism = RobotLibrary.of([str(path)]).own_mechanism(str(path))
    original = read_robot(path)
    found = FileAsRead(RobotLibrary.of([str(path)]), "physx", mechanism, original, fold(original, find_readings("physx", "usd")))
    with pytest.raises(Unsupported, match=r"does not have: \(base of upper\) \(PhysX lets a body with \w+ float.*: put a base with mass"):
        _ = found.computed
