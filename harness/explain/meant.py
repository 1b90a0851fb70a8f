"""Certified truth of robots, whose programs a process keeps, at sampled states; questions to engines there, and effects of changes."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from harness.arrays import Array
from harness.engines import request
from harness.engines.request import AskedJoint, EngineQuestion, Held, Request, in_columns
from harness.engines.tree_request import aid_of, asked_joints, inertias_of
from harness.files.tree import Joint, Tree
from harness.library import Stance
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.states import States
from harness.storage import Kept
from harness.trees.bodies.inertias import bounded
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import Robot, with_actuators
from harness.truth.compare import Comparison, Flags
from harness.truth.reference import Reference, ReferenceKernel, asked_at, energy_norm
from harness.truth.sampling import sample

# Sampled states of a file, and how many of them the effect of a change is computed at.
STATES, STATES_OF_EFFECTS = 64, 16
# Programs of humanoids take megabytes.
_REFERENCES: Kept[ReferenceKernel] = Kept(most=8)
Named = TypeVar("Named", bound=Hashable)


@dataclass(frozen=True)
class Meant:
    """A robot with its states and their truth, over the joints that move by themselves; can be pickled.

    Attributes:
        truth: None where no state can have one. undetermined: why; "" where states can.
        unit_roundoff: of the numbers that the engine computes with which is asked.
    """

    robot: Robot
    states: States
    certified: Reference | None
    undetermined: str = ""
    unit_roundoff: float = UNIT_ROUNDOFF

    @property
    def truth(self) -> Reference:
        assert self.certified is not None, self.undetermined
        return self.certified

    @property
    def joints(self) -> tuple[AskedJoint, ...]:
        return asked_joints(self.robot.tree, self.robot.joints)

    @property
    def few(self) -> Meant:
        """The same at the states at which effects are computed."""
        first = np.arange(min(STATES_OF_EFFECTS, len(self.states)))
        return replace(self, states=self.states[first], certified=self.truth[first])

    def rounded(self, unit_roundoff: float) -> Meant:
        """The same without a truth, at the states as an engine of this unit roundoff takes them; the very same at that of float64."""
        if unit_roundoff == self.unit_roundoff:
            return self
        states = asked_at(self.states, unit_roundoff, mechanism_of(self.robot).attitudes)
        return replace(self, states=states, certified=None, unit_roundoff=unit_roundoff)


def reference_of(robot: Robot, unit_roundoff: float = UNIT_ROUNDOFF) -> ReferenceKernel:
    """The evaluator of a robot's truth for engines of a unit roundoff; kept in the process."""
    key = robot.path, robot.tree, robot.joints, unit_roundoff
    return _REFERENCES.get(key, lambda: ReferenceKernel(mechanism_of(robot), unit_roundoff=unit_roundoff))


def for_engine(found: Meant, unit_roundoff: float) -> Meant:
    """The robot with its truth at the states as an engine of this unit roundoff takes them; the very same at that of float64."""
    rounded = found.rounded(unit_roundoff)
    return rounded if rounded is found or found.certified is None else _certified(found.robot, rounded.states, unit_roundoff)


def meant(robot: Robot, count: int, seed: int) -> Meant:
    """``count`` sampled states of a robot, and their truth."""
    if not robot.joints:
        return _unmoved(robot, 0, why_unmoved(robot))
    return _certified(robot, sample(reference_of(robot).mechanism, count, seed))


def read_as(original: Meant, robot: Robot, into: Callable[[States], States] = lambda states: states) -> Meant:
    """The truth of another reading of a robot, ``robot``, at the states of the original, which ``into`` takes to its coordinates."""
    if robot is original.robot:
        return original
    if why := why_unread(robot, original.robot):
        return _unmoved(robot, len(original.states), why)
    return _certified(robot, into(spread(original.robot, original.states, asked_joints(robot.tree, robot.joints))), original.unit_roundoff)


def driven(meant: Meant) -> Meant:
    """A robot with those of its actuators on that are read, at the same states with controls; the very same without any."""
    numbers = [one.number for one in meant.robot.actuators if not one.why_not]
    if not numbers:
        return meant
    robot = with_actuators(meant.robot, numbers)
    actuation = reference_of(robot).mechanism.actuation
    states = meant.states if actuation is None else actuation.controlled(meant.states)
    return _certified(robot, states, meant.unit_roundoff)


def why_unread(read: Robot, original: Robot) -> str:
    """Why what a reader makes of a robot has no states of that; "" where it has some."""
    if not read.joints:
        return "no joint is left"
    sizes = {joint.name: joint.kind.sizes for joint in original.tree.joints}
    further = [joint.name for joint in read.tree.joints if sizes.get(joint.name) != joint.kind.sizes]
    return f"it has joints that the file does not have: {', '.join(further)}" if further else ""


def undetermined(robot: Robot) -> str:
    """Why no state of a robot has accelerations; "" where states have."""
    if idle := joints_without_inertia(robot.tree):
        named = ", ".join(f"{joint.name} (line {joint.place.line})" if joint.place else joint.name for joint in idle)
        return f"no acceleration is determined, for nothing with mass or inertia moves with {named}"
    return ""


def why_unmoved(robot: Robot) -> str:
    """Why a robot without joints that move has no acceleration, and what to do."""
    if not robot.bodies:
        return "the file holds no body, as a part that other files include; name the file that includes it"
    return "no joint moves, so that there is no acceleration; expected a joint that moves by itself"


def _unmoved(robot: Robot, count: int, why: str) -> Meant:
    none = np.empty((count, 0))
    return Meant(robot, States(none, none, none, np.zeros(count)), None, why)


def _certified(robot: Robot, states: States, unit_roundoff: float = UNIT_ROUNDOFF) -> Meant:
    """The truth of a robot at its states; none where no acceleration is determined."""
    if why := undetermined(robot):
        return Meant(robot, states, None, why, unit_roundoff)
    return Meant(robot, states, reference_of(robot, unit_roundoff).evaluate(states), unit_roundoff=unit_roundoff)


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


# Questions to engines


def request_of(robot: Robot, stance: Stance, read: Robot | None = None) -> Request:
    """File for a plain or aided engine to load, with the actuators that act in the tree, or in that of ``read``.

    ``read``: the robot as its reader has it, for whose joints it is asked.
    """
    # One that eliminates joints that mimic is asked about those too.
    follows = any(joint.follows for joint in robot.tree.joints)
    joints, moving = asked_joints(robot.tree, None if follows else robot.joints), robot.joints
    if read is not None:
        kept, moving = {joint.name: joint for joint in asked_joints(read.tree)}, read.joints
        # They are measured as the file says, and follow whom the reader lets them follow.
        joints = in_columns([_following(joint, kept[joint.name]) for joint in joints if joint.name in kept])
    aid = aid_of(robot.tree, joints) if stance == Stance.AIDED else None
    if aid is not None and robot.format == "urdf":
        aid = replace(aid, inertias=inertias_of(robot.tree))
    actuators = tuple(one.number for one in (read or robot).tree.actuators)
    return Request(
        path=robot.path,
        format=robot.format,
        joints=joints,
        moving=moving,
        floating_base=robot.floating_base,
        aid=aid,
        held=Held((), (), actuators=actuators) if actuators else None,
    )


def _following(joint: AskedJoint, other: AskedJoint) -> AskedJoint:
    """A joint that mimics what another one mimics."""
    return replace(joint, follows=other.follows, multiplier=other.multiplier, offset=other.offset)


def question_of(found: Meant, stance: Stance, held: Held | None = None) -> EngineQuestion:
    """Question to a plain or aided engine about a file; ``held``: what acts, by default the actuators of the tree."""
    asked = request_of(found.robot, stance)
    asked = asked if held is None else replace(asked, held=held)
    states = spread(found.robot, found.states, asked.joints)
    return EngineQuestion(asked, states.q, states.v, states.tau, (states.control, states.activation) if asked.driven else ())


def spread(robot: Robot, states: States, joints: Sequence[AskedJoint]) -> States:
    """States of a robot's own joints, over ``joints`` of its tree: a joint that mimics another moves as the other lets it, unloaded."""
    by_name = {joint.name: joint for joint in asked_joints(robot.tree)}
    own = asked_joints(robot.tree, robot.joints)
    q, v, tau = request.spread(own, [by_name[joint.name] for joint in joints], (states.q, states.v, states.tau))
    return States(q, v, tau, np.zeros(len(states)), states.control, states.activation)


# Changes of accelerations


def worst(compared: Comparison, name: str = "backward_error") -> float | None:
    """The largest "backward_error" or "relative_error" that is known; None where none is."""
    known = compared.known(name)
    return float(known.max()) if len(known) else None


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
    return largest_change(original.truth, other.truth.high[:, columns_of(other.joints, original.robot.joints)], both)


def largest_change(truth: Reference, accelerations: Array, among: Flags) -> float | None:
    """The largest |a - a*|_M / |a*|_M among the states of a mask; None where no acceleration there is finite or other than zero."""
    with np.errstate(all="ignore"):
        error = energy_norm(truth.norm_factor, (accelerations - truth.high) - truth.low)
        relative = (error / truth.size)[among]
    known = relative[np.isfinite(relative)]
    return float(known.max()) if len(known) else None


def effects_of_numbers(
    reference: ReferenceKernel, states: States, changes: Mapping[Named, Mapping[str, float]], own: Array
) -> dict[Named, float | None]:
    """The largest relative change of qdd that each change does alone, {parameter: value}, at a few of the states; as of ``change``.

    ``own`` are the values that are not changed, (number of parameters,).
    """
    columns = {name: column for column, (name, _, _) in enumerate(reference.mechanism.parameters)}
    states = states[np.arange(min(STATES_OF_EFFECTS, len(states)))]
    before = reference.evaluate(states, reference.mechanism.parameters_at(states, own))
    found: dict[Named, float | None] = {}
    for key, numbers in changes.items():
        changed = own.copy()
        for name, value in numbers.items():
            if name in columns:
                changed[columns[name]] = value
        after = reference.evaluate(states, reference.mechanism.parameters_at(states, changed))
        found[key] = largest_change(before, after.high, before.certified & after.certified)
    return found
