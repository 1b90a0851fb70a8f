"""An engine's answer on a file: the verdict against the file's truth, and the readings that explain it.

Every reading that applies is folded into the tree; the truth of that tree is what an engine has to answer, to 64 data roundoffs. An
aided engine is explained by those alone that the harness cannot supply. Of what is left the single numbers of the file are named that
would explain it: they are the parameters of its truth, which is certified anew at each value. No change is taken for linear.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from harness.comparison.robot_library import engine_of
from harness.engines import Engine
from harness.engines.request import EngineAnswers
from harness.explain.as_read import effects, read_by, why_refused
from harness.explain.file_numbers import left_beside_readings
from harness.explain.meant import Meant, for_engine, read_as, worst
from harness.library import Stance
from harness.results.comparison import SubjectRecord
from harness.results.table import counted, error_text
from harness.truth.compare import Comparison, compare
from harness.truth.far_links import FarLinks, far_links_of
from harness.truth.reference import precision_in_words
from harness.verdict import AGREEMENT, Verdict, gravest

ILL_CONDITIONED = "no error is beyond what the condition of M does to a solution with it, and no number of the file explains them"

_NOWHERE = "at no state is an acceleration certain, for M is singular or not positive definite there"


def judge(meant: Meant, answers: EngineAnswers, engine: str, stance: Stance) -> SubjectRecord:
    """The record of an engine that returned something."""
    caller = engine_of(engine)
    meant = for_engine(meant, caller.unit_roundoff)
    notes = filter(None, [*answers.notes, precision_in_words(caller.unit_roundoff)])
    about: dict[str, Any] = {**subject_of(meant, caller, stance), "notes": tuple(notes)}
    if answers.refusal:
        rest = why_refused(meant.robot, answers.refusal)
        return SubjectRecord(**about, verdict=Verdict.UNSUPPORTED, explained=True, message=answers.refusal, rest=rest)
    if meant.undetermined:
        finite = int(np.isfinite(answers.of(meant.robot.joints)).all(axis=1).sum())
        message = f"it answers with finite numbers at {finite} of {len(meant.states)} states, and is silent"
        return SubjectRecord(**about, verdict=Verdict.UNDECIDED, explained=True, message=message)
    folded = read_by(meant.robot, caller.name, caller, stance)
    lacking = [name for name in meant.robot.joints if name not in answers.accelerations]
    compared = None if lacking else _judged(meant, answers, caller)
    record = SubjectRecord(**about, **_verdict(compared), explained=False, readings=effects(meant, folded))
    read = read_as(meant, folded.robot)
    if read.undetermined:
        # Of a robot that has no accelerations any more, an engine may answer anything.
        return replace(record, verdict=Verdict.DISAGREES, explained=True, another_robot=f"as it reads the file, {read.undetermined}")
    if unread := [name for name in folded.robot.joints if name not in answers.accelerations]:
        return replace(record, rest=[f"the engine has no joint {', '.join(unread)}"])
    after = compared if read is meant and compared is not None else _judged(read, answers, caller)
    if after.are_all(Verdict.UNDECIDED):
        return replace(record, verdict=Verdict.UNDECIDED, explained=True, message=_NOWHERE)
    record = replace(record, left=worst(after) if folded.applied else None)
    if after.are_all(Verdict.AGREES):
        return replace(record, explained=True)
    if not (read.truth.certified & np.isfinite(answers.of(read.robot.joints)).all(axis=1)).any():
        return replace(record, rest=["it answers with finite numbers at no state"])
    if rest := left_beside_readings(meant, folded, read, answers, after):
        verdict = gravest([record.verdict, Verdict.DISAGREES]) if after is compared else record.verdict
        return replace(record, rest=rest, verdict=verdict)
    by_condition = compare(read.truth, answers.of(read.robot.joints), factorises=True).are_all(Verdict.AGREES, Verdict.UNSTABLE)
    cause = ILL_CONDITIONED if by_condition else far_links_of(caller.inertias_about)
    return replace(record, explained=True, lost_digits=_lost(after, cause))


def _lost(after: Comparison, cause: str) -> str:
    """The finding in a sentence."""
    known = after.known("backward_error")
    count = f"{int((known > AGREEMENT).sum())} of {counted(len(after), 'state')}"
    return f"it loses digits at {count}, up to {error_text(float(known.max()))} data roundoffs: {cause}"


def subject_of(meant: Meant, caller: Engine, stance: Stance) -> dict[str, Any]:
    """Fields of a record that name its subject."""
    model_format = meant.robot.format
    return {
        "path": str(meant.robot.path),
        "engine": caller.name,
        "title": caller.title,
        "format": model_format,
        "aided": stance == Stance.AIDED,
        "call": caller.call[model_format],
    }


def _judged(meant: Meant, answers: EngineAnswers, caller: Engine) -> Comparison:
    """The judgement of a cross-check of the file: digits that the condition of M costs are excused whether or not M is factorised."""
    accelerations = answers.of(meant.robot.joints)
    found = compare(meant.truth, accelerations, factorises=True)
    if not caller.inertias_about:
        return found
    far = FarLinks(meant.robot, caller.inertias_about, caller.unit_roundoff)
    return far.excused(found, meant.truth, meant.states, accelerations)


def _verdict(compared: Comparison | None) -> dict[str, Any]:
    """Verdict and errors; an engine that lacks a joint disagrees, and has no errors."""
    if compared is None:
        return {"verdict": Verdict.DISAGREES.value}
    return {
        "verdict": str(compared.verdicts[compared.worst]),
        "backward_error": worst(compared),
        "relative_error": worst(compared, "relative_error"),
    }
