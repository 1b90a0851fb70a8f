"""Pinocchio stores the damping of joints, and its dynamics apply none."""

from dataclasses import replace
from fractions import Fraction

from harness.comparison.readings import Reading, with_joints
from harness.robots.robot import Robot
from harness.robots.tree import Tree


def _tree(robot: Robot) -> Tree:
    return with_joints(robot.tree, lambda joint: replace(joint, damping=Fraction(0)) if joint.damping else joint)


READING = Reading(
    name="joint damping",
    engine="pinocchio",
    formats=("urdf", "mjcf"),
    sentence="Pinocchio's ABA applies no joint damping",
    concerns="joints",
    source="stack-of-tasks/pinocchio issues 1291 and 1147: damping and friction are the user's, in tau; Model.damping is data only",
    tree=_tree,
    supplied=True,
)
