"""The cross-check of a quantity beyond accelerations: the same systems, subjects and sampled states, and a truth of its own.

The numbers of one file of a mechanism are the truth, its MJCF where it has one, so that the engines are held against it and the two
files against one another. Nothing is searched for, and nothing is looked for in the files: that is the cross-check of accelerations.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

from harness.certify.quantities import Quantity, Question, Truth, find_quantities
from harness.certify.quantity import Certified, judge_answers
from harness.crosscheck.expected import Expectation, load_expectations
from harness.crosscheck.progress import Pair, Pairs, System
from harness.crosscheck.run import CrossCheck
from harness.crosscheck.settings import Settings
from harness.crosscheck.stages import Answers
from harness.crosscheck.tasks import Assignment, Note, frame_of, load_audited
from harness.engines import NotOffered
from harness.equations.states import States
from harness.errors import InvalidRequest
from harness.library import MODEL_SUFFIXES, Library
from harness.models.model_file import ModelFile, read_model
from harness.results.records import Record
from harness.storage import Kept
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

    def _expectations(self) -> Mapping[tuple[str, str], Expectation]:
        return load_expectations(self.settings.library, self._quantity.name)

    def _searched_of(self, system: System) -> int:
        return 0

    def _compare(self, system: System, states: States, pairs: Pairs) -> None:
        assignments = [pair.assignment for pair in pairs]
        self._ask(self._compared, system, pairs, compare_quantity, self._quantity.name, system.name, assignments, states, about=states)

    def _go_on(self, system: System) -> None:
        pass

    def _measure(self, system: System, pair: Pair) -> bool:
        return False

    def _record(self, name: str, pair: Pair) -> Record:
        record = replace(super()._record(name, pair), quantity=self._quantity.name)
        if pair.unsupported and record.message.startswith(NOT_OFFERED):
            # What nobody claims to compute needs no entry that excuses it.
            return replace(record, expected=Verdict.UNSUPPORTED.value, expected_reason=record.message.removeprefix(NOT_OFFERED))
        return record


def compare_quantity(
    name: str, system: str, assignments: Sequence[Assignment], states: States, note: Note
) -> tuple[float, float, dict[str, Answers]]:
    """Seconds per certified state, 0, and by subject what it answered at ``states``; all assignments are of one mechanism."""
    quantity, library = find_quantities()[name], assignments[0].library
    answers, seconds = {}, 0.0
    known: dict[tuple[str, bool], Certified] = {}
    for assignment in assignments:
        note(json.dumps({"subject": str(assignment.subject)}))
        try:
            model = load_audited(assignment)
            if assignment.model is None:
                raise NotOffered(f"{assignment.subject} reads no model file, whose {name} these are")
            truth = _truth(quantity, library, system, assignment, assignment.model)
            started = time.perf_counter()
            key = assignment.model.text, frame_of(assignment)
            if key not in known:
                known[key] = truth.evaluate(states)
                seconds = max(seconds, (time.perf_counter() - started) / len(states))
            # What is compiled or allocated on first use is not charged to the engine.
            truth.answers(model, states[:1])
            started = time.perf_counter()
            found = truth.answers(model, states)
            spent = (time.perf_counter() - started) / len(states)
            answers[str(assignment.subject)] = Answers(judge_answers(known[key], found), [spent])
        except NotOffered as error:
            answers[str(assignment.subject)] = Answers(failure=f"{NOT_OFFERED}{error}", unsupported=True)
        except Exception as error:
            answers[str(assignment.subject)] = Answers.missing(error)
    return seconds, 0.0, answers


def _truth(quantity: Quantity, library: Library, system: str, assignment: Assignment, read: ModelFile) -> Truth:
    """The truth for the readers of one file, made once per process."""
    declared = declared_model(library, system)
    key = quantity.name, assignment.mechanism.key, declared.text, read.text, frame_of(assignment)
    return _TRUTHS.get(key, lambda: quantity.truth(Question(assignment.mechanism, declared, read, frame_of(assignment))))


def declared_model(library: Library, system: str) -> ModelFile:
    """The model file whose numbers are the truth: the library's own, whatever stands in for it.

    Raises:
        InvalidModel: it is invalid. NotOffered: the system has none.
    """
    for model_format in MODEL_SUFFIXES:
        if library.has_model(system, model_format):
            return read_model(library.validated_models(system)[model_format], model_format)
    raise NotOffered(f"{system} has no model file")


_TRUTHS: Kept[Truth] = Kept(64)
