"""MuJoCo bounds the masses and inertias of a URDF's links as the file's own element ``<mujoco>`` says, which URDF does not know."""

from dataclasses import replace
from fractions import Fraction

from harness.comparison.readings import Reading, element_at, mujoco_settings
from harness.comparison.readings.mujoco_bound_centre import centred
from harness.robots.bounds import bounded
from harness.robots.robot import Robot
from harness.robots.tree import Bounds, Tree


def _tree(robot: Robot) -> Tree:
    tree, root = robot.tree, element_at(robot.tree.place)
    settings = mujoco_settings(robot, "compiler")
    mass, moment = (next(iter(settings.get(name, ())), Fraction(0)) for name in ("boundmass", "boundinertia"))
    balances = root is not None and root.find("mujoco/compiler[@balanceinertia='true']") is not None
    read = centred(replace(tree, bounds=Bounds(mass, moment, balances)))
    return tree if bounded(read) == tree else read


READING = Reading(
    name="least masses and inertias",
    engine="mujoco",
    formats=("urdf",),
    sentence="MuJoCo bounds masses and inertias by the compiler settings of the file's element <mujoco>, before it fuses links",
    concerns="links",
    source="MuJoCo documentation, Modeling, URDF extensions, and XML reference, compiler: boundmass, boundinertia, balanceinertia",
    tree=_tree,
    supplied=True,
    after=("mass of collision geometry",),
)
