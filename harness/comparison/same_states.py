"""The states of one robot's file in the coordinates of another's, whose frames are placed and turned otherwise.

A hinge or slide has the same position in both. The rotation of a ball joint is measured in the frame of its body, a planar joint's
position along axes of its frame, and a free joint's pose in a frame that a URDF may place anywhere. With every joint at zero, frames of
one robot differ by a turn that stays: of a ball joint, q' = c q c^-1 and v' = C v.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines.coordinates import multiplied, of_linear, quaternion_of, rotations
from harness.engines.request import AskedJoint
from harness.engines.tree_request import asked_joints
from harness.files.joint_kinds import JointKind
from harness.programs.states import States
from harness.trees.canonical import CanonicalNode, canonical
from harness.trees.robot import Robot

_ALIKE = 2.0**-48
# Of any precision.
Reals = np.ndarray[Any, np.dtype[np.floating[Any]]]


@dataclass(frozen=True)
class _Joint:
    """A joint whose coordinates differ: its columns in both, and ``turn`` that takes vectors of the first file to the second's."""

    own: AskedJoint
    other: AskedJoint
    turn: Array


class SameStates:
    """From the coordinates of one robot to those of another with equal names of joints, and back."""

    def __init__(self, first: Robot, second: Robot) -> None:
        self._joints: list[_Joint] = []
        ones, others = ({joint.name: joint for joint in asked_joints(robot.tree, robot.joints)} for robot in (first, second))
        if all(joint.kind.is_single for joint in ones.values()):
            return
        nodes = canonical(first), canonical(second)
        for name, own in ones.items():
            turn = _turn(own, others[name], nodes[0][name], nodes[1][name])
            if np.abs(turn - np.eye(len(turn))).max() > _ALIKE or own.shift != others[name].shift:
                self._joints.append(_Joint(own, others[name], turn))

    def of_second(self, states: States) -> States:
        """``states`` of the first robot over the joints of the second, in the second's coordinates."""
        q, v, tau = states.q.copy(), states.v.copy(), states.tau.copy()
        for joint in self._joints:
            columns, rates = list(joint.other.positions), list(joint.other.velocities)
            q[:, columns] = _position(joint, q[:, columns])
            for values in (v, tau):
                values[:, rates] = _turned(joint, values[:, rates], joint.turn)
        return States(q, v, tau, states.time)

    def of_first(self, accelerations: Reals) -> Reals:
        """Accelerations of the second robot, in its own columns, in the first's coordinates."""
        found = accelerations.copy()
        for joint in self._joints:
            rates = list(joint.other.velocities)
            found[:, rates] = _turned(joint, found[:, rates], joint.turn.T)
        return found


def _turn(own: AskedJoint, other: AskedJoint, one: CanonicalNode, its_like: CanonicalNode) -> Array:
    if own.kind == JointKind.FREE:
        return np.asarray(rotations(np.array([other.turn]))[0].T @ rotations(np.array([own.turn]))[0])
    if own.kind in (JointKind.BALL, JointKind.PLANAR):
        return np.asarray(its_like.frame.T @ one.frame)
    return np.eye(1)


def _turned(joint: _Joint, values: Reals, turn: Array) -> Any:
    """Velocities, forces or accelerations of a joint; only the linear ones of a free joint depend on where its frame stands."""
    if joint.own.kind == JointKind.PLANAR:
        # About an axis that points the other way it turns the other way.
        return np.hstack([values[:, :2] @ turn[:2, :2].T, values[:, 2:] * turn[2, 2]])
    return of_linear(turn, values) if joint.own.kind.linear > 1 else values @ turn.T


def _position(joint: _Joint, q: Array) -> Array:
    if joint.own.kind == JointKind.PLANAR:
        return np.asarray(_turned(joint, q, joint.turn))
    by = quaternion_of(joint.turn)
    if joint.own.kind == JointKind.BALL:
        return multiplied(multiplied(by, q), by * np.array([1.0, -1.0, -1.0, -1.0]))
    to_second = rotations(np.array([joint.other.turn]))[0].T
    shift = to_second @ (np.array(joint.own.shift) - np.array(joint.other.shift))
    return np.hstack([shift + q[:, :3] @ joint.turn.T, multiplied(by, q[:, 3:])])
