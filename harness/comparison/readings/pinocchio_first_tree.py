"""Pinocchio's reader of MJCF reads the first body of the world alone."""

from harness.comparison.readings import Reading, without_bodies
from harness.robots.robot import Robot
from harness.robots.tree import WORLD, Tree


def _tree(robot: Robot) -> Tree:
    return without_bodies(robot.tree, [body.name for body in robot.tree.bodies if body.parent == WORLD][1:])


READING = Reading(
    name="further trees",
    engine="pinocchio",
    formats=("mjcf",),
    sentence="Pinocchio's MJCF reader reads the first body in <worldbody> with what it carries, and passes over the others",
    concerns="bodies",
    source="Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, parseGraph: get_child(worldbody).get_child(body), of which there is one",
    tree=_tree,
)
