"""Pinocchio's reader of MJCF scales no masses."""

from dataclasses import replace

from harness.comparison.readings import Reading
from harness.robots.robot import Robot
from harness.robots.tree import Tree


def _tree(robot: Robot) -> Tree:
    return robot.tree if robot.tree.total_mass is None else replace(robot.tree, total_mass=None)


READING = Reading(
    name="settotalmass",
    engine="pinocchio",
    formats=("mjcf",),
    sentence="Pinocchio's MJCF reader passes over <compiler settotalmass>",
    concerns="files",
    source="Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, parseCompiler, which does not read it",
    tree=_tree,
)
