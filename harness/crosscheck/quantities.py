"""The cross-check of a quantity beyond accelerations: the same systems, subjects and sampled states, and a truth of its own.

The numbers of one file of a mechanism are the truth, its MJCF where it has one, so that the engines are held against it and the two
files against one another. What disagrees is explained by a number of the subject's file where one does. No state is searched for.
"""

from __future__ import annotations

import json
import time
from collections.abc import Collection, Hashable, Sequence
from dataclasses import replace

from harness.certify.certified import Certified
from harness.certify.compare import compare, farthest_block
from harness.certify.quantities import Quantity, find_quantities
from harness.crosscheck.expected import Expectations, load_expectations
from harness.crosscheck.progress import Pair, Pairs, System, answering
from harness.crosscheck.quantity_explanation import explain_difference
from harness.crosscheck.quantity_truth import truth_of
from harness.crosscheck.run import CrossCheck
from harness.crosscheck.settings import Settings
from harness.crosscheck.stages import Answers
from harness.crosscheck.tasks import Assignment, Note, load_audited
from harness.engines import EQUATIONS, NotOffered
from harness.equations.mechanism import Mechanism
from harness.equations.states import States
from harness.results.records import ACCELERATIONS, Record, SystemCard
from harness.verdict import Verdict

NOT_OFFERED = "not offered: "


class QuantityCheck(CrossCheck):
    """A ``harness.study.Study`` like the cross-check, whose records are of other quantities.

    ``audits``: whether what engines hold after loading is compared as well, which a cross-check of accelerations does.
    ``without``: (system, subject) that are not asked.
    """

    def __init__(
        self, settings: Settings, quantities: Sequence[Quantity], audits: bool = True, without: Collection[tuple[str, str]] = ()
    ) -> None:
        names = [quantity.name for quantity in quantities]
        self.title = names[0] if len(names) == 1 else "further quantities"
        self._quantities, self._audits, self._without = names, audits, without
        self._of_quantities = {name: load_expectations(settings.library, name) for name in names}
        super().__init__(settings)

    def _pairs_of(self, name: str) -> list[Pair]:
        asked = [subject for subject in self.subjects_of(name) if (name, str(subject)) not in self._without]
        return [Pair(subject=subject, quantity=quantity) for quantity in self._quantities for subject in asked]

    def _expectations_of(self, pair: Pair) -> Expectations:
        return self._of_quantities[pair.quantity]

    def _replay_options_of(self, pair: Pair) -> Sequence[str]:
        return [*self.settings.replay_options, "--quantity", pair.quantity]

    def _searched_of(self, system: System) -> int:
        return 0

    def _compare(self, system: System, states: States, pairs: Pairs) -> None:
        asked = [(pair.key, pair.quantity, pair.assignment) for pair in pairs]
        self._ask(self._compared, system, pairs, compare_quantities, system.name, asked, states, about=states)

    def _go_on(self, system: System) -> None:
        if self._audits and not self.settings.library.is_of_robots:
            by_subject = {pair.subject: pair for pair in answering(system.pairs.values()) if pair.subject.format != EQUATIONS}
            self._hold(system, list(by_subject.values()))

    def _described(self, system: System, mechanism: Mechanism) -> list[SystemCard]:
        # A cross-check of accelerations says what there is to say.
        return []

    # In place of the componentwise error: the number of the file that explains what disagrees.

    def _measure(self, system: System, pair: Pair) -> bool:
        if pair.explained is not None or pair.verdict != Verdict.DISAGREES:
            return False
        pair.explained = ""
        wanted = pair.quantity, system.name, pair.assignment, self.settings.seed
        self._ask(self._explained, system, [pair], explain_difference, *wanted)
        return True

    def _record(self, name: str, pair: Pair) -> Record:
        record = replace(super()._record(name, pair), quantity=pair.quantity)
        if pair.unsupported and record.message.startswith(NOT_OFFERED):
            # What nobody claims to compute needs no entry that excuses it.
            return replace(record, expected=Verdict.UNSUPPORTED.value, expected_reason=record.message.removeprefix(NOT_OFFERED))
        return record


def cross_check_of(quantity: str, settings: Settings, audits: bool = True) -> CrossCheck:
    """The cross-check of one quantity, accelerations or another; of these with ``audits``, see ``QuantityCheck``."""
    return CrossCheck(settings) if quantity == ACCELERATIONS else QuantityCheck(settings, [find_quantities()[quantity]], audits)


# Truths at one batch of states by their keys, with the seconds per state that they took: two files of a mechanism mostly say the same.
Known = dict[Hashable, tuple[Certified, float]]


def compare_quantities(
    system: str, asked: Sequence[tuple[str, str, Assignment]], states: States, note: Note
) -> tuple[float, float, dict[str, Answers]]:
    """Seconds per certified state, 0, and by key what was answered at ``states``.

    ``asked`` are keys, names of quantities, and assignments of one mechanism.
    """
    answers: dict[str, Answers] = {}
    known: dict[str, Known] = {}
    for key, name, assignment in asked:
        note(json.dumps({"subject": key}))
        try:
            answers[key] = _ask(find_quantities()[name], system, assignment, states, known.setdefault(name, {}))
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
