"""Pinocchio's reader of MJCF passes over ``<option gravity>``."""

from dataclasses import replace
from fractions import Fraction

from harness.comparison.readings import Reading
from harness.robots.robot import Robot
from harness.robots.tree import Tree, vector

# pinocchio::Model::gravity981.
_DEFAULT = vector((0, 0, Fraction(-9.81)))


def _tree(robot: Robot) -> Tree:
    return robot.tree if robot.tree.gravity == _DEFAULT else replace(robot.tree, gravity=_DEFAULT)


READING = Reading(
    name="gravity",
    engine="pinocchio",
    formats=("urdf", "mjcf"),
    sentence="Pinocchio takes 9.81 m/s^2 along -z for gravity, whatever the file says",
    concerns="files",
    source="Pinocchio 4.1, multibody/model.hpp, gravity981; its MJCF reader reads no <option gravity>",
    tree=_tree,
    supplied=True,
)
