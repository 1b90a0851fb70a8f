"""MuJoCo scales the masses of a URDF as the file's own element ``<mujoco>`` says."""

from dataclasses import replace
from fractions import Fraction

from harness.comparison.readings import Reading, mujoco_settings
from harness.robots.robot import Robot
from harness.robots.tree import Tree


def _tree(robot: Robot) -> Tree:
    total = next(iter(mujoco_settings(robot, "compiler").get("settotalmass", ())), Fraction(0))
    return replace(robot.tree, total_mass=total) if total > 0 else robot.tree


READING = Reading(
    name="settotalmass",
    engine="mujoco",
    formats=("urdf",),
    sentence="MuJoCo scales all masses by the compiler settings of the file's element <mujoco>",
    concerns="files",
    source="MuJoCo documentation, Modeling, URDF extensions, and XML reference, compiler: settotalmass",
    tree=_tree,
    supplied=True,
    after=("inertia without mass",),
)
