"""MJX applies no passive force where springs are switched off, nor where dampers are."""

from dataclasses import replace
from fractions import Fraction

from harness.explain.changes.readings import element_at, law, with_joints
from harness.files.tree import Tree
from harness.trees.robot import Robot


@law("flags of springs and dampers", "elements", supplied=True)
def _tree(robot: Robot) -> Tree:
    root, nothing = element_at(robot.tree.place), Fraction(0)
    flags = [] if root is None else list(root.iterfind("option/flag"))
    if not any(flag.get(name) == "disable" for flag in flags for name in ("spring", "damper")):
        return robot.tree
    tree = with_joints(robot.tree, lambda joint: replace(joint, stiffness=nothing, damping=nothing))
    return replace(tree, springs=(), couplings=())


READINGS = (
    _tree(
        "mjx",
        ("mjcf",),
        "MJX leaves out springs and dampers alike where the file switches off the one or the other",
        "mujoco/mjx/_src/passive.py, passive; https://github.com/google-deepmind/mujoco/pull/3440",
    ),
)
