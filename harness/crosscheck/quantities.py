"""The cross-check of a quantity beyond accelerations: the same systems, subjects and sampled states, and a truth of its own.

The numbers of one file of a mechanism are the truth, its MJCF where it has one, so that the engines are held against it and the two
files against one another. What disagrees is explained by a number of the subject's file where one does. No state is searched for.
"""

from __future__ import annotations

import json
import time
from collections.abc import Hashable, Sequence
from dataclasses import replace

from harness.certify.quantities import Quantity, find_quantities
from harness.certify.quantity import Certified, farthest_block, judge_answers
from harness.crosscheck.expected import Expectations, load_expectations
from harness.crosscheck.progress import Pair, Pairs, System, answering
from harness.crosscheck.quantity_explanation import explain_difference
from harness.crosscheck.quantity_truth import declared_model, truth_of
from harness.crosscheck.run import CrossCheck
from harness.crosscheck.settings import Settings
from harness.crosscheck.stages import Answers
from harness.crosscheck.tasks import Assignment, Note, load_audited
from harness.engines import EQUATIONS, NotOffered
from harness.equations.states import States
from harness.errors import InvalidRequest
from harness.results.records import Record
from harness.verdict import Verdict

NOT_OFFERED = "not offered: "


class QuantityCheck(CrossCheck):
    """A ``harness.study.Study`` like the cross-check, whose records are of one quantity.

    Raises:
        InvalidRequest: the library is of robots, whose files have no second truth.
    """

    def __init__(self, settings: Settings, quantity: Quantity) -> None:
        if settings.library.is_of_robots:
            raise InvalidRequest(f"{quantity.name} are checked of mechanisms; of a robot's file accelerations alone")
        self.title, self._quantity = quantity.name, quantity
        super().__init__(replace(settings, replay_options=[*settings.replay_options, "--quantity", quantity.name]))

    def _expectations(self) -> Expectations:
        return load_expectations(self.settings.library, self._quantity.name)

    def _searched_of(self, system: System) -> int:
        return 0

    def _compare(self, system: System, states: States, pairs: Pairs) -> None:
        assignments = [pair.assignment for pair in pairs]
        self._ask(self._compared, system, pairs, compare_quantity, self._quantity.name, system.name, assignments, states, about=states)

    def _go_on(self, system: System) -> None:
        self._hold(system, [pair for pair in answering(system.pairs.values()) if pair.subject.format != EQUATIONS])

    # In place of the componentwise error: the number of the file that explains what disagrees.

    def _measure(self, system: System, pair: Pair) -> bool:
        if pair.explained is not None or pair.verdict != Verdict.DISAGREES:
            return False
        pair.explained = ""
        wanted = self._quantity.name, system.name, pair.assignment, self.settings.seed
        self._ask(self._explained, system, [pair], explain_difference, *wanted)
        return True

    def _record(self, name: str, pair: Pair) -> Record:
        record = replace(super()._record(name, pair), quantity=self._quantity.name)
        if pair.unsupported and record.message.startswith(NOT_OFFERED):
            # What nobody claims to compute needs no entry that excuses it.
            return replace(record, expected=Verdict.UNSUPPORTED.value, expected_reason=record.message.removeprefix(NOT_OFFERED))
        return record


# Truths at one batch of states by their keys, with the seconds per state that they took: two files of a mechanism mostly say the same.
Known = dict[Hashable, tuple[Certified, float]]


def compare_quantity(
    name: str, system: str, assignments: Sequence[Assignment], states: States, note: Note
) -> tuple[float, float, dict[str, Answers]]:
    """Seconds per certified state, 0, and by subject what it answered at ``states``; all assignments are of one mechanism."""
    quantity, known, answers = find_quantities()[name], Known(), {}
    for assignment in assignments:
        note(json.dumps({"subject": str(assignment.subject)}))
        try:
            answers[str(assignment.subject)] = _ask(quantity, system, assignment, states, known)
        except NotOffered as error:
            answers[str(assignment.subject)] = Answers(failure=f"{NOT_OFFERED}{error}", unsupported=True)
        except Exception as error:
            answers[str(assignment.subject)] = Answers.missing(error)
    return max((seconds for _, seconds in known.values()), default=0.0), 0.0, answers


def _ask(quantity: Quantity, system: str, assignment: Assignment, states: States, known: Known) -> Answers:
    """One subject's answers, timed and compared with the truth."""
    model = load_audited(assignment)
    # Equations have the coordinates of the file whose numbers are the truth.
    read = declared_model(assignment.library, system) if assignment.model is None else assignment.model
    truth = truth_of(quantity, system, assignment, read)
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
    comparison = judge_answers(certified, found)
    if not (comparison.verdicts == Verdict.DISAGREES.value).any():
        remark = ""
    elif quantity.describe is None:
        remark = f"Farthest off is the {truth.blocks[farthest_block(certified, found)]}"
    else:
        remark = quantity.describe(truth, states, certified, found)
    return Answers(comparison, [spent], remark=remark)
