"""The answers on a mechanism's model of an engine whose reader is known to misread it, held against what it makes of the model.

A reader that is mended agrees with the model again, and one that does something else disagrees with both: each is another verdict than
``misreads``.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from harness.crosscheck.assignment import Assignment, truth_of
from harness.engines import load_model
from harness.programs.states import States
from harness.results.records import ACCELERATIONS
from harness.truth.compare import Comparison, Flags, compare
from harness.verdict import Verdict


def judged(assignment: Assignment, states: States, comparison: Comparison) -> Comparison:
    """The judgement of a mechanism's model, in which a disagreement ``misreads`` where the answer is that for what is read."""
    wrong = comparison.verdicts == Verdict.DISAGREES.value
    known = wrong & is_for_what_is_read(assignment, states)
    return replace(comparison, verdicts=np.where(known, Verdict.MISREADS.value, comparison.verdicts))


def judged_alone(assignment: Assignment, states: States) -> Comparison:
    """The judgement of an engine whose reader makes other joints of the model, so that nothing is compared with it."""
    known, nothing, no = is_for_what_is_read(assignment, states), np.full(len(states), np.nan), np.zeros(len(states), dtype=bool)
    verdicts = np.where(known, Verdict.MISREADS.value, Verdict.DISAGREES.value)
    return Comparison(nothing, nothing, no, verdicts, no, np.zeros(len(states)))


def is_for_what_is_read(assignment: Assignment, states: States) -> Flags:
    """True for each answer that is that of the mechanism which the reader makes of the model; nowhere where it is declared to make none."""
    nowhere, found = np.zeros(len(states), dtype=bool), assignment.file_as_read
    if not found.folded.applied or assignment.mechanism.constraints is not None or found.why_not:
        return nowhere
    about = replace(assignment, mechanism=found.written, quantity=ACCELERATIONS)
    model = load_model(about.library, about.subject, about.mechanism, about.model)
    loaded = model.loaded()
    if loaded is not None and set(loaded.joints) != set(about.mechanism.joints):
        return nowhere
    truth, own_states = truth_of(about), found.into(states)
    # The other mechanism may be one whose M is next to singular: digits that this costs are excused in any engine.
    verdicts = compare(truth.evaluate(own_states), truth.answers(model, own_states), factorises=True).verdicts
    return np.isin(verdicts, (Verdict.AGREES.value, Verdict.UNSTABLE.value))
