"""The model's side of a diagnosis: the place in a model file that explains a subject's answers, and the value that would.

Every number of the file is tried, and whatever the declared hypotheses would mend.

Source: Khalil, Dombre, Modeling, Identification and Control of Robots (2002), chapter 12.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from harness.arrays import Array
from harness.certify.compare import compare
from harness.certify.one_number import Projection, explaining_directions
from harness.certify.reference import Reference
from harness.crosscheck.perturbation import DIFFERENCE, NUMBER, Column, derivative, find_columns, numeric_candidates
from harness.diagnosis.base_parameters import BaseParameters, base_parameters
from harness.diagnosis.hypotheses import Candidate, find_hypotheses
from harness.diagnosis.least_inertia import felt_least_inertia
from harness.diagnosis.result import Conclusion, Diagnosis, TriedChange, to_four_digits
from harness.diagnosis.search import Search, Tried
from harness.models.model_file import ModelFile
from harness.models.text import Watch, tag, written
from harness.verdict import AGREEMENT, Verdict

# Of directions that explain the errors of all states, those are reported that are all but as significant as the strongest.
AS_SIGNIFICANT = 0.9
# Evaluations of a model that a diagnosis may take.
EVALUATIONS = 1500


def diagnose(
    watch: Watch, reference: Reference, *, evaluations: int = EVALUATIONS, tolerance: float = AGREEMENT, factorises: bool = False
) -> Diagnosis:
    """Find the one change of a model's text that explains why its accelerations are not the reference's.

    Args:
        watch: answers at the states of ``reference``, about 100 at rest and moving, of which every third is held out of
            fits. Made by ``harness.crosscheck.perturbation.watch``, its states by ``harness.crosscheck.perturbation.diagnostic_states``.
        reference: certified accelerations; states that are not certified do not count.
        evaluations: of changed texts, after which the best so far is reported.
        tolerance: the largest backward error that explains [data roundoffs].
        factorises: as of ``harness.certify.compare.compare``; a number may then explain errors below the tolerance.
    """
    model = watch.model
    search = _ModelSearch(watch, reference, tolerance, evaluations, factorises)
    if not search.is_needed and not factorises:
        return search.diagnosis(model.path, partial(_tried_change, model))
    # Where lost digits are tolerated, nearly nothing explains as well as anything.
    if tolerance <= AGREEMENT and (least := felt_least_inertia(watch, search.left_of, tolerance)) is not None:
        return Diagnosis(model.path, Conclusion.EXPLAINED, search.before, (least,), evaluations)
    numbers = numeric_candidates(model)
    structural = [candidate for hypothesis in find_hypotheses() for candidate in hypothesis.mend(model)]
    valued = [candidate for candidate in structural if candidate.start is not None]
    # Numbers first: they explain most of what is wrong, should the evaluations run out.
    columns = find_columns(search.evaluated, reference, numbers, lambda: search.is_spent)
    # Of a part of the columns no count would be true.
    base = None if search.is_spent else base_parameters(columns)
    # What lost digits cover is told by its direction; by its size, any change would explain it.
    if factorises:
        search.try_directions(columns)
    if search.is_needed and not search.explaining:
        search.try_zeros(numbers)
        search.fit_best(columns)
        search.fit_closely(columns)
        if search.is_large or not search.explaining:
            search.try_without_value(candidate for candidate in structural if candidate.start is None)
        search.fit_best(find_columns(search.evaluated, reference, valued, lambda: search.is_spent))
        # What is left out may be felt by its square only, or there may be no answer without it.
        search.fit_from_other_starts([*numbers, *valued])
    diagnosis = search.diagnosis(model.path, partial(_tried_change, model))
    if base is None:
        return diagnosis
    together = _together(model, diagnosis.tried[0], columns, base) if diagnosis.explaining else ()
    return replace(diagnosis, live=len(columns), rank=base.rank, together=together)


class _ModelSearch(Search[Array]):
    """Changed texts of a model file are evaluated to the engine's accelerations."""

    def __init__(self, watch: Watch, reference: Reference, tolerance: float, evaluations: int, factorises: bool) -> None:
        super().__init__(reference, watch.healthy, tolerance, evaluations, factorises)
        self._watch = watch
        # Step of derivatives, relative to a value or its scale.
        self._step = DIFFERENCE

    def evaluate(self, text: str) -> Array | None:
        return self._watch.accelerations(text)

    def residual_of(self, evaluated: Array) -> Array:
        return self.whitening.residual(evaluated)

    def try_directions(self, columns: Sequence[Column]) -> None:
        """Keep the numbers that explain the errors of all states, each at the value that leaves no more than lost digits."""
        here = self.residual_of(self.accelerations)
        directions = explaining_directions([Projection.of(self.reference, here, [column.values for column in columns])])
        for one in directions:
            candidate = columns[one.index].candidate
            value = (candidate.start or 0.0) - one.change
            mended = self.evaluated(candidate.text(value))
            if one.significance < AS_SIGNIFICANT * directions[0].significance or mended is None:
                continue
            if Verdict.DISAGREES.value not in compare(self.reference, mended, factorises=True).verdicts[self.certified]:
                self._tried[id(candidate), value] = Tried(candidate, value, self.left_of(mended), True)

    def fit_closely(self, columns: Sequence[Column]) -> None:
        """Fit the candidates of columns again, if nothing explains a small error, by derivatives over steps as small as the error.

        Answers may bend within the usual step: where a wrong length keeps redundant rows from holding together, an engine that
        iterates with a proximal parameter feels it by its square, until the row that is new counts in full.
        """
        if self.is_large or self.explaining or not columns:
            return
        size = float(np.linalg.norm(self.residual_of(self.accelerations)[self.seen]))
        # The relative change that the number felt most would make up for the error by.
        self._step = min(DIFFERENCE, size / max(column.norm * column.candidate.scale for column in columns))
        candidates = [column.candidate for column in columns]
        closely = find_columns(self.evaluated, self.reference, candidates, lambda: self.is_spent, lambda one: self._step * one.scale)
        self.fit_best(closely)
        if not self.explaining:
            self._step = DIFFERENCE

    def slope(self, candidate: Candidate, value: float) -> Array | None:
        slope = derivative(self.evaluated, candidate.text, value, self._step * max(candidate.scale, abs(value)))
        return None if slope is None else self.whitening.change(slope)[self.seen]


def _tried_change(model: ModelFile, tried: Tried) -> TriedChange:
    candidate, value = tried.candidate, tried.value
    place = candidate.place
    if value is not None and not tried.explains:
        value = to_four_digits(value, candidate.start or 0.0)
    found = written(model.text, model.format, place)
    shown = written(candidate.text(0.0 if value is None else value), model.format, place)
    if shown == found:
        # The place is where something is missing, or what changes stands elsewhere.
        shown = "" if value is None else repr(value)
    elif candidate.hypothesis == NUMBER and place.index is not None:
        # A component of an axis stops at the axis's length.
        value = float(shown.split()[place.index])
    shown = f'"{shown}"' if " " in shown else shown
    return TriedChange(candidate.hypothesis, candidate.statement, place, value, tag(place, found), shown, tried.left, tried.explains)


def _together(model: ModelFile, change: TriedChange, columns: Sequence[Column], base: BaseParameters) -> tuple[str, ...]:
    """The other values whose changes together do what a change of this one does, as the file has them."""
    of_change = change.place, change.statement
    own = next((n for n, column in enumerate(columns) if (column.candidate.place, column.candidate.statement) == of_change), None)
    partners = [columns[partner].candidate.place for partner in sorted(base.together_with(own))] if own is not None else []
    return tuple(dict.fromkeys(f"line {place.line} {tag(place, written(model.text, model.format, place))}" for place in partners))
