"""MuJoCo takes the gravity of a URDF from the file's own element ``<mujoco>``."""

from dataclasses import replace

from harness.comparison.readings import Reading, mujoco_settings
from harness.robots.robot import Robot
from harness.robots.tree import Tree, vector


def _tree(robot: Robot) -> Tree:
    gravity = mujoco_settings(robot, "option").get("gravity", ())
    read = replace(robot.tree, gravity=vector(gravity)) if len(gravity) == 3 else robot.tree
    return robot.tree if read.gravity == robot.tree.gravity else read


READING = Reading(
    name="gravity",
    engine="mujoco",
    formats=("urdf",),
    sentence="MuJoCo takes gravity from the option settings of the file's element <mujoco>",
    concerns="files",
    source="MuJoCo documentation, Modeling, URDF extensions, and XML reference, option: gravity",
    tree=_tree,
    supplied=True,
)
