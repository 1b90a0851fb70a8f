"""What Pinocchio's dynamics and its reader of URDF leave out; what its reader of MJCF does is in ``pinocchio_mjcf``."""

from dataclasses import replace
from fractions import Fraction

from harness.explain.changes.readings import _left_out, law, with_joints
from harness.files.joint_kinds import JointKind
from harness.files.tree import Given, Joint, Tree, vector
from harness.trees.robot import Robot

_BOTH, _URDF = ("urdf", "mjcf"), ("urdf",)
_NO_FORCE = "and aba.hxx, which has no such force"
# pinocchio::Model::gravity981.
_GRAVITY = -9.81
_UPWARD = vector((0, 0, 1))


@law("gravity", "files", supplied=True)
def _gravity(robot: Robot) -> Tree:
    tree, place = robot.tree, robot.tree.place
    # A decimal that the engine rounds, as the file's own is.
    down = Fraction(_GRAVITY) if place is None else Given(_GRAVITY, place, "gravity of Pinocchio")
    gravity = vector((0, 0, down))
    return tree if tree.gravity == gravity else replace(tree, gravity=gravity)


@law("axis of planar joints", "joints")
def _in_the_plane_of_the_frame(robot: Robot) -> Tree:
    def read(joint: Joint) -> Joint:
        x, y, z = joint.axis
        return replace(joint, axis=_UPWARD) if joint.kind == JointKind.PLANAR and (x or y or z < 0) else joint

    return with_joints(robot.tree, read)


READINGS = (
    _gravity(
        "pinocchio",
        _BOTH,
        "Pinocchio takes 9.81 m/s^2 along -z for gravity, whatever the file says",
        "Pinocchio 4.1, multibody/model.hpp, gravity981; its MJCF reader reads no <option gravity>",
    ),
    _in_the_plane_of_the_frame(
        "pinocchio",
        _URDF,
        "Pinocchio moves a planar joint in the xy plane of the joint's frame, whatever axis the file gives it",
        "Pinocchio 4.1, multibody/joint/joint-planar.hpp, without axis; parsers/urdf/model.cpp: planar, with normal axis along Z",
    ),
    _left_out.dampers(
        "pinocchio",
        _BOTH,
        "Pinocchio's ABA applies no joint damping",
        "stack-of-tasks/pinocchio issues 1291 and 1147: damping and friction are the user's, in tau; Model.damping is data only",
    ),
    _left_out.springs(
        "pinocchio",
        _BOTH,
        "Pinocchio applies no springs",
        f"Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, which does not read stiffness, {_NO_FORCE}",
    ),
    _left_out.point_springs(
        "pinocchio",
        _BOTH,
        "Pinocchio has no springs between points, and no tendons",
        f"Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, which reads no <tendon>, {_NO_FORCE}",
    ),
    _left_out.linear_tendons(
        "pinocchio",
        ("mjcf",),
        "Pinocchio has no tendons on joints",
        f"Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, which reads no <tendon>, {_NO_FORCE}",
    ),
    _left_out.rotors(
        "pinocchio",
        _URDF,
        "Pinocchio's reader of URDF reads no rotor inertias",
        "Pinocchio 4.1, parsers/urdf/model.cpp, which reads no <transmission>",
    ),
    _left_out.ball_joints(
        "pinocchio",
        _URDF,
        "Pinocchio's reader of URDF passes over Drake's ball joint, and fixes the root link to the world",
        "Pinocchio 4.1, parsers/urdf/model.cpp, which reads the joints of URDF alone",
    ),
    _left_out.mimics(
        "pinocchio",
        _URDF,
        "Pinocchio's URDF reader takes a joint that mimics another for one that moves by itself",
        "Pinocchio 4.1, parsers/urdf.hpp, buildModel: mimic is false unless the caller asks; aba refuses models with mimic joints",
    ),
)
