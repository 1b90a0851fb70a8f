"""A mimic joint of a URDF is free in MuJoCo."""

from harness.comparison.readings import Reading, freed, with_joints
from harness.robots.robot import Robot
from harness.robots.tree import Tree


def _tree(robot: Robot) -> Tree:
    return with_joints(robot.tree, freed)


READING = Reading(
    name="mimic joints",
    engine="mujoco",
    formats=("urdf",),
    sentence="MuJoCo makes a joint that mimics another a joint of its own under a soft equality constraint, which is off here",
    concerns="joints",
    source="MuJoCo documentation, Modeling, URDF extensions, and XML reference, equality/joint",
    tree=_tree,
    supplied=True,
)
