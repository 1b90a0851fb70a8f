"""An engine's answer on a file: the verdict against the file's truth, and the readings that explain it.

Every reading that applies is folded into the tree; the truth of that tree is what an engine has to answer, to 64 data roundoffs. An
aided engine is explained by those alone that the harness cannot supply. What is left is handed to ``harness.comparison.rest``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from harness.certify.compare import Comparison, compare
from harness.comparison.accounting import effects, fold, readings_that_do_not_hold
from harness.comparison.far_links import FAR_LINKS, is_explained_by_distance
from harness.comparison.rest import is_explained_by_number, unexplained, why_refused
from harness.comparison.truth import Meant, read_as
from harness.engines import Engine
from harness.engines.request import EngineAnswers
from harness.explain.changes.readings import find_readings
from harness.results.comparison import SubjectRecord
from harness.results.table import counted, error_text
from harness.verdict import AGREEMENT, Verdict

ILL_CONDITIONED = "no error is beyond what the condition of M does to a solution with it, and no number of the file explains them"

_NOWHERE = "at no state is an acceleration certain, for M is singular or not positive definite there"


def judge(meant: Meant, answers: EngineAnswers, caller: Engine, aided: bool) -> SubjectRecord:
    """The record of a subject that returned something."""
    about: dict[str, Any] = {**subject_of(meant, caller, aided), "notes": answers.notes}
    if answers.refusal:
        rest = why_refused(meant.robot, answers.element)
        return SubjectRecord(**about, verdict=Verdict.UNSUPPORTED, explained=True, message=answers.refusal, rest=rest)
    if meant.undetermined:
        return SubjectRecord(**about, verdict=Verdict.UNDECIDED, explained=True, message=_of_undetermined(meant, answers))
    readings = find_readings(caller.name, meant.robot.format, caller.reader)
    folded = fold(meant.robot, (one for one in readings if not (aided and one.supplied)))
    lacking = [name for name in meant.robot.joints if name not in answers.accelerations]
    compared = None if lacking else _compare(meant, answers)
    record = SubjectRecord(**about, **_verdict(compared), explained=False, readings=effects(meant, folded))
    if unread := [name for name in lacking if name in folded.robot.joints]:
        return replace(record, rest=[f"the engine has no joint {', '.join(unread)}"])
    read = read_as(meant, folded.robot)
    if read.undetermined:
        # Of a robot that has no accelerations any more, an engine may answer anything.
        return replace(
            record, verdict=Verdict.DISAGREES, explained=True, notes=(*answers.notes, f"as it reads the file, {read.undetermined}")
        )
    after = compared if read is meant and compared is not None else _compare(read, answers)
    if _are_all(after, Verdict.UNDECIDED):
        return replace(record, verdict=Verdict.UNDECIDED, explained=True, message=_NOWHERE)
    record = replace(record, left=_worst(after) if folded.applied else None)
    if _are_all(after, Verdict.AGREES):
        return replace(record, explained=True)
    if cause := _cause_of_lost_digits(read, answers, after, caller):
        return replace(record, explained=True, lost_digits=_lost(after, cause))
    return replace(record, rest=readings_that_do_not_hold(meant, folded, answers) or unexplained(read, answers))


def _cause_of_lost_digits(read: Meant, answers: EngineAnswers, after: Comparison, caller: Engine) -> str:
    """Why digits are lost in what the readings leave; "" where they are not, or a number of the file explains it."""
    accelerations = answers.of(read.robot.joints)
    if is_explained_by_number(read, accelerations):
        return ""
    if _are_all(after, Verdict.AGREES, Verdict.UNSTABLE):
        return ILL_CONDITIONED
    return FAR_LINKS if caller.takes_inertias_about_tree and is_explained_by_distance(read, accelerations) else ""


def _lost(after: Comparison, cause: str) -> str:
    """The finding in a sentence."""
    known = after.known("backward_error")
    count = f"{int((known > AGREEMENT).sum())} of {counted(len(after), 'state')}"
    return f"it loses digits at {count}, up to {error_text(float(known.max()))} data roundoffs: {cause}"


def _of_undetermined(meant: Meant, answers: EngineAnswers) -> str:
    finite = int(np.isfinite(answers.of(meant.robot.joints)).all(axis=1).sum())
    return f"it answers with finite numbers at {finite} of {len(meant.states)} states, and is silent"


def subject_of(meant: Meant, caller: Engine, aided: bool) -> dict[str, Any]:
    """What a record says of its subject."""
    model_format = meant.robot.format
    return {
        "path": str(meant.robot.path),
        "engine": caller.name,
        "format": model_format,
        "aided": aided,
        "call": caller.call[model_format],
    }


def _compare(meant: Meant, answers: EngineAnswers) -> Comparison:
    """Whether an engine factorises M is its own matter: digits that M's condition costs are excused in either."""
    return compare(meant.truth, answers.of(meant.robot.joints), factorises=True)


def _verdict(compared: Comparison | None) -> dict[str, Any]:
    """Of an engine that lacks a joint there is nothing to compare, and it disagrees."""
    if compared is None:
        return {"verdict": Verdict.DISAGREES.value}
    relative = compared.known("relative_error")
    return {
        "verdict": str(compared.verdicts[compared.worst]),
        "backward_error": _worst(compared),
        "relative_error": float(relative.max()) if len(relative) else None,
    }


def _worst(compared: Comparison) -> float | None:
    known = compared.known("backward_error")
    return float(known.max()) if len(known) else None


def _are_all(compared: Comparison, *allowed: Verdict) -> bool:
    """True where each state with a certified truth has one of these verdicts, and one has such a truth."""
    verdicts, wanted = set(compared.verdicts.tolist()), {one.value for one in allowed}
    return bool(verdicts & wanted) and verdicts <= {*wanted, Verdict.UNDECIDED.value}
