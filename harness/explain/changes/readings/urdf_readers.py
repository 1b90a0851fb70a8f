"""Elements that adam, DART and iDynTree, which read URDF alone, leave out of it or take otherwise."""

from dataclasses import replace
from fractions import Fraction

import numpy as np

from harness.explain.changes.readings import _left_out, law, readings_of, with_inertias, with_joints
from harness.files.tree import Joint, Tree
from harness.trees.robot import Robot

_URDF = ("urdf",)
_ADAM = "adam, src/adam/model/std_factories: of a URDF it takes links with their inertials, and joints with origin, axis and limits"
_DART = "DART, dart/utils/urdf/DartLoader.cpp, which reads links, and of joints origin, axis, limits, dynamics and mimic"
_IDYNTREE = "iDynTree, src/model_io/codecs: its parser of URDF knows links, joints and sensors"
# Of a DART Skeleton that is in no world [s].
_TIME_STEP = Fraction(0.001)

# The default of adam's KinDynComputations.
_gravity = _left_out.gravity_along_z(float(np.float32(-9.80665)), "adam")


@law("implicit dampers", "joints", supplied=True, after=("rotor inertias",), each=with_joints)
def _damped_implicitly(joint: Joint) -> Joint:
    """At the end of a step h the damper acts on v + h a, as if h times the damping were an inertia of a rotor."""
    return replace(joint, armature=joint.armature + _TIME_STEP * joint.damping)


@law("inertia without mass", "links")
def _without_frames(robot: Robot) -> Tree:
    """A link is taken for a frame if a fixed joint carries it, nothing but such links hangs on it, and its mass is 0."""
    frames: set[str] = set()
    parents = {body.name: body.parent for body in robot.tree.bodies}
    for body in reversed(robot.tree.bodies):
        carries = any(parent == body.name and name not in frames for name, parent in parents.items())
        if body.parent in parents and not (body.joints or carries or (body.inertia and body.inertia.mass)):
            frames.add(body.name)
    return with_inertias(
        robot.tree, lambda body: None if body.name in frames and body.inertia and any(body.inertia.moments) else body.inertia
    )


ADAM = readings_of(
    "adam",
    {
        _URDF: {
            _left_out.dampers: ("The computations of adam apply no joint damping", _left_out.ADD_DAMPING, _ADAM),
            _left_out.springs: ("The parser of adam reads no springs", _left_out.ADD_SPRINGS, _ADAM),
            _left_out.rotors: ("The parser of adam reads no rotor inertias", _left_out.ADD_ROTORS, _ADAM),
            _left_out.mimics: ("The parser of adam leaves a mimic joint free", _left_out.LEAD, _ADAM),
            _left_out.point_springs: ("The parser of adam reads no springs between points", _left_out.ADD_POINT_SPRINGS, _ADAM),
            _gravity: (
                "The computations of adam take 9.80665 m/s^2 along -z for gravity, rounded to float32",
                "pass the gravity of the file to KinDynComputations, as gravity=[x, y, z, 0, 0, 0]",
                "adam, src/adam/numpy/computations.py, KinDynComputations: gravity",
            ),
        },
    },
)
DART = readings_of(
    "dartpy",
    {
        _URDF: {
            _left_out.unit_inertias: (
                "DART gives a link without <inertial> 1 kg and moments of 1 kg m^2",
                _left_out.WRITE_INERTIA,
                "DART, dart/utils/urdf/DartLoader.hpp, Options::mDefaultInertia",
            ),
            _left_out.springs: ("DART's loader reads no springs", _left_out.ADD_SPRINGS, _DART),
            _left_out.rotors: ("DART knows no rotor inertias of joints", _left_out.ADD_ROTORS, _DART),
            _left_out.mimics: (
                "DART holds a mimic joint by a constraint of its World, which computeForwardDynamics leaves out",
                "add the skeleton to a World, and step that",
                "DART, dart/utils/urdf/DartLoader.cpp, and dart/constraint/MimicMotorConstraint.cpp",
            ),
            _left_out.point_springs: ("DART's loader reads no springs between points", _left_out.ADD_POINT_SPRINGS, _DART),
            _damped_implicitly: (
                "DART evaluates the dampers of joints at the end of its time step, which is 1 ms by default",
                "call setTimeStep(0) on the skeleton",
                "https://github.com/dartsim/dart/issues/1450; dart/dynamics/detail/GenericJoint.hpp, updateInvProjArtInertiaImplicit",
            ),
        },
    },
)
IDYNTREE = readings_of(
    "idyntree",
    {
        _URDF: {
            _without_frames: (
                "The parser of iDynTree takes a link of mass 0 at the end of fixed joints as a mere frame, and drops its inertia",
                "give the link a mass above 0",
                "iDynTree, src/model/src/ModelTransformers.cpp, removeFakeLinks",
            ),
            _left_out.dampers: (
                "The parser of iDynTree stores the damping of joints, but no computation applies it",
                _left_out.ADD_DAMPING,
                "iDynTree, src/model: IJoint::getDamping is read by no algorithm of ForwardKinematics.cpp or Dynamics.cpp",
            ),
            _left_out.springs: (
                "The parser of iDynTree reads no springs",
                _left_out.ADD_SPRINGS,
                _IDYNTREE,
            ),
            _left_out.rotors: (
                "The parser of iDynTree reads no rotor inertias",
                _left_out.ADD_ROTORS,
                _IDYNTREE,
            ),
            _left_out.mimics: (
                "The parser of iDynTree leaves a mimic joint free, without a message",
                _left_out.LEAD,
                "iDynTree, src/model_io/codecs/src/URDFParsingUtils and JointElement.cpp, which know no <mimic>",
            ),
            _left_out.point_springs: (
                "The parser of iDynTree reads no springs between points",
                _left_out.ADD_POINT_SPRINGS,
                _IDYNTREE,
            ),
        },
    },
)
