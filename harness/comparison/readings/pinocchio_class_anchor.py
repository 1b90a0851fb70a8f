"""Pinocchio's reader of MJCF passes over the position that a joint takes from a default class."""

from dataclasses import replace

from harness.comparison.readings import Reading, with_joints
from harness.robots.robot import Robot
from harness.robots.tree import ORIGIN, Given, Joint, Tree


def _read(joint: Joint) -> Joint:
    is_of_class = any(isinstance(number, Given) and number.place != joint.place for number in joint.anchor)
    return replace(joint, anchor=ORIGIN) if is_of_class else joint


def _tree(robot: Robot) -> Tree:
    return with_joints(robot.tree, _read)


READING = Reading(
    name="position of a default class",
    engine="pinocchio",
    formats=("mjcf",),
    sentence="Pinocchio's MJCF reader passes over a joint's pos from a default class, and puts the joint into the body's origin",
    concerns="joints",
    source="Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, MjcfJoint::fill: only the joint's own attribute pos is read",
    tree=_tree,
)
