"""Pinocchio before 3.4: what its reader of MJCF made of Euler angles of which the file does not give the sequence.

It turned about axes of length 0, which gives the identity times the cosines of the angles. No tree of bodies holds a matrix that is no
rotation: that of the reading has the identity, which is what the engine computes with where the cosines make 1.
"""

from dataclasses import replace

from harness.explain.changes.readings import element_at, law, readings_of, with_poses
from harness.files.given import Placement
from harness.files.tree import Tree
from harness.trees.robot import Robot

_ANGLES = 3


@law("Euler angles without a sequence", "elements", after=("frames",))
def _without_axes(robot: Robot) -> Tree:
    root = element_at(robot.tree.place)
    if root is None or any(compiler.get("eulerseq") for compiler in root.iterchildren("compiler")):
        return robot.tree

    def read(placement: Placement) -> Placement:
        return replace(placement, rotation=()) if len(placement.rotation) == _ANGLES else placement

    return with_poses(robot.tree, lambda pose: tuple(map(read, pose)))


READINGS = readings_of(
    "pinocchio",
    {
        ("mjcf",): {
            _without_axes: (
                "Pinocchio's MJCF reader before 3.4 turns euler without eulerseq into a matrix that is not a rotation",
                'call Pinocchio 3.4 or later, or write <compiler eulerseq="xyz"/>',
                "the versions themselves: jointPlacements is a multiple of 1; harness upgrade pinocchio 3.3.1 3.4.0 mjcf/acrobot.euler.xml",
            ),
        },
    },
    "<3.4",
    is_misread=True,
)
