"""An engine's answer with the equalities of a file switched on, held against the optimum that the engine documents for them.

What a plain answer leaves out is asked once more: points that meet and joints that are coupled act, and limits, contacts and friction
stay off. The tree is that which the engine's readings make of the file. Each state has its own impedance, by its distance from closing.

Source: MuJoCo documentation, Computation, sections Constraint model and Solver parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from harness.comparison.robot_library import ask_engine, engine_of, engines_of_files
from harness.engines import Engine
from harness.engines.request import EngineAnswers, Held
from harness.explain.as_read import read_by
from harness.explain.changes.readings import element_at
from harness.explain.meant import Meant, largest_change, question_of, read_as, reference_of, worst
from harness.files.equalities import Equality, Meeting, Sum, TendonLinkage
from harness.files.tree import WORLD
from harness.library import Stance
from harness.results.comparison import EqualitiesRecord, EqualityPart
from harness.trees.inverse_weights import inverse_weights_of
from harness.trees.mechanism import tied_tree
from harness.trees.robot import Robot
from harness.truth.compare import Comparison, compare
from harness.truth.declared import declared
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
    # The first answer was given, so that this one is no refusal.
    answers, declared = _asked(meant, caller, judged), _declared_truth(read, caller, judged)
    compared = compare(declared, answers.of(joints), factorises=True)
    record = EqualitiesRecord(
        **about,
        parts=parts,
        verdict=str(compared.verdicts[compared.worst]),
        explained=_is_held(compared),
        backward_error=worst(compared),
        together=_effect(read, answers),
    )
    if record.explained or not caller.to_the_end:
        return record
    ended = compare(declared, _asked(meant, caller, judged, to_the_end=True).of(joints), factorises=True)
    return replace(record, explained=True, to_the_end=worst(ended), remedy=caller.to_the_end) if _is_held(ended) else record


def truth_with(meant: Meant, equality: Equality | None) -> Reference | None:
    """The truth of a robot with one equality, by the law that an engine documents; None where it is not judged.

    With none, or one that is switched off, it is that of the robot alone.
    """
    if equality is None or not equality.is_active:
        return meant.truth
    caller = next((one for one in engines_of_files().values() if not one.why_no_equalities and meant.robot.format in one.formats), None)
    if caller is None or _why_not(equality, meant.robot):
        return None
    return _declared_truth(replace(meant, robot=replace(meant.robot, equalities=(equality,))), caller, [0])


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


def _asked(meant: Meant, caller: Engine, switched_on: Sequence[int], to_the_end: bool = False) -> EngineAnswers:
    """Accelerations of the plain engine with some of the equalities."""
    held = Held(tuple(one.kind for one in meant.robot.equalities), tuple(switched_on), to_the_end)
    return ask_engine(caller.name, question_of(meant, Stance.PLAIN, held))


def _effect(read: Meant, answers: EngineAnswers) -> float | None:
    """By how much an answer differs from the truth of the tree alone, relative in the energy norm."""
    found = answers.of(read.robot.joints)
    truth = read.truth[np.arange(len(found))]
    return largest_change(truth, found, truth.certified)


def _declared_truth(read: Meant, caller: Engine, numbers: Sequence[int]) -> Reference:
    """The certified optimum at the states of ``read`` with these equalities."""
    robot, states = read.robot, read.states
    chosen = {f"{robot.equalities[number].kind} {number}": robot.equalities[number] for number in numbers}
    root = element_at(robot.tree.place)
    laws = caller.laws(root, robot.format, [replace(one, name=name) for name, one in chosen.items()])
    tied = tied_tree(robot.tree, robot.joints, {name: one.rows for name, one in chosen.items() if one.rows is not None})
    weights = inverse_weights_of(
        robot.tree,
        (part for law in laws.values() for row in law.weights or () for part in row),
        caller.fuses(root, robot.format),
        (tendon for one in chosen.values() if isinstance(one.rows, TendonLinkage) for tendon in one.rows.tendons),
    )
    own = tuple((str(number), float(value), "") for number, value in enumerate(tied.parameters))
    mechanism = replace(reference_of(robot).mechanism, parameters=own, constraints=tied.constraints, other_charts=(), charts_in_body=())
    return ReferenceKernel(declared(mechanism, laws, weights)).evaluate(states)
