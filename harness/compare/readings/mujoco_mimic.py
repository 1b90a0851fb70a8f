"""A mimic joint of a URDF is free in MuJoCo."""

from dataclasses import replace
from fractions import Fraction

from harness.compare.readings import Reading, with_joints
from harness.robots.robot import Robot
from harness.robots.tree import Joint, Tree


def _freed(joint: Joint) -> Joint:
    return replace(joint, follows="", multiplier=Fraction(1), offset=Fraction(0)) if joint.follows else joint


def _tree(robot: Robot) -> Tree:
    return with_joints(robot.tree, _freed)


READING = Reading(
    name="mimic joints",
    engine="mujoco",
    formats=("urdf",),
    sentence="MuJoCo makes a joint that mimics another a joint of its own under a soft equality constraint, which is off here",
    concerns="joints",
    source="MuJoCo documentation, Modeling, URDF extensions, and XML reference, equality/joint",
    tree=_tree,
)
