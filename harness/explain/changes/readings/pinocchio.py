"""Elements that Pinocchio's dynamics leave out, and its reader of URDF; ``pinocchio_mjcf`` has its reader of MJCF."""

import math
from dataclasses import replace
from fractions import Fraction

from harness.explain.changes.readings import _left_out, element_at, law, readings_of, with_bodies, with_inertias, with_joints
from harness.files.given import vector
from harness.files.joint_kinds import JointKind
from harness.files.tree import Body, Inertia, Joint

_BOTH, _URDF, _MJCF = ("urdf", "mjcf"), ("urdf",), ("mjcf",)
_NO_FORCE = "and aba.hxx, which has no such force"
_UPWARD = vector((0, 0, 1))
# Distance up to which an axis is one of the frame's, of the shorter of both; as Eigen's isApprox.
_ALIGNED = 1e-12

_NOTHING = (Fraction(0),) * 6
# pinocchio::Model::gravity981.
_gravity = _left_out.gravity_along_z(-9.81, "Pinocchio")


@law("axis of planar joints", "joints", each=with_joints)
def _in_the_plane_of_the_frame(joint: Joint) -> Joint:
    x, y, z = joint.axis
    return replace(joint, axis=_UPWARD) if joint.kind == JointKind.PLANAR and (x or y or z < 0) else joint


@law(
    "energy of rotors at unaligned hinges",
    "joints",
    after=("rotor inertias", "rotor inertia beside a childclass", "class beside a childclass", "frames"),
    quantity="energy",
    each=with_bodies,
)
def _without_energy(body: Body) -> Body:
    """The armature of the only joint of a body has no energy; several are composed to one, which has the energy of all."""
    joints = body.joints
    return replace(body, joints=(replace(joints[0], armature=Fraction(0)),)) if len(joints) == 1 and _is_unaligned(joints[0]) else body


def _is_unaligned(joint: Joint) -> bool:
    """True for a hinge that is a ``JointModelRevoluteUnaligned`` of Pinocchio; a continuous one of a URDF is another."""
    element = element_at(joint.place)
    if joint.kind != JointKind.HINGE or (element is not None and element.get("type") == "continuous"):
        return False
    axis = [float(part) for part in joint.axis]
    shorter = min(1.0, math.hypot(*axis))
    return all(math.dist(axis, along) > _ALIGNED * shorter for along in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))


@law("blanks after a number", "links", each=with_inertias)
def _without_blanks(body: Body) -> Inertia | None:
    """No moments of a link one of whose numbers has blanks or a line break behind it, and no mass either where the mass has."""
    inertia, element = body.inertia, element_at(body.place)
    inertial = None if element is None else element.find("inertial")
    if inertia is None or inertial is None:
        return inertia
    are_blank = [
        any(text != text.rstrip() for text in part.attrib.values()) for tag in ("mass", "inertia") for part in inertial.iterfind(tag)
    ]
    if not any(are_blank):
        return inertia
    return replace(inertia, moments=_NOTHING, mass=Fraction(0) if are_blank[0] else inertia.mass)


@law(
    "rotors of free joints",
    "joints",
    after=("rotor inertias", "rotor inertia beside a childclass", "class beside a childclass", "frames"),
    each=with_joints,
)
def _along_the_body(joint: Joint) -> Joint:
    return replace(joint, rotors_in_body=True) if joint.kind == JointKind.FREE and joint.armature else joint


READINGS = readings_of(
    "pinocchio",
    {
        _BOTH: {
            _gravity: (
                "Pinocchio takes 9.81 m/s^2 along -z for gravity, whatever the file says",
                "set model.gravity.linear to the gravity of the file",
                "Pinocchio 4.1, multibody/model.hpp, gravity981; its MJCF reader reads no <option gravity>",
            ),
            _left_out.dampers: (
                "Pinocchio's ABA applies no joint damping",
                _left_out.ADD_DAMPING,
                "stack-of-tasks/pinocchio issues 1291 and 1147: damping and friction are the user's, in tau; Model.damping is data only",
            ),
            _left_out.springs: (
                "Pinocchio applies no springs",
                _left_out.ADD_SPRINGS,
                f"Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, which does not read stiffness, {_NO_FORCE}",
            ),
            _left_out.springs_without_axis: (
                "Pinocchio applies no springs",
                _left_out.ADD_TURNING_SPRINGS,
                f"Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, which does not read stiffness, {_NO_FORCE}",
            ),
            _left_out.point_springs: (
                "Pinocchio has no springs between points, and no tendons",
                _left_out.ADD_POINT_SPRINGS,
                f"Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, which reads no <tendon>, {_NO_FORCE}",
            ),
        },
        _URDF: {
            _in_the_plane_of_the_frame: (
                "Pinocchio moves a planar joint in the xy plane of the joint's frame, whatever axis the file gives it",
                "turn the joint's origin so that its z is the axis",
                "Pinocchio 4.1, multibody/joint/joint-planar.hpp, without axis; parsers/urdf/model.cpp: planar, with normal axis along Z",
            ),
            _left_out.rotors: (
                "Pinocchio's reader of URDF reads no rotor inertias",
                "set model.armature to the rotor inertias",
                "Pinocchio 4.1, parsers/urdf/model.cpp, which reads no <transmission>",
            ),
            _left_out.ball_joints: (
                "Pinocchio's reader of URDF passes over Drake's ball joint, and fixes the root link to the world",
                "build the model with pin.JointModelSpherical() as its root joint",
                "Pinocchio 4.1, parsers/urdf/model.cpp, which reads the joints of URDF alone",
            ),
            _left_out.mimics: (
                "Pinocchio's reader of URDF leaves a mimic joint free",
                "build the model with mimic=True, and solve with pin.crba and pin.nonLinearEffects",
                "Pinocchio 4.1, parsers/urdf.hpp, buildModel: mimic is false unless the caller asks; aba refuses models with mimic joints",
            ),
        },
        _MJCF: {
            _left_out.actuators: (
                "Pinocchio's ABA drives no actuator",
                _left_out.DRIVE,
                "Pinocchio documentation, aba, whose one input of forces is tau; parsers/mjcf/mjcf-graph.cpp, which reads no <actuator>",
            ),
            _left_out.rotors_of_actuators: (
                "Pinocchio's MJCF reader reads no actuators, nor the armature and damping that they have",
                _left_out.ADD_TO_TARGET,
                "Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, which reads no <actuator>",
            ),
            _left_out.gravity_compensation: (
                "Pinocchio has no gravity compensation of bodies",
                _left_out.CARRY_WEIGHTS,
                f"Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, which reads no gravcomp, {_NO_FORCE}",
            ),
            _left_out.slack_springs: (
                "Pinocchio has no springs between points, and no tendons",
                _left_out.ADD_POINT_SPRINGS,
                f"Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, which reads no <tendon>, {_NO_FORCE}",
            ),
            _left_out.tendon_inertias: (
                "Pinocchio has no tendons, nor their inertia",
                _left_out.ADD_TENDON_INERTIAS,
                "Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, which reads no <tendon>",
            ),
            _left_out.linear_tendons: (
                "Pinocchio has no tendons on joints",
                _left_out.ADD_TENDONS,
                f"Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, which reads no <tendon>, {_NO_FORCE}",
            ),
        },
    },
) + readings_of(
    "pinocchio",
    {
        _BOTH: {
            _without_energy: (
                "Pinocchio's computeKineticEnergy leaves out the armature of a hinge about another axis than 1 0 0, 0 1 0 or 0 0 1",
                "add armature v^2 / 2 of each of them",
                "Pinocchio 4.1, multibody/joint/joint-revolute-unaligned.hxx, whose calc sets data.v and not data.joint_v",
            ),
        },
        _MJCF: {
            _along_the_body: (
                ("Pinocchio applies the armature of a free joint along the axes of the body, which turn, and not along those of the world"),
                'write <freejoint/>, or armature="0" on the free joint, which has no rotor',
                "Pinocchio 4.1, multibody/joint/joint-free-flyer.hpp: its velocity is along the axes of the body, as armature is in aba",
            ),
        },
        _URDF: {
            _without_blanks: (
                "Pinocchio's reader of URDF sets the moments of a link to 0 if one of its numbers has a trailing blank, and its mass too "
                "if that has one",
                "write the numbers of <mass> and <inertia> without blanks or line breaks behind them",
                "urdfdom, urdf_parser/src/link.cpp, parseInertial, and strToDouble, which wants the end of the text behind a number",
            ),
        },
    },
    is_misread=True,
)
