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

import math
from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from harness.arrays import Array
from harness.comparison.case import AskedEngine, felt
from harness.comparison.geometry import hold_shapes
from harness.comparison.robot_library import RobotLibrary, engine_of
from harness.engines import Engine
from harness.engines.request import EngineAnswers
from harness.explain.as_read import Folded, effects, read_by
from harness.explain.changes.readings import element_at
from harness.explain.changes.shape_rules import shape_rules_of
from harness.explain.documented import documented, effect_of_friction, engine_documenting, switched_off_by_file
from harness.explain.file_case import FileCase, is_held, judged_by
from harness.explain.meant import Meant, driven, for_engine, largest_change, read_as, worst
from harness.explain.switches import Switch, switches_of, why_no_equality
from harness.explain.touching import Touching
from harness.files.equalities import Equality
from harness.files.findings import CONTACTS, EQUALITIES
from harness.library import Stance
from harness.results.readings import Effect, lines_text
from harness.results.shapes import ShapesRecord
from harness.results.switched_on import SwitchedOnRecord
from harness.results.table import error_text
from harness.trees.robot import with_actuators
from harness.truth.compare import compare
from harness.truth.reference import Reference, ReferenceKernel
from harness.verdict import Verdict

# Elements whose effect is said; each takes the file's being loaded once more.
MOST_EFFECTS = 32
# So many times smaller, an error was for the most part what a solver left.
_MOSTLY = 10.0
_UNEXPLAINED = "not judged: without them its answer is not what its readings make of the file, as told above"


@dataclass(frozen=True)
class Posed:
    """A case that an engine was asked about, and what it answers; ``shapes`` as of a record."""

    case: FileCase
    asked: AskedEngine
    answers: EngineAnswers
    shapes: ShapesRecord | None


def judge_switched_on(meant: Meant, engine: str) -> SwitchedOnRecord:
    """The record of an engine on a file with all on that is judged; ``meant`` is the file with all of it off."""
    record, posed = pose(meant, engine)
    if posed is None:
        return record
    record = with_verdict(record, posed.case, posed.asked, posed.answers)
    return record if posed.shapes is None else record.with_shapes(posed.shapes)


def pose(meant: Meant, engine: str, without: Collection[str] = ()) -> tuple[SwitchedOnRecord, Posed | None]:
    """The record before any verdict, and the engine's answers with all on that is judged; None where none is.

    ``without``: kinds of elements that stay off, as of ``Group.what``.
    """
    caller = engine_of(engine)
    meant = for_engine(meant, caller.unit_roundoff)
    original = driven(meant)
    smooth, folded = (read_by(one.robot, caller.name, caller, Stance.PLAIN) for one in (meant, original))
    asked, read = AskedEngine(original, caller), read_as(original, folded.robot)
    off = read if original is meant else read_as(meant, with_actuators(folded.robot, ()))
    why_off = {what: f"is off: {reason}" for what, reason in caller.why_off.items()}
    on_in_file = switched_off_by_file(switches_of(original.robot, read.robot, caller), read.robot, caller)
    switches = [replace(one, why_not=why_off.get(one.group.what) or one.why_not) for one in on_in_file if one.group.what not in without]
    record = SwitchedOnRecord(
        path=str(meant.robot.path),
        engine=caller.name,
        title=caller.title,
        format=meant.robot.format,
        parts=[one.part() for one in switches],
        readings=[*_of_what_is_on(original, folded, smooth), *effect_of_friction(meant, caller, RobotLibrary.without_files())],
        message="; ".join(reason for what, reason in caller.why_off.items() if any(one.group.what == what for one in switches)),
    )
    asked_with = [one for one in switches if one.group.what not in caller.why_off]
    judged = [one for one in asked_with if not one.why_not]
    if not asked_with:
        return record, None
    free, joints = asked.with_those([]), read.robot.joints
    refusal = free.refusal or asked.with_those(judged, few=True).refusal
    untouched = [one for one in judged if one.group.what != CONTACTS]
    if refusal and not free.refusal and len(untouched) < len(judged) and not asked.with_those(untouched, few=True).refusal:
        # It takes the file but for the shapes that may touch, as one whose meshes are not there.
        switches = [_refused(one, refusal) for one in switches]
        record = replace(record, parts=[one.part() for one in switches])
        asked_with, judged, refusal = [one for one in asked_with if one.group.what != CONTACTS], untouched, ""
    if refusal or read.undetermined or not set(joints) <= set(free.accelerations):
        return replace(record, message=refusal or _UNEXPLAINED), None
    if not is_held(compare(off.truth, free.of(joints), factorises=True)):
        return replace(record, message=_UNEXPLAINED), None
    told = [one for one in asked_with if one.group.is_told_alone]
    known = [one for one in told if not one.why_not or one.group.acts_unjudged(one.element)][:MOST_EFFECTS]
    alone = {id(one): _effect(off, asked.with_those([one], few=True)) for one in known}
    record = replace(record, parts=[one.part(alone.get(id(one))) for one in switches])
    if not judged:
        return record, None
    at, within = felt(asked, read, judged)
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
    case = FileCase(original, caller, folded, at, judged, touching.chosen, within)
    return record, Posed(case, asked, touching.of_states(answers), shapes)


def _refused(switch: Switch, refusal: str) -> Switch:
    """The same of a shape that may touch, for which an engine refuses the file."""
    return replace(switch, why_not=switch.why_not or f"is refused: {refusal}") if switch.group.what == CONTACTS else switch


def _shapes(at: Meant, caller: Engine, answers: EngineAnswers) -> ShapesRecord | None:
    """The contacts of answers held against the shapes of the file; None where nothing is said of them."""
    # Shapes of bodies that are fused have other bodies and numbers.
    if not answers.contacts or caller.fuses(element_at(at.robot.tree.place), at.robot.format):
        return None
    about = answers.contacts, answers.shapes, caller.unit_roundoff
    found, shapes, tree = hold_shapes(at.robot, at.states.q, *about), at.robot.shapes, at.robot.tree
    if found is None or not found.rest or shapes is None:
        return found
    for rule in shape_rules_of(caller.name, caller.reader):
        lines = [one.place.line for one in shapes.shapes if rule.bears_on(tree, one)]
        robot = replace(at.robot, shapes=replace(shapes, shapes=tuple(rule.of(tree, one) for one in shapes.shapes)))
        by_rule = hold_shapes(robot, at.states.q, *about, rule.every_corner) if lines else found
        if by_rule is not None and not by_rule.rest:
            told = f"{rule.sentence} ({lines_text(lines)}): {rule.remedy}"
            return replace(by_rule, verdict=str(Verdict.EXPLAINED.value), rule=told)
    return found


def with_verdict(
    record: SwitchedOnRecord, case: FileCase, asked: AskedEngine, answers: EngineAnswers, names: bool = True
) -> SwitchedOnRecord:
    """The record with the verdict on the elements of a case; what is known of answers that nothing explains, where it ``names`` that."""
    at, caller, joints = case.at, case.caller, case.at.robot.joints
    compared = judged_by(case, case.truth, answers.of(joints))
    record = replace(
        record,
        verdict=str(compared.verdicts[compared.worst]),
        explained=is_held(compared),
        backward_error=worst(compared),
        relative_error=compared.relative_error_at(compared.largest),
        together=_change(case, answers.of(joints)),
        states=len(at.states),
        touching=int((case.touching.is_any & (compared.verdicts != Verdict.UNDECIDED.value)).sum()),
    )
    if record.explained:
        return record
    if record.verdict == Verdict.ERROR:
        count = int((compared.verdicts == Verdict.ERROR.value).sum())
        return replace(record, rest=[f"a number of its answer is not finite at {count} of {len(at.states)} states"])
    if case.departures:
        compared = judged_by(case, case.computed, answers.of(joints), case.departures)
        record = replace(
            record,
            explained=is_held(compared),
            backward_error=worst(compared),
            relative_error=compared.relative_error_at(compared.largest),
            departures=[*case.departures.values()],
        )
    wrong = np.flatnonzero([not is_held(compared[[state]]) for state in range(len(at.states))])
    gone_on: list[tuple[float, str]] = []
    for ending in () if record.explained else caller.endings:
        # What a solver leaves that stops early has no number of the file for its cause. Where it did not, going on may cost digits.
        answers = asked.with_those(case.judged, at, solver=ending.solver)
        compared = judged_by(case, case.computed, answers.of(joints), case.departures)
        if is_held(ended := compared[wrong]):
            return replace(record, explained=True, to_the_end=worst(ended), remedy=ending.remedy, fault=ending.fault)
        gone_on.append((worst(ended) or math.inf, ending.remedy))
    if not record.explained and (share := case.stops_as_documented(answers, compared)) is not None and caller.stops is not None:
        return replace(record, explained=True, left=share, remedy=caller.stops.remedy)
    if record.explained or not names:
        return record
    # That the solver is stopped too early is the first suspicion of who uses it.
    still = [beyond_the_end(record.backward_error, left, remedy) for left, remedy in sorted(gone_on)[:1]]
    return replace(record, rest=[*case.left(answers, compared), *still])


def beyond_the_end(before: float | None, left: float, remedy: str) -> str:
    """A sentence on what is ``left`` of an error, both in data roundoffs, where a solver goes on to the end."""
    is_cause = before is not None and left <= before / _MOSTLY
    whose = "most of it is what its solver leaves, but" if is_cause else "what its solver leaves is not the cause:"
    return f"{whose} {error_text(left)} data roundoffs remain if you {remedy}"


def _change(case: FileCase, found: Array) -> float | None:
    """By how much an answer differs from the truth without what is judged, relative in the energy norm; by nothing if by rounding alone."""
    without = case.without_actuators
    among = without.certified & case.within
    return 0.0 if is_held(compare(without, found, factorises=True)[among]) else largest_change(without, found, among)


def _of_what_is_on(original: Meant, folded: Folded, smooth: Folded) -> list[Effect]:
    """The effects of the readings that make something of what is on alone."""
    known = {reading.name for reading, _ in smooth.applied}
    own = tuple((reading, before) for reading, before in folded.applied if reading.name not in known)
    return effects(original, Folded(folded.robot, own)) if own else []


def truth_with(meant: Meant, equality: Equality | None) -> Reference | None:
    """The truth of a robot with one equality, by the law that an engine documents; None where it is not judged.

    With none, or one that is switched off, it is that of the robot alone.
    """
    if equality is None or not equality.is_active:
        return meant.truth
    caller = engine_documenting(EQUALITIES, meant.robot.format, RobotLibrary.without_files())
    if caller is None or why_no_equality(equality, meant.robot):
        return None
    alone = replace(meant.robot, equalities=(equality,))
    own = [one for one in switches_of(alone, alone, caller) if one.group.what == EQUALITIES]
    return ReferenceKernel(documented(alone, caller, own)).evaluate(meant.states)


def _effect(read: Meant, answers: EngineAnswers) -> float | None:
    """By how much an answer differs from the truth of the tree alone, relative in the energy norm."""
    found = answers.of(read.robot.joints)
    truth = read.truth[np.arange(len(found))]
    return largest_change(truth, found, truth.certified)
