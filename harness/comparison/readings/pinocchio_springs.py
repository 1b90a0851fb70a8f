"""Pinocchio's dynamics have no springs in joints."""

from dataclasses import replace
from fractions import Fraction

from harness.comparison.readings import Reading, with_joints
from harness.robots.robot import Robot
from harness.robots.tree import Tree


def _tree(robot: Robot) -> Tree:
    return with_joints(robot.tree, lambda joint: replace(joint, stiffness=Fraction(0)) if joint.stiffness else joint)


READING = Reading(
    name="springs",
    engine="pinocchio",
    formats=("urdf", "mjcf"),
    sentence="Pinocchio applies no springs",
    concerns="joints",
    source="Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, which does not read stiffness, and aba.hxx, which has no such force",
    tree=_tree,
    supplied=True,
)
