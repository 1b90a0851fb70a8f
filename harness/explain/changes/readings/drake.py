"""Elements that Drake's parsers leave out in a plant in continuous time."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np

from harness.explain.changes.readings import _left_out, computed, element_at, law, matrix_of, readings_of, with_inertias, with_joints
from harness.files.given import Given, vector
from harness.files.tree import Body, Inertia, Tree
from harness.trees.robot import Robot

# Of the sphere [kg/m^3], and its mass where the file's is none [kg].
_DENSITY, _MASS = 1000.0, 1.0
# That Drake's parser of MJCF knows.
_ACTUATORS = ("motor", "position")
_BOTH, _MJCF = ("urdf", "mjcf"), ("mjcf",)
_MANUAL = 'Drake documentation, "Parsing model files"'
_PARSER = f"{_MANUAL}, MJCF; multibody/parsing/detail_mujoco_parser.cc"
# Of half the trace, or of 1 kg m^2 where that is more, by which moments may be off: RotationalInertia::CouldBePhysicallyValid.
_ROUNDINGS = 16 * 2.0**-52


def _is_possible(inertia: Inertia) -> bool:
    matrix = matrix_of(inertia)
    if not inertia.mass > 0:
        return not (inertia.mass or matrix.any())
    moments, allowed = np.linalg.eigvalsh(matrix), _ROUNDINGS * max(1.0, float(np.trace(matrix)) / 2)
    return bool(moments[0] >= -allowed and moments[0] + moments[1] + allowed >= moments[2])


def _sphere(body: Body, inertia: Inertia) -> Inertia:
    mass = inertia.mass if inertia.mass > 0 else computed(_MASS, body, "mass of Drake's sphere")
    radius = math.cbrt(3 * float(mass) / (4 * math.pi * _DENSITY))
    moment = computed(0.4 * float(mass) * radius**2, body, "moment of Drake's sphere")
    return replace(inertia, mass=mass, moments=(moment,) * 3 + (Fraction(0),) * 3)


@law("impossible inertias", "links", each=with_inertias)
def _possible(body: Body) -> Inertia | None:
    return body.inertia if body.inertia is None or _is_possible(body.inertia) else _sphere(body, body.inertia)


_without_settings = law("settings of the compiler", "files")(lambda robot: replace(robot.tree, total_mass=None, bounds=None))


@law("rotor inertias", "joints", supplied=True)
def _undriven(robot: Robot) -> Tree:
    root = element_at(robot.tree.place)
    driven = set() if root is None else {one.get("joint") for tag in _ACTUATORS for one in root.iterfind(f"actuator/{tag}")}
    return with_joints(robot.tree, lambda joint: joint if joint.name in driven else replace(joint, armature=Fraction(0)))


@law("gravity", "files", supplied=True)
def _written_gravity(robot: Robot) -> Tree:
    """That of ``<option>``, be it switched off by a flag or not."""
    tree, place = robot.tree, robot.tree.place
    root = element_at(place)
    if place is None or root is None or any(tree.gravity):
        return tree
    written = next((option.get("gravity") for option in root.iterfind("option") if option.get("gravity")), "0 0 -9.81")
    numbers = [float(word) for word in written.split()]
    return replace(tree, gravity=vector([Given(one, place, "gravity", index) for index, one in enumerate(numbers)]))


@law("several joints of a body", "bodies", after=("frames",))
def _in_a_row(robot: Robot) -> Tree:
    """All but the last of several joints of a body carry bodies of their own, without a pose."""
    taken = {body.name for body in robot.tree.bodies}
    bodies: list[Body] = []
    for body in robot.tree.bodies:
        parent = body.parent
        for joint in body.joints[:-1]:
            name = next(f"{body.name} {number}" for number in range(len(taken) + 1) if f"{body.name} {number}" not in taken)
            taken.add(name)
            bodies.append(Body(name, parent, (), (joint,), None, body.place))
            parent = name
        bodies.append(replace(body, parent=parent, joints=body.joints[-1:]))
    return replace(robot.tree, bodies=tuple(bodies))


READINGS = readings_of(
    "drake",
    {
        _MJCF: {
            _in_a_row: (
                "Drake's parser puts all but the last of several joints of a body into the frame of its parent, without the body's pose",
                "give each of these joints a body of its own",
                "Drake 1.51, multibody/parsing/detail_mujoco_parser.cc, ParseBody",
            ),
            _left_out.frames: (
                "Drake's parser ignores <frame> and <replicate> with all their contents",
                _left_out.WRITE_OUT_FRAMES,
                _PARSER,
            ),
            _without_settings: (
                "Drake's parser ignores settotalmass, boundmass, boundinertia and balanceinertia, with a warning",
                "write the masses and inertias that result into each <inertial>",
                _PARSER,
            ),
            _undriven: (
                "Drake's parser gives the armature of a joint to its motor or position actuator, and drops it if there is none",
                "add a <motor> for the joint",
                "https://github.com/RobotLocomotion/drake/pull/21967",
            ),
            _written_gravity: (
                "Drake's parser ignores the flag that switches gravity off, with a warning",
                "call plant.mutable_gravity_field().set_gravity_vector([0, 0, 0])",
                _PARSER,
            ),
            _left_out.actuators: (
                "Drake's parser makes a JointActuator of a motor on a joint, which acts only by the plant's input, and ignores other "
                "actuators",
                _left_out.DRIVE,
                _PARSER,
            ),
            _left_out.rotors_of_actuators: (
                "Drake's parser reads neither the armature nor the damping of actuators",
                _left_out.ADD_TO_TARGET,
                _PARSER,
            ),
            _left_out.gravity_compensation: ("Drake's parser reads no gravcomp of bodies", _left_out.CARRY_WEIGHTS, _PARSER),
            _left_out.point_springs: (
                "Drake's parser passes over tendons, with a warning",
                "add a LinearSpringDamper to the plant for each",
                _PARSER,
            ),
            _left_out.slack_springs: ("Drake's parser passes over tendons, with a warning", _left_out.ADD_POINT_SPRINGS, _PARSER),
            _left_out.tendon_inertias: (
                "Drake's parser passes over tendons, with a warning",
                _left_out.ADD_TENDON_INERTIAS,
                _PARSER,
            ),
            _left_out.linear_tendons: ("Drake's parser passes over tendons on joints, with a warning", _left_out.ADD_TENDONS, _PARSER),
        },
        _BOTH: {
            _left_out.springs: (
                "Drake's parser passes over the springs of joints, with a warning for those of an MJCF",
                "add a RevoluteSpring or PrismaticSpring to the plant for each",
                f"{_MANUAL}: <springStiffness> is unknown, and stiffness of an MJCF's joint is not supported",
            ),
            _left_out.springs_without_axis: (
                "Drake's parser passes over the springs of joints, with a warning",
                _left_out.ADD_TURNING_SPRINGS,
                f"{_MANUAL}: stiffness of an MJCF's joint is not supported",
            ),
            _possible: (
                (
                    "Drake replaces an inertia that no body can have by that of a solid sphere of 1000 kg/m^3 with the same mass, or 1 kg "
                    "if none is given, with a warning"
                ),
                _left_out.POSSIBLE,
                "Drake, multibody/parsing/detail_common.h, ParseSpatialInertia, and its fallback",
            ),
        },
    },
)
