"""A model's file as an engine's reader is known to misread it, and the engine's answers held against what it makes of the file.

The mechanism that the engine computes with follows from the declared readings, never from an answer. A reader that is mended agrees with
the file again, and one that does something else disagrees with both: each is another verdict than ``misreads``.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from harness.crosscheck.assignment import Assignment, truth_of
from harness.engines import load_model
from harness.engines.tree_request import asked_joints
from harness.explain.meant import STATES, Folded, effects, meant, misread_by, spread, undetermined, why_unread
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.results.readings import Effect
from harness.results.records import ACCELERATIONS
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import Robot
from harness.truth.compare import Comparison, Flags, compare
from harness.verdict import Verdict

_EXPLAINED = (Verdict.AGREES.value, Verdict.UNSTABLE.value)


def readings_and_refusal(assignment: Assignment, seed: int) -> tuple[list[Effect], list[str]]:
    """What each misreading of the file does, at the states of a comparison of the file; it is refused by none."""
    robot, folded = _folded(assignment)
    return effects(meant(robot, STATES, seed), folded), []


def judged(assignment: Assignment, states: States, comparison: Comparison) -> Comparison:
    """The judgement, in which a disagreement ``misreads`` where the answer is that for what the reader makes of the file."""
    wrong = comparison.verdicts == Verdict.DISAGREES.value
    known = wrong & is_for_what_is_read(assignment, states)
    return replace(comparison, verdicts=np.where(known, Verdict.MISREADS.value, comparison.verdicts))


def judged_alone(assignment: Assignment, states: States) -> Comparison:
    """The judgement of an engine whose reader makes other joints of the file, so that nothing is compared with it."""
    known, nothing, no = is_for_what_is_read(assignment, states), np.full(len(states), np.nan), np.zeros(len(states), dtype=bool)
    verdicts = np.where(known, Verdict.MISREADS.value, Verdict.DISAGREES.value)
    return Comparison(nothing, nothing, no, verdicts, no, np.zeros(len(states)))


def is_for_what_is_read(assignment: Assignment, states: States) -> Flags:
    """Whether each answer is that of the mechanism that the reader makes of the file; nowhere where it is declared to make none."""
    nowhere = np.zeros(len(states), dtype=bool)
    own, folded = _folded(assignment)
    read = folded.robot
    if not folded.applied or assignment.mechanism.constraints is not None or why_unread(read, own) or undetermined(read):
        return nowhere
    about = replace(assignment, mechanism=mechanism_of(read), quantity=ACCELERATIONS)
    model = load_model(about.library, about.subject, about.mechanism, about.model)
    loaded = model.loaded()
    if loaded is not None and set(loaded.joints) != set(read.joints):
        return nowhere
    own_states = spread(own, _in_order_of_file(assignment.mechanism, own, states), asked_joints(read.tree, read.joints))
    truth = truth_of(about)
    # The other mechanism may be one whose M is next to singular: digits that this costs are excused in any engine.
    found = compare(truth.evaluate(own_states), truth.answers(model, own_states), factorises=True)
    return np.isin(found.verdicts, _EXPLAINED)


def _folded(assignment: Assignment) -> tuple[Robot, Folded]:
    assert assignment.model is not None
    return misread_by(assignment.model, assignment.mechanism.gravity, assignment.subject.engine, assignment.library)


def _in_order_of_file(mechanism: Mechanism, robot: Robot, states: States) -> States:
    """States of a mechanism with the joints in the order of its file."""
    sizes = mechanism.joint_sizes
    q, v = (_columns({joint: size[which] for joint, size in sizes.items()}, robot.joints) for which in (0, 1))
    return States(states.q[:, q], states.v[:, v], states.tau[:, v], states.time)


def _columns(sizes: Mapping[str, int], joints: tuple[str, ...]) -> list[int]:
    ends = dict(zip(sizes, itertools.accumulate(sizes.values()), strict=True))
    return [column for joint in joints for column in range(ends[joint] - sizes[joint], ends[joint])]
