"""A file has one meaning, whoever asks: what a mechanism's model may not leave open is refused there, and listed or refused for a robot."""

from __future__ import annotations

from pathlib import Path

import pytest

from harness.errors import InvalidModel
from harness.files.model_file import JointSpring, parse_model
from harness.library import Library
from harness.trees.robot import Robot, read_robot

PLAIN = Library.built_in().model_path("bar_pendulum", "urdf").read_text()
EFFORTLESS = PLAIN.replace("<robot ", '<robot xmlns:drake="http://drake.mit.edu" ', 1)
URDF = EFFORTLESS.replace('effort="0"', 'effort="1"')
ROTOR = '<drake:rotor_inertia value="0.5"/>'
TRANSMISSION = (
    '<transmission name="t"><type>transmission_interface/SimpleTransmission</type><joint name="pin"/>'
    f'<actuator name="a">{ROTOR}</actuator></transmission>'
)
STIFFNESS, REFERENCE = "<springStiffness>2</springStiffness>", "<springReference>0</springReference>"
SPRING = f'<gazebo reference="pin">{STIFFNESS}{REFERENCE}</gazebo>'
PROBES = {
    "a rotor without effort": (EFFORTLESS, TRANSMISSION, "rotors of transmissions that Drake leaves out"),
    "a rotor of another transmission": (
        URDF,
        TRANSMISSION.replace("Simple", "FourBarLinkage"),
        "rotors of transmissions that Drake leaves out",
    ),
    "two rotors in an actuator": (URDF, TRANSMISSION.replace(ROTOR, ROTOR + ROTOR), None),
    "two springs in an element": (URDF, SPRING.replace(STIFFNESS, STIFFNESS + STIFFNESS), None),
    "a spring with another element": (
        URDF,
        SPRING.replace("</gazebo>", "<implicitSpringDamper>1</implicitSpringDamper></gazebo>"),
        "gazebo elements",
    ),
    "a spring in a joint without axis": (URDF.replace('type="continuous"', 'type="floating"').replace('type="revolute"', 'type="floating"'),
        SPRING, "springs and rotors of joints of none or several degrees of freedom"),
}  # fmt: skip


def robot_in(text: str, folder: Path) -> Robot:
    path = folder / "robot.urdf"
    path.write_text(text)
    return read_robot(path)


@pytest.mark.parametrize("name", PROBES)
def test_what_is_ambiguous_or_passed_over_is_no_silent_value(tmp_path: Path, name: str) -> None:
    """A mechanism's model is refused at a line; a robot's file has it listed as left out at that line, or is refused alike."""
    plain, added, listed = PROBES[name]
    text = plain.replace("</robot>", f"{added}\n</robot>")
    with pytest.raises(InvalidModel) as refused:
        parse_model(Path("model.urdf"), text, "urdf")
    assert refused.value.line
    if listed is None:
        with pytest.raises(InvalidModel) as found:
            robot_in(text, tmp_path)
        assert (found.value.line, found.value.problem) == (refused.value.line, refused.value.problem)
        return
    robot = robot_in(text, tmp_path)
    assert refused.value.line in next(one.lines for one in robot.left_out if one.what == listed)
    assert not any(joint.armature for joint in robot.tree.joints)
    assert any(joint.stiffness for joint in robot.tree.joints) == (name == "a spring with another element")


def test_what_is_read_is_read_alike(tmp_path: Path) -> None:
    text = URDF.replace("</robot>", f"{TRANSMISSION}\n{SPRING}\n</robot>")
    model, robot = parse_model(Path("model.urdf"), text, "urdf"), robot_in(text, tmp_path)
    (joint,) = robot.tree.joints
    assert [float(one.armature) for one in model.armatures] == [float(joint.armature)] == [0.5]
    assert [one.stiffness for one in model.force_elements if isinstance(one, JointSpring)] == [float(joint.stiffness)] == [2.0]
    assert {one.what for one in robot.left_out} <= {"effort and velocity limits"}


def test_a_transmission_without_rotors_moves_nothing_whatever_joints_it_names(tmp_path: Path) -> None:
    two_joints = TRANSMISSION.replace("Simple", "Differential").replace(ROTOR, "").replace('<joint name="pin"/>', 2 * '<joint name="pin"/>')
    for kind in (two_joints, two_joints.replace("Differential", "Simple")):
        text = URDF.replace("</robot>", f"{kind}\n</robot>")
        with pytest.raises(InvalidModel):
            parse_model(Path("model.urdf"), text, "urdf")
        assert {one.what for one in robot_in(text, tmp_path).left_out} <= {"effort and velocity limits", "transmissions"}
