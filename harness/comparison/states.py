"""What engines are asked about a robot, and its states over all joints of its tree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from harness.engines import request
from harness.engines.request import Aid, AskedJoint, Request
from harness.engines.tree_request import aid_of, asked_joints, inertias_of
from harness.programs.states import States
from harness.trees.robot import Robot


def spread(robot: Robot, states: States, joints: Sequence[AskedJoint]) -> States:
    """States of a robot's own joints, over ``joints`` of its tree: a joint that mimics another moves as the other lets it, unloaded."""
    by_name = {joint.name: joint for joint in asked_joints(robot.tree)}
    own = asked_joints(robot.tree, robot.joints)
    q, v, tau = request.spread(own, [by_name[joint.name] for joint in joints], (states.q, states.v, states.tau))
    return States(q, v, tau, np.zeros(len(states)))


def request_of(robot: Robot, aided: bool) -> Request:
    """What a plain or aided engine is to load."""
    # One that eliminates joints that mimic is asked about those too.
    follows = any(joint.follows for joint in robot.tree.joints)
    joints = asked_joints(robot.tree, None if follows else robot.joints)
    return Request(
        path=robot.path,
        format=robot.format,
        joints=joints,
        moving=robot.joints,
        floating_base=robot.floating_base,
        aid=_aid(robot, joints) if aided else None,
    )


def _aid(robot: Robot, joints: Sequence[AskedJoint]) -> Aid:
    aid = aid_of(robot.tree, joints)
    return replace(aid, inertias=inertias_of(robot.tree)) if robot.format == "urdf" else aid
