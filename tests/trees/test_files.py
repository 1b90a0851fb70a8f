"""Robots of our own, with what files in the wild hold: every number is found, with its line."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from harness.errors import InvalidModel
from harness.files.equalities import Weld
from harness.files.given import Given
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import LeftOut, Robot, read_robot
from harness.truth.compare import compare
from harness.truth.reference import Reference, ReferenceKernel
from harness.truth.sampling import sample

FILES = Path(__file__).parent / "files"
NAMES = ("arm.urdf", "humanoid.urdf", "humanoid.xml", "quadruped.xml")
SEED = 11


def numbers_of(part: object) -> Iterator[Given]:
    """The numbers of the file in a part of a tree."""
    if isinstance(part, Given):
        yield part
    elif isinstance(part, tuple):
        for one in part:
            yield from numbers_of(one)
    elif is_dataclass(part):
        for field in fields(part):
            yield from numbers_of(getattr(part, field.name))


def written(robot: Robot) -> list[Given]:
    """The numbers of a tree that stand in a file, each once; those of no attribute in the text are defaults."""
    found = {number.key: number for number in numbers_of(robot.tree)}
    return [number for number in found.values() if words_of(number) is not None]


def words_of(number: Given) -> list[str] | None:
    """The words of the attribute in which a number stands, found in the text from its line on."""
    text = "\n".join(number.place.path.read_text().split("\n")[number.place.line - 1 :])
    if not number.attribute:
        return text[text.index(f"<{number.place.tag}>") :].partition(">")[2].split("<")[0].split()
    # Of several elements that start on one line, any may be meant.
    first = text.split("\n", 1)[0]
    options = re.findall(rf'<{number.place.tag}\b[^>]*?\s{number.attribute}="([^"]*)"', first)
    for option in options:
        words = option.split()
        if number.index < len(words) and float(words[number.index]) == float(number):
            return list(words)
    return None if not options else options[0].split()


@pytest.mark.parametrize("name", NAMES)
def test_every_number_stands_at_its_line(name: str) -> None:
    robot = read_robot(FILES / name)
    found = written(robot)
    for number in found:
        words = words_of(number)
        assert words is not None
        assert float(words[number.index]) == float(number), number.key
    # Masses, moments and places of all bodies are among them.
    assert len(found) > 5 * robot.bodies


def test_the_parameters_of_a_program_are_numbers_of_the_file() -> None:
    reference = ReferenceKernel(mechanism_of(read_robot(FILES / "arm.urdf")))
    names = [name for name, _, _ in reference.mechanism.parameters]
    lines = (FILES / "arm.urdf").read_text().split("\n")
    masses = [number for number, line in enumerate(lines, 1) if "<mass" in line]
    assert {f"arm.urdf:{line}: mass value" for line in masses} <= set(names)


@pytest.mark.parametrize("field", ["mass", "com", "inertia", "origin", "axis", "damping", "friction", "limits", "spring", "mimic"])
def test_each_quantity_knows_its_line(field: str) -> None:
    robot = read_robot(FILES / "arm.urdf")
    bodies = {body.name: body for body in robot.tree.bodies}
    inertia, joint = bodies["shoulder"].inertia, robot.joint("shoulder_joint")
    assert inertia is not None
    flange, follower = robot.joint("flange_joint"), robot.joint("right_finger_joint")
    place, text = {
        "mass": (inertia.places["mass"], '<mass value="3.7"/>'),
        "com": (inertia.places["pose"], '<origin xyz="0 -0.03 0.12"'),
        "inertia": (inertia.places["moments"], '<inertia ixx="0.0103"'),
        "origin": (bodies["shoulder"].places["pose"], '<origin rpy="0 0 0" xyz="0 0 0.3"'),
        "axis": (joint.places["axis"], '<axis xyz="0 0 1"/>'),
        "damping": (joint.places["damping"], '<dynamics damping="1.3"'),
        "friction": (joint.places["friction_loss"], 'friction="0.3"'),
        "limits": (joint.places["limits"], "<limit effort"),
        "spring": (flange.places["stiffness"], "<springStiffness>4.5"),
        "mimic": (follower.places["multiplier"], '<mimic joint="left_finger_joint"'),
    }[field]
    assert text in place.path.read_text().split("\n")[place.line - 1]


@pytest.mark.ci
def test_numbers_of_classes_stand_in_the_included_file() -> None:
    robot = read_robot(FILES / "humanoid.xml")
    place = robot.joint("left_knee").places["damping"]
    assert place.path.name == "humanoid_classes.xml"
    assert 'damping="2.75"' in place.path.read_text().split("\n")[place.line - 1]
    # What the file does not say stands at the element that leaves it out.
    anchor = robot.joint("left_knee").places["anchor"]
    assert 'name="left_knee"' in anchor.path.read_text().split("\n")[anchor.line - 1]
    # Of the numbers that all legs share, the program has one input.
    inputs = [name for name, _, _ in mechanism_of(robot).parameters if name.endswith(" joint damping")]
    assert len(inputs) == 3


def test_what_is_left_out_is_listed_with_its_lines() -> None:
    robot = read_robot(FILES / "arm.urdf")
    lines = robot.path.read_text().split("\n")
    found = {one.what: one for one in robot.left_out}
    for what, text, bears in (
        ("contacts", "<collision>", True),
        ("dry friction", 'friction="', True),
        ("visual geometry", "<visual>", False),
        ("safety controllers and calibration", "<safety_controller", False),
        ("transmissions", "<transmission", False),
        ("elements that URDF does not know", "<ros2_control", False),
        ("xacro leftovers", "<xacro:", False),
    ):
        expected = [number for number, line in enumerate(lines, 1) if text in line]
        extra = [number for number, line in enumerate(lines, 1) if what == "visual geometry" and "<material name" in line]
        assert found[what] == LeftOut(what, tuple(sorted(expected + extra)), bears)
    # A spring is read, and no more left out than the joints without limits.
    assert [lines[line - 1].strip() for line in found["gazebo elements"].lines] == [
        '<gazebo reference="forearm"><mu1>0.2</mu1><turnGravityOff>false</turnGravityOff></gazebo>'
    ]
    assert len(found["joint limits"].lines) == 8
    kinds = {one.what: one.bears_on_motion for one in read_robot(FILES / "quadruped.xml").left_out}
    assert {what for what, bears in kinds.items() if bears} == {
        "fluid",
        "equalities",
        "contacts",
        "dry friction",
        "joint limits",
    }


# One line each: a part of an MJCF, how it is told, and whether it bears on the motion.
PARTS = [
    ("<visual/>", "settings of the picture", False),
    ("<statistic/>", "settings of the picture", False),
    ('<size nconmax="3"/>', "sizes of memory", False),
    ("<bones/>", "elements that MJCF does not know", False),
    ('<option density="0 -0.0"/>', "", False),
    ('<option wind="0 0 -2"/>', "fluid", True),
    ('<asset><material name="red"/></asset>', "meshes, textures and materials", False),
    ('<custom><numeric name="one" data="1"/></custom>', "custom data", False),
    ('<keyframe><key name="rest"/></keyframe>', "keyframes", False),
    ('<contact><exclude body1="a" body2="b"/></contact>', "contacts that are excluded", False),
    ('<contact><pair geom1="one" geom2="other"/></contact>', "contacts", True),
    ('<deformable><skin name="skin"/></deformable>', "visual geometry", False),
    ('<deformable><flex name="flex"/></deformable>', "deformable bodies", True),
    ('<extension><plugin plugin="own"/></extension>', "plugins", True),
    ('<worldbody><body mocap="true"/></worldbody>', "bodies moved from outside", False),
    ("<worldbody><camera/></worldbody>", "cameras and lights", False),
    ("<worldbody><light/></worldbody>", "cameras and lights", False),
    ('<worldbody><geom name="one" size="1"/></worldbody>', "contacts", True),
    ('<worldbody><geom name="other" size="1" contype="0"/></worldbody>', "contacts", True),
    ('<worldbody><geom size="1" contype="0" conaffinity="0"/></worldbody>', "visual geometry", False),
    ('<tendon><fixed range="0 1"><joint joint="hinge" coef="1"/></fixed></tendon>', "tendon limits", True),
    ('<tendon><fixed frictionloss="0.5"><joint joint="hinge" coef="1"/></fixed></tendon>', "dry friction", True),
    ('<tendon><fixed frictionloss="0.0"><joint joint="hinge" coef="1"/></fixed></tendon>', "", False),
]


def test_parts_that_are_left_out_are_told_with_their_lines(tmp_path: Path) -> None:
    bodies = "".join(
        f'<body name="{name}"><joint name="{joint}"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
        for name, joint in (("a", "hinge"), ("b", "other"))
    )
    path = tmp_path / "robot.xml"
    path.write_text("\n".join(["<mujoco>", *(text for text, _, _ in PARTS), f"<worldbody>{bodies}</worldbody></mujoco>"]))
    told = {(what, bears) for _, what, bears in PARTS if what}
    expected = {
        LeftOut(what, tuple(line for line, (_, *own) in enumerate(PARTS, 2) if own == [what, bears]), bears) for what, bears in told
    }
    found = read_robot(path).left_out
    assert set(found) == expected and len(found) == len(expected)
    assert [one.bears_on_motion for one in found] == sorted((one.bears_on_motion for one in found), reverse=True)


def test_joints_stand_in_the_order_of_the_file() -> None:
    for name in ("arm.urdf", "humanoid.urdf"):
        robot = read_robot(FILES / name)
        text = robot.path.read_text()
        places = [text.index(f'<joint name="{joint}"') for joint in robot.joints]
        assert places == sorted(places)
    robot = read_robot(FILES / "quadruped.xml")
    assert robot.joints[:6] == ("base", "wag", "swing_0", "lift_0", "reach_0", "(joint 1 of (body 1 of thigh_0))")
    assert (robot.bodies, len(robot.joints), robot.degrees_of_freedom) == (15, 18, 25)


def certified(robot: Robot, like: ReferenceKernel | None = None) -> tuple[ReferenceKernel, Reference]:
    reference = ReferenceKernel(mechanism_of(robot))
    states = sample((like or reference).mechanism, 40, SEED)
    return reference, reference.evaluate(states)


@pytest.mark.ci
def test_twins_in_both_formats_have_the_same_accelerations() -> None:
    """Their angles are rounded apart, in degrees here and radians there."""
    by_urdf = read_robot(FILES / "humanoid.urdf", floating_base=True)
    text = (FILES / "humanoid.xml").read_text()
    by_mjcf = read_robot(FILES / "humanoid.xml")
    assert "freejoint" in text and by_mjcf.degrees_of_freedom == by_urdf.degrees_of_freedom == 35
    assert (by_mjcf.total_mass, by_mjcf.bodies) == (by_urdf.total_mass, by_urdf.bodies) == (pytest.approx(73.2), 30)
    first, truth = certified(by_urdf)
    assert truth.certified.all()
    assert set(by_urdf.joints) == set(by_mjcf.joints)
    second, other = certified(replace(by_mjcf, joints=by_urdf.joints), first)
    assert second.mechanism.joint_sizes == first.mechanism.joint_sizes
    assert compare(truth, other.high).backward_error.max() < 4


@pytest.mark.ci
def test_a_free_joint_may_have_its_velocity_in_its_own_frame() -> None:
    robot = read_robot(FILES / "humanoid.urdf", floating_base=True)
    in_parent, in_body = ReferenceKernel(mechanism_of(robot)), ReferenceKernel(mechanism_of(robot), linear_velocity_in_body=True)
    states = sample(in_parent.mechanism, 10, SEED)
    expected = in_parent.evaluate(states).high
    for row in range(len(states)):
        w, x, y, z = states.q[row, 3:7] / np.linalg.norm(states.q[row, 3:7])
        skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        rotation = np.eye(3) + 2 * w * skew + 2 * skew @ skew
        one = states[[row]]
        velocity, tau = one.v.copy(), one.tau.copy()
        velocity[0, :3], tau[0, :3] = rotation.T @ velocity[0, :3], rotation.T @ tau[0, :3]
        found = in_body.evaluate(type(one)(one.q, velocity, tau, one.time)).high[0]
        found[:3] = rotation @ (found[:3] + np.cross(velocity[0, 3:6], velocity[0, :3]))
        np.testing.assert_allclose(found, expected[row], rtol=0, atol=1e-11 * np.abs(expected[row]).max())


def test_data_roundoff_includes_the_rounding_of_each_number_of_the_file(tmp_path: Path) -> None:
    """Two files whose masses differ by an ulp differ by about a data roundoff, and by no more."""
    text = (FILES / "arm.urdf").read_text()
    path = tmp_path / "arm.urdf"
    path.write_text(
        text.replace('<mass value="3.7"/>', f'<mass value="{float(np.nextafter(3.7, 4))!r}"/>').replace(
            'value="2.3"', f'value="{float(np.nextafter(2.3, 3))!r}"'
        )
    )
    reference, truth = certified(read_robot(FILES / "arm.urdf"))
    _, other = certified(read_robot(path), reference)
    error = np.abs((other.high - truth.high) + (other.low - truth.low))
    assert error.max() > 0
    assert 0.001 < compare(truth, other.high).backward_error.max() < 2


def test_a_floating_base_has_a_name_that_no_joint_of_the_file_has(tmp_path: Path) -> None:
    """Quadrupeds call the joint that fixes their trunk so."""
    text = (FILES / "arm.urdf").read_text()
    name = next(joint.name for joint in read_robot(FILES / "arm.urdf").tree.joints)
    path = tmp_path / "arm.urdf"
    path.write_text(text.replace(f'"{name}"', '"floating_base"'))
    robot = read_robot(path, floating_base=True)
    assert robot.floating_base == robot.joints[0] == "floating_base_2" and "floating_base" in robot.joints
    assert read_robot(FILES / "arm.urdf", floating_base=True).floating_base == "floating_base"


def test_what_a_file_leaves_unsaid_has_the_value_of_its_format(tmp_path: Path) -> None:
    """The axis of a joint, and the share of torques in a weld of an MJCF."""
    path = tmp_path / "arm.urdf"
    text = (FILES / "arm.urdf").read_text()
    path.write_text(re.sub(r"<axis [^>]*/>", "", text))
    assert {tuple(map(float, joint.axis)) for joint in read_robot(path).tree.joints if joint.kind.has_axis} == {(1.0, 0.0, 0.0)}
    path = tmp_path / "held.xml"
    arm = '<body><joint name="pin"/><geom size="0.1"/></body>'
    body = f'<body name="held"><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>{arm}</body>'
    path.write_text(f'<mujoco><worldbody>{body}</worldbody><equality><weld body1="held"/></equality></mujoco>')
    model, robot = mujoco.MjModel.from_xml_path(str(path)), read_robot(path)
    assert [float(component) for component in robot.joint("pin").axis] == model.joint("pin").axis.tolist() == [0.0, 0.0, 1.0]
    [weld] = [one.rows for one in robot.equalities]
    assert isinstance(weld, Weld) and float(weld.torque_scale) == model.eq_data[0, 10] == 1.0


def test_a_joint_that_mimics_one_that_mimics_has_the_product_of_both(tmp_path: Path) -> None:
    link = '<link name="{0}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    joint = '<joint name="to_{1}" type="continuous"><parent link="{0}"/><child link="{1}"/>{2}</joint>'
    follow = '<mimic joint="{}" multiplier="{}" offset="{}"/>'
    joints = [("a", "b", ""), ("b", "c", follow.format("to_b", 4, 0.125)), ("c", "d", follow.format("to_c", 0.5, 0.75))]
    path = tmp_path / "chain.urdf"
    path.write_text(f'<robot name="chain">{"".join(map(link.format, "abcd"))}{"".join(joint.format(*one) for one in joints)}</robot>')
    _, first, second = read_robot(path).tree.joints
    assert [(one.follows, float(one.multiplier), float(one.offset)) for one in (first, second)] == [
        ("to_b", 4.0, 0.125),
        ("to_b", 2.0, 0.8125),
    ]


def test_replicas_are_counted_before_they_are_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Four of three elements below the one that replicates, in a file of six."""
    body = '<body><joint name="pin"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
    path = tmp_path / "many.xml"
    path.write_text(f'<mujoco><worldbody><replicate count="4" offset="1 0 0">{body}</replicate></worldbody></mujoco>')
    monkeypatch.setattr("harness.files.mjcf.reading.MAXIMUM_ELEMENTS", 18)
    assert len(read_robot(path).joints) == 4
    monkeypatch.setattr("harness.files.mjcf.reading.MAXIMUM_ELEMENTS", 17)
    with pytest.raises(InvalidModel, match="makes 18 elements; expected at most 17"):
        read_robot(path)
    (tmp_path / "part.xml").write_text(f"<mujocoinclude>{body}</mujocoinclude>")
    path.write_text('<mujoco><worldbody><include file="part.xml"/></worldbody></mujoco>')
    monkeypatch.setattr("harness.files.mjcf.reading.MAXIMUM_ELEMENTS", 5)
    assert len(read_robot(path).joints) == 1
    monkeypatch.setattr("harness.files.mjcf.reading.MAXIMUM_ELEMENTS", 4)
    with pytest.raises(InvalidModel, match="makes 5 elements; expected at most 4"):
        read_robot(path)


@pytest.mark.parametrize("numbers", ["0.1 0", "0 0.1", "0.1 -1"])
def test_a_time_constant_without_a_damping_ratio_is_refused(numbers: str, tmp_path: Path) -> None:
    path = tmp_path / "one.xml"
    joint = f'<joint name="pin" springdamper="{numbers}"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    path.write_text(f"<mujoco><worldbody><body>{joint}</body></worldbody></mujoco>")
    with pytest.raises(InvalidModel, match="expected two positive numbers"):
        read_robot(path)


LEG = """<link name="{side}_thigh"/><link name="{side}_{foot}"/>
<joint name="{side}_hip" type="revolute"><parent link="base"/><child link="{side}_thigh"/></joint>
<joint name="{side}_knee" type="revolute"><parent link="{side}_thigh"/><child link="{side}_{foot}"/></joint>"""


@pytest.mark.parametrize(
    ("root", "ends", "trunk"),
    [
        ("base", ("foot", "foot"), "base"),
        ("base", ("foot",), ""),
        ("base", ("link", "link", "link"), "base"),
        ("base", ("link", "link"), ""),
        ("base", ("link", "link", "gripper"), "base"),
        ("base", ("link", "finger_tip", "thumb"), ""),
        ("plate", ("link", "link", "link"), ""),
        ("plate", ("toe", "toe"), "plate"),
        ("plate", ("rotor", "rotor", "propeller"), "plate"),
        ("plate", ("rotor", "rotor"), ""),
    ],
)
def test_a_trunk_that_hangs_on_the_world_is_told(root: str, ends: tuple[str, ...], trunk: str, tmp_path: Path) -> None:
    legs = "".join(LEG.format(side=side, foot=end) for side, end in zip("abc", ends, strict=False))
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="r"><link name="base"/>{legs}</robot>'.replace('"base"', f'"{root}"'))
    assert read_robot(path).trunk_on_the_world == trunk
    assert read_robot(path, floating_base=True).trunk_on_the_world == ""


@pytest.mark.parametrize("axis", ["", "<axis/>"])
def test_a_joint_of_a_urdf_without_an_axis_is_along_x(axis: str, tmp_path: Path) -> None:
    """Source: http://wiki.ros.org/urdf/XML/joint, axis."""
    inertial = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    joint = f'<joint name="j" type="continuous"><parent link="base"/><child link="arm"/>{axis}</joint>'
    (tmp_path / "arm.urdf").write_text(f'<robot name="arm"><link name="base"/><link name="arm">{inertial}</link>{joint}</robot>')
    [read] = read_robot(tmp_path / "arm.urdf").tree.joints
    assert read.axis == (1, 0, 0)
