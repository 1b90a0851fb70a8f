"""The model's side of a diagnosis: the place in a model file that explains a subject's answers, and the value that would.

Every number of the file is tried, and whatever the declared hypotheses would mend.

Source: Khalil, Dombre, Modeling, Identification and Control of Robots (2002), chapter 12.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from harness.arrays import Array
from harness.certify.reference import Reference
from harness.diagnosis.base_parameters import BaseParameters, base_parameters
from harness.diagnosis.hypotheses import Candidate, find_hypotheses
from harness.diagnosis.perturbation import DIFFERENCE, NUMBER, Column, derivative, find_columns, numeric_candidates
from harness.diagnosis.result import Diagnosis, TriedChange, tag, to_four_digits, written
from harness.diagnosis.search import Search, Tried
from harness.models.model_file import ModelFile
from harness.models.text import Watch
from harness.verdict import AGREEMENT

# Evaluations of a model that a diagnosis may take.
EVALUATIONS = 1500


def diagnose(watch: Watch, reference: Reference, *, evaluations: int = EVALUATIONS, tolerance: float = AGREEMENT) -> Diagnosis:
    """Find the one change of a model's text that explains why its accelerations are not the reference's.

    Args:
        watch: answers at the states of ``reference``, about 100 at rest and moving, of which every third is held out of
            fits. Made by ``harness.diagnosis.perturbation.watch``, its states by ``harness.diagnosis.perturbation.diagnostic_states``.
        reference: certified accelerations; states that are not certified do not count.
        evaluations: of changed texts, after which the best so far is reported.
        tolerance: the largest backward error that explains [data roundoffs].
    """
    model = watch.model
    search = _ModelSearch(watch, reference, tolerance, evaluations)
    if not search.is_needed:
        return search.diagnosis(model.path, partial(_tried_change, model))
    numbers = numeric_candidates(model)
    structural = [candidate for hypothesis in find_hypotheses() for candidate in hypothesis.mend(model)]
    valued = [candidate for candidate in structural if candidate.start is not None]
    # Numbers first: they explain most of what is wrong, should the evaluations run out.
    columns = find_columns(search.evaluated, reference, numbers, lambda: search.is_spent)
    # Of a part of the columns no count would be true.
    base = None if search.is_spent else base_parameters(columns)
    search.fit_best(columns)
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

    def __init__(self, watch: Watch, reference: Reference, tolerance: float, evaluations: int) -> None:
        super().__init__(reference, watch.healthy, tolerance, evaluations)
        self._watch = watch

    def evaluate(self, text: str) -> Array | None:
        return self._watch.accelerations(text)

    def residual_of(self, evaluated: Array) -> Array:
        return self.whitening.residual(evaluated)

    def slope(self, candidate: Candidate, value: float) -> Array | None:
        slope = derivative(self.evaluated, candidate.text, value, DIFFERENCE * max(candidate.scale, abs(value)))
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
