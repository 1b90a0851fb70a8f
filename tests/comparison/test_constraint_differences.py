"""What two files say beside their equations of motion: each planted difference is told with both lines, and is no robot's sameness."""

from __future__ import annotations

from pathlib import Path

import pytest
from comparison.robots import FILES, edited, line_of, meant_by

from harness.comparison.sameness import hold_against
from harness.explain.meant import largest_change
from harness.results.comparison import PairRecord
from harness.results.pair_conclusion import conclude_pair
from harness.trees.robot import read_robot

TEXT = """<mujoco><compiler angle="radian"/><default><motor ctrlrange="-1 1"/></default><worldbody>
<body name="a"><joint name="j1" axis="0 1 0" range="-1 1" limited="true" frictionloss="0.1"/><geom size="0.1" mass="1" pos="0 0 -0.5"/>
<body name="b" pos="0 0 -1"><joint name="j2" axis="0 1 0"/><geom size="0.1" mass="2" pos="0 0 -0.5"/>
<body name="c" pos="0 0 -1"><joint name="j3" axis="1 0 0"/><geom size="0.1" mass="3" pos="0 0 -0.5"/></body></body></body>
</worldbody><equality>
<joint joint1="j1" joint2="j2" polycoef="0 1 0 0 0"/>
<connect body1="c" anchor="0 0 -1"/>
</equality><actuator>
<motor joint="j1" gear="10"/>
</actuator></mujoco>
"""
COUPLING, CONNECT = 'polycoef="0 1 0 0 0"/>', '<connect body1="c" anchor="0 0 -1"/>'
# What stands in the first, what in the second, what is said of it, and whether its effect is judged.
PLANTED = {
    "coefficient": (COUPLING, 'polycoef="0 1.0000001 0 0 0"/>', "joint equality of j1 and j2", True),
    "solref": (COUPLING, 'polycoef="0 1 0 0 0" solref="0.04 1"/>', "joint equality of j1 and j2", True),
    "solimp": (CONNECT, '<connect body1="c" anchor="0 0 -1" solimp="0.8 0.95 0.001"/>', "point equality of c and world", True),
    "switched off": (COUPLING, 'polycoef="0 1 0 0 0" active="false"/>', "joint equality of j1 and j2", True),
    "removed": (CONNECT, "", "point equality of c and world", True),
    "point": (CONNECT, '<connect body1="c" anchor="0 0 -0.9"/>', "point equality of c and world", True),
    "limit": (' range="-1 1"', ' range="-1 1.5"', "limits of joint j1", False),
    "no limit": ('range="-1 1" limited="true"', "", "limits of joint j1", False),
    "friction": ('frictionloss="0.1"', 'frictionloss="0.2"', "dry friction of joint j1", False),
    "gear": ('gear="10"', 'gear="11"', "actuators of joint j1", False),
    "class": ('ctrlrange="-1 1"', 'ctrlrange="-2 1"', "actuators of joint j1", False),
    "contact": ('mass="3"', 'mass="3" solref="0.01 1"', "contacts of link c", False),
}


@pytest.fixture
def base(tmp_path: Path) -> Path:
    path = tmp_path / "robot.xml"
    path.write_text(TEXT)
    return path


def pair(first: Path, second: Path, **renamed: str) -> PairRecord:
    return hold_against(meant_by(first), read_robot(second), renamed)


@pytest.mark.parametrize("kind", PLANTED)
def test_a_planted_difference_is_told_with_both_lines(kind: str, base: Path, tmp_path: Path) -> None:
    before, after, what, is_judged = PLANTED[kind]
    (tmp_path / "other").mkdir()
    other = edited(base, tmp_path / "other", (before, after))
    found = pair(base, other)
    (difference,) = found.constraints
    assert not found.same and found.alike and not found.differences
    assert (difference.what, difference.is_judged) == (what, is_judged)
    assert difference.first != difference.second and difference.first_place
    if kind not in ("class", "removed"):
        assert difference.second_place == f"robot.xml:{line_of(other, after or 'frictionloss')}"
    if is_judged:
        assert difference.alone is not None and difference.alone > 0
    assert "move alike" in conclude_pair(found).sentence and what in conclude_pair(found).sentence


def test_a_coefficient_moves_accelerations_in_proportion(base: Path, tmp_path: Path) -> None:
    alone = []
    for size in ("1.0000001", "1.000001"):
        (tmp_path / size).mkdir()
        found = pair(base, edited(base, tmp_path / size, (COUPLING, f'polycoef="0 {size} 0 0 0"/>')))
        alone.append(found.constraints[0].alone)
    assert alone[0] is not None and alone[1] == pytest.approx(10 * alone[0], rel=1e-3)


def test_a_copy_differs_in_nothing_and_names_what_was_compared(base: Path, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    found = pair(base, edited(base, tmp_path / "other"))
    assert found.same and not found.constraints and not found.not_held
    renamed = tmp_path / "other" / "renamed.xml"
    renamed.write_text(TEXT.replace('"j1"', '"first"').replace('"j2"', '"second"'))
    assert pair(base, renamed, j1="first", j2="second").same


def test_what_is_about_joints_that_stand_still_is_no_difference(base: Path, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    changes = ('<motor joint="j1" gear="10"/>', ""), ('<joint joint1="j1" joint2="j2" polycoef="0 1 0 0 0"/>', ""), (' range="-1 1"', "")
    other = edited(base, tmp_path / "other", *changes)
    assert len(pair(base, other).constraints) == 3
    assert hold_against(meant_by(base), read_robot(other), {}, ["j1"]).same
    gripper = edited(FILES / "mimic.urdf", tmp_path, ('<joint name="right" type="prismatic">', '<joint name="right" type="fixed">'))
    gripper.write_text(gripper.read_text().replace('<mimic joint="left" multiplier="0.75" offset="0.125"/>', ""))
    assert pair(FILES / "mimic.urdf", gripper).constraints == []


def test_limits_of_a_urdf_are_held_against_those_of_an_mjcf(tmp_path: Path) -> None:
    """Contacts and actuators have other words there, and are named as not compared."""
    wider = edited(FILES / "arm.urdf", tmp_path, ('upper="0.5"', 'upper="0.75"'))
    found = pair(wider, FILES / "arm.xml")
    assert not found.same and [one.what for one in found.constraints] == ["limits of joint elbow"]
    assert found.constraints[0].first_place == f"arm.urdf:{line_of(wider, '0.75')}"
    actuated = tmp_path / "actuated.xml"
    actuated.write_text((FILES / "arm.xml").read_text().replace("</mujoco>", '<actuator><motor joint="elbow"/></actuator></mujoco>'))
    assert pair(FILES / "arm.urdf", actuated).not_held == ["actuators (0 and 1)"]


def test_an_effect_is_the_change_of_certified_accelerations(base: Path) -> None:
    truth = meant_by(base).truth
    assert largest_change(truth, truth.high, truth.certified) == pytest.approx(0.0, abs=1e-15)
