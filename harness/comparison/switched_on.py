"""An engine's answer with all elements of a file switched on that are judged, held against the law that it documents for them.

What a smooth answer leaves out is asked once more: points that meet and joints that are coupled act, joints rub and have limits, and
actuators drive at controls within and beyond their ranges; what is not judged stays off. The tree is that which the engine's readings make
of the file. Half of the states nearly close the equalities, where impedances vary with the distance, and some are beyond limits. Where the
engine's program departs from the documented law, that is told, with its effect.

A quarter is where the engine's own steps lead from where the file puts all bodies, so that some touch; contacts there are taken as the
engine finds them.

Source: MuJoCo documentation, Computation, sections Actuation model, Constraint model and Solver parameters.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from harness.comparison.documented import documented, laws_of, switched_off_by_file
from harness.comparison.geometry import hold_shapes
from harness.comparison.robot_library import ask_engine, engine_of, engines_of_files
from harness.comparison.switches import GROUPS, Switch, constraints_among, switches_of, why_no_equality
from harness.comparison.touching import Touching, put, settling, steps_of
from harness.crosscheck.constraint_laws import effect_of
from harness.engines import Engine
from harness.engines.request import EngineAnswers, EngineQuestion, Held
from harness.explain.as_read import Folded, effects, read_by
from harness.explain.changes.departures import Departure, departures_of
from harness.explain.changes.readings import element_at
from harness.explain.file_numbers import left_beside_readings, unexplained
from harness.explain.meant import Meant, driven, largest_change, question_of, read_as, reference_of, request_of, spread, worst
from harness.explain.row_numbers import row_numbers_that_explain
from harness.files.equalities import Equality
from harness.files.findings import CONTACTS, EQUALITIES, FRICTION
from harness.files.tree import Tree
from harness.library import Stance
from harness.results.readings import FELT, Effect
from harness.results.shapes import ShapesRecord
from harness.results.switched_on import SwitchedOnRecord
from harness.trees.robot import with_actuators
from harness.truth.compare import Comparison, Flags, compare
from harness.truth.declared import DeclaredMechanism
from harness.truth.displaced import near, pressed
from harness.truth.reference import Reference, ReferenceKernel
from harness.verdict import Verdict

# Elements whose effect is said; each takes the file's being loaded once more.
MOST_EFFECTS = 32
# One of so many states is beyond limits.
_EACH_PRESSED = 4
_HELD = {Verdict.AGREES.value, Verdict.UNSTABLE.value, Verdict.UNDECIDED.value}
_UNEXPLAINED = "not judged: without them its answer is not what its readings make of the file, as told above"


@dataclass(frozen=True)
class _Asked:
    """An engine that is asked about a file, ``original``, with some of its elements on."""

    original: Meant
    caller: Engine

    def with_those(self, switches: Sequence[Switch], at: Meant | None = None, few: bool = False, to_the_end: bool = False) -> EngineAnswers:
        """Its accelerations, at the states of the file, ``few`` of them, or those of what is read, ``at``."""
        return ask_engine(self.caller.name, self._question(switches, at, few, to_the_end))

    def settled(self, switches: Sequence[Switch], at: Meant) -> Meant:
        """What is read, at states of which some are where the engine's own steps lead; as it is where the harness lets it take none."""
        numbers = settling(len(at.states))
        part = replace(at, states=at.states[numbers])
        question = self._question(switches, part, few=False, to_the_end=False)
        found = ask_engine(self.caller.name, replace(question, steps=steps_of(len(numbers))))
        joints = {joint.name: joint for joint in question.request.joints}
        if not found.states or not set(at.robot.joints) <= set(joints):
            return at
        own = [joints[name] for name in at.robot.joints]
        places = [column for joint in own for column in joint.positions], [column for joint in own for column in joint.velocities]
        return replace(at, states=put(at.states, numbers, *(part[:, columns] for part, columns in zip(found.states, places, strict=True))))

    def _question(self, switches: Sequence[Switch], at: Meant | None, few: bool, to_the_end: bool) -> EngineQuestion:
        original = self.original.few if few else self.original
        held = Held(tuple(one.kind for one in original.robot.equalities), (), to_the_end)
        for group in GROUPS:
            held = group.held(held, [one for one in switches if one.group is group])
        question = question_of(original, Stance.PLAIN, held)
        if at is not None and {joint.name for joint in question.request.joints} <= set(at.robot.joints):
            states = spread(at.robot, at.states, question.request.joints)
            driving = (states.control, states.activation) if question.driving else ()
            question = replace(question, q=states.q, v=states.v, tau=states.tau, driving=driving)
        return question


def judge_switched_on(meant: Meant, engine: str) -> SwitchedOnRecord:
    """The record of an engine on a file with all on that is judged; ``meant`` is the file with all of it off."""
    caller, original = engine_of(engine), driven(meant)
    smooth, folded = (read_by(one.robot, caller.name, caller, Stance.PLAIN) for one in (meant, original))
    asked, read = _Asked(original, caller), read_as(original, folded.robot)
    off = read if original is meant else read_as(meant, with_actuators(folded.robot, ()))
    why_off = {what: f"is off: {reason}" for what, reason in caller.why_off.items()}
    on_in_file = switched_off_by_file(switches_of(original.robot, read.robot, caller), read.robot, caller)
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
    if not judged:
        return record
    at, within = _felt(asked, read, judged)
    # The first answer was given, so that this one is no refusal.
    answers, touching = asked.with_those(judged, at), Touching.nowhere(len(at.states))
    if answers.contacts and caller.contacts is not None:
        cone, _ = caller.contacts(element_at(at.robot.tree.place), at.robot.format)
        touching = Touching.of(answers.contacts, at.robot, cone)
    shapes = _shapes(at, caller, answers)
    at = replace(at, states=at.states[touching.states], certified=at.truth[touching.states])
    within = within[touching.states]
    apart = within & ~touching.chosen.is_any
    within = apart if apart.any() else within
    record = _judged(record, _Case(asked, folded, at, judged, touching.chosen), touching.of_states(answers), within)
    return record if shapes is None else record.with_shapes(shapes)


def _shapes(at: Meant, caller: Engine, answers: EngineAnswers) -> ShapesRecord | None:
    """The contacts of answers held against the shapes of the file; None where nothing is said of them."""
    # Shapes of bodies that are fused have other bodies and numbers.
    if not answers.contacts or caller.fuses(element_at(at.robot.tree.place), at.robot.format):
        return None
    return hold_shapes(at.robot, at.states.q, answers.contacts, answers.shapes)


@dataclass(frozen=True)
class _Case:
    """Elements that are judged, at the states of what is read, ``at``, and the contacts there."""

    asked: _Asked
    folded: Folded
    at: Meant
    judged: Sequence[Switch]
    touching: Touching

    def truth(self, departures: Iterable[Departure] = ()) -> Reference:
        """By the laws that the engine documents, or with departures from them."""
        caller = self.asked.caller
        return self.touching.truth(self.at.states, lambda contacts: documented(self.at.robot, caller, self.judged, departures, contacts))


def _judged(record: SwitchedOnRecord, case: _Case, answers: EngineAnswers, within: Flags) -> SwitchedOnRecord:
    """The record with the verdict on these elements; ``within`` as of ``_felt``, where no bodies touch if there are such states."""
    at, asked, judged, caller = case.at, case.asked, case.judged, case.asked.caller
    joints, has_constraints = at.robot.joints, bool(constraints_among(at.robot, judged)) or case.touching.is_any.any()
    truth = case.truth()
    compared = compare(truth, answers.of(joints), factorises=True)
    without = reference_of(with_actuators(at.robot, ())).evaluate(at.states)
    record = replace(
        record,
        verdict=str(compared.verdicts[compared.worst]),
        explained=_is_held(compared),
        backward_error=worst(compared),
        together=largest_change(without, answers.of(joints), without.certified & within),
        states=len(at.states),
        touching=int((case.touching.is_any & (compared.verdicts != Verdict.UNDECIDED.value)).sum()),
    )
    if record.explained:
        return record
    departures = _departures(case, truth)
    computed = truth
    if departures:
        computed = case.truth(departures)
        compared = compare(computed, answers.of(joints), factorises=True)
        record = replace(record, explained=_is_held(compared), backward_error=worst(compared), departures=[*departures.values()])
    if not record.explained and caller.to_the_end:
        ended = compare(computed, asked.with_those(judged, at, to_the_end=True).of(joints), factorises=True)
        if _is_held(ended):
            return replace(record, explained=True, to_the_end=worst(ended), remedy=caller.to_the_end)
    if record.explained:
        return record
    if not has_constraints:
        return replace(record, rest=left_beside_readings(asked.original, case.folded, at, answers, compared))
    apart = ~case.touching.is_any
    if set(compared.verdicts[apart].tolist()) <= _HELD:
        return replace(record, rest=["it is only at states where bodies touch that it is not what its documentation gives"])
    certified = replace(at, states=at.states[apart], certified=computed[np.flatnonzero(apart)])

    def truth_of(tree: Tree) -> Reference:
        changed = replace(at.robot, tree=tree)
        return ReferenceKernel(documented(changed, caller, judged, departures, of=at.robot)).evaluate(certified.states)

    if found := row_numbers_that_explain(at.robot.tree, truth_of, certified.truth, answers.of(joints)[apart]):
        return replace(record, rest=found)
    kernel = ReferenceKernel(documented(at.robot, caller, judged, departures))
    return replace(record, rest=unexplained(certified, answers.of(joints)[apart], kernel))


def _of_what_is_on(original: Meant, folded: Folded, smooth: Folded) -> list[Effect]:
    """The effects of the readings that make something of what is on alone."""
    known = {reading.name for reading, _ in smooth.applied}
    own = tuple((reading, before) for reading, before in folded.applied if reading.name not in known)
    return effects(original, Folded(folded.robot, own)) if own else []


def _of_no_friction(meant: Meant, caller: Engine) -> list[Effect]:
    """What an engine leaves out that documents no dry friction, by the law that another one documents of the file."""
    own = [one for one in switches_of(meant.robot, meant.robot, caller) if one.group.what == FRICTION and not one.why_not]
    other = _engine_with(FRICTION, meant.robot.format)
    # One that documents a law applies some.
    if not own or FRICTION not in caller.why_off or other is None or laws_of(meant.robot, caller, own)[1]:
        return []
    rubbing = ReferenceKernel(documented(meant.few.robot, other, own)).evaluate(meant.few.states)
    lines = tuple(dict.fromkeys(one.element.line for one in own))
    change = largest_change(meant.few.truth, rubbing.high, meant.few.truth.certified & rubbing.certified)
    sentence, source = caller.why_off[FRICTION], f"by the law that {other.title} documents"
    return [Effect(name=FRICTION, sentence=sentence, concerns="joints", lines=lines, count=len(own), alone=change, source=source)]


def _engine_with(what: str, model_format: str) -> Engine | None:
    """The first engine that is asked with elements of a kind, of which it documents a law."""
    return next((one for one in engines_of_files().values() if what not in one.why_off and model_format in one.formats), None)


def _felt(asked: _Asked, read: Meant, judged: Sequence[Switch]) -> tuple[Meant, Flags]:
    """What is read, at states where constraints are felt, and which of them no limit pushes.

    Half of the states nearly close the equalities: anywhere else impedances are those of far away. A quarter is beyond limits, and
    another where the engine's steps lead, so that bodies touch.
    """
    asked_about = {joint.name for joint in request_of(asked.original.robot, Stance.PLAIN).joints}
    numbers, within = np.arange(len(read.states)), np.ones(len(read.states), dtype=bool)
    touches, constraints = any(one.group.what == CONTACTS for one in judged), constraints_among(read.robot, judged)
    if not (touches or constraints) or not asked_about <= set(read.robot.joints):
        return read, within
    mechanism, states = documented(with_actuators(read.robot, ()), asked.caller, judged), read.states
    if isinstance(mechanism, DeclaredMechanism):
        for displaced, chosen in (
            (near if mechanism.constraints else None, numbers % 2 == 0),
            (pressed if mechanism.pushing else None, numbers % _EACH_PRESSED == 1),
        ):
            if displaced is not None:
                moved = displaced(mechanism, states[chosen])
                q, v = states.q.copy(), states.v.copy()
                q[chosen], v[chosen] = moved.q, moved.v
                states = replace(states, q=q, v=v)
    if touches:
        states = asked.settled(judged, replace(read, states=states)).states
    if isinstance(mechanism, DeclaredMechanism) and mechanism.pushing:
        within = ~mechanism.reaches_limits(states)
    return Meant(read.robot, states, reference_of(read.robot).evaluate(states)), within


def _departures(case: _Case, documented: Reference) -> dict[Departure, Effect]:
    """The engine's departures from the documented laws of some constraints, each with what it does alone; none that does nothing."""
    robot, caller, found = case.at.robot, case.asked.caller, dict[Departure, Effect]()
    chosen, laws = laws_of(robot, caller, case.judged, case.touching.first)
    for one in departures_of(caller.name, caller.reader):
        if concerned := one.concerned(robot.tree, chosen, laws):
            found[one] = effect_of(one, concerned, documented, case.truth([one]))
    return {one: effect for one, effect in found.items() if effect.alone is None or effect.alone > FELT}


def truth_with(meant: Meant, equality: Equality | None) -> Reference | None:
    """The truth of a robot with one equality, by the law that an engine documents; None where it is not judged.

    With none, or one that is switched off, it is that of the robot alone.
    """
    if equality is None or not equality.is_active:
        return meant.truth
    caller = _engine_with(EQUALITIES, meant.robot.format)
    if caller is None or why_no_equality(equality, meant.robot):
        return None
    alone = replace(meant.robot, equalities=(equality,))
    own = [one for one in switches_of(alone, alone, caller) if one.group.what == EQUALITIES]
    return ReferenceKernel(documented(alone, caller, own)).evaluate(meant.states)


def _is_held(compared: Comparison) -> bool:
    return set(compared.verdicts.tolist()) <= _HELD


def _effect(read: Meant, answers: EngineAnswers) -> float | None:
    """By how much an answer differs from the truth of the tree alone, relative in the energy norm."""
    found = answers.of(read.robot.joints)
    truth = read.truth[np.arange(len(found))]
    return largest_change(truth, found, truth.certified)
