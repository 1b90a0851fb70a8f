"""An inertial frame that is nearly the body's own, which MuJoCo takes for it."""

from __future__ import annotations

from pathlib import Path

import pytest
from comparison.robots import record_of

from harness.explain.changes.readings import find_readings
from harness.verdict import AGREEMENT

NAME = "inertial frames near those of bodies"
ARM = """<mujoco><worldbody><body name="a" pos="0 0 1"><joint name="h" type="ball"/>{}
<body name="b" pos="0.1 0.2 1"><joint name="g" axis="0 1 0"/><inertial pos="0.1 0 0" mass="1" diaginertia="0.02 0.03 0.04"/></body></body>
</worldbody></mujoco>"""
INERTIAL = '<inertial pos="{}" quat="{}" mass="1.5" diaginertia="0.02 0.03 0.04"/>'
NEAR = {
    "position": INERTIAL.format("5e-7 0 0", "1 0 0 0"),
    "turn": INERTIAL.format("0.1 0 0", "1 5e-7 0 0"),
    "both": INERTIAL.format("5e-7 0 0", "-1 5e-7 0 0"),
    "shape": '<geom type="box" size="0.1 0.2 0.3" pos="0 -9e-7 0"/>',
    "full inertia": '<inertial pos="5e-7 0 0" mass="1.5" fullinertia="0.04 0.03 0.02 0 0 0"/>',
    "small products": '<inertial pos="0.1 0 0" mass="1.5" fullinertia="0.04 0.03 0.02 5e-9 0 -3e-9"/>',
}
APART = {
    "position": INERTIAL.format("5e-7 2e-6 0", "1 0 0 0"),
    "turned": INERTIAL.format("5e-7 0 0", "1 1 0 0"),
    "exact": INERTIAL.format("0.1 0 0", "1 0 0 0"),
    "products": '<inertial pos="5e-7 0 0" mass="1.5" fullinertia="0.02 0.03 0.04 0.001 0 0"/>',
    "smallest first": '<inertial pos="5e-7 0 0" mass="1.5" fullinertia="0.02 0.03 0.04 0 0 0"/>',
}
LINKS = """<robot name="r"><link name="base"/><link name="a">{}</link><link name="b"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>
<inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0.001" ixz="0" iyz="0"/></inertial></link>
<joint name="h" type="continuous"><parent link="base"/><child link="a"/><origin xyz="0 0 1"/><axis xyz="0.6 0.8 0"/></joint>
<joint name="g" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0.1 0.2 1"/><axis xyz="0 1 0"/></joint>{}</robot>"""
LINK = """<inertial><origin xyz="{}" rpy="{}"/><mass value="1.5"/>
<inertia ixx="{}" iyy="{}" izz="{}" ixy="{}" ixz="0" iyz="0"/></inertial>"""
FIXED = """<link name="c"><inertial><origin xyz="{}"/><mass value="0.5"/>
<inertia ixx="0.04" iyy="0.03" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="f" type="fixed"><parent link="a"/><child link="c"/></joint>"""
ON_ITS_OWN = '<mujoco><compiler fusestatic="false"/></mujoco>'
NEAR_LINKS = {
    "turned about equal moments": (LINK.format("5e-7 0 0", "0 0 1.5", 0.04, 0.04, 0.02, 0), ""),
    "position": (LINK.format("5e-7 0 -3e-8", "0 0 0", 0.04, 0.03, 0.02, 0), ""),
    "small products": (LINK.format("0.1 0 0", "0 0 0", 0.04, 0.03, 0.02, 5e-9), ""),
    "both": (LINK.format("0 -2e-8 0", "0 0 1e-9", 0.04, 0.03, 0.02, 5e-12), ""),
    "a sum": (LINK.format("1e-7 0 0", "0 0 0", 0.04, 0.03, 0.02, 1e-10), FIXED.format("0 0 1e-7")),
    "turn of a sum": (LINK.format("0 0 0.1", "0 0 0", 0.04, 0.03, 0.02, 1e-10), FIXED.format("0 0 0.2")),
    "not fused": (LINK.format("5e-7 0 0", "0 0 0", 0.04, 0.03, 0.02, 0), f"{FIXED.format('0 0 1e-7')}{ON_ITS_OWN}"),
}
APART_LINKS = {
    "smallest first": (LINK.format("5e-7 0 0", "0 0 0", 0.02, 0.03, 0.04, 0), ""),
    "turned": (LINK.format("5e-7 0 0", "0 0 0.5", 0.04, 0.03, 0.02, 0), ""),
    "products": (LINK.format("5e-7 0 0", "0 0 0", 0.04, 0.03, 0.02, 1e-3), ""),
    "exact": (LINK.format("0.1 0 0", "0 0 0", 0.04, 0.03, 0.02, 0), ""),
    "near before a sum": (LINK.format("5e-7 0 0", "0 0 0", 0.04, 0.03, 0.02, 0), FIXED.format("0.1 0.2 0.3")),
    "an exact sum": (LINK.format("0 0 0.125", "0 0 0", 0.04, 0.03, 0.02, 0), FIXED.format("0 0 0.25")),
}


@pytest.mark.parametrize("name", NEAR)
def test_a_frame_that_is_nearly_the_bodys_is_that(name: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(NEAR[name]))
    record = record_of(path, "mujoco", aided=False)
    assert record.explained and [one.name for one in record.readings] == [NAME]
    assert record.left is not None and record.left < AGREEMENT < (record.backward_error or 0.0)


@pytest.mark.parametrize("name", APART)
def test_a_frame_that_is_not_is_the_files(name: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(APART[name]))
    record = record_of(path, "mujoco", aided=False)
    assert record.verdict == "agrees" and not record.readings


@pytest.mark.parametrize("aided", [False, True])
@pytest.mark.parametrize("name", NEAR_LINKS)
def test_a_frame_that_is_nearly_the_links_is_that_but_for_an_aided_engine(name: str, aided: bool, tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(LINKS.format(*NEAR_LINKS[name]))
    record = record_of(path, "mujoco", aided=aided)
    if aided:
        assert record.verdict == "agrees" and not record.readings
        return
    assert record.explained and [one.name for one in record.readings] == [NAME]
    assert record.left is not None and record.left < AGREEMENT < (record.backward_error or 0.0)


@pytest.mark.parametrize("name", APART_LINKS)
def test_a_frame_of_links_that_is_not_is_the_files(name: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(LINKS.format(*APART_LINKS[name]))
    record = record_of(path, "mujoco", aided=False)
    assert record.verdict == "agrees" and not record.readings


def test_engines_with_its_reader_have_the_frame_of_the_file() -> None:
    assert NAME in {one.name for one in find_readings("mujoco", "mjcf")}
    assert NAME not in {one.name for one in find_readings("mjx", "mjcf", "mujoco")}
