"""The joints of one robot's file in another: which is which, and the states of one in the coordinates of the other.

Joints are matched by name, then as the user says, then by place and kind. Frames of two files are placed and turned otherwise. A hinge
or slide has the same position in both. The rotation of a ball joint is measured in the frame of its body, a planar joint's position
along axes of its frame, and a free joint's pose in a frame that a URDF may place anywhere. With every joint at zero, frames of one robot
differ by a turn that stays: of a ball joint, q' = c q c^-1 and v' = C v.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines.coordinates import multiplied, of_linear, quaternion_of, rotations
from harness.engines.request import AskedJoint
from harness.engines.tree_request import asked_joints
from harness.explain.changes.readings import with_joints, with_tree
from harness.files.joint_kinds import JointKind
from harness.files.tree import Joint, Tree
from harness.programs.states import States
from harness.trees.canonical import CanonicalNode, canonical
from harness.trees.robot import Robot

# Entries of a turn up to which two frames are alike.
_ALIKE = 2.0**-48
# Of any precision.
Reals = np.ndarray[Any, np.dtype[np.floating[Any]]]


@dataclass(frozen=True)
class Matching:
    """The joints of two files.

    Attributes:
        names: {joint of the first: joint of the second}. by_place: those of the first that were matched by place and kind.
        only_first, only_second: joints that have no partner. otherwise: (first, second) partners of different kinds.
    """

    names: Mapping[str, str]
    by_place: tuple[str, ...]
    only_first: tuple[str, ...]
    only_second: tuple[str, ...]
    otherwise: tuple[tuple[str, str], ...]

    @property
    def problem(self) -> str:
        """Why the two are no one robot, joint by joint; "" where every joint has its like."""
        parts = [f"only the first has joint {name}" for name in self.only_first]
        parts += [f"only the second has joint {name}" for name in self.only_second]
        parts += [f"joint {one} is {other} of another kind" for one, other in self.otherwise]
        return "; ".join(parts)


def match(first: Robot, second: Robot, renamed: Mapping[str, str]) -> Matching:
    """Match the joints of two robots; ``renamed`` is {joint of the first: joint of the second} as the user says."""
    ones, others = ({joint.name: joint.kind for joint in robot.tree.joints} for robot in (first, second))
    named = {one: renamed.get(one, one) for one in ones if renamed.get(one, one) in others}
    names, before, others_before = dict(named), joints_before(first.tree), joints_before(second.tree)
    for one, above in before.items():
        # Of one kind, behind partners, in the order of the files.
        place = names.get(above, "") if above else ""
        free = (
            other for other, its in others_before.items() if other not in names.values() and others[other] == ones[one] and its == place
        )
        if one not in names and (partner := next(free, None)) is not None:
            names[one] = partner
    return Matching(
        names=names,
        by_place=tuple(one for one in names if one not in named),
        only_first=tuple(name for name in ones if name not in names),
        only_second=tuple(name for name in others if name not in names.values()),
        otherwise=tuple((one, other) for one, other in names.items() if ones[one] != others[other]),
    )


def joints_before(tree: Tree) -> dict[str, str]:
    """For each joint the one that carries it, "" for none; parents first."""
    last: dict[str, str] = {}
    found = {}
    for body in tree.bodies:
        above = last.get(body.parent, "")
        for joint in body.joints:
            found[joint.name], above = above, joint.name
        last[body.name] = above
    return found


def renamed_to(robot: Robot, names: Mapping[str, str]) -> Robot:
    """A robot with the names ``{joint: new name}`` of its joints."""

    def change(joint: Joint) -> Joint:
        return replace(joint, name=names.get(joint.name, joint.name), follows=names.get(joint.follows, joint.follows))

    if all(one == other for one, other in names.items()):
        return robot
    return with_tree(robot, with_joints(robot.tree, change))


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
