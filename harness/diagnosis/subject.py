"""The diagnosis of one subject: its terms or blocks that are wrong, and what explains its accelerations in its file or in the textbook.

A model that the load audit refuses is diagnosed all the same: the engine answers, and its answers show what is wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from harness.crosscheck.assignment import Assignment, acceleration_truth_of
from harness.crosscheck.explanation import explain_difference
from harness.engines import Subject, accelerations, gaps_of, load_engine
from harness.engines.interface import require_bounds
from harness.errors import InvalidModel, shown_path
from harness.explain.columns import diagnostic_states, watch
from harness.explain.model_side import diagnose
from harness.explain.result import Diagnosis, Finding, digits_of
from harness.explain.search import EVALUATIONS, Limits
from harness.explain.terms import TermComparison, batches_at, compare_terms, wrong_blocks
from harness.explain.textbook_side import TextbookSide, search_parameters, textbook_evaluations
from harness.library import Library, member_of
from harness.programs.states import States
from harness.results.records import ACCELERATIONS
from harness.study import Note
from harness.truth.compare import errors_in_roundoffs
from harness.truth.quantities.accelerations import beside_gaps
from harness.truth.sampling import generic_sample
from harness.verdict import AGREEMENT

# Positions at which terms are compared, of a mechanism of up to so many velocities; their cost grows with the cube of those.
TERM_STATES, TERM_VELOCITIES, LEAST_TERM_STATES = 64, 12, 4
# Of a parameter in a system file.
MOST_DIGITS_WRITTEN = 12
# Positions at which blocks are compared, each three times.
POSITIONS = 16


def examine(
    library: Library, name: str, subject: Subject, stand_in: Path | None, scope: Scope, note: Callable[[str], None]
) -> SubjectDiagnosis | QuantityDiagnosis:
    """The diagnosis of a system and the model that stands in for its own, if any, as a task for ``harness.workers``.

    Raises:
        InvalidInput: the system or its model cannot be used. harness.engines.Unsupported: the engine cannot express it.
    """
    assignment = Assignment.of(library, name, subject, stand_in).about(scope.quantity)
    return diagnose_subject(assignment, scope, note) if assignment.asked.is_default else diagnose_blocks(assignment, scope.seed, note)


@dataclass(frozen=True)
class SubjectDiagnosis:
    """The terms of one subject, and both sides of its diagnosis.

    Attributes:
        subject: as "mujoco/mjcf". terms: its terms against the certified ones.
        model: the diagnosis of its file; None for one that reads none. textbook: that of the system's parameters.
    """

    subject: str
    terms: TermComparison
    model: Diagnosis | None
    textbook: Diagnosis

    def first_line(self, suspects_textbook: bool = False) -> str:
        """The model's place where one explains, else the textbook's parameter, else what the model's side came to.

        ``suspects_textbook``: the textbook's parameter goes first where one explains, but for a value that nobody would have written
        where the model has an explanation without any.
        """
        explained = self.model is not None and self.model.finding == Finding.EXPLAINED
        textbook_explains = self.textbook.finding == Finding.EXPLAINED
        of_model, of_textbook = (side.first if side is not None else None for side in (self.model, self.textbook))
        if of_model is not None and of_model.value is None and of_textbook is not None:
            suspects_textbook = suspects_textbook and digits_of(of_textbook.value) <= MOST_DIGITS_WRITTEN
        if self.model is None or (textbook_explains and (suspects_textbook or not explained)):
            return self.textbook.first_line
        return self.model.first_line

    def as_json(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "subject": self.subject,
            "terms": self.terms.as_json(),
            "model": None if self.model is None else self.model.as_json(),
            "textbook": self.textbook.as_json(),
        }


@dataclass(frozen=True)
class Scope:
    """The states of a diagnosis and its limits.

    Attributes:
        seed: of the sampled states. quantity: that was asked for.
        evaluations: of changed models that it may take; of the textbook in proportion.
        tolerance: the largest backward error that explains [data roundoffs].
        worst_states: {"q", "v", "tau"} of states at which the subject is known to be wrong, to be among those of the diagnosis.
    """

    seed: int
    quantity: str = ACCELERATIONS
    evaluations: int = EVALUATIONS
    tolerance: float = AGREEMENT
    worst_states: Sequence[Mapping[str, Sequence[float]]] = ()


def diagnose_subject(assignment: Assignment, scope: Scope, note: Callable[[str], None]) -> SubjectDiagnosis:
    """Diagnose a subject; each stage is announced by ``note``.

    Raises:
        InvalidModel: the engine refuses the model, or dry friction, limits or actuators of it are not the mechanism's.
        harness.engines.Unsupported: the engine cannot express the mechanism.
    """
    mechanism, model, library = assignment.mechanism, assignment.model, assignment.library
    if model is not None:
        # Without them the engine would be examined about another question.
        require_bounds(model, mechanism)
    note("loading")
    engine = load_engine(library, assignment.subject.engine)
    of_answers = acceleration_truth_of(assignment)
    kernel = of_answers.kernel
    worst = [States.at(**state) for state in scope.worst_states]
    states = States.concatenate([of_answers.asked_at(diagnostic_states(mechanism, scope.seed)), *worst])
    try:
        loaded = engine.load(assignment.in_equations if model is None else model, mechanism.joints, mechanism.gravity)
        watched = None if model is None else watch(engine, mechanism, model, states)
    except (ValueError, KeyError) as error:
        if model is None:
            raise
        raise InvalidModel(model.path, None, f"{assignment.subject.engine} refuses it: {error}") from error
    answer = accelerations(loaded, states)
    note("comparing terms")
    count = TERM_STATES * min(1.0, (TERM_VELOCITIES / len(mechanism.joints)) ** 3)
    positions = generic_sample(mechanism, max(LEAST_TERM_STATES, int(count)), scope.seed)
    terms = compare_terms(kernel, positions, loaded, str(assignment.subject), of_answers.factorises)
    limits = Limits(scope.evaluations, scope.tolerance, of_answers.factorises)
    note("diagnosing the model")
    of_model, certified = None, kernel.evaluate(states)
    if watched is not None:
        of_model = diagnose(watched, beside_gaps(certified, mechanism, states, gaps_of(loaded, states)), limits)
    note("diagnosing the textbook's side")
    path = library.system_path(mechanism.name)
    member = member_of(path)
    evaluations = int(textbook_evaluations(mechanism) * scope.evaluations / EVALUATIONS)
    limits = replace(limits, evaluations=evaluations)
    side = TextbookSide(kernel, states, answer, path if member is None else member[0], limits, certified)
    of_textbook = search_parameters(side, len(mechanism.parameters)).diagnosis()
    return SubjectDiagnosis(str(assignment.subject), terms, of_model, of_textbook)


@dataclass(frozen=True)
class QuantityDiagnosis:
    """Diagnosis of a subject's answers to another quantity than accelerations.

    Attributes:
        sentences: one for blocks that are wrong since the same kind of state. file: path of the model; None for a subject without one.
        of_file: the numbers of the file that explain it, or that none does; "" without a file.
    """

    sentences: tuple[str, ...]
    file: Path | None
    of_file: str

    def first_line(self, suspects_textbook: bool = False) -> str:
        """The sentence on the file; there is no diagnosis of the textbook's side."""
        return self.of_file

    def as_json(self) -> dict[str, Any]:
        """Plain data in the shape of ``harness.diagnosis.subject.SubjectDiagnosis.as_json``."""
        model = None if self.file is None else {"file": str(self.file), "text": [self.of_file]}
        return {"terms": {"sentences": list(self.sentences)}, "model": model, "textbook": None}


def diagnose_blocks(asked: Assignment, seed: int, note: Note) -> QuantityDiagnosis:
    """Diagnose a subject by the blocks of a quantity, and the numbers of its file.

    Raises:
        InvalidModel: a file is no truth, or the engine refuses it. harness.engines.Unsupported: the engine cannot express it.
    """
    note("comparing blocks")
    batches = batches_at(generic_sample(asked.mechanism, POSITIONS, seed))
    states = States.concatenate(list(batches.values()))
    certified, answers = asked.truth.evaluate(states), asked.answers(states)
    errors = np.where(certified.certified[:, None], errors_in_roundoffs(certified, answers), 0.0)
    kinds = np.repeat(list(batches), POSITIONS)
    sentences = tuple(wrong_blocks(asked.truth.blocks, errors, kinds)) or (
        f"{asked.quantity} agrees at the {len(states)} states of the diagnosis",
    )
    if asked.model is None:
        return QuantityDiagnosis(sentences, None, "")
    note("explaining by numbers of the file")
    explained = explain_difference(asked, seed) or "no single number explains it"
    of_file = f"{shown_path(asked.model.path)}: {explained}"
    return QuantityDiagnosis(sentences, asked.model.path, of_file)
