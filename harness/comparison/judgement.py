"""An engine's answer on a file: the verdict against the file's truth, and the readings that explain it.

Every reading that applies is folded into the tree; the truth of that tree is what an engine has to answer, to 64 data roundoffs. An
aided engine is explained by those alone that the harness cannot supply. Of what is left the single numbers of the file are named that
would explain it: they are the parameters of its truth, which is certified anew at each value. No change is taken for linear.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, is_dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.comparison.robot_library import engine_of
from harness.engines import Engine
from harness.engines.request import EngineAnswers
from harness.explain.fit import best_change
from harness.explain.meant import Meant, effects, read_as, read_by, readings_that_do_not_hold, reference_of, worst
from harness.explain.search import Tried
from harness.explain.textbook_side import TextbookSide, search_parameters
from harness.files.tree import Given, Place
from harness.library import Stance
from harness.results.comparison import SubjectRecord
from harness.results.table import counted, error_text
from harness.trees.bodies.inertias import impossible_inertias
from harness.trees.bodies.spatial import parameter_name
from harness.trees.robot import Robot
from harness.truth.compare import Comparison, compare
from harness.truth.quantities.accelerations import FAR_LINKS, FarLinks
from harness.truth.reference import Reference
from harness.verdict import AGREEMENT, Verdict

ILL_CONDITIONED = "no error is beyond what the condition of M does to a solution with it, and no number of the file explains them"

_NOWHERE = "at no state is an acceleration certain, for M is singular or not positive definite there"


def judge(meant: Meant, answers: EngineAnswers, engine: str, stance: Stance) -> SubjectRecord:
    """The record of an engine that returned something."""
    caller = engine_of(engine)
    about: dict[str, Any] = {**subject_of(meant, caller, stance), "notes": answers.notes}
    if answers.refusal:
        rest = why_refused(meant.robot, answers.element)
        return SubjectRecord(**about, verdict=Verdict.UNSUPPORTED, explained=True, message=answers.refusal, rest=rest)
    if meant.undetermined:
        finite = int(np.isfinite(answers.of(meant.robot.joints)).all(axis=1).sum())
        message = f"it answers with finite numbers at {finite} of {len(meant.states)} states, and is silent"
        return SubjectRecord(**about, verdict=Verdict.UNDECIDED, explained=True, message=message)
    folded = read_by(meant.robot, caller.name, caller, stance)
    lacking = [name for name in meant.robot.joints if name not in answers.accelerations]
    compared = None if lacking else _compare(meant, answers)
    record = SubjectRecord(**about, **_verdict(compared), explained=False, readings=effects(meant, folded))
    read = read_as(meant, folded.robot)
    if read.undetermined:
        # Of a robot that has no accelerations any more, an engine may answer anything.
        return replace(record, verdict=Verdict.DISAGREES, explained=True, left_nothing=f"as it reads the file, {read.undetermined}")
    if unread := [name for name in folded.robot.joints if name not in answers.accelerations]:
        return replace(record, rest=[f"the engine has no joint {', '.join(unread)}"])
    after = compared if read is meant and compared is not None else _compare(read, answers)
    if _are_all(after, Verdict.UNDECIDED):
        return replace(record, verdict=Verdict.UNDECIDED, explained=True, message=_NOWHERE)
    record = replace(record, left=worst(after) if folded.applied else None)
    if _are_all(after, Verdict.AGREES):
        return replace(record, explained=True)
    if not (read.truth.certified & np.isfinite(answers.of(read.robot.joints)).all(axis=1)).any():
        return replace(record, rest=["it answers with finite numbers at no state"])
    if cause := _cause_of_lost_digits(read, answers, after, caller):
        # As the cross-check of the file has it.
        verdict = Verdict.UNSTABLE.value if after is compared else record.verdict
        return replace(record, explained=True, lost_digits=_lost(after, cause), verdict=verdict)
    return replace(record, rest=readings_that_do_not_hold(meant, folded, answers) or unexplained(read, answers))


def _cause_of_lost_digits(read: Meant, answers: EngineAnswers, after: Comparison, caller: Engine) -> str:
    """Why digits are lost in what the readings leave; "" where they are not, or a number of the file explains it."""
    accelerations = answers.of(read.robot.joints)
    if is_explained_by_number(read, accelerations):
        return ""
    if _are_all(after, Verdict.AGREES, Verdict.UNSTABLE):
        return ILL_CONDITIONED
    if not caller.takes_inertias_about_tree:
        return ""
    lost = FarLinks(read.robot).explain(read.truth, read.states, accelerations)
    return FAR_LINKS if lost[read.truth.certified].all() else ""


def _lost(after: Comparison, cause: str) -> str:
    """The finding in a sentence."""
    known = after.known("backward_error")
    count = f"{int((known > AGREEMENT).sum())} of {counted(len(after), 'state')}"
    return f"it loses digits at {count}, up to {error_text(float(known.max()))} data roundoffs: {cause}"


def subject_of(meant: Meant, caller: Engine, stance: Stance) -> dict[str, Any]:
    """What a record says of its subject."""
    model_format = meant.robot.format
    return {
        "path": str(meant.robot.path),
        "engine": caller.name,
        "format": model_format,
        "aided": stance == Stance.AIDED,
        "call": caller.call[model_format],
    }


def _compare(meant: Meant, answers: EngineAnswers) -> Comparison:
    """Whether an engine factorises M is its own matter: digits that M's condition costs are excused in either."""
    return compare(meant.truth, answers.of(meant.robot.joints), factorises=True)


def _verdict(compared: Comparison | None) -> dict[str, Any]:
    """Of an engine that lacks a joint there is nothing to compare, and it disagrees."""
    if compared is None:
        return {"verdict": Verdict.DISAGREES.value}
    return {
        "verdict": str(compared.verdicts[compared.worst]),
        "backward_error": worst(compared),
        "relative_error": worst(compared, "relative_error"),
    }


def _are_all(compared: Comparison, *allowed: Verdict) -> bool:
    """True where each state with a certified truth has one of these verdicts, and one has such a truth."""
    verdicts, wanted = set(compared.verdicts.tolist()), {one.value for one in allowed}
    return bool(verdicts & wanted) and verdicts <= {*wanted, Verdict.UNDECIDED.value}


# Numbers that are named, and the share of the error that a small change or a fitted value of one may leave to be of interest.
MOST_NAMED, OF_INTEREST = 3, 0.1
# Attributes of what is never negative.
_NEVER_NEGATIVE = ("armature", "damping", "density", "mass", "size", "stiffness")
# Share of its largest entry by which M varies where it is the same but for rounding.
SAME_MATRIX = 1e-12


def unexplained(meant: Meant, answers: EngineAnswers) -> list[str]:
    """Sentences on an answer that differs from what the tree means; numbers are named that make it agree, and that a body can have."""
    accelerations = answers.of(meant.robot.joints)
    side, sentences = _side(meant, accelerations), []
    search, enough = search_parameters(side), max(AGREEMENT, _rounding_of_answers(side))
    for one in search.found():
        number, value = one.change.place.attribute, _agreeing_value(side, one, enough)
        if value is not None and _is_possible(meant.robot, number, value):
            behaves, left = f"{number} = {one.change.start:g}: the engine behaves as with {value:.10g}", side.left_at(one.change, value)
            sentences.append(f"{behaves}, which leaves {error_text(left)} data roundoffs")
    return sentences[:MOST_NAMED] or [f"no single number of the file explains it; it differs in {_where(meant, accelerations)}"]


def _rounding_of_answers(side: TextbookSide) -> float:
    """The most that an answer is off by for being float64 [data roundoffs]."""
    half = np.spacing(np.abs(side.answers)) / 2
    parts = (side.whitening.change(half * unit) for unit in np.eye(half.shape[1]))
    return float(sum(np.linalg.norm(part, axis=1) for part in parts).max())


def _agreeing_value(side: TextbookSide, tried: Tried, enough: float) -> float | None:
    """The value of a number that leaves ``enough`` or less; None where neither that which was fitted does nor one of fewer digits."""
    if tried.value is None or tried.left > OF_INTEREST * side.before:
        return None
    values = (tried.value, *(float(f"{tried.value:.{digits}g}") for digits in range(1, 17)))
    return next((value for value in values if side.left_at(tried.change, value) <= enough), None)


def _is_possible(robot: Robot, name: str, value: float) -> bool:
    """True where the number of the file that is a parameter of this name can have a value.

    It gives no body an inertia that no body can have, no force or size another sign, gravity no other direction, and no unit quaternion
    a component beyond 1: numbers beyond these imitate what is wrong elsewhere.
    """
    found: list[Given] = []

    def changed(part: Any) -> Any:
        if isinstance(part, Given) and parameter_name(part) == name:
            found.append(part)
            return Given(value, part.place, part.attribute, part.index)
        if isinstance(part, tuple):
            return tuple(map(changed, part))
        if is_dataclass(part) and not isinstance(part, type | Place):
            return replace(part, **{field.name: changed(getattr(part, field.name)) for field in fields(part)})
        return part

    tree = changed(robot.tree)
    if any(_is_out_of_bounds(number, value) for number in found):
        return False
    return len(impossible_inertias(tree)) <= len(robot.impossible)


def _is_out_of_bounds(number: Given, value: float) -> bool:
    attribute, own = number.attribute.partition(" ")[0], float(number)
    if attribute == "quat":
        return abs(value) > max(1.0, abs(own))
    return value < 0 if attribute in _NEVER_NEGATIVE else attribute == "gravity" and own * value < 0


def is_explained_by_number(meant: Meant, accelerations: Array) -> bool:
    """True where a small change of one number of the file leaves little of the errors of accelerations (n, nv).

    Where M is the same at all states it must leave as little of what a change of M leaves, as its rounding there is.
    """
    side = _side(meant, accelerations)
    if not 0 < float(np.linalg.norm(side.here)) < np.inf:
        return False
    least = min((best_change(column.values[side.seen], side.here)[1] for column in side.columns()), default=1.0)
    return least < OF_INTEREST * _left_by_rounding(side)


def _side(meant: Meant, accelerations: Array) -> TextbookSide:
    """The answers beside the truth of the file, at the states that have both."""
    kept = np.flatnonzero(meant.truth.certified & np.isfinite(accelerations).all(axis=1))
    return TextbookSide(reference_of(meant.robot), meant.states[kept], accelerations[kept], meant.robot.path, certified=meant.truth[kept])


def _left_by_rounding(side: TextbookSide) -> float:
    """Share of the residual that the best change of a constant M leaves, d(qdd) = -M^-1 dM qdd; 1 where M varies."""
    truth = side.truth[side.seen]
    matrices = truth.norm_factor.transpose(0, 2, 1) @ truth.norm_factor
    if np.ptp(matrices, axis=0).max(initial=0.0) > SAME_MATRIX * np.abs(matrices).max(initial=0.0):
        return 1.0
    moved = side.whitening.change(side.truth.high)[side.seen]
    change = np.linalg.lstsq(moved, side.here)[0]
    return float(np.linalg.norm(side.here - moved @ change) / np.linalg.norm(side.here))


def _where(meant: Meant, accelerations: Array) -> str:
    """The joints whose accelerations differ, the worst first."""
    truth: Reference = meant.truth
    error = np.abs(accelerations - truth.high).max(axis=0)
    joints = reference_of(meant.robot).mechanism.joints
    worst = dict.fromkeys(joints[column] for column in np.argsort(-error)[:4])
    bad = compare(truth, accelerations).known("backward_error") > AGREEMENT
    return f"{int(bad.sum())} of {len(truth)} states, most in {', '.join(worst)} (up to {error_text(float(error.max()))} rad/s^2 or m/s^2)"


def why_refused(robot: Robot, element: str) -> list[str]:
    """What the file says of the body that an engine's refusal names, and what is impossible in it, a sentence each."""
    sentences = []
    for body in robot.tree.bodies:
        if body.name == element and body.place is not None:
            line = body.place.line if body.inertia is None else body.inertia.places["moments"].line
            numbers = (
                "no inertia" if body.inertia is None else f"{_numbers((body.inertia.mass,))} kg, {_numbers(body.inertia.moments)} kg m^2"
            )
            sentences.append(f"line {line}: {element}: {numbers}")
    return sentences + [f"line {one.line}: {one.body}: {one.what}" for one in robot.impossible]


def _numbers(values: Sequence[Fraction]) -> str:
    return " ".join(f"{float(value):g}" for value in values)
