"""A mimic joint of a URDF is free in Pinocchio."""

from harness.comparison.readings import Reading, freed, with_joints
from harness.robots.robot import Robot
from harness.robots.tree import Tree


def _tree(robot: Robot) -> Tree:
    return with_joints(robot.tree, freed)


READING = Reading(
    name="mimic joints",
    engine="pinocchio",
    formats=("urdf",),
    sentence="Pinocchio's URDF reader takes a joint that mimics another for one that moves by itself",
    concerns="joints",
    source="Pinocchio 4.1, parsers/urdf.hpp, buildModel: mimic is false unless the caller asks; aba refuses models with mimic joints",
    tree=_tree,
    supplied=True,
)
