"""An engine's answer with all elements of a file switched on that are judged, held against the law that it documents for them.

What a smooth answer leaves out is asked once more: points that meet and joints that are coupled act, and actuators drive at controls
within and beyond their ranges; what is not judged stays off. The tree is that which the engine's readings make of the file. Half of the
states nearly close the equalities, where impedances vary with the distance. Where the engine's program departs from the documented law,
that is told, with its effect.

A kind of elements is a ``_Group``: what of a file it is, and how an engine is told to let some of them act.

Source: MuJoCo documentation, Computation, sections Actuation model, Constraint model and Solver parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from harness.comparison.robot_library import ask_engine, engine_of, engines_of_files
from harness.crosscheck.constraint_laws import effect_of
from harness.engines import ConstraintLaw, Engine
from harness.engines.request import EngineAnswers, Held
from harness.explain.as_read import Folded, effects, read_by
from harness.explain.changes.departures import Departure, departed, departures_of
from harness.explain.changes.readings import element_at
from harness.explain.file_numbers import left_beside_readings
from harness.explain.meant import Meant, driven, largest_change, question_of, read_as, reference_of, request_of, spread, worst
from harness.files.equalities import Equality, Meeting, Sum, TendonLinkage
from harness.files.findings import ACTUATORS, EQUALITIES, SWITCHED_OFF
from harness.files.tree import WORLD, Actuator
from harness.library import Stance
from harness.programs.mechanisms.mechanism import Mechanism
from harness.results.readings import FELT, Effect
from harness.results.switched_on import SwitchedOnPart, SwitchedOnRecord
from harness.trees.inverse_weights import inverse_weights_of
from harness.trees.mechanism import tied_tree
from harness.trees.robot import Robot, with_actuators
from harness.truth.compare import Comparison, compare
from harness.truth.declared import DeclaredMechanism, declared, near
from harness.truth.reference import Reference, ReferenceKernel
from harness.verdict import Verdict

# Elements whose effect is said; each takes the file's being loaded once more.
MOST_EFFECTS = 32
_HELD = {Verdict.AGREES.value, Verdict.UNSTABLE.value, Verdict.UNDECIDED.value}
_UNEXPLAINED = "not judged: without them its answer is not what its readings make of the file, as told above"


@dataclass(frozen=True)
class _Group:
    """A kind of elements.

    Attributes:
        what: as of ``LeftOut``. of: all of a file, in its order.
        why_not: why an engine's answer with one is not judged, for what its reader makes of the file; "" where it is.
        acts_unjudged: whether an engine may be asked what one does whose answer is not judged.
        held: what else an engine holds with those of these numbers on.
    """

    what: str
    of: Callable[[Robot], Sequence[Any]]
    why_not: Callable[[Any, Robot], str]
    acts_unjudged: Callable[[Any], bool]
    held: Callable[[Held, tuple[int, ...]], Held]


@dataclass(frozen=True)
class _Switch:
    """An element by its number in its group; ``why_not`` as of a part of a record."""

    group: _Group
    number: int
    element: Any
    why_not: str

    def part(self, alone: float | None = None) -> SwitchedOnPart:
        one = self.element
        return SwitchedOnPart(what=self.group.what, kind=one.kind, line=one.line, why_not=self.why_not, alone=alone)


@dataclass(frozen=True)
class _Asked:
    """An engine that is asked about a file, ``original``, with some of its elements on."""

    original: Meant
    caller: Engine

    def with_those(
        self, switches: Sequence[_Switch], at: Meant | None = None, few: bool = False, to_the_end: bool = False
    ) -> EngineAnswers:
        """Its accelerations, at the states of the file, ``few`` of them, or those of what is read, ``at``."""
        original = self.original.few if few else self.original
        held = Held(tuple(one.kind for one in original.robot.equalities), (), to_the_end)
        for group in _GROUPS:
            held = group.held(held, tuple(one.number for one in switches if one.group is group))
        question = question_of(original, Stance.PLAIN, held)
        if at is not None and {joint.name for joint in question.request.joints} <= set(at.robot.joints):
            states = spread(at.robot, at.states, question.request.joints)
            question = replace(question, q=states.q, v=states.v, tau=states.tau)
        return ask_engine(self.caller.name, question)


def has_switches(robot: Robot) -> bool:
    """True for a file with elements of which an engine may let some act and others not."""
    return any(group.of(robot) for group in _GROUPS)


def judge_switched_on(meant: Meant, engine: str) -> SwitchedOnRecord:
    """The record of an engine on a file with all on that is judged; ``meant`` is the file with all of it off."""
    caller, original = engine_of(engine), driven(meant)
    smooth, folded = (read_by(one.robot, caller.name, caller, Stance.PLAIN) for one in (meant, original))
    asked, read = _Asked(original, caller), read_as(original, folded.robot)
    off = read if original is meant else read_as(meant, with_actuators(folded.robot, ()))
    why_off = {what: f"is off: {reason}" for what, reason in caller.why_off.items()}
    switches = [
        _Switch(group, number, one, why_off.get(group.what) or group.why_not(one, read.robot))
        for group in _GROUPS
        for number, one in enumerate(group.of(original.robot))
    ]
    record = SwitchedOnRecord(
        path=str(meant.robot.path),
        engine=caller.name,
        title=caller.title,
        format=meant.robot.format,
        parts=[one.part() for one in switches],
        readings=_of_what_is_on(original, folded, smooth),
        message="; ".join(reason for what, reason in caller.why_off.items() if any(one.group.what == what for one in switches)),
    )
    asked_with = [one for one in switches if one.group.what not in caller.why_off]
    judged = [one for one in asked_with if not one.why_not]
    if not asked_with:
        return record
    free, joints = asked.with_those([]), read.robot.joints
    refusal = free.refusal or asked.with_those(judged, few=True).refusal
    if refusal or read.undetermined or not set(joints) <= set(free.accelerations):
        return replace(record, message=refusal or _UNEXPLAINED)
    if not _is_held(compare(off.truth, free.of(joints), factorises=True)):
        return replace(record, message=_UNEXPLAINED)
    known = [one for one in asked_with if not one.why_not or one.group.acts_unjudged(one.element)][:MOST_EFFECTS]
    alone = {id(one): _effect(off, asked.with_those([one], few=True)) for one in known}
    record = replace(record, parts=[one.part(alone.get(id(one))) for one in switches])
    return _judged(record, asked, folded, _nearly_closed(original, read, caller, judged), judged) if judged else record


def _judged(record: SwitchedOnRecord, asked: _Asked, folded: Folded, at: Meant, judged: Sequence[_Switch]) -> SwitchedOnRecord:
    """The record with the verdict on these elements; ``at`` is what the engine reads, at the states where it is asked."""
    caller, joints = asked.caller, at.robot.joints
    # The first answer was given, so that this one is no refusal.
    answers, equalities = asked.with_those(judged, at), _numbers(judged, EQUALITIES)
    truth = ReferenceKernel(_documented(at, caller, equalities)).evaluate(at.states)
    compared = compare(truth, answers.of(joints), factorises=True)
    without = reference_of(with_actuators(at.robot, ())).evaluate(at.states)
    record = replace(
        record,
        verdict=str(compared.verdicts[compared.worst]),
        explained=_is_held(compared),
        backward_error=worst(compared),
        together=largest_change(without, answers.of(joints), without.certified),
    )
    if record.explained:
        return record
    departures = _departures(at, caller, equalities, truth)
    computed = truth
    if departures:
        computed = ReferenceKernel(_documented(at, caller, equalities, departures)).evaluate(at.states)
        compared = compare(computed, answers.of(joints), factorises=True)
        record = replace(record, explained=_is_held(compared), backward_error=worst(compared), departures=[*departures.values()])
    if not record.explained and caller.to_the_end:
        ended = compare(computed, asked.with_those(judged, at, to_the_end=True).of(joints), factorises=True)
        if _is_held(ended):
            return replace(record, explained=True, to_the_end=worst(ended), remedy=caller.to_the_end)
    if record.explained or equalities:
        return record
    return replace(record, rest=left_beside_readings(asked.original, folded, at, answers, compared))


def _of_what_is_on(original: Meant, folded: Folded, smooth: Folded) -> list[Effect]:
    """The effects of the readings that make something of what is on alone."""
    known = {reading.name for reading, _ in smooth.applied}
    own = tuple((reading, before) for reading, before in folded.applied if reading.name not in known)
    return effects(original, Folded(folded.robot, own)) if own else []


def _numbers(switches: Iterable[_Switch], what: str) -> list[int]:
    return [one.number for one in switches if one.group.what == what]


def _nearly_closed(original: Meant, read: Meant, caller: Engine, judged: Sequence[_Switch]) -> Meant:
    """What is read, where half of the states nearly close the equalities: anywhere else impedances are those of far away."""
    asked_about = {joint.name for joint in request_of(original.robot, Stance.PLAIN).joints}
    numbers = _numbers(judged, EQUALITIES)
    if not numbers or not asked_about <= set(read.robot.joints):
        return read
    half = np.arange(len(read.states)) % 2 == 0
    closing = near(_tied(with_actuators(read.robot, ()), caller, numbers), read.states[half])
    q, v = read.states.q.copy(), read.states.v.copy()
    q[half], v[half] = closing.q, closing.v
    states = replace(read.states, q=q, v=v)
    return Meant(read.robot, states, reference_of(read.robot).evaluate(states))


def _departures(near: Meant, caller: Engine, numbers: Sequence[int], documented: Reference) -> dict[Departure, Effect]:
    """The engine's departures from the documented laws of some equalities, each with what it does alone; none that does nothing."""
    robot, found = near.robot, {}
    chosen, laws = _laws(robot, caller, numbers)
    for one in departures_of(caller.name, caller.reader):
        if concerned := one.concerned(robot.tree, chosen, laws):
            departed = ReferenceKernel(_documented(near, caller, numbers, [one])).evaluate(near.states)
            found[one] = effect_of(one, concerned, documented, departed)
    return {one: effect for one, effect in found.items() if effect.alone is None or effect.alone > FELT}


def truth_with(meant: Meant, equality: Equality | None) -> Reference | None:
    """The truth of a robot with one equality, by the law that an engine documents; None where it is not judged.

    With none, or one that is switched off, it is that of the robot alone.
    """
    if equality is None or not equality.is_active:
        return meant.truth
    engines = (one for one in engines_of_files().values() if EQUALITIES not in one.why_off and meant.robot.format in one.formats)
    caller = next(engines, None)
    if caller is None or _why_no_equality(equality, meant.robot):
        return None
    alone = replace(meant.robot, equalities=(equality,))
    return ReferenceKernel(_tied(alone, caller, [0])).evaluate(meant.states)


def _is_held(compared: Comparison) -> bool:
    return set(compared.verdicts.tolist()) <= _HELD


def _why_no_equality(equality: Equality, read: Robot) -> str:
    """Why an engine's answer with an equality is not judged; "" where it is."""
    if not equality.is_active:
        return SWITCHED_OFF
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


def _why_not_driven(actuator: Actuator, read: Robot) -> str:
    """Why an engine's answer with an actuator is not judged; "" where it is."""
    is_read = any(one.number == actuator.number for one in read.tree.actuators)
    return actuator.why_not or ("" if is_read else "is left out by the engine's reader")


_GROUPS = (
    _Group(
        EQUALITIES,
        of=lambda robot: robot.equalities,
        why_not=_why_no_equality,
        acts_unjudged=lambda one: one.is_active,
        held=lambda held, numbers: replace(held, switched_on=numbers),
    ),
    _Group(
        ACTUATORS,
        of=lambda robot: robot.actuators,
        why_not=_why_not_driven,
        # Nobody knows its range.
        acts_unjudged=lambda _: False,
        held=lambda held, numbers: replace(held, actuators=numbers),
    ),
)


def _effect(read: Meant, answers: EngineAnswers) -> float | None:
    """By how much an answer differs from the truth of the tree alone, relative in the energy norm."""
    found = answers.of(read.robot.joints)
    truth = read.truth[np.arange(len(found))]
    return largest_change(truth, found, truth.certified)


def _laws(robot: Robot, caller: Engine, numbers: Sequence[int]) -> tuple[list[Equality], Mapping[str, ConstraintLaw]]:
    """Equalities by these numbers under names of their own, and the laws that the engine documents of them."""
    chosen = [replace(robot.equalities[number], name=f"{robot.equalities[number].kind} {number}") for number in numbers]
    return chosen, caller.laws(element_at(robot.tree.place), robot.format, chosen)


def _documented(read: Meant, caller: Engine, numbers: Sequence[int], departures: Iterable[Departure] = ()) -> Mechanism:
    """What is read, with these equalities by the laws that the engine documents, or with departures from them."""
    return _tied(read.robot, caller, numbers, departures) if numbers else reference_of(read.robot).mechanism


def _tied(robot: Robot, caller: Engine, numbers: Sequence[int], departures: Iterable[Departure] = ()) -> DeclaredMechanism:
    """A robot with some of its equalities by the laws that an engine documents, or with departures from them."""
    chosen, laws = _laws(robot, caller, numbers)
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
