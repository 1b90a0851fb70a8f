"""Floating, planar and ball joints of each engine, at the states of the file, wherever their frames stand."""

from __future__ import annotations

from pathlib import Path

import pytest
from comparison.robots import line_of, record_of

from harness.verdict import AGREEMENT, Verdict

INERTIAL = (
    '<inertial><origin xyz="0.1 0.2 0.05" rpy="0.3 0.2 0.1"/><mass value="2"/>'
    '<inertia ixx="0.3" iyy="0.4" izz="0.5" ixy="0.01" ixz="0.02" iyz="0.03"/></inertial>'
)
TURNED = '<origin xyz="0.5 0.25 1" rpy="0.7 0.2 0.3"/>'
PRINCIPAL = '<inertial pos="0.1 0.2 0.05" euler="10 20 30" mass="2" diaginertia="0.3 0.4 0.5"/>'
AWAY = 'pos="0.5 0.25 1" euler="30 20 10"'
SUBJECTS = [("mujoco", False), ("mujoco", True), ("pinocchio", False), ("pinocchio", True)]


def urdf(folder: Path, kind: str, parts: str) -> Path:
    """A link on a stand that is turned itself, and another one that it carries."""
    path = folder / "robot.urdf"
    path.write_text(f"""<robot name="robot">
<link name="ground"/><link name="one">{INERTIAL}</link><link name="two">{INERTIAL}</link>
<joint name="free" type="{kind}"><parent link="ground"/><child link="one"/>
{parts}</joint>
<joint name="hinge" type="revolute"><parent link="one"/><child link="two"/><origin xyz="0 0.5 0.2" rpy="0.5 0 0"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
</robot>
""")
    return path


def mjcf(folder: Path, joint: str, pose: str) -> Path:
    path = folder / "robot.xml"
    path.write_text(f"""<mujoco><worldbody><body name="one" {pose}>{joint}{PRINCIPAL}
    <body name="two" pos="0 0.5 0.2" euler="20 0 0"><joint name="hinge" axis="0 1 0"/>{PRINCIPAL}</body></body></worldbody></mujoco>""")
    return path


@pytest.mark.parametrize(("engine", "aided"), SUBJECTS)
@pytest.mark.parametrize(("kind", "parts"), [("floating", ""), ("floating", TURNED), ("planar", TURNED + '<axis xyz="0 0 2"/>')])
def test_joints_of_several_degrees_of_freedom_of_a_urdf(kind: str, parts: str, engine: str, aided: bool, tmp_path: Path) -> None:
    record = record_of(urdf(tmp_path, kind, parts), engine, aided)
    assert (record.verdict, record.readings) == (Verdict.AGREES, [])


@pytest.mark.parametrize(("engine", "aided"), SUBJECTS)
@pytest.mark.parametrize("joint", ['<freejoint name="free"/>', '<joint name="free" type="ball" pos="0.1 0 0.2"/>'])
@pytest.mark.parametrize("pose", ["", AWAY])
def test_joints_of_several_degrees_of_freedom_of_an_mjcf(joint: str, pose: str, engine: str, aided: bool, tmp_path: Path) -> None:
    record = record_of(mjcf(tmp_path, joint, pose), engine, aided)
    assert (record.verdict, record.readings) == (Verdict.AGREES, [])


@pytest.mark.parametrize(("engine", "aided"), SUBJECTS)
def test_a_wheel_that_turns_without_end_on_a_floating_body(engine: str, aided: bool, tmp_path: Path) -> None:
    """Its place in q is one behind that in v, and its turn stands in Pinocchio's q as cosine and sine."""
    path = urdf(tmp_path, "floating", TURNED)
    path.write_text(path.read_text().replace('type="revolute"', 'type="continuous"'))
    record = record_of(path, engine, aided)
    assert (record.verdict, record.readings) == (Verdict.AGREES, [])


def test_a_stand_that_is_turned_beside_a_free_body(tmp_path: Path) -> None:
    path = mjcf(tmp_path, '<freejoint name="free"/>', AWAY)
    path.write_text(path.read_text().replace("<worldbody>", '<worldbody><body name="stand" quat="1 2 3 4" pos="1 0 0"/>'))
    assert record_of(path, "mujoco").verdict == Verdict.AGREES


@pytest.mark.parametrize("axis", ["1 0 0", "0 0 -1", "1 2 -3"])
def test_the_axis_of_a_planar_joint_is_a_reading_of_pinocchio(axis: str, tmp_path: Path) -> None:
    path = urdf(tmp_path, "planar", f'{TURNED}<axis xyz="{axis}"/>')
    assert record_of(path, "mujoco").verdict == Verdict.AGREES
    record = record_of(path, "pinocchio", aided=True)
    assert record.explained and record.verdict == Verdict.DISAGREES and record.left is not None and record.left <= AGREEMENT
    assert [(reading.name, reading.lines) for reading in record.readings] == [
        ("axis of planar joints", (line_of(path, '<axis xyz="' + axis),))
    ]


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_damping_of_several_velocities_is_a_reading_of_mujoco(kind: str, tmp_path: Path) -> None:
    path = urdf(tmp_path, kind, TURNED + '<axis xyz="0 0 1"/><dynamics damping="0.5"/>')
    assert record_of(path, "pinocchio").verdict == Verdict.AGREES
    for aided in (False, True):
        record = record_of(path, "mujoco", aided)
        assert record.explained and record.verdict == Verdict.DISAGREES and record.left is not None and record.left <= AGREEMENT
        assert [reading.name for reading in record.readings] == ["damping of joints of several degrees of freedom"]


@pytest.mark.parametrize("engine", ["mujoco", "pinocchio"])
def test_a_floating_base_beside_a_mimic_joint(engine: str, tmp_path: Path) -> None:
    """The aided engine's accelerations come from its own M and forces, in its own coordinates."""
    path = urdf(tmp_path, "floating", TURNED)
    follower = (
        '<joint name="follower" type="revolute"><parent link="two"/><child link="three"/><origin xyz="0 0 0.3"/><axis xyz="1 0 0"/>'
        f'<limit lower="-2" upper="2" effort="1" velocity="1"/><mimic joint="hinge" multiplier="0.5"/></joint>'
        f'<link name="three">{INERTIAL}</link>'
    )
    path.write_text(path.read_text().replace("</robot>", f"{follower}</robot>"))
    assert record_of(path, engine, aided=True).verdict == Verdict.AGREES
