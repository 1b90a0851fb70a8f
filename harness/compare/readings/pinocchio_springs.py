"""Pinocchio's dynamics have no springs, in joints or between points."""

from dataclasses import replace
from fractions import Fraction

from harness.compare.readings import Reading, with_joints
from harness.robots.robot import Robot
from harness.robots.tree import Tree


def _tree(robot: Robot) -> Tree:
    tree = with_joints(robot.tree, lambda joint: replace(joint, stiffness=Fraction(0)) if joint.stiffness else joint)
    return replace(tree, springs=(), couplings=()) if tree.springs or tree.couplings else tree


READING = Reading(
    name="springs",
    engine="pinocchio",
    formats=("urdf", "mjcf"),
    sentence="Pinocchio applies no springs",
    concerns="joints and tendons",
    source="Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, which reads neither stiffness nor tendons, and aba.hxx, which has no such force",
    tree=_tree,
)
