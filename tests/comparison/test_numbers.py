"""Numbers of two files as a person reads them: named in their attributes, with the digits that stand there and no residue of rounding."""

from __future__ import annotations

from pathlib import Path

import pytest
from comparison.robots import meant_by

from harness.comparison.sameness import hold_against
from harness.files.given import Given, Place
from harness.trees.robot import read_robot

# Its inertia stands behind quarter turns, which rounding leaves inexact.
TURNED = """<robot name="r"><link name="ground"/>
<link name="one"><inertial><origin xyz="0.1 0 0.25" rpy="1.5707963267948966 0 1.5707963267948966"/><mass value="2"/>
<inertia ixx="0.0003" iyy="0.0004" izz="0.0005" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="pin" type="revolute"><parent link="ground"/><child link="one"/><origin rpy="0 1.5707963267948966 0"/><axis xyz="0 0 1"/>
<dynamics damping="0.5"/></joint></robot>"""
# A link more, with which the files are built otherwise.
TIP = '<link name="tip"/><joint name="weld" type="fixed"><parent link="one"/><child link="tip"/></joint></robot>'
CHANGES = {
    ('ixx="0.0003"', 'ixx="0.00031"'): ("ixx of link one", "0.0003", "0.00031"),
    ('xyz="0.1 0', 'xyz="0.125 0'): ("centre of mass x of link one", "0.1", "0.125"),
    ('rpy="0 1.5707963267948966 0"', 'rpy="0 1.75 0"'): ("origin pitch of link one", "1.5707963267948966", "1.75"),
    ('damping="0.5"', 'damping="0.500001"'): ("damping of joint pin", "0.5", "0.500001"),
}
MOVES = "all that moves with joint pin"
# In axes of the world at zero.
BUILT_OTHERWISE = {
    ('ixx="0.0003"', 'ixx="0.00031"'): (f"moments of inertia of {MOVES}", "iyy 0.0003", "iyy 0.00031"),
    ('mass value="2"', 'mass value="2.5"'): (f"mass of {MOVES}", "2", "2.5"),
    ('damping="0.5"', 'damping="0.500001"'): ("damping of joint pin", "0.5", "0.500001"),
}


@pytest.mark.parametrize(("end", "changes"), [("</robot>", CHANGES), (TIP, BUILT_OTHERWISE)])
def test_a_number_has_its_name_and_the_digits_of_the_file(
    end: str, changes: dict[tuple[str, str], tuple[str, str, str]], tmp_path: Path
) -> None:
    one, other = tmp_path / "one.urdf", tmp_path / "two.urdf"
    one.write_text(TURNED)
    for change, wanted in changes.items():
        other.write_text(TURNED.replace("</robot>", end).replace(*change))
        (found,) = hold_against(meant_by(one), read_robot(other), {}).differences
        assert (found.what, found.first, found.second) == wanted


@pytest.mark.parametrize(
    ("attribute", "index", "component"),
    [
        ("damping", 0, ""),
        ("xyz", 1, "y"),
        ("quat", 0, "w"),
        ("fullinertia", 4, "ixz"),
        ("rpy", 2, "yaw"),
        ("euler", 0, ""),
        ("euler", 2, "[2]"),
    ],
)
def test_the_numbers_of_an_attribute_have_names(attribute: str, index: int, component: str) -> None:
    assert Given(1.0, Place(Path("r.urdf"), 1), attribute, index).component == component
