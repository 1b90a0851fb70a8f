"""Subjects that are asked for other quantities than accelerations, at the same states as a truth of its own.

The numbers of one file of a mechanism are the truth, its MJCF where it has one, so that the engines are held against it and the two
files against one another.
"""

from __future__ import annotations

import json
import time
from collections.abc import Hashable, Sequence

from harness.certify.certified import Certified
from harness.certify.compare import compare, farthest_block
from harness.certify.quantities import Quantity, find_quantities
from harness.crosscheck.quantity_judge import QuantityAssignment
from harness.crosscheck.quantity_truth import truth_of
from harness.crosscheck.recording import NOT_OFFERED
from harness.crosscheck.stages import Answers
from harness.crosscheck.tasks import Assignment, Note, load_audited
from harness.engines import NotOffered
from harness.equations.states import States
from harness.verdict import Verdict

# Truths at one batch of states by their keys, with the seconds per state that they took: two files of a mechanism mostly say the same.
Known = dict[Hashable, tuple[Certified, float]]


def compare_quantities(assignments: Sequence[QuantityAssignment], states: States, note: Note) -> tuple[float, float, dict[str, Answers]]:
    """Seconds per certified state, 0, and by subject and quantity what was answered at ``states``; all are of one mechanism."""
    answers: dict[str, Answers] = {}
    known: dict[str, Known] = {}
    for assignment in assignments:
        key, name = f"{assignment.subject} {assignment.quantity}", assignment.quantity
        note(json.dumps({"subject": key}))
        try:
            answers[key] = _ask(find_quantities()[name], assignment.system, assignment, states, known.setdefault(name, {}))
        except NotOffered as error:
            answers[key] = Answers(failure=f"{NOT_OFFERED}{error}", unsupported=True)
        except Exception as error:
            answers[key] = Answers.missing(error)
    return max((seconds for one in known.values() for _, seconds in one.values()), default=0.0), 0.0, answers


def _ask(quantity: Quantity, system: str, assignment: Assignment, states: States, known: Known) -> Answers:
    """One subject's answers, timed and compared with the truth."""
    model = load_audited(assignment)
    truth = truth_of(quantity, system, assignment)
    if truth.key not in known:
        started = time.perf_counter()
        certified = truth.evaluate(states)
        known[truth.key] = certified, (time.perf_counter() - started) / len(states)
    certified, _ = known[truth.key]
    # What is compiled or allocated on first use is not charged to the engine.
    truth.answers(model, states[:1])
    started = time.perf_counter()
    found = truth.answers(model, states)
    spent = (time.perf_counter() - started) / len(states)
    comparison = compare(certified, found)
    if not (comparison.verdicts == Verdict.DISAGREES.value).any():
        remark = ""
    elif quantity.describe is None:
        remark = f"Farthest off is the {truth.blocks[farthest_block(certified, found)]}"
    else:
        remark = quantity.describe(truth, states, certified, found)
    return Answers(comparison, [spent], remark=remark)
