"""The number of a model file that explains why what its reader answers of a quantity is not the truth.

Accelerations may agree all the same: a centre of mass along a fixed axis is felt by a reaction alone. Each number of the file is changed
a little, zeros included, and the errors at all states are projected on what that does; the change that leaves least is made, and has to
make the answers agree.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from harness.arrays import Array
from harness.certify.certified import Certified
from harness.certify.compare import compare
from harness.crosscheck.assignment import Assignment, declared_model
from harness.crosscheck.perturbation import DIFFERENCE, derivative, diagnostic_states, numeric_candidates
from harness.crosscheck.tasks import Note
from harness.engines import Unsupported, load_engine
from harness.equations.states import States
from harness.models.model_file import ModelFile
from harness.models.text import Candidate, Watch, tag, written
from harness.verdict import Verdict

# At rest and moving, of which each state adds six equations a joint.
STATES = 32
# Numbers that are tried after the projection, steps of each, and how many that explain are named.
TRIED, STEPS, NAMED = 8, 4, 3
MOST_DIGITS = 17


@dataclass(frozen=True)
class NumberExplained:
    """The numbers that explain a difference, of which one is enough; ``sentence`` is for a record."""

    sentence: str


@dataclass(frozen=True)
class _Fit:
    """A number with what a change of 1 in it does to the answers, (n, blocks, size), in multiples of what an error is held against."""

    candidate: Candidate
    column: Array

    def change(self, residual: Array) -> float:
        """The change that leaves least of the residual."""
        return -float((self.column * residual).sum() / (self.column**2).sum())

    def left(self, residual: Array) -> float:
        return float(np.linalg.norm(residual + self.change(residual) * self.column))


def explain_difference(assignment: Assignment, seed: int, note: Note) -> NumberExplained | None:
    """The numbers that explain why the subject disagrees; None for a subject without a file, or where no single number does.

    Raises:
        InvalidModel: a file is no truth, or the engine refuses it. harness.engines.Unsupported: the engine cannot express it.
    """
    if assignment.model is None:
        return None
    search = _Search(assignment, assignment.model, diagnostic_states(assignment.mechanism, seed, STATES))
    found = [text for text, _ in zip(search.explanations(), range(NAMED), strict=False)]
    if not found:
        return None
    declared = declared_model(assignment.library, assignment.system or assignment.mechanism.name)
    rest = f"; so does {' or '.join(found[1:])}" if found[1:] else ""
    return NumberExplained(f"{found[0]} makes the {assignment.quantity} those of the numbers in {declared.path.name}{rest}.")


class _Search:
    """The answers of one subject to changed texts of its file."""

    def __init__(self, assignment: Assignment, model: ModelFile, states: States) -> None:
        mechanism, truth, engine = assignment.mechanism, assignment.truth, load_engine(assignment.library, assignment.subject.engine)

        def answer(changed: ModelFile) -> Array:
            try:
                return truth.answers(engine.load(changed, mechanism.joints, mechanism.gravity), states)
            except Unsupported as reason:
                raise ValueError(str(reason)) from reason

        self._model = model
        self._answers = Watch(model, answer).accelerations
        self._certified: Certified = truth.evaluate(states)

    def explanations(self) -> Iterator[str]:
        """Each number that explains, with the value that does."""
        residual = self._residual(self._model.text)
        # At these states all may be well.
        if residual is None or self._agrees(self._model.text):
            return
        for fit in sorted(self._fits(), key=lambda fit: fit.left(residual))[:TRIED]:
            value = self._solved(fit, residual)
            if value is not None:
                place = fit.candidate.place
                shown = tag(place, written(self._model.text, self._model.format, place))
                how = f" {fit.candidate.statement}" if fit.candidate.statement else ""
                yield f"line {place.line}: {self._shortest(fit, value)!r} in the place of {place.found} in {shown}{how}"

    def _fits(self) -> Iterator[_Fit]:
        """The numbers that the answers feel."""
        for candidate in numeric_candidates(self._model):
            if candidate.start is None:
                continue
            slope = derivative(self._answers, candidate.text, candidate.start, DIFFERENCE * candidate.scale)
            if slope is None:
                continue
            column = self._certified.whitened(slope)
            if np.linalg.norm(column) > 0:
                yield _Fit(candidate, column)

    def _solved(self, fit: _Fit, residual: Array | None) -> float | None:
        """The value at which all answers agree; None where none is found."""
        value = fit.candidate.start or 0.0
        for _ in range(STEPS):
            if residual is None:
                return None
            value += fit.change(residual)
            text = fit.candidate.text(value)
            if self._agrees(text):
                return value
            residual = self._residual(text)
        return None

    def _shortest(self, fit: _Fit, value: float) -> float:
        """The number of fewest digits beside a value that explains just as well."""
        shorter = (0.0, *(float(f"{value:.{digits}g}") for digits in range(1, MOST_DIGITS)))
        return next((one for one in shorter if self._agrees(fit.candidate.text(one))), value)

    def _agrees(self, text: str) -> bool:
        answers = self._answers(text)
        return answers is not None and Verdict.DISAGREES.value not in compare(self._certified, answers).verdicts

    def _residual(self, text: str) -> Array | None:
        answers = self._answers(text)
        return None if answers is None else self._certified.whitened(self._certified.errors(answers))
