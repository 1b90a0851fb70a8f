"""Effects of an engine's departures from its documented law of constraints on the accelerations of a mechanism, each alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from harness.crosscheck.assignment import (
    Assignment,
    acceleration_truth_of,
    departures_of,
    truth_of,
    truth_without,
    why_left_out,
)
from harness.crosscheck.constraint_laws import DepartedTruth
from harness.engines import load_engine
from harness.engines.tree_request import asked_joints
from harness.explain.as_read import ReadTruth
from harness.explain.documented import all_judged, documented, effect_of, effect_of_friction, softening_of
from harness.explain.meant import STATES, STATES_OF_EFFECTS, columns_of, largest_change, meant, spread
from harness.files.equalities import Constraint, DryFriction
from harness.files.findings import ACTUATORS, FRICTION, LIMITS
from harness.files.model_file import ModelFile
from harness.programs.mechanisms.mechanism import controls_of
from harness.programs.states import States
from harness.results.readings import Effect
from harness.results.records import ACCELERATIONS
from harness.trees.mechanism import RobotMechanism
from harness.truth.quantities.accelerations import AccelerationTruth
from harness.truth.reference import Reference, ReferenceKernel, moves
from harness.truth.sampling import sample


def departures_and_refusal(assignment: Assignment, seed: int) -> tuple[list[Effect], list[str]]:
    """Each departure from the documented law of the model's constraints, with what it does; the model is refused by none."""
    about = replace(assignment, quantity=ACCELERATIONS)
    truth = truth_of(about)
    assert isinstance(truth, DepartedTruth) and isinstance(truth.of_file, AccelerationTruth)
    sampled = sample(assignment.mechanism, STATES, seed)
    if LIMITS in why_left_out(about):
        # At rest where their ranges begin, too: some of those are stops.
        low = [low if bounds is None else bounds[0] for bounds, low in zip(assignment.mechanism.position_ranges, sampled.q[0], strict=True)]
        sampled = States.concatenate([sampled, replace(sampled, q=np.tile(low, (STATES, 1)), v=np.zeros_like(sampled.v))])
    states = truth.asked_at(sampled)
    reference = truth.of_file.evaluate(states)
    found = list[Effect]()
    for what, sentence in why_left_out(about).items():
        assert assignment.model is not None
        lines, is_driving = _lines(assignment.model, what), what == ACTUATORS
        left = truth_without(about, [what]).evaluate(states)
        assert isinstance(left, Reference)
        found.append(
            Effect(
                name=what,
                sentence=sentence,
                concerns="actuators" if is_driving else "joints",
                lines=tuple(dict.fromkeys(lines)),
                count=controls_of(assignment.mechanism) if is_driving else len(lines),
                # Of the accelerations without: where a mechanism sticks it has none.
                alone=largest_change(left, reference.high, reference.certified & left.certified & moves(left)),
                source="its documentation of forward dynamics, whose one input of forces is tau",
                remedy="add J' f of each actuator to tau, f its force at the control" if is_driving else "",
            )
        )
    for one, concerned in departures_of(about).items():
        departed = acceleration_truth_of(replace(about, departures=(one.name,)))
        found.append(effect_of(one, concerned, reference, departed.evaluate(states)))
    return found, []


def effects_on_file(assignment: Assignment, of_readings: Sequence[Effect], seed: int) -> list[Effect]:
    """The effects of readings of a user's file, of what its engine leaves out, and of departures from the law that it documents."""
    own, library, engine = assignment.mechanism, assignment.library, load_engine(assignment.library, assignment.subject.engine)
    read = assignment.as_read
    mechanism, departures = read.mechanism, departures_of(read)
    assert isinstance(own, RobotMechanism) and isinstance(mechanism, RobotMechanism)
    of_file = assignment.truth.asked_at(sample(own, STATES_OF_EFFECTS, seed))
    found = [_held_again(assignment, one, of_file) for one in of_readings]
    if why_left_out(assignment):
        found += effect_of_friction(meant(own.robot, STATES, seed), engine, library)
    if not departures:
        return found
    states = assignment.into(of_file)

    def reference(*names: str) -> Reference:
        softening = softening_of(mechanism, engine, library, names)
        assert softening is not None
        return ReferenceKernel(softening(mechanism)).evaluate(states)

    by_law = reference()
    return [*found, *(effect_of(one, concerned, by_law, reference(one.name)) for one, concerned in departures.items())]


def _held_again(assignment: Assignment, effect: Effect, states: States) -> Effect:
    """The effect of a reading that frees joints, where the engine holds them by constraints of its own; any other as it is."""
    file, truth = assignment.file_as_read, assignment.truth
    freeing = [one for one, before in file.folded.applied if one.name == effect.name and one.read(before).joints != before.joints]
    if not freeing or not isinstance(truth, ReadTruth):
        return effect
    robot, engine = freeing[0].read(file.robot), load_engine(assignment.library, assignment.subject.engine)
    held = documented(robot, engine, all_judged(robot, engine))
    joints = asked_joints(robot.tree, robot.joints)
    if held.softened is None or not set(file.robot.joints) <= set(robot.joints):
        return effect
    meant, freed = truth.of_file.evaluate(states), ReferenceKernel(held).evaluate(spread(file.robot, states, joints))
    assert isinstance(meant, Reference)
    moved = freed.high[:, columns_of(joints, file.robot.joints)]
    return replace(effect, alone=largest_change(meant, moved, meant.certified & freed.certified))


def _lines(model: ModelFile, what: str) -> list[int]:
    """Lines of the constraints of a kind that the mechanism has; for actuators that a file does not have, its first line."""
    if what == ACTUATORS:
        return [line for name, line in model.actuators if name in model.driven] or [model.root_line]
    return [one.line for one in model.bounded if one.name in model.acting and _what(one) == what]


def _what(bounded: Constraint) -> str:
    return FRICTION if isinstance(bounded.says, DryFriction) else LIMITS
