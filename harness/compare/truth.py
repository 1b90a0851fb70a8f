"""Certified truth of robots, whose programs a process keeps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from harness.arrays import Array
from harness.certify.reference import Reference, energy_norm
from harness.certify.robot_reference import RobotReference
from harness.certify.sampling import sample
from harness.compare.questions import Asked
from harness.compare.states import asked_joints, spread
from harness.equations.states import States
from harness.robots.robot import Robot
from harness.storage import Kept

# Programs of humanoids take megabytes.
_REFERENCES: Kept[RobotReference] = Kept(most=8)


@dataclass(frozen=True)
class Meant:
    """A robot with its states and their truth, over the joints that move by themselves; can be pickled."""

    robot: Robot
    states: States
    truth: Reference

    @property
    def joints(self) -> tuple[Asked, ...]:
        return asked_joints(self.robot.tree, self.robot.joints)


def reference_of(robot: Robot) -> RobotReference:
    """The evaluator of a robot's truth; kept in the process."""
    return _REFERENCES.get((robot.path, robot.tree, robot.joints), lambda: RobotReference(robot))


def meant(robot: Robot, count: int, seed: int) -> Meant:
    """``count`` sampled states of a robot, and their truth."""
    reference = reference_of(robot)
    states = sample(reference.mechanism, count, seed)
    return Meant(robot, states, reference.evaluate(states))


def read_as(original: Meant, robot: Robot) -> Meant:
    """The truth of another reading of a robot, ``robot``, at the states of the original."""
    if robot is original.robot:
        return original
    states = spread(original.robot, original.states, asked_joints(robot.tree, robot.joints))
    return Meant(robot, states, reference_of(robot).evaluate(states))


def columns_of(joints: Sequence[Asked], names: Sequence[str]) -> list[int]:
    """The velocities of the joints called ``names``, in their order."""
    by_name = {joint.name: joint for joint in joints}
    return [column for name in names for column in by_name[name].velocities]


def change(original: Meant, other: Meant) -> float | None:
    """The largest |qdd' - qdd|_M / |qdd|_M over the states, in the original's joints; None where one has no certified truth."""
    both = original.truth.certified & other.truth.certified
    if not both.any():
        return None
    moved = other.truth.high[:, columns_of(other.joints, original.robot.joints)]
    return largest_change(original.truth, moved, both)


def largest_change(truth: Reference, accelerations: Array, among: Array) -> float | None:
    """The largest |a - a*|_M / |a*|_M among the states of a mask; None where no acceleration there is finite or other than zero."""
    with np.errstate(all="ignore"):
        error = energy_norm(truth.norm_factor, (accelerations - truth.high) - truth.low)
        relative = (error / truth.size)[np.asarray(among, dtype=np.bool_)]
    known = relative[np.isfinite(relative)]
    return float(known.max()) if len(known) else None
