"""Pinocchio passes over the axis of a planar joint."""

from dataclasses import replace

from harness.comparison.readings import Reading, with_joints
from harness.robots.robot import Robot
from harness.robots.tree import Joint, Tree, vector

_UPWARD = vector((0, 0, 1))


def _read(joint: Joint) -> Joint:
    x, y, z = joint.axis
    return replace(joint, axis=_UPWARD) if joint.kind == "planar" and (x or y or z < 0) else joint


def _tree(robot: Robot) -> Tree:
    return with_joints(robot.tree, _read)


READING = Reading(
    name="axis of planar joints",
    engine="pinocchio",
    formats=("urdf",),
    sentence="Pinocchio moves a planar joint in the xy plane of the joint's frame, whatever axis the file gives it",
    concerns="joints",
    source="Pinocchio 4.1, multibody/joint/joint-planar.hpp, which has no axis; parsers/urdf/model.cpp: planar, with normal axis along Z",
    tree=_tree,
)
