"""Pinocchio's reader of MJCF passes over tendons."""

from dataclasses import replace

from harness.comparison.readings import Reading
from harness.robots.robot import Robot
from harness.robots.tree import Tree


def _tree(robot: Robot) -> Tree:
    tree = robot.tree
    return replace(tree, springs=(), couplings=()) if tree.springs or tree.couplings else tree


READING = Reading(
    name="tendons",
    engine="pinocchio",
    formats=("urdf", "mjcf"),
    sentence="Pinocchio has no springs between points, and no tendons",
    concerns="tendons",
    source="Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, which reads no <tendon>, and aba.hxx, which has no such force",
    tree=_tree,
)
