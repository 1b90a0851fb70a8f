"""Pinocchio's reader of URDF passes over the axis of a planar joint."""

from dataclasses import replace

from harness.comparison.readings import Reading
from harness.robots.robot import Robot
from harness.robots.tree import Body, Joint, Tree, vector

_UP = vector((0, 0, 1))


def _is_tilted(joint: Joint) -> bool:
    return joint.kind == "planar" and tuple(joint.axis) != tuple(_UP)


def _untilted(body: Body) -> Body:
    joints = tuple(replace(joint, axis=_UP) if _is_tilted(joint) else joint for joint in body.joints)
    return replace(body, joints=joints)


def _tree(robot: Robot) -> Tree:
    if not any(map(_is_tilted, robot.tree.joints)):
        return robot.tree
    return replace(robot.tree, bodies=tuple(_untilted(body) if any(map(_is_tilted, body.joints)) else body for body in robot.tree.bodies))


READING = Reading(
    name="planar axis",
    engine="pinocchio",
    formats=("urdf",),
    sentence="Pinocchio's URDF reader passes over the axis of a planar joint, whose plane it takes for the link's x and y",
    concerns="joints",
    source="Pinocchio 4.1, parsers/urdf/model.cpp, where JointModelPlanar is added without an axis",
    tree=_tree,
)
