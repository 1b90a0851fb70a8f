"""Remarks on a record beside its verdicts, as worker processes find them; none changes a verdict."""

from __future__ import annotations

import json
import math

from harness.crosscheck.assignment import Assignment, departures_of, load_audited, reference_kernel_of, touches, why_left_out
from harness.engines import accelerations
from harness.programs.states import States
from harness.results.readings import Effect
from harness.study import Note
from harness.truth.componentwise import componentwise_error


def ask_one_by_one(assignment: Assignment, states: States, note: Note) -> None:
    """Ask for one state after the other, noting each, so that a crash names its state."""
    load_audited(assignment)
    states = assignment.truth.asked_at(states)
    for index in range(len(states)):
        note(json.dumps(states.as_json(index)))
        assignment.answers(states[index : index + 1])


def measure_componentwise(assignment: Assignment, state: States, beyond: float) -> float:
    """The componentwise backward error of the subject's answer at one state, as ``componentwise_error`` gives it.

    NaN with contacts on, whose numbers are an engine's and no data of the file.
    """
    if touches(assignment):
        return math.nan
    kernel, state = reference_kernel_of(assignment), assignment.into(state)
    answer = accelerations(load_audited(assignment), state)
    return componentwise_error(kernel, state, kernel.evaluate(state), answer[0], beyond)


def readings_and_refusal(assignment: Assignment, seed: int, failure: str) -> tuple[list[Effect], list[str]]:
    """Readings that explain answers: see ``FileAsRead.effects_and_refusal`` and ``departing.departures_and_refusal``."""
    if not assignment.library.reads_files and (departures_of(assignment) or why_left_out(assignment)):
        # Imported late: a run in which all is well needs nothing of it.
        from harness.crosscheck.departing import departures_and_refusal

        return departures_and_refusal(assignment, seed)
    effects, refusal = assignment.file_as_read.effects_and_refusal(seed, failure)
    if assignment.acts and not failure:
        from harness.crosscheck.departing import effects_on_file

        effects = effects_on_file(assignment, effects, seed)
    return effects, refusal
