"""Pinocchio's reader of MJCF passes over ``<option gravity>``."""

from dataclasses import replace
from fractions import Fraction

from harness.comparison.readings import Reading
from harness.robots.robot import Robot
from harness.robots.tree import Given, Tree, vector

# pinocchio::Model::gravity981.
_DEFAULT = -9.81


def _tree(robot: Robot) -> Tree:
    tree, place = robot.tree, robot.tree.place
    # A decimal that the engine rounds, as the file's own is.
    down = Fraction(_DEFAULT) if place is None else Given(_DEFAULT, place, "gravity of Pinocchio")
    gravity = vector((0, 0, down))
    return tree if tree.gravity == gravity else replace(tree, gravity=gravity)


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
