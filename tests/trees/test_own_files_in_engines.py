"""Robots of our own as the engines of their formats compile them: a check of our reading, outside of the truth."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import pytest
from support_robots import by_mujoco, by_pinocchio

from harness.trees.mechanism import mechanism_of
from harness.trees.robot import read_robot
from harness.truth.compare import compare
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import sample

FILES = Path(__file__).parent / "files"
STATES = 30
SEED = 5


def without_meshes(text: str) -> str:
    """The file without the mesh that no number comes from, and that is not there."""
    return re.sub(r'<mesh name="shell"[^>]*/>|<geom[^>]*mesh="shell"[^>]*/>', "", text)


@pytest.mark.ci
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {'<compiler angle="radian"': '<compiler angle="degree" eulerseq="ZYx"', 'range="-1.2 1.2"': 'range="-70 70"'},
        {'<compiler angle="radian"': '<compiler angle="radian" settotalmass="20"'},
        {'<geom type="ellipsoid"': '<geom group="3" type="ellipsoid"'},
        {
            '<geom density="1100"/>': '<geom density="800" shellinertia="true"/>',
            'type="ellipsoid"': 'shellinertia="false" type="ellipsoid"',
        },
        {'<option gravity="0 0.1 -9.8"': '<option gravity="3 2 1"'},
        {"<option gravity": '<option><flag gravity="disable" damper="disable"/></option><option gravity'},
        {"<option gravity": '<option><flag spring="disable"/></option><option gravity'},
        {'springlength="0.5"': 'springlength="0.4 0.4"'},
        {'stiffness="2" damping="0.1"': 'stiffness="2" damping="0.1" springlength="0.3"'},
        {
            'count="4" offset="0 0 0.001" euler="0 0 1.5"': 'count="12" offset="0.01 0 0.1" euler="0.1 0 0"',
            "lift_0": "lift_00",
            "lift_2": "lift_11",
        },
    ],
)
def test_the_quadruped_is_that_of_mujoco(tmp_path: Path, changes: dict[str, str]) -> None:
    text = without_meshes((FILES / "quadruped.xml").read_text())
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "quadruped.xml"
    path.write_text(text)
    robot = read_robot(path)
    model = mujoco.MjModel.from_xml_path(str(path))
    assert robot.joints == tuple(model.joint(number).name or robot.joints[number] for number in range(model.njnt))
    assert robot.total_mass == pytest.approx(mujoco.mj_getTotalmass(model), rel=1e-14)
    reference = ReferenceKernel(mechanism_of(robot))
    states = sample(reference.mechanism, STATES, SEED)
    truth = reference.evaluate(states)
    assert truth.certified.all()
    assert compare(truth, by_mujoco(model, states)).backward_error.max() < 64


@pytest.mark.parametrize("flag", ["", '<option><flag spring="disable"/></option>', '<option><flag damper="disable"/></option>'])
def test_a_time_constant_and_damping_ratio_are_those_of_mujoco(flag: str, tmp_path: Path) -> None:
    """Of a class too, at a reference position, on a joint that moves others, and instead of what stands beside it."""
    path = tmp_path / "spring_dampers.xml"
    path.write_text(
        f"""<mujoco>{flag}
        <default><default class="slow"><joint springdamper="0.5 0.75" stiffness="3"/></default></default>
        <worldbody><body><freejoint/><geom type="box" size="0.1 0.2 0.3"/>
        <body pos="0.3 0 0"><joint class="slow" axis="0 1 0" ref="30" armature="0.01"/>
        <geom type="capsule" fromto="0 0 0 0.5 0 0" size="0.05"/>
        <body pos="0.5 0 0"><joint class="slow" axis="0 1 1" springref="20"/><joint type="slide" springdamper="0.1 1" stiffness="2"/>
        <geom size="0.1" pos="0 0.1 0.2"/></body></body></body></worldbody></mujoco>"""
    )
    robot, model = read_robot(path), mujoco.MjModel.from_xml_path(str(path))
    reference = ReferenceKernel(mechanism_of(robot))
    states = sample(reference.mechanism, STATES, SEED)
    assert compare(reference.evaluate(states), by_mujoco(model, states)).backward_error.max() < 64


OF_CLASSES = ['euler="10 20 30"', 'quat="0.2 1 0.3 0"', 'zaxis="1 2 0.5"', 'axisangle="1 0 2 50"', 'xyaxes="1 0.2 0 0 1 1"', ""]


@pytest.mark.parametrize("own", OF_CLASSES)
@pytest.mark.parametrize("of_class", OF_CLASSES)
@pytest.mark.parametrize("around", ['euler="50 0 10"', 'quat="1 0.5 0 0.1"'])
def test_an_orientation_replaces_that_of_the_class_in_any_form(around: str, of_class: str, own: str, tmp_path: Path) -> None:
    path = tmp_path / "turned.xml"
    path.write_text(
        f"""<mujoco><default><geom {around} type="box" size="0.1 0.2 0.3"/><default class="turned"><geom {of_class}/></default></default>
        <worldbody><body><joint axis="1 2 3"/><geom class="turned" {own} pos="0.3 0.1 0"/></body></worldbody></mujoco>"""
    )
    reference = ReferenceKernel(mechanism_of(read_robot(path)))
    states = sample(reference.mechanism, STATES, SEED)
    assert compare(reference.evaluate(states), by_mujoco(mujoco.MjModel.from_xml_path(str(path)), states)).backward_error.max() < 64


# Bodies of which least values change much, little, or nothing; and the moments that none can have, for a mean.
BODIES = {
    "principal": '<inertial pos="0.1 0.2 0.3" mass="0.05" diaginertia="0.002 0.003 0.004" euler="10 20 30"/>',
    "heavy": '<inertial pos="0.1 0.2 0.3" mass="2" diaginertia="0.03 0.02 0.02" euler="10 20 30"/>',
    "full": '<inertial pos="0.1 0.2 0.3" mass="2" fullinertia="0.014 0.1 0.11 0.001 0.002 0.003"/>',
    "solid": '<geom type="capsule" fromto="0.1 0 0 0.2 0.3 0.1" size="0.02" density="100"/>',
    "solid that points down": '<geom type="box" fromto="0.1 0 0.2 0.1 0 -0.3" size="0.02" density="100"/>',
    "solid that points up": '<geom type="box" fromto="0.3 0 0 0.3 0 0.1" size="0.03" density="90"/>',
    "solids": '<geom size="0.05" pos="0.1 0 0"/><geom type="box" size="0.02 0.03 0.04" pos="-0.1 0.2 0" euler="10 20 30"/>',
    "nothing": "",
}
OF_NO_BODY = {'"0.03 0.02 0.02"': '"0.5 0.01 0.02"', '"0.014 0.1 0.11': '"0.004 0.1 0.11'}


@pytest.mark.parametrize(
    "options",
    [
        'boundmass="0.1" boundinertia="1e-4"',
        'boundmass="0.6" boundinertia="0.003"',
        'boundmass="0.1" boundinertia="0.05"',
        'balanceinertia="true" boundmass="0.1" boundinertia="1e-4"',
        'boundmass="0.1" boundinertia="0.05" balanceinertia="true"',
        'boundmass="0.6" boundinertia="0.003" settotalmass="9"',
    ],
)
def test_bounds_of_inertias_are_those_of_mujoco(options: str, tmp_path: Path) -> None:
    path = tmp_path / "bounded.xml"
    bodies = "".join(f'<body name="{name}"><joint axis="1 2 3"/>{inertia}</body>' for name, inertia in BODIES.items())
    for old, new in OF_NO_BODY.items() if "balance" in options else ():
        assert old in bodies
        bodies = bodies.replace(old, new)
    path.write_text(f"<mujoco><compiler {options}/><worldbody>{bodies}</worldbody></mujoco>")
    robot, model = read_robot(path), mujoco.MjModel.from_xml_path(str(path))
    assert robot.impossible == ()
    assert robot.total_mass == pytest.approx(mujoco.mj_getTotalmass(model), rel=1e-14)
    reference = ReferenceKernel(mechanism_of(robot))
    states = sample(reference.mechanism, STATES, SEED)
    assert compare(reference.evaluate(states), by_mujoco(model, states)).backward_error.max() < 64


@pytest.mark.ci
def test_the_humanoid_is_that_of_mujoco_and_of_pinocchio() -> None:
    robot = read_robot(FILES / "humanoid.xml")
    reference = ReferenceKernel(mechanism_of(robot))
    states = sample(reference.mechanism, STATES, SEED)
    model = mujoco.MjModel.from_xml_path(str(robot.path))
    assert compare(reference.evaluate(states), by_mujoco(model, states)).backward_error.max() < 64


def test_the_arm_is_that_of_pinocchio(tmp_path: Path) -> None:
    """Without the finger that follows, which aba refuses, and the spring, which its reader leaves out."""
    text = (FILES / "arm.urdf").read_text()
    text = text.replace('    <mimic joint="left_finger_joint" multiplier="0.75" offset="0.001"/>\n', "").replace(
        "<springStiffness>4.5", "<springStiffness>0"
    )
    path = tmp_path / "arm.urdf"
    path.write_text(text.replace(' xmlns="http://www.ros.org/urdf"', ""))
    robot = read_robot(path)
    reference = ReferenceKernel(mechanism_of(robot))
    states = sample(reference.mechanism, STATES, SEED)
    assert compare(reference.evaluate(states), by_pinocchio(path, robot, states)).backward_error.max() < 4


@pytest.mark.ci
def test_a_follower_has_its_damping_times_the_square_of_its_multiple(tmp_path: Path) -> None:
    """As a damper of the leader has that would take as much power."""
    text = (FILES / "arm.urdf").read_text()
    follower = text[text.index('<joint name="right_finger_joint"') :]
    own = follower[: follower.index("</joint>")]
    found = []
    for of_leader, of_follower in (("2", "2"), (str(2 + 2 * 0.75**2), "0")):
        changed = text.replace(own, own.replace('damping="2"', f'damping="{of_follower}"'))
        leader = changed.index('damping="2"', changed.index('<joint name="left_finger_joint"'))
        path = tmp_path / "arm.urdf"
        path.write_text(changed[:leader] + f'damping="{of_leader}"' + changed[leader + len('damping="2"') :])
        reference = ReferenceKernel(mechanism_of(read_robot(path)))
        found.append(reference.evaluate(sample(reference.mechanism, STATES, SEED)))
    assert compare(found[0], found[1].high).backward_error.max() < 4


def test_a_replica_stands_in_the_frame_of_the_one_before(tmp_path: Path) -> None:
    """As the documentation says of ``euler``. MuJoCo 4.0.0 multiplies the three angles by the number of the replica instead."""
    body = '<body pos="0.1 0.2 0.3"><joint axis="1 2 3"/><geom size="0.1" pos="0.2 0 0.1"/></body>'
    turn = 'euler="10 20 30"'
    frame = f'<frame pos="0.1 0 0.2" {turn}>'
    by_hand = body + f"{frame}{body}{frame}{body}</frame></frame>"
    found = []
    for number, bodies in enumerate((f'<replicate count="3" offset="0.1 0 0.2" {turn}>{body}</replicate>', by_hand)):
        path = tmp_path / f"replicas{number}.xml"
        path.write_text(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
        reference = ReferenceKernel(mechanism_of(read_robot(path)))
        found.append(reference.evaluate(sample(reference.mechanism, STATES, SEED)))
    assert compare(found[0], found[1].high).backward_error.max() < 1
