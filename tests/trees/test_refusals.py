"""What has no meaning is refused at its line, with what to do, and nothing else crashes."""

from __future__ import annotations

import random
import re
from pathlib import Path

import mujoco
import pytest

from harness.errors import InvalidModel
from harness.files.mjcf.reading import MOST_FILES
from harness.trees.recursion import recursion_program
from harness.trees.robot import read_robot

FILES = Path(__file__).parent / "files"
JUNK = ("", "nan", "abc", "${mass}", "1 2", "-1", "0", "0 0 0", "1e999", "0x10", "1,5", "1 2 3 4 5 6 7", "trunk", "true")
CHANGES = 40

URDF = """<robot name="two">
<link name="base"/>
<link name="one"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="two"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="first" type="revolute"><parent link="base"/><child link="one"/><axis xyz="0 0 1"/></joint>
<joint name="second" type="revolute"><parent link="one"/><child link="two"/><axis xyz="0 1 0"/></joint>
</robot>
"""
FIRST = '<joint name="first" type="revolute"><parent link="base"/><child link="one"/><axis xyz="0 0 1"/></joint>'
SPRING = '<gazebo reference="third"><springStiffness>1</springStiffness></gazebo>'
MJCF = """<mujoco>
<compiler angle="radian"/>
<worldbody>
<body name="one"><joint name="first"/><geom name="ball" size="0.1"/>
<body name="two"><joint name="second"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
</body>
</worldbody>
</mujoco>
"""


def refusal(tmp_path: Path, text: str, floating_base: bool = False) -> InvalidModel:
    path = tmp_path / "robot.xml"
    path.write_text(text)
    with pytest.raises(InvalidModel) as caught:
        read_robot(path, floating_base=floating_base)
    return caught.value


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ('xyz="0 0 1"', 'xyz="0 0 0"', 5, "is zero; expected a direction"),
        ('xyz="0 0 1"', 'xyz="0 1"', 5, "holds 2 numbers; expected 3"),
        ('<link name="two">', '<link name="one">', 4, "repeats the name of line 3"),
        ('name="second"', 'name="first"', 6, "repeats the name of line 5"),
        ('<parent link="one"/>', '<parent link="three"/>', 6, "names nothing in this file"),
        ('<parent link="one"/>', '<parent link="two"/>', 6, "is part of a cycle that link 'base' does not reach"),
        ('<parent link="base"/>', '<parent link="two"/>', 5, "every link is the child of a joint|part of a cycle"),
        ('<child link="two"/>', '<child link="one"/>', 6, "carries link 'one', and so does .*first"),
        ('<joint name="second" type="revolute">', '<joint name="second" type="helical">', 6, "is of type 'helical'; expected one of fixed"),
        ('<child link="one"/>', "", 5, "has no <child>; add it"),
        ('<mass value="1"/>', '<mass value="nan"/>', 3, "contains 'nan'; expected a finite decimal number"),
        ('<mass value="1"/>', "", 3, "has no <mass>; add it, or remove the <inertial>"),
        ('ixx="1"', "", 3, "has no attribute 'ixx'; add it"),
        ("</joint>\n</robot>", '<mimic joint="third"/></joint>\n</robot>', 6, "names nothing in this file"),
        ("</joint>\n</robot>", '<mimic joint="second"/></joint>\n</robot>', 6, "mimics 'second', which mimics it"),
        ("</robot>", SPRING + "</robot>", 7, "names nothing in this file"),
        (FIRST, "", 3, "expected one root, join the other"),
        ("<robot", "<!DOCTYPE robot><robot", 1, "declares a DOCTYPE"),
        ("<robot name=\"two\">", "<model>", 7, "not well-formed"),
    ],
)  # fmt: skip
def test_a_urdf_without_meaning_is_refused_at_its_line(tmp_path: Path, old: str, new: str, line: int, message: str) -> None:
    assert old in URDF
    found = refusal(tmp_path, URDF.replace(old, new, 1))
    assert re.search(message, found.problem), found.problem
    assert found.line == line


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ('angle="radian"', 'angle="grad"', 2, "expected degree or radian"),
        ('angle="radian"', 'eulerseq="xyw"', 2, "expected three of the letters"),
        ('angle="radian"', 'coordinate="global"', 2, "changes the frames of bodies"),
        ('angle="radian"', 'balanceinertia="maybe"', 2, "expected true or false"),
        ('angle="radian"', 'boundmass="light"', 2, "expected a finite decimal number"),
        ("<geom name", '<geom type="mesh" mesh="m" name', 4, "gives its body the inertia of a mesh of MuJoCo's making"),
        ("<geom name", '<geom type="ellipsoid" shellinertia="true" name', 4, "shell of an ellipsoid, whose area has no closed form"),
        ("<geom name", '<geom type="box" name', 4, "is a box of size 0.1 0.0 0.0, of which one is not positive"),
        ("<geom name", '<geom fromto="0 0 0 0 0 1" name', 4, "is a sphere with fromto"),
        ("<geom name", '<geom type="capsule" fromto="1 0 0 1 0 0" name', 4, "reaches from a point to itself"),
        ('<body name="two">', '<body name="one">', 5, "repeats the name of line 4"),
        ('<joint name="second"/>', "<site><body/></site>", 5, "<body> stands in <site>; expected it in a body, a frame or the worldbody"),
        ('<body name="two">', '<body name="world">', 5, "has the name of the world itself"),
        ('<body name="two">', '<body name="two" quat="0 0 0 0">', 5, "quat is zero"),
        ('<body name="two">', '<body name="two" xyaxes="1 0 0 2 0 0">', 5, "the two directions of xyaxes are parallel"),
        ('<body name="two">', '<body name="two" euler="1 0 0" quat="1 0 0 0">', 5, "has quat and euler; expected one orientation"),
        ('<joint name="second"/>', "<freejoint/>", 5, "has a free joint; expected it alone, in a body right inside the worldbody"),
        ('<joint name="second"/>', '<joint name="second" axis="0 0 0"/>', 5, "axis is zero; expected a direction"),
        ('<joint name="second"/>', '<joint springdamper="1 0"/>', 5, "has springdamper 1 0; expected two positive numbers"),
        ('<joint name="second"/>', '<joint type="ball" springdamper="1 1"/>', 5, "is a ball joint with springdamper, which is not read"),
        ('<joint name="second"/>', '<joint stiffness="1 2"/>', 5, 'stiffness="1 2" is not linear, which is not read; write one number'),
        ('name="second"', 'name="second" type="screw"', 5, "is of type 'screw'; expected one of hinge, slide, ball, free"),
        ("</mujoco>", '<tendon><fixed stiffness="1"><joint joint="third" coef="1"/></fixed></tendon></mujoco>', 8, "no hinge or slide"),
        ('diaginertia="1 1 1"', 'fullinertia="1 1 1 0 0"', 5, "holds 5 numbers; expected 6"),
        ('mass="1"', "", 5, "has no attribute 'mass'; add it"),
        ("</body>\n</body>", '</body>\n</body><composite type="cable"/>', 6, "makes bodies by the rules of MuJoCo's program"),
        ("</body>\n</body>", '</body>\n</body><replicate count="100000"><site/></replicate>', 6, "expected"),
        ("</body>\n</body>", '</body>\n</body><replicate count="1.5"><site/></replicate>', 6, "expected a whole number of replicas"),
        ('<joint name="first"/>', '<freejoint align="true"/>', 4, "turns the frame of its body, which is not read; write it out"),
        ("<worldbody>", "<include/><worldbody>", 3, "<include> has no file; add its name"),
        ("<worldbody>", '<include file="nothing.xml"/><worldbody>', 3, "nothing.xml there is no such file"),
        ("<worldbody>", '<include file="robot.xml"/><worldbody>', 3, "stands for the second time, or in itself"),
        ("</mujoco>", '<tendon><spatial stiffness="1"/></tendon></mujoco>', 8, "does not run straight|leaves its springlength"),
    ],
)  # fmt: skip
def test_an_mjcf_without_meaning_is_refused_at_its_line(tmp_path: Path, old: str, new: str, line: int, message: str) -> None:
    assert old in MJCF
    found = refusal(tmp_path, MJCF.replace(old, new, 1))
    assert re.search(message, found.problem), found.problem
    assert found.line == line


def test_files_that_include_each_other_are_refused(tmp_path: Path) -> None:
    (tmp_path / "other.xml").write_text('<mujocoinclude>\n<include file="robot.xml"/></mujocoinclude>')
    found = refusal(tmp_path, MJCF.replace("<worldbody>", '<include file="other.xml"/><worldbody>'))
    assert (found.path.name, found.line) == ("other.xml", 2)


def test_more_files_than_a_robot_needs_are_refused(tmp_path: Path) -> None:
    for number in range(MOST_FILES + 1):
        (tmp_path / f"{number}.xml").write_text("<mujocoinclude/>")
    includes = [f'<include file="{number}.xml"/>' for number in range(MOST_FILES + 1)]
    few, many = (MJCF.replace("<worldbody>", f"{''.join(includes[:count])}<worldbody>") for count in (MOST_FILES, None))
    assert refusal(tmp_path, many).problem == "<include> is file 101; expected at most 100, no robot needs more"
    (tmp_path / "robot.xml").write_text(few)
    read_robot(tmp_path / "robot.xml")


def test_a_backslash_between_folders_is_a_slash_as_mujoco_has_it(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "other.xml").write_text('<mujocoinclude><option gravity="0 0 -2"/></mujocoinclude>')
    path = tmp_path / "robot.xml"
    path.write_text(MJCF.replace("<worldbody>", '<include file="parts\\other.xml"/><worldbody>'))
    assert (
        [float(part) for part in read_robot(path).tree.gravity]
        == mujoco.MjModel.from_xml_path(str(path)).opt.gravity.tolist()
        == [0, 0, -2]
    )


def test_a_file_that_takes_no_inertia_from_geoms_has_those_that_it_states(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    for word, has_solids in (("false", False), ("auto", True)):
        path.write_text(MJCF.replace('angle="radian"', f'inertiafromgeom="{word}"'))
        one, two = read_robot(path).tree.bodies
        assert (bool(one.solids), one.inertia, two.inertia is not None) == (has_solids, None, True)


def test_an_actuator_of_a_ball_joint_must_bring_it_no_damping(tmp_path: Path) -> None:
    acts = '<actuator><general joint="second" damping="2"/></actuator>'
    text = MJCF.replace('name="second"', 'name="second" type="ball"').replace("</mujoco>", f"{acts}</mujoco>")
    found = refusal(tmp_path, text)
    why_not = "the actuator drives joint 'second', which is no hinge or slide"
    said = f'<general> damping="2" is on with actuators off, and {why_not}, which is not read; remove it'
    assert (found.line, found.problem) == (8, said)
    (tmp_path / "robot.xml").write_text(text.replace(' damping="2"', ""))
    assert [one.why_not for one in read_robot(tmp_path / "robot.xml").actuators] == [""]


def test_other_files_are_refused(tmp_path: Path) -> None:
    assert "expected a robot: a URDF" in refusal(tmp_path, "<sdf/>").problem
    assert "is empty; expected a robot" in refusal(tmp_path, " ").problem
    assert "leave the floating base out" in refusal(tmp_path, MJCF, floating_base=True).problem
    many = "".join('<body><joint type="ball"/><geom size="1"/></body>' for _ in range(167))
    assert (
        "has 501 degrees of freedom; expected at most 500" in refusal(tmp_path, f"<mujoco><worldbody>{many}</worldbody></mujoco>").problem
    )


@pytest.mark.ci
@pytest.mark.parametrize("name", ["arm.urdf", "quadruped.xml"])
def test_junk_is_refused_or_read_and_crashes_nothing(tmp_path: Path, name: str) -> None:
    """Each time, one attribute anywhere holds something else."""
    text, chance = (FILES / name).read_text(), random.Random(5)
    values = [match.span(1) for match in re.finditer(r'\s[a-zA-Z_]+="([^"]*)"', text)]
    path = tmp_path / name
    refused = 0
    for _ in range(CHANGES):
        start, end = chance.choice(values)
        path.write_text(text[:start] + chance.choice(JUNK) + text[end:])
        try:
            robot = read_robot(path)
        except InvalidModel as error:
            assert error.path == path
            refused += 1
        else:
            recursion_program(robot.tree, robot.joints)
    assert CHANGES / 6 < refused < CHANGES
