"""The joints of one robot's file in another: which is which, and the states of one in the coordinates of the other.

Joints are matched as the user says, then by name, then by place and kind. Those without a partner stand still while the rest is
compared: a joint that is left out of the tree fixes its body to what carried it.

Frames of two files are placed and turned otherwise. A hinge or slide has the same position in both. The rotation of a ball joint is
measured in the frame of its body, a planar joint's position along axes of its frame, and a free joint's pose in a frame that a URDF may
place anywhere. With every joint at zero, frames of one robot differ by a turn that stays: of a ball joint, q' = c q c^-1 and v' = C v.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines.coordinates import multiplied, of_linear, quaternion_of, rotations
from harness.engines.request import AskedJoint
from harness.engines.tree_request import asked_joints
from harness.errors import InvalidRequest
from harness.explain.changes.readings import with_bodies, with_joints, with_tree
from harness.files.equalities import Linkage, Rows, Sum, Tendon, TendonLinkage
from harness.files.facts import in_radians
from harness.files.joint_kinds import JointKind
from harness.files.tree import Coupling, Joint, Tree
from harness.library import nearest
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


# Of the joints that two joints carry, themselves among them, the share by which one with another name may be the same joint.
_LIKE = Fraction(1, 2)


def match(first: Robot, second: Robot, renamed: Mapping[str, str]) -> Matching:
    """Match the joints of two robots; ``renamed`` is {joint of the first: joint of the second} as the user says."""
    ones, others = ({joint.name: joint.kind for joint in robot.tree.joints} for robot in (first, second))
    said = {one: other for one, other in renamed.items() if one in ones and other in others}
    named = said | {one: one for one in ones if one in others and one not in said and one not in said.values()}
    names, before, others_before = dict(named), first.tree.joints_before, second.tree.joints_before
    carried, others_carried = _carried(before), _carried(others_before)
    for one, above in before.items():
        # Of one kind, behind partners, in the order of the files; nothing is known of what joints without a partner carry.
        place, partners = names.get(above) if above else "", set(names.values())
        free = (other for other in others_before if other not in partners and (others[other], others_before[other]) == (ones[one], place))
        sizes = ((other, (carried[one], others_carried[other])) for other in free)
        partner = next((other for other, size in sizes if min(size) >= _LIKE * max(size)), None)
        if one not in names and partner is not None:
            names[one] = partner
    return Matching(
        names=names,
        by_place=tuple(one for one in names if one not in named),
        only_first=tuple(name for name in ones if name not in names),
        only_second=tuple(name for name in others if name not in names.values()),
        otherwise=tuple((one, other) for one, other in names.items() if ones[one] != others[other]),
    )


def refuse_unknown(robots: Sequence[Robot], renamed: Mapping[str, str], without: Sequence[str]) -> None:
    """Raises InvalidRequest for a joint that the user names and that no file has, the first of ``robots`` or another."""
    first, *others = robots
    for one, other in renamed.items():
        _refuse(f"--map {one}={other}", one, [first])
        _refuse(f"--map {one}={other}", other, others)
    for name in without:
        _refuse(f"--without {name}", name, robots)


def _refuse(option: str, name: str, robots: Sequence[Robot]) -> None:
    known = dict.fromkeys(joint.name for robot in robots for joint in robot.tree.joints)
    if name not in known:
        files = " and ".join(dict.fromkeys(robot.path.name for robot in robots))
        raise InvalidRequest(f"{option}: no joint {name!r} moves in {files}; {nearest(name, known)}")


def _carried(before: Mapping[str, str]) -> Counter[str]:
    """Number of joints that each carries, itself among them."""
    found = Counter(dict.fromkeys(before, 1))
    for name, above in reversed(list(before.items())):
        if above:
            found[above] += found[name]
    return found


def locked(robot: Robot, names: Set[str]) -> Robot:
    """A robot in which joints stand still where the file writes their bodies down: at zero, or at the ``ref`` of an MJCF.

    A joint that mimics one of them stands still too. Their bodies ride on what carried the joints.
    """
    still = {joint.name: joint for joint in robot.tree.joints if {joint.name, joint.follows} & names}
    if not still:
        return robot
    tree = with_bodies(robot.tree, lambda body: replace(body, joints=tuple(joint for joint in body.joints if joint.name not in still)))
    kinds = {joint.name: joint for joint in robot.tree.joints}
    couplings = (_of_moving(coupling, kinds, still) for coupling in tree.couplings)
    tree = replace(tree, couplings=tuple(coupling for coupling in couplings if coupling.joints))
    return replace(robot, tree=tree, joints=tuple(name for name in robot.joints if name not in still))


def _of_moving(coupling: Coupling, joints: Mapping[str, Joint], still: Mapping[str, Joint]) -> Coupling:
    """A coupling without the joints that stand still, each of which adds a constant to the sum."""
    kept = tuple((name, multiple) for name, multiple in coupling.joints if name not in still)
    if len(kept) == len(coupling.joints):
        return coupling
    rest = coupling.rest

    def position(name: str, field: str) -> Fraction:
        return Fraction(in_radians(joints[name], field))

    constant = Fraction(0)
    for name, multiple in coupling.joints:
        if name in still:
            constant += multiple * (position(name, "reference") - (position(name, "spring_reference") if rest is None else 0))
    if constant:
        relaxed = (multiple * position(name, "spring_reference") for name, multiple in kept)
        rest = (sum(relaxed, Fraction(0)) if rest is None else rest) - constant
    slack_to = None if coupling.slack_to is None else coupling.slack_to - constant
    return replace(coupling, joints=kept, rest=rest, slack_to=slack_to)


def renamed_to(robot: Robot, names: Mapping[str, str]) -> Robot:
    """A robot with the names ``{joint: new name}`` of its joints."""

    def change(joint: Joint) -> Joint:
        return replace(joint, name=names.get(joint.name, joint.name), follows=names.get(joint.follows, joint.follows))

    def of_sum(terms: Iterable[tuple[str, Fraction]]) -> tuple[tuple[str, Fraction], ...]:
        return tuple((names.get(name, name), multiple) for name, multiple in terms)

    def of_tendon(tendon: Tendon) -> Tendon:
        return replace(tendon, terms=of_sum(tendon.terms)) if isinstance(tendon, Sum) else tendon

    def driving(one: Robot | Tree) -> dict[str, Any]:
        limits = tuple((names.get(name, name), bounds) for name, bounds in one.force_limits)
        return {"actuators": tuple(replace(own, joints=of_sum(own.joints)) for own in one.actuators), "force_limits": limits}

    def tied(says: Rows | None) -> Rows | None:
        if isinstance(says, Linkage):
            return replace(says, joint=names.get(says.joint, says.joint), leader=says.leader and names.get(says.leader, says.leader))
        if isinstance(says, TendonLinkage):
            return replace(says, tendon=of_tendon(says.tendon), leader=says.leader and of_tendon(says.leader))
        return says

    if all(one == other for one, other in names.items()):
        return robot
    equalities = tuple(replace(one, says=tied(one.says)) for one in robot.equalities)
    declared = tuple(one.about(names) for one in robot.declared)
    couplings = tuple(replace(one, joints=of_sum(one.joints)) for one in robot.tree.couplings)
    tree = replace(with_joints(robot.tree, change), couplings=couplings, **driving(robot.tree))
    return replace(with_tree(robot, tree), equalities=equalities, declared=declared, **driving(robot))


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
