"""An engine's answer with the equalities of a file switched on, held against the optimum that the engine documents for them.

What a plain answer leaves out is asked once more: points that meet and joints that are coupled act, and limits, contacts and friction
stay off. The tree is that which the engine's readings make of the file. Half of the states nearly close the equalities, where impedances
vary with the distance. Where the engine's program departs from the documented law, that is told, with its effect.

Source: MuJoCo documentation, Computation, sections Constraint model and Solver parameters.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from harness.comparison.robot_library import ask_engine, engine_of, engines_of_files
from harness.crosscheck.constraint_laws import effect_of
from harness.engines import ConstraintLaw, Engine
from harness.engines.request import EngineAnswers, Held
from harness.explain.as_read import read_by
from harness.explain.changes.departures import Departure, departed, departures_of
from harness.explain.changes.readings import element_at
from harness.explain.meant import Meant, largest_change, question_of, read_as, reference_of, request_of, spread, worst
from harness.files.equalities import Equality, Meeting, Sum, TendonLinkage
from harness.files.tree import WORLD
from harness.library import Stance
from harness.programs.states import States
from harness.results.comparison import EqualitiesRecord, EqualityPart
from harness.results.readings import FELT, Effect
from harness.trees.inverse_weights import inverse_weights_of
from harness.trees.mechanism import tied_tree
from harness.trees.robot import Robot
from harness.truth.compare import Comparison, compare
from harness.truth.declared import DeclaredMechanism, declared, near
from harness.truth.reference import Reference, ReferenceKernel
from harness.verdict import Verdict

# Equalities whose effect is said; each takes the file's being loaded once more.
MOST_EFFECTS = 32
_HELD = {Verdict.AGREES.value, Verdict.UNSTABLE.value, Verdict.UNDECIDED.value}
_UNEXPLAINED = "not judged: without them its answer is not what its readings make of the file, as told above"


def judge_equalities(meant: Meant, engine: str) -> EqualitiesRecord:
    """The record of a plain engine on a file with equalities."""
    robot, caller = meant.robot, engine_of(engine)
    about: dict[str, Any] = {"path": str(robot.path), "engine": caller.name, "title": caller.title, "format": robot.format}
    if caller.why_no_equalities:
        return EqualitiesRecord(**about, parts=[_part(one, "") for one in robot.equalities], message=caller.why_no_equalities)
    read = read_as(meant, read_by(robot, caller.name, caller, Stance.PLAIN).robot)
    why_not = {number: reason for number, one in enumerate(robot.equalities) if (reason := _why_not(one, read.robot))}
    judged = [number for number in range(len(robot.equalities)) if number not in why_not]
    free = _asked(meant, caller, ())
    joints = read.robot.joints
    if free.refusal or read.undetermined or not set(joints) <= set(free.accelerations):
        return EqualitiesRecord(**about, parts=[_part(one, "") for one in robot.equalities], message=free.refusal or _UNEXPLAINED)
    is_known = _is_held(compare(read.truth, free.of(joints), factorises=True))
    active = [number for number, one in enumerate(robot.equalities) if one.is_active][:MOST_EFFECTS]
    alone = {number: _effect(read, _asked(meant.few, caller, (number,))) for number in active} if is_known else {}
    parts = [_part(one, why_not.get(number, ""), alone.get(number)) for number, one in enumerate(robot.equalities)]
    if not is_known or not judged:
        return EqualitiesRecord(**about, parts=parts, message="" if is_known else _UNEXPLAINED)
    documented, nearly = _declared(read, caller, judged), _nearly_closed(meant, read, caller, judged)
    # The first answer was given, so that this one is no refusal.
    truth, answers = ReferenceKernel(documented).evaluate(nearly.states), _asked(meant, caller, judged, nearly)
    compared = compare(truth, answers.of(joints), factorises=True)
    record = EqualitiesRecord(
        **about,
        parts=parts,
        verdict=str(compared.verdicts[compared.worst]),
        explained=_is_held(compared),
        backward_error=worst(compared),
        together=_effect(nearly, answers),
    )
    if record.explained:
        return record
    departures = _departures(nearly, caller, judged, truth)
    computed = truth
    if departures:
        computed = ReferenceKernel(_declared(read, caller, judged, departures)).evaluate(nearly.states)
        compared = compare(computed, answers.of(joints), factorises=True)
        record = replace(record, explained=_is_held(compared), backward_error=worst(compared), departures=[*departures.values()])
    if record.explained or not caller.to_the_end:
        return record
    ended = compare(computed, _asked(meant, caller, judged, nearly, to_the_end=True).of(joints), factorises=True)
    return replace(record, explained=True, to_the_end=worst(ended), remedy=caller.to_the_end) if _is_held(ended) else record


def _nearly_closed(meant: Meant, read: Meant, caller: Engine, numbers: Sequence[int]) -> Meant:
    """The same where half of the states nearly close the equalities: anywhere else impedances are those of far away."""
    if not {joint.name for joint in request_of(meant.robot, Stance.PLAIN).joints} <= set(read.robot.joints):
        return read
    half = np.arange(len(read.states)) % 2 == 0
    closing = near(_declared(read, caller, numbers), read.states[half])
    q, v = read.states.q.copy(), read.states.v.copy()
    q[half], v[half] = closing.q, closing.v
    states = States(q, v, read.states.tau, read.states.time)
    return Meant(read.robot, states, reference_of(read.robot).evaluate(states))


def _departures(near: Meant, caller: Engine, numbers: Sequence[int], documented: Reference) -> dict[Departure, Effect]:
    """The engine's departures from the documented laws of some equalities, each with what it does alone; none that does nothing."""
    robot, found = near.robot, {}
    chosen, laws = _laws(near, caller, numbers)
    for one in departures_of(caller.name, caller.reader):
        if concerned := one.concerned(robot.tree, chosen, laws):
            departed = ReferenceKernel(_declared(near, caller, numbers, [one])).evaluate(near.states)
            found[one] = effect_of(one, concerned, documented, departed)
    return {one: effect for one, effect in found.items() if effect.alone is None or effect.alone > FELT}


def truth_with(meant: Meant, equality: Equality | None) -> Reference | None:
    """The truth of a robot with one equality, by the law that an engine documents; None where it is not judged.

    With none, or one that is switched off, it is that of the robot alone.
    """
    if equality is None or not equality.is_active:
        return meant.truth
    caller = next((one for one in engines_of_files().values() if not one.why_no_equalities and meant.robot.format in one.formats), None)
    if caller is None or _why_not(equality, meant.robot):
        return None
    alone = replace(meant, robot=replace(meant.robot, equalities=(equality,)))
    return ReferenceKernel(_declared(alone, caller, [0])).evaluate(meant.states)


def _is_held(compared: Comparison) -> bool:
    return set(compared.verdicts.tolist()) <= _HELD


def _part(equality: Equality, why_not: str, alone: float | None = None) -> EqualityPart:
    return EqualityPart(kind=equality.kind, line=equality.line, why_not=why_not, alone=alone)


def _why_not(equality: Equality, read: Robot) -> str:
    """Why an engine's answer with an equality is not judged; "" where it is."""
    if not equality.is_active:
        return "is switched off in the file"
    if equality.rows is None:
        return equality.why_not
    joints, bodies = {joint.name for joint in read.tree.joints}, {body.name for body in read.tree.bodies} | {WORLD}
    if isinstance(equality.rows, Meeting):
        named, known = set(equality.rows.bodies), bodies
    elif isinstance(equality.rows, TendonLinkage):
        named, known = {joint for tendon in equality.rows.tendons if isinstance(tendon, Sum) for joint, _ in tendon.terms}, joints
    else:
        named, known = {equality.rows.joint, equality.rows.leader or equality.rows.joint}, joints
    missing = ", ".join(sorted(named - known))
    return f"is about {missing}, which the engine does not have" if missing else ""


def _asked(meant: Meant, caller: Engine, switched_on: Sequence[int], near: Meant | None = None, to_the_end: bool = False) -> EngineAnswers:
    """Accelerations of the plain engine with some of the equalities; ``near`` is what it reads, at states to ask at."""
    held = Held(tuple(one.kind for one in meant.robot.equalities), tuple(switched_on), to_the_end)
    question = question_of(meant, Stance.PLAIN, held)
    if near is not None and {joint.name for joint in question.request.joints} <= set(near.robot.joints):
        states = spread(near.robot, near.states, question.request.joints)
        question = replace(question, q=states.q, v=states.v, tau=states.tau)
    return ask_engine(caller.name, question)


def _effect(read: Meant, answers: EngineAnswers) -> float | None:
    """By how much an answer differs from the truth of the tree alone, relative in the energy norm."""
    found = answers.of(read.robot.joints)
    truth = read.truth[np.arange(len(found))]
    return largest_change(truth, found, truth.certified)


def _laws(read: Meant, caller: Engine, numbers: Sequence[int]) -> tuple[list[Equality], Mapping[str, ConstraintLaw]]:
    """Equalities by these numbers under names of their own, and the laws that the engine documents of them."""
    robot = read.robot
    chosen = [replace(robot.equalities[number], name=f"{robot.equalities[number].kind} {number}") for number in numbers]
    return chosen, caller.laws(element_at(robot.tree.place), robot.format, chosen)


def _declared(read: Meant, caller: Engine, numbers: Sequence[int], departures: Iterable[Departure] = ()) -> DeclaredMechanism:
    """What is read with these equalities, by the laws that the engine documents, or with departures from them."""
    robot = read.robot
    chosen, laws = _laws(read, caller, numbers)
    laws = departed(departures, robot.tree, chosen, laws)
    tied = tied_tree(robot.tree, robot.joints, {one.name: one.rows for one in chosen if one.rows is not None})
    weights = inverse_weights_of(
        robot.tree,
        (part for law in laws.values() for row in law.weights or () for part in row),
        caller.fuses(element_at(robot.tree.place), robot.format),
        (tendon for one in chosen if isinstance(one.rows, TendonLinkage) for tendon in one.rows.tendons),
    )
    own = tuple((str(number), float(value), "") for number, value in enumerate(tied.parameters))
    mechanism = replace(reference_of(robot).mechanism, parameters=own, constraints=tied.constraints, other_charts=(), charts_in_body=())
    return declared(mechanism, laws, weights)
