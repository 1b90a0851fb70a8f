"""``harness survey --against``: which robots differ from an earlier state of the folder, and what of them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from rooms import PACKAGE
from support import Done, harness

ASKED = ("--states", "8", "--subject", "pinocchio", "--against", "old")
WITH_A_PART = """<mujoco><include file="part.xml"/><worldbody><body name="bar">
<joint name="hinge" axis="0 1 0"/><inertial pos="0 0 -0.2" mass="1" diaginertia="0.02 0.02 0.001"/></body></worldbody></mujoco>"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with robots as they are and, in ``old``, as they were: equal."""
    for place in (tmp_path / "robots", tmp_path / "old" / "robots"):
        place.mkdir(parents=True)
        for name in ("arm.urdf", "quadruped.xml"):
            shutil.copy(PACKAGE / "robots" / name, place)
        (place / "bar.xml").write_text(WITH_A_PART)
        (place / "part.xml").write_text("<mujoco><option gravity='0 0 -9.81'/></mujoco>")
    return tmp_path


def survey(folder: Path, *options: str) -> Done:
    return harness("survey", "robots", *ASKED, *options, cwd=folder)


@pytest.mark.ci
def test_robots_that_are_as_they_were_are_counted(folder: Path) -> None:
    arm = folder / "robots" / "arm.urdf"
    arm.write_text(arm.read_text().replace("<robot", "<!-- with a remark -->\n<robot", 1))
    done = survey(folder)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[0] == "3 robots: none differs from old."
    assert not (folder / "reports").exists()


@pytest.mark.ci
def test_what_came_what_went_and_what_cannot_be_read_any_more_is_told(folder: Path) -> None:
    robots = folder / "robots"
    shutil.copy(robots / "arm.urdf", robots / "second.urdf")
    (robots / "quadruped.xml").unlink()
    (robots / "arm.urdf").write_text((robots / "arm.urdf").read_text().replace('<mass value="4"/>', '<mass value="four"/>'))
    lines = survey(folder).stdout.splitlines()
    assert lines[0] == "3 of 4 robots differ from old: robots/arm.urdf, robots/quadruped.xml, robots/second.urdf."
    assert lines[1].startswith("  robots/arm.urdf: cannot be read: line 26: ")
    assert lines[3] == "  robots/quadruped.xml: no longer there."
    assert lines[4] == "  robots/second.urdf: new."
    assert lines[5].startswith("    engines: pinocchio/urdf explained: joint damping")


@pytest.mark.ci
def test_a_file_that_another_includes_makes_it_another_robot(folder: Path) -> None:
    (folder / "robots" / "part.xml").write_text("<mujoco><option gravity='0 0 -1.62'/></mujoco>")
    done = survey(folder, "--json", "out.json", "--markdown", "out.md")
    assert done.stdout.startswith("1 of 3 robots differs from old: robots/bar.xml.\n  robots/bar.xml: ")
    [pair] = json.loads((folder / "out.json").read_text())["pairs"]
    assert not pair["same"]
    text = (folder / "out.md").read_text()
    assert text.startswith("**1 of 3 robots differs from old: robots/bar.xml.**\n\n- robots/bar.xml: ")
    assert "\n  - engines: pinocchio/mjcf " in text and "| quadruped.xml |" in text


def test_the_earlier_state_may_lie_in_a_place(folder: Path) -> None:
    done = harness("survey", ".", *ASKED, cwd=folder)
    assert done.stdout.splitlines()[0] == "3 robots: none differs from old."


@pytest.mark.parametrize(
    ("places", "options", "said"),
    [
        (("robots",), ("--against", "nowhere"), "nowhere: is no folder; name one that holds an earlier state of the current folder"),
        (("../other",), ("--against", "old"), "../other does not lie in the current folder, of which old is an earlier state"),
        (("robots",), ("--subject", "nobody"), "no subject is called 'nobody'"),
    ],
)
def test_what_cannot_be_compared_is_refused(folder: Path, places: tuple[str, ...], options: tuple[str, ...], said: str) -> None:
    done = harness("survey", *places, *options, cwd=folder)
    assert done.returncode == 2 and said in done.stderr
