"""Several files of one robot: what is the same stays the same in other words, and a wrong number is named with file and line."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from comparison.robots import FILES, edited, line_of, meant_by

from harness.comparison.matching import match, renamed_to
from harness.comparison.sameness import hold_against
from harness.results.comparison import PairRecord
from harness.results.pair_conclusion import conclude_pair
from harness.trees.canonical import canonical
from harness.trees.robot import read_robot

URDF, MJCF = FILES / "arm.urdf", FILES / "arm.xml"


def pair(first: Path, second: Path, **renamed: str) -> PairRecord:
    return hold_against(meant_by(first), read_robot(second), renamed)


def test_two_formats_of_one_robot_are_one_robot() -> None:
    """The MJCF fuses nothing and holds one inertia in a turned frame of its own."""
    found = pair(URDF, MJCF)
    assert found.same and not found.problem and found.backward_error is not None and found.backward_error < 4


# What stands in both files, the text in the URDF and its number, and how the difference begins.
PLANTED = {
    "mass": ('<mass value="1"/>', 1.0, '<mass value="{}"/>', "mass of link fore"),
    "com": ('xyz="0 0 -0.1875"', -0.1875, 'xyz="0 0 {}"', "centre of mass z of link fore"),
    "inertia": ('ixx="0.015625"', 0.015625, 'ixx="{}"', "ixx of link fore"),
    "origin": ('xyz="0 0.0625 -0.5"', -0.5, 'xyz="0 0.0625 {}"', "origin z of link fore"),
    "orientation": ('rpy="0.25 0 0"', 0.25, 'rpy="{} 0 0"', "origin roll of link upper"),
    "axis": ('<axis xyz="1 0 0"/>', 0.0, '<axis xyz="1 {} 0"/>', "axis y of joint elbow"),
    "damping": ('damping="0.5"', 0.5, 'damping="{}"', "damping of joint shoulder"),
}
SIZES = [1e-9, 1e-5, 1e-1]


def _planted(kind: str, size: float, folder: Path) -> tuple[Path, str, str]:
    """The URDF with one number wrong by ``size``, the text that stands there then, and what is to be said of it."""
    text, value, form, what = PLANTED[kind]
    wrong = form.format(repr(value * (1 + size) if value else size))
    return edited(URDF, folder, (text, wrong)), wrong, what


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("kind", PLANTED)
def test_a_wrong_number_of_a_copy_is_named_with_its_line(kind: str, size: float, tmp_path: Path) -> None:
    copy, wrong, what = _planted(kind, size, tmp_path)
    found = pair(URDF, copy)
    assert not found.same
    (difference,) = found.differences
    assert (difference.what, difference.second_place) == (what, f"arm.urdf:{line_of(copy, wrong)}")
    assert difference.alone is not None and difference.alone == pytest.approx(found.relative_error, rel=0.5)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("kind", PLANTED)
def test_a_wrong_number_is_named_beside_another_format(kind: str, size: float, tmp_path: Path) -> None:
    copy, wrong, _ = _planted(kind, size, tmp_path)
    found = pair(copy, MJCF)
    assert not found.same
    # Of a link in parts there is a mass for each.
    places = [difference.first_place for difference in found.differences[:3]]
    assert f"arm.urdf:{line_of(copy, wrong)}" in places


def test_nothing_differs_between_a_file_and_its_copy(tmp_path: Path) -> None:
    found = pair(URDF, edited(URDF, tmp_path))
    assert found.same and found.differences == [] and found.backward_error == pytest.approx(0.0, abs=1e-3)


def test_mass_that_moves_without_being_felt_is_told(tmp_path: Path) -> None:
    """Twice the mass at half the arm has the same weight about the pin, and here the same inertia."""
    first = edited(FILES / "impossible.urdf", tmp_path, ('iyy="0.25"', 'iyy="0.125"'))
    (tmp_path / "other").mkdir()
    # 1 kg at 0.5 m with 0.125, and 2 kg at 0.25 m with 0.25: 0.375 kg m^2 about the pin in both.
    changes = (('xyz="0 0 -0.5"', 'xyz="0 0 -0.25"'), ('mass value="1"', 'mass value="2"'))
    second = edited(FILES / "impossible.urdf", tmp_path / "other", *changes)
    found = pair(first, second)
    assert found.same and found.equivalent and {one.what for one in found.differences} >= {"mass of link rod"}


def test_joints_are_matched_by_name_then_by_word_then_by_place(tmp_path: Path) -> None:
    text = URDF.read_text().replace('"shoulder"', '"joint1"').replace('"elbow"', '"joint2"')
    other = tmp_path / "renamed.urdf"
    other.write_text(text)
    one, two = read_robot(URDF), read_robot(other)
    assert match(one, two, {}).by_place == ("shoulder", "elbow")
    assert match(one, two, {"elbow": "joint2"}).by_place == ("shoulder",)
    assert match(one, one, {}).by_place == ()
    found = pair(URDF, other)
    assert found.same and len(found.remarks) == 2


ELBOW = '<joint name="elbow" type="revolute">'


@pytest.mark.parametrize(("kind", "why"), [("fixed", "only arm.urdf moves it"), ("prismatic", "a slide joint in other/arm.urdf")])
def test_the_rest_is_compared_where_a_joint_is_not_shared(kind: str, why: str, tmp_path: Path) -> None:
    """The joint stands still in both, and the files are not one robot for it."""
    (tmp_path / "other").mkdir()
    (tmp_path / "heavier").mkdir()
    other = edited(URDF, tmp_path / "other", (ELBOW, f'<joint name="elbow" type="{kind}">'))
    found = pair(edited(URDF, tmp_path), other)
    (joint,) = found.locked
    assert (joint.name, joint.asked, joint.first_place) == ("elbow", False, f"arm.urdf:{line_of(URDF, ELBOW)}")
    assert not found.same and found.alike and not found.differences and not found.problem
    assert "are the same robot but for 1 joint that the files do not share (" in conclude_pair(found).sentence
    heavier = pair(URDF, edited(other, tmp_path / "heavier", ('<mass value="1"/>', '<mass value="1.001"/>')))
    assert not heavier.alike and "differ: mass of link fore, 1 " in conclude_pair(heavier).sentence
    assert [difference.what for difference in heavier.differences] == ["mass of link fore"]
    assert found.backward_error is not None and found.backward_error < 1e-3


def test_joints_that_are_left_out_stand_still_in_both(tmp_path: Path) -> None:
    """A wrong damper of the elbow is felt no more; what mimics the joint stands still beside it."""
    other = edited(URDF, tmp_path, ('damping="0.25"', 'damping="9"'))
    assert not pair(URDF, other).same
    found = hold_against(meant_by(URDF), read_robot(other), {}, ["elbow"])
    assert found.same and found.locked[0].asked and "are the same robot, 1 joint left out (" in conclude_pair(found).sentence
    gripper = FILES / "mimic.urdf"
    both = hold_against(meant_by(gripper), read_robot(gripper), {}, ["left"])
    assert both.problem.startswith("no joint of the one") and [joint.name for joint in both.locked] == ["left", "right"]


COUPLED = """<mujoco><compiler angle="radian"/><worldbody><body name="one"><joint name="a" axis="0 1 0"/>
<inertial pos="0 0 -0.5" mass="1" diaginertia="0.1 0.1 0.1"/><body name="two" pos="0 0 -1"><joint name="b" axis="0 1 0" {of_joint}/>
<inertial pos="0 0 -0.5" mass="1" diaginertia="0.1 0.1 0.1"/></body></body></worldbody>
<tendon><fixed stiffness="3" {rest}><joint joint="a" coef="2"/><joint joint="b" coef="0.5"/></fixed></tendon></mujoco>"""
ALONE = '<joint name="b" axis="0 1 0" {of_joint}/>'


@pytest.mark.parametrize(
    ("of_joint", "rest", "other_rest"),
    [
        ("", 'springlength="0.25"', 'springlength="0.25"'),
        ("", "", ""),
        ('ref="0.5"', 'springlength="0.75"', 'springlength="0.5"'),
        ('ref="0.5" springref="0.75"', "", 'springlength="0.125"'),
    ],
)
def test_a_joint_that_stands_still_adds_a_constant_to_a_tendon(of_joint: str, rest: str, other_rest: str, tmp_path: Path) -> None:
    """It stands still at its ``ref``, where the file writes its body down."""
    both, one = tmp_path / "both.xml", tmp_path / "one.xml"
    both.write_text(COUPLED.format(of_joint=of_joint, rest=rest))
    text = COUPLED.format(of_joint="", rest=other_rest)
    one.write_text(text.replace(ALONE.format(of_joint=""), "").replace('<joint joint="b" coef="0.5"/>', ""))
    found = pair(both, one)
    assert found.alike and found.backward_error is not None and found.backward_error < 4, conclude_pair(found).sentence


HELD_BY_NAME = """<mujoco><default><muscle ctrllimited="false"/></default><worldbody>
<body name="one"><joint name="one" axis="0 1 0" range="-40 30" frictionloss="1" actuatorfrcrange="-3 5"/>
<inertial pos="1 0 0" mass="1" diaginertia="1 1 1"/>
<body name="two"><joint name="two" axis="0 1 0"/><inertial pos="1 0 0" mass="1" diaginertia="1 1 1"/>
<body name="tip"><joint name="tip" type="slide"/><inertial pos="1 0 0" mass="1" diaginertia="1 1 1"/></body></body></body></worldbody>
<tendon><fixed name="t" springlength="0.1" stiffness="3"><joint joint="one" coef="1"/><joint joint="tip" coef="2"/></fixed>
<fixed name="u"><joint joint="two" coef="1"/></fixed></tendon>
<equality><joint joint1="one" joint2="two" polycoef="0 1 0 0 0"/><tendon tendon1="t" tendon2="u"/></equality>
<actuator><muscle joint="one"/><motor joint="two" gear="2"/><motor tendon="t" gear="2"/></actuator></mujoco>"""


def test_a_robot_whose_joints_are_renamed_is_read_from_a_file_that_names_them_so(tmp_path: Path) -> None:
    path, names = tmp_path / "robot.xml", {"one": "start", "tip": "end"}
    path.write_text(HELD_BY_NAME)
    robot = read_robot(path)
    path.write_text(re.sub(r'(joint\d?|joint name)="(one|tip)"', lambda found: f'{found[1]}="{names[found[2]]}"', HELD_BY_NAME))
    assert renamed_to(robot, names) == read_robot(path) != robot
    assert robot.declared[0].values == {"joint": "one", "ctrllimited": "false"}
    (tmp_path / "other.xml").write_text(HELD_BY_NAME)
    found = pair(path, tmp_path / "other.xml", **{new: name for name, new in names.items()})
    assert found.same and not found.problem and found.backward_error is not None and found.backward_error < 4


def test_a_joint_that_carries_much_is_none_that_carries_little(tmp_path: Path) -> None:
    """Neither are those behind it joints of the other file."""
    head = edited(URDF, tmp_path, (ELBOW, '<joint name="elbow" type="fixed">'))
    chain = COUPLED.format(of_joint="", rest="").replace("</body></body>", '<body><joint name="c"/></body></body></body>')
    (tmp_path / "chain.xml").write_text(chain)
    assert match(read_robot(tmp_path / "chain.xml"), read_robot(head), {}).names == {}
    assert pair(head, tmp_path / "chain.xml").problem.startswith("no joint of the one is known as a joint of the other; --map")


def test_a_joint_that_mimics_in_one_file_only_is_a_difference(tmp_path: Path) -> None:
    mimic = '<mimic joint="left" multiplier="0.75" offset="0.125"/>'
    found = pair(FILES / "mimic.urdf", edited(FILES / "mimic.urdf", tmp_path, (mimic, "")))
    assert not found.same
    assert (found.differences[0].first, found.differences[0].second) == ("mimics left", "moves by itself")


def test_a_joint_that_mimics_by_zero_is_compared_in_files_that_are_built_otherwise(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    still = edited(FILES / "mimic.urdf", tmp_path, ('multiplier="0.75"', 'multiplier="0"'))
    tip = '<link name="tip"/><joint name="weld" type="fixed"><parent link="right_finger"/><child link="tip"/></joint></robot>'
    other = edited(still, tmp_path / "other", ('<mass value="0.5"/>', '<mass value="0.625"/>'), ("</robot>", tip))
    (found,) = pair(still, other).differences
    # It moves nothing, for the joint stands still.
    assert (found.first, found.second) == ("0.5", "0.625") and found.alone is not None and found.alone < 1e-12


BALL = """<mujoco><compiler angle="radian"/><worldbody><body name="one" pos="0 0 1"{pose}>{joint}
<inertial pos="{centre}" mass="2" diaginertia="0.25 0.5 0.375"{turned}/>
<body name="two" pos="{arm}"{turned}><joint name="hinge" axis="0 1 0"/><inertial pos="0.1 0 0.3" mass="1" diaginertia="0.1 0.1 0.1"/></body>
</body></worldbody></mujoco>"""


def test_ball_joints_of_turned_bodies_are_the_same_joints(tmp_path: Path) -> None:
    """The body's frame is turned by a quarter about z, and what it holds is turned back."""
    joint, names = '<joint name="ball" type="ball"/>', ("straight.xml", "turned.xml")
    straight = BALL.format(joint=joint, pose="", centre="0.25 0 0", turned="", arm="0.5 0 0.125")
    quarter, back = "0.7071067811865476 0 0 0.7071067811865476", "0.7071067811865476 0 0 -0.7071067811865476"
    turned = BALL.format(joint=joint, pose=f' quat="{quarter}"', centre="0 -0.25 0", turned=f' quat="{back}"', arm="0 -0.5 0.125")
    for name, text in zip(names, (straight, turned), strict=True):
        (tmp_path / name).write_text(text)
    found = pair(tmp_path / names[0], tmp_path / names[1])
    assert found.same and found.backward_error is not None and found.backward_error < 16
    (tmp_path / names[1]).write_text(turned.replace('mass="2"', 'mass="2.00002"'))
    found = pair(tmp_path / names[0], tmp_path / names[1])
    assert not found.same and found.differences[0].what == "mass of link one"


LINK = '<inertial><origin xyz="0.1 0.2 0.05"/><mass value="2"/><inertia ixx="0.3" iyy="0.4" izz="0.5" ixy="0" ixz="0" iyz="0"/></inertial>'


def test_a_file_whose_joint_carries_nothing_is_said_so(tmp_path: Path) -> None:
    text = (FILES / "impossible.urdf").read_text()
    start, end = text.index("<inertial>"), text.index("</inertial>") + len("</inertial>")
    copy = tmp_path / "idle.urdf"
    copy.write_text(text[:start] + text[end:])
    found = pair(FILES / "impossible.urdf", copy)
    assert not found.same and found.problem.startswith("idle.urdf: no acceleration is determined")


# On a slope, so that no acceleration is zero where nothing moves.
FLOATING = """<robot name="r"><link name="ground"/><link name="base"/><link name="one">{inertial}</link><link name="two">{inertial}</link>
<joint name="slope" type="fixed"><parent link="ground"/><child link="base"/><origin rpy="0.25 0.5 0"/></joint>
<joint name="free" type="{kind}"><parent link="base"/><child link="one"/>{origin}{axis}</joint>
<joint name="hinge" type="revolute"><parent link="one"/><child link="two"/>{child}<axis xyz="{hinge}"/></joint></robot>"""


def test_a_floating_joint_is_the_same_wherever_its_frame_stands(tmp_path: Path) -> None:
    child, names = '<origin xyz="0 0.5 0.2"/>', ("near.urdf", "away.urdf")
    for name, origin in zip(names, ("", '<origin xyz="1 2 3" rpy="0.25 0.5 1"/>'), strict=True):
        text = FLOATING.format(inertial=LINK, kind="floating", origin=origin, axis="", child=child, hinge="0 1 0")
        (tmp_path / name).write_text(text)
    found = pair(tmp_path / names[0], tmp_path / names[1])
    assert found.same and found.backward_error is not None and found.backward_error < 16


@pytest.mark.parametrize("turn", ["3.141592653589793 0 0", "0 0 1.5707963267948966"])
def test_a_planar_joint_is_the_same_in_a_turned_frame(turn: str, tmp_path: Path) -> None:
    """Half a turn about x turns its axis round, a quarter about z its directions; the link's frame is turned back behind it."""
    angles = [float(angle) for angle in turn.split()]
    straight = FLOATING.format(inertial=LINK, kind="planar", origin="", axis='<axis xyz="0 0 1"/>', child="", hinge="0 0 1")
    axis = "0 0 -1" if angles[0] else "0 0 1"
    back = f'<origin rpy="{-angles[0]} 0 {-angles[2]}"/>'
    # What stands in the first link, by the turned link's axes.
    centre = "0.1 -0.2 -0.05" if angles[0] else "0.2 -0.1 0.05"
    moments = ('ixx="0.3" iyy="0.4"', 'ixx="0.3" iyy="0.4"' if angles[0] else 'ixx="0.4" iyy="0.3"')
    own = LINK.replace("0.1 0.2 0.05", centre).replace(*moments)
    turned = FLOATING.format(
        inertial=LINK, kind="planar", origin=f'<origin rpy="{turn}"/>', axis=f'<axis xyz="{axis}"/>', child=back, hinge="0 0 1"
    )
    turned = turned.replace(f'<link name="one">{LINK}', f'<link name="one">{own}')
    for name, text in (("straight.urdf", straight), ("turned.urdf", turned)):
        (tmp_path / name).write_text(text)
    found = pair(tmp_path / "straight.urdf", tmp_path / "turned.urdf")
    assert found.same and found.backward_error is not None and found.backward_error < 16


DUMB_BELL = """<mujoco><worldbody><body name="bar"><joint name="hinge" axis="0 0 1"/><inertial pos="1 0 0" mass="2" diaginertia="1 1 1"/>
  <body name="end" pos="-1 0 0"><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body></body></worldbody></mujoco>"""


def test_bodies_in_one_have_the_moments_of_the_parallel_axis_theorem(tmp_path: Path) -> None:
    path = tmp_path / "bell.xml"
    path.write_text(DUMB_BELL)
    total = canonical(read_robot(path))["hinge"].total
    assert total.mass == 4.0 and not total.centre.any()
    assert np.array_equal(total.moments, np.diag([2.0, 6.0, 6.0]))
