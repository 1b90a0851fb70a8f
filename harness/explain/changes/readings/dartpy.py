"""What DART's loader of URDF leaves out, and how its dampers act."""

from dataclasses import replace
from fractions import Fraction

from harness.explain.changes.readings import _left_out, law, with_joints
from harness.files.tree import Joint, Tree
from harness.trees.robot import Robot

_FORMATS = ("urdf",)
_LOADER = "DART, dart/utils/urdf/DartLoader.cpp, which reads links, and of joints origin, axis, limits, dynamics and mimic"
# Of a Skeleton that is in no world [s].
_TIME_STEP = Fraction(0.001)


@law("implicit dampers", "joints", supplied=True, after=("rotor inertias",))
def _damped_implicitly(robot: Robot) -> Tree:
    """At the end of a step h the damper acts on v + h a, as if h times the damping were an inertia of a rotor."""

    def read(joint: Joint) -> Joint:
        return replace(joint, armature=joint.armature + _TIME_STEP * joint.damping) if joint.damping else joint

    return with_joints(robot.tree, read)


READINGS = (
    _left_out.unit_inertias(
        "dartpy",
        _FORMATS,
        "DART gives a link without <inertial> 1 kg and moments of 1 kg m^2",
        "DART, dart/utils/urdf/DartLoader.hpp, Options::mDefaultInertia",
    ),
    _left_out.springs("dartpy", _FORMATS, "DART's loader reads no springs", _LOADER),
    _left_out.rotors("dartpy", _FORMATS, "DART knows no rotor inertias of joints", _LOADER),
    _left_out.mimics(
        "dartpy",
        _FORMATS,
        "DART has a joint that mimics another follow it by a constraint of its world, which computeForwardDynamics does not ask",
        "DART, dart/utils/urdf/DartLoader.cpp, and dart/constraint/MimicMotorConstraint.cpp",
    ),
    _left_out.point_springs("dartpy", _FORMATS, "DART's loader reads no springs between points", _LOADER),
    _damped_implicitly(
        "dartpy",
        _FORMATS,
        "DART has the dampers of joints act at the end of its time step, which is 1 ms by default",
        "https://github.com/dartsim/dart/issues/1450; dart/dynamics/detail/GenericJoint.hpp, updateInvProjArtInertiaImplicit",
    ),
)
