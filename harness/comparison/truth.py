"""Certified truth of robots, whose programs a process keeps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from harness.arrays import Array
from harness.comparison.same_states import SameStates
from harness.engines import request
from harness.engines.request import Aid, AskedJoint, Request
from harness.engines.tree_request import aid_of, asked_joints, inertias_of
from harness.files.tree import Joint, Tree
from harness.programs.states import States
from harness.storage import Kept
from harness.trees.bodies.bounds import bounded
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import Robot
from harness.truth.compare import Flags
from harness.truth.reference import Reference, ReferenceKernel, energy_norm
from harness.truth.sampling import sample


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


# States at which the effect of one change is computed.
STATES_OF_EFFECTS = 16
# Programs of humanoids take megabytes.
_REFERENCES: Kept[ReferenceKernel] = Kept(most=8)


@dataclass(frozen=True)
class Meant:
    """A robot with its states and their truth, over the joints that move by themselves; can be pickled.

    Attributes:
        truth: None where no state can have one. undetermined: why; "" where states can.
    """

    robot: Robot
    states: States
    certified: Reference | None
    undetermined: str = ""

    @property
    def truth(self) -> Reference:
        assert self.certified is not None, self.undetermined
        return self.certified

    @property
    def joints(self) -> tuple[AskedJoint, ...]:
        return asked_joints(self.robot.tree, self.robot.joints)


def reference_of(robot: Robot) -> ReferenceKernel:
    """The evaluator of a robot's truth; kept in the process."""
    return _REFERENCES.get((robot.path, robot.tree, robot.joints), lambda: ReferenceKernel(mechanism_of(robot)))


def meant(robot: Robot, count: int, seed: int) -> Meant:
    """``count`` sampled states of a robot, and their truth."""
    if not robot.joints:
        none = np.empty((0, 0))
        return Meant(robot, States(none, none, none, np.empty(0)), None, "no joint moves, so that there is no acceleration")
    reference = reference_of(robot)
    states = sample(reference.mechanism, count, seed)
    if undetermined := _undetermined(robot.tree):
        return Meant(robot, states, None, undetermined)
    return Meant(robot, states, reference.evaluate(states))


def _undetermined(tree: Tree) -> str:
    """Why no acceleration is determined; "" where some are."""
    idle = joints_without_inertia(tree)
    named = ", ".join(f"{joint.name} (line {joint.place.line})" if joint.place else joint.name for joint in idle)
    return f"no acceleration is determined, for nothing with mass or inertia moves with {named}" if idle else ""


def joints_without_inertia(tree: Tree) -> list[Joint]:
    """The joints that carry neither mass nor inertia nor an armature, so that M is singular in every state."""
    loaded: set[str] = set()
    tree = bounded(tree)
    heavy = [body.name for body in tree.bodies if not body.is_massless or (body.inertia is not None and any(body.inertia.moments))]
    above = {body.name: body.parent for body in tree.bodies}
    for name in heavy:
        while name in above and name not in loaded:
            loaded.add(name)
            name = above[name]
    of_body = [(joint, body.name in loaded or bool(joint.armature)) for body in tree.bodies for joint in body.joints]
    moved = {joint.follows or joint.name for joint, is_loaded in of_body if is_loaded}
    return [joint for joint, _ in of_body if not joint.follows and joint.name not in moved]


def read_as(original: Meant, robot: Robot, same: SameStates | None = None) -> Meant:
    """The truth of another reading of a robot, ``robot``, at the states of the original; ``same`` gives these in its coordinates."""
    if robot is original.robot:
        return original
    if not robot.joints:
        none = np.empty((len(original.states), 0))
        return Meant(robot, States(none, none, none, np.zeros(len(none))), None, "no joint is left")
    states = spread(original.robot, original.states, asked_joints(robot.tree, robot.joints))
    if undetermined := _undetermined(robot.tree):
        return Meant(robot, states, None, undetermined)
    states = states if same is None else same.of_second(states)
    return Meant(robot, states, reference_of(robot).evaluate(states))


def columns_of(joints: Sequence[AskedJoint], names: Sequence[str]) -> list[int]:
    """The velocities of the joints called ``names``, in their order."""
    by_name = {joint.name: joint for joint in joints}
    return [column for name in names for column in by_name[name].velocities]


def change(original: Meant, other: Meant) -> float | None:
    """The largest |qdd' - qdd|_M / |qdd|_M over the states, in the original's joints; None where one has no certified truth.

    Infinite where the other lacks a joint.
    """
    if not set(original.robot.joints) <= set(other.robot.joints):
        return math.inf
    if other.undetermined:
        return None
    both = original.truth.certified & other.truth.certified
    if not both.any():
        return None
    moved = other.truth.high[:, columns_of(other.joints, original.robot.joints)]
    return largest_change(original.truth, moved, both)


def largest_change(truth: Reference, accelerations: Array, among: Flags) -> float | None:
    """The largest |a - a*|_M / |a*|_M among the states of a mask; None where no acceleration there is finite or other than zero."""
    with np.errstate(all="ignore"):
        error = energy_norm(truth.norm_factor, (accelerations - truth.high) - truth.low)
        relative = (error / truth.size)[among]
    known = relative[np.isfinite(relative)]
    return float(known.max()) if len(known) else None


def change_by_numbers(reference: ReferenceKernel, states: States, own: Array, changed: Array) -> float | None:
    """The largest relative change of qdd when a robot's numbers, (number of parameters,), become others; as of ``change``."""
    before, after = (reference.evaluate(states, np.tile(numbers, (len(states), 1))) for numbers in (own, changed))
    both = before.certified & after.certified
    return largest_change(before, after.high, both) if both.any() else None
