"""An engine's answer with all elements of a file switched on that are judged, held against the law that it documents for them.

What a smooth answer leaves out is asked once more: points that meet and joints that are coupled act, joints rub and have limits, and
actuators drive at controls within and beyond their ranges; what is not judged stays off. The tree is that which the engine's readings make
of the file. Half of the states nearly close the equalities, where impedances vary with the distance, and some are beyond limits. Where the
engine's program departs from the documented law, that is told, with its effect.

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
from harness.explain.file_numbers import left_beside_readings, unexplained
from harness.explain.meant import Meant, driven, largest_change, question_of, read_as, reference_of, request_of, spread, worst
from harness.files.equalities import Constraint, Equality, Meeting, Sum, TendonLinkage, frictions_of, limits_of
from harness.files.findings import ACTUATORS, EQUALITIES, FRICTION, LIMITS, SWITCHED_OFF, TENDON_LIMITS
from harness.files.tree import WORLD, Actuator
from harness.library import Stance
from harness.programs.mechanisms.mechanism import Mechanism
from harness.results.readings import FELT, Effect
from harness.results.switched_on import SwitchedOnPart, SwitchedOnRecord
from harness.trees.robot import Robot, with_actuators
from harness.truth.compare import Comparison, Flags, compare
from harness.truth.declared import DeclaredMechanism
from harness.truth.displaced import near, pressed
from harness.truth.optimum import optimum
from harness.truth.reference import Reference, ReferenceKernel
from harness.verdict import Verdict

# Elements whose effect is said; each takes the file's being loaded once more.
MOST_EFFECTS = 32
# One of so many states is beyond limits.
_EACH_PRESSED = 4
_HELD = {Verdict.AGREES.value, Verdict.UNSTABLE.value, Verdict.UNDECIDED.value}
_UNEXPLAINED = "not judged: without them its answer is not what its readings make of the file, as told above"


@dataclass(frozen=True)
class _Group:
    """A kind of elements.

    Attributes:
        what: as of ``LeftOut``. of: all of a file, in its order.
        why_not: why an engine's answer with one is not judged, for what its reader makes of the file; "" where it is.
        acts_unjudged: whether an engine may be asked what one does whose answer is not judged.
        held: what else an engine holds with some of them on.
        constraints: of a robot, those of them that are constraints, each under a name of its own.
        is_told_alone: whether it is told what each does alone.
    """

    what: str
    of: Callable[[Robot], Sequence[Any]]
    why_not: Callable[[Any, Robot], str]
    acts_unjudged: Callable[[Any], bool]
    held: Callable[[Held, Sequence[_Switch]], Held]
    constraints: Callable[[Robot, Sequence[_Switch]], list[Constraint]] = lambda robot, switches: []
    is_told_alone: bool = True


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
            held = group.held(held, [one for one in switches if one.group is group])
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
    on_in_file = _switched_off_by_file(_switches(original.robot, read.robot), read.robot, caller)
    switches = [replace(one, why_not=why_off.get(one.group.what) or one.why_not) for one in on_in_file]
    record = SwitchedOnRecord(
        path=str(meant.robot.path),
        engine=caller.name,
        title=caller.title,
        format=meant.robot.format,
        parts=[one.part() for one in switches],
        readings=[*_of_what_is_on(original, folded, smooth), *_of_no_friction(meant, caller)],
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
    told = [one for one in asked_with if one.group.is_told_alone]
    known = [one for one in told if not one.why_not or one.group.acts_unjudged(one.element)][:MOST_EFFECTS]
    alone = {id(one): _effect(off, asked.with_those([one], few=True)) for one in known}
    record = replace(record, parts=[one.part(alone.get(id(one))) for one in switches])
    return _judged(record, asked, folded, *_felt(original, read, caller, judged), judged) if judged else record


def _judged(
    record: SwitchedOnRecord, asked: _Asked, folded: Folded, at: Meant, within: Flags, judged: Sequence[_Switch]
) -> SwitchedOnRecord:
    """The record with the verdict on these elements; ``at`` and ``within`` as of ``_felt``."""
    caller, joints = asked.caller, at.robot.joints
    # The first answer was given, so that this one is no refusal.
    answers, has_constraints = asked.with_those(judged, at), bool(_constraints(at.robot, judged))
    truth = ReferenceKernel(_documented(at, caller, judged)).evaluate(at.states)
    compared = compare(truth, answers.of(joints), factorises=True)
    without = reference_of(with_actuators(at.robot, ())).evaluate(at.states)
    record = replace(
        record,
        verdict=str(compared.verdicts[compared.worst]),
        explained=_is_held(compared),
        backward_error=worst(compared),
        together=largest_change(without, answers.of(joints), without.certified & within),
    )
    if record.explained:
        return record
    departures = _departures(at, caller, judged, truth)
    computed = truth
    if departures:
        computed = ReferenceKernel(_documented(at, caller, judged, departures)).evaluate(at.states)
        compared = compare(computed, answers.of(joints), factorises=True)
        record = replace(record, explained=_is_held(compared), backward_error=worst(compared), departures=[*departures.values()])
    if not record.explained and caller.to_the_end:
        ended = compare(computed, asked.with_those(judged, at, to_the_end=True).of(joints), factorises=True)
        if _is_held(ended):
            return replace(record, explained=True, to_the_end=worst(ended), remedy=caller.to_the_end)
    if record.explained:
        return record
    if not has_constraints:
        return replace(record, rest=left_beside_readings(asked.original, folded, at, answers, compared))
    kernel = ReferenceKernel(_documented(at, caller, judged, departures))
    return replace(record, rest=unexplained(replace(at, certified=computed), answers.of(joints), kernel))


def _of_what_is_on(original: Meant, folded: Folded, smooth: Folded) -> list[Effect]:
    """The effects of the readings that make something of what is on alone."""
    known = {reading.name for reading, _ in smooth.applied}
    own = tuple((reading, before) for reading, before in folded.applied if reading.name not in known)
    return effects(original, Folded(folded.robot, own)) if own else []


def _of_no_friction(meant: Meant, caller: Engine) -> list[Effect]:
    """What an engine leaves out that documents no dry friction, by the law that another one documents of the file."""
    own = [one for one in _switches(meant.robot, meant.robot) if one.group.what == FRICTION and not one.why_not]
    other = _engine_with(FRICTION, meant.robot.format)
    # One that documents a law applies some.
    if not own or FRICTION not in caller.why_off or other is None or _laws(meant.robot, caller, own)[1]:
        return []
    rubbing = ReferenceKernel(_documented(meant.few, other, own)).evaluate(meant.few.states)
    lines = tuple(dict.fromkeys(one.element.line for one in own))
    change = largest_change(meant.few.truth, rubbing.high, meant.few.truth.certified & rubbing.certified)
    sentence, source = caller.why_off[FRICTION], f"by the law that {other.title} documents"
    return [Effect(name=FRICTION, sentence=sentence, concerns="joints", lines=lines, count=len(own), alone=change, source=source)]


def _engine_with(what: str, model_format: str) -> Engine | None:
    """The first engine that is asked with elements of a kind, of which it documents a law."""
    return next((one for one in engines_of_files().values() if what not in one.why_off and model_format in one.formats), None)


def _felt(original: Meant, read: Meant, caller: Engine, judged: Sequence[_Switch]) -> tuple[Meant, Flags]:
    """What is read, at states where constraints are felt, and which of them no limit pushes.

    Half of the states nearly close the equalities: anywhere else impedances are those of far away. A quarter is beyond limits.
    """
    asked_about = {joint.name for joint in request_of(original.robot, Stance.PLAIN).joints}
    numbers, within = np.arange(len(read.states)), np.ones(len(read.states), dtype=bool)
    if not _constraints(read.robot, judged) or not asked_about <= set(read.robot.joints):
        return read, within
    mechanism, states = _tied(with_actuators(read.robot, ()), caller, judged), read.states
    if not isinstance(mechanism, DeclaredMechanism):
        return read, within
    for displaced, chosen in (
        (near if mechanism.constraints else None, numbers % 2 == 0),
        (pressed if mechanism.pushing else None, numbers % _EACH_PRESSED == 1),
    ):
        if displaced is not None:
            moved = displaced(mechanism, states[chosen])
            q, v = states.q.copy(), states.v.copy()
            q[chosen], v[chosen] = moved.q, moved.v
            states = replace(states, q=q, v=v)
    if mechanism.pushing:
        within = ~mechanism.reaches_limits(states)
    return Meant(read.robot, states, reference_of(read.robot).evaluate(states)), within


def _departures(near: Meant, caller: Engine, switches: Sequence[_Switch], documented: Reference) -> dict[Departure, Effect]:
    """The engine's departures from the documented laws of some constraints, each with what it does alone; none that does nothing."""
    robot, found = near.robot, {}
    chosen, laws = _laws(robot, caller, switches)
    for one in departures_of(caller.name, caller.reader):
        if concerned := one.concerned(robot.tree, chosen, laws):
            departed = ReferenceKernel(_documented(near, caller, switches, [one])).evaluate(near.states)
            found[one] = effect_of(one, concerned, documented, departed)
    return {one: effect for one, effect in found.items() if effect.alone is None or effect.alone > FELT}


def truth_with(meant: Meant, equality: Equality | None) -> Reference | None:
    """The truth of a robot with one equality, by the law that an engine documents; None where it is not judged.

    With none, or one that is switched off, it is that of the robot alone.
    """
    if equality is None or not equality.is_active:
        return meant.truth
    caller = _engine_with(EQUALITIES, meant.robot.format)
    if caller is None or _why_no_equality(equality, meant.robot):
        return None
    alone = replace(meant.robot, equalities=(equality,))
    own = [one for one in _switches(alone, alone) if one.group.what == EQUALITIES]
    return ReferenceKernel(_tied(alone, caller, own)).evaluate(meant.states)


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


def _why_no_row(constraint: Constraint, read: Robot) -> str:
    """Why an engine's answer with dry friction or a limit is not judged; "" where it is."""
    of_tree = [*frictions_of(read.tree), *limits_of(read.tree), *limits_of(read.tree, of_tendons=True)]
    return constraint.why_not or ("" if any(one.name == constraint.name for one in of_tree) else "is left out by the engine's reader")


def _numbered(robot: Robot, switches: Sequence[_Switch]) -> list[Constraint]:
    return [
        replace(one, name=f"{one.kind} {number}")
        for switch in switches
        for number, one in [(switch.number, robot.equalities[switch.number])]
    ]


def _names(switches: Sequence[_Switch]) -> tuple[str, ...]:
    return tuple(one.element.says.owner for one in switches)


def _limits(what: str, of_tendons: bool) -> _Group:
    """Limits of joints or tendons, of which an engine has both of one on, or none; within them there is nothing to tell."""

    def of_owners(robot: Robot) -> list[Constraint]:
        return list({one.name.partition(" of ")[2]: one for one in limits_of(robot.tree, of_tendons)}.values())

    def chosen(robot: Robot, switches: Sequence[_Switch]) -> list[Constraint]:
        own = {one.element.name.partition(" of ")[2] for one in switches}
        return [one for one in limits_of(robot.tree, of_tendons) if one.name.partition(" of ")[2] in own]

    def held(held: Held, switches: Sequence[_Switch]) -> Held:
        return replace(held, limited=(*held.limited, *_names(switches)))

    return _Group(what, of_owners, _why_no_row, lambda _: False, held, chosen, is_told_alone=False)


_GROUPS = (
    _Group(
        EQUALITIES,
        of=lambda robot: robot.equalities,
        why_not=_why_no_equality,
        acts_unjudged=lambda one: one.is_active,
        held=lambda held, own: replace(held, switched_on=tuple(one.number for one in own)),
        constraints=_numbered,
    ),
    _Group(
        ACTUATORS,
        of=lambda robot: robot.actuators,
        why_not=_why_not_driven,
        # Nobody knows its range.
        acts_unjudged=lambda _: False,
        held=lambda held, own: replace(held, actuators=tuple(one.number for one in own)),
    ),
    _Group(
        FRICTION,
        of=lambda robot: frictions_of(robot.tree),
        why_not=_why_no_row,
        acts_unjudged=lambda _: False,
        held=lambda held, own: replace(held, rubbing=_names(own)),
        constraints=lambda robot, own: [one for one in frictions_of(robot.tree) if one.name in {other.element.name for other in own}],
    ),
    _limits(LIMITS, of_tendons=False),
    _limits(TENDON_LIMITS, of_tendons=True),
)


def _switches(original: Robot, read: Robot) -> list[_Switch]:
    """All elements of a robot; ``read`` is what the engine's reader makes of it."""
    return [_Switch(group, number, one, group.why_not(one, read)) for group in _GROUPS for number, one in enumerate(group.of(original))]


def _constraints(robot: Robot, switches: Sequence[_Switch]) -> list[Constraint]:
    """The constraints of a robot among what is on."""
    return [one for group in _GROUPS for one in group.constraints(robot, [switch for switch in switches if switch.group is group])]


def _effect(read: Meant, answers: EngineAnswers) -> float | None:
    """By how much an answer differs from the truth of the tree alone, relative in the energy norm."""
    found = answers.of(read.robot.joints)
    truth = read.truth[np.arange(len(found))]
    return largest_change(truth, found, truth.certified)


def _laws(robot: Robot, caller: Engine, switches: Sequence[_Switch]) -> tuple[list[Constraint], Mapping[str, ConstraintLaw]]:
    """The constraints among what is on, and the laws that the engine documents of them."""
    chosen = _constraints(robot, switches)
    return chosen, caller.laws(element_at(robot.tree.place), robot.format, chosen)


def _switched_off_by_file(switches: Sequence[_Switch], read: Robot, caller: Engine) -> list[_Switch]:
    """The same; an element that the file switches off has no law, and says so."""
    known = [one for one in switches if not one.why_not and one.group.what not in caller.why_off]
    chosen, laws = _laws(read, caller, known)
    lawless = {one.name for one in chosen} - set(laws)
    return [replace(one, why_not=SWITCHED_OFF) if lawless & {own.name for own in _constraints(read, [one])} else one for one in switches]


def _documented(read: Meant, caller: Engine, switches: Sequence[_Switch], departures: Iterable[Departure] = ()) -> Mechanism:
    """What is read, with these elements by the laws that the engine documents, or with departures from them."""
    return _tied(read.robot, caller, switches, departures)


def _tied(robot: Robot, caller: Engine, switches: Sequence[_Switch], departures: Iterable[Departure] = ()) -> Mechanism:
    """A robot with some of its constraints by the laws that an engine documents, or with departures from them."""
    chosen, laws = _laws(robot, caller, switches)
    laws = departed(departures, robot.tree, chosen, laws)
    return optimum(reference_of(robot).mechanism, robot, chosen, laws, caller.fuses(element_at(robot.tree.place), robot.format))
