"""A mimic joint of a URDF is free in Pinocchio."""

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
    engine="pinocchio",
    formats=("urdf",),
    sentence="Pinocchio's URDF reader takes a joint that mimics another for one that moves by itself",
    concerns="joints",
    source="Pinocchio 4.1, parsers/urdf.hpp, buildModel: mimic is false unless the caller asks; aba refuses models with mimic joints",
    tree=_tree,
)
