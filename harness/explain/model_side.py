"""The model's side of a diagnosis: the place in a model file that explains a subject's answers, and the value that would.

Every number of the file is tried, and whatever the declared mistakes would mend. The engine itself answers to each changed text.

Source: Khalil, Dombre, Modeling, Identification and Control of Robots (2002), chapter 12.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from harness.arrays import Array
from harness.explain.changes import NUMBER, Change
from harness.explain.changes.mistakes import mended_mistakes
from harness.explain.changes.numbers import INERTIAS, numeric_changes
from harness.explain.columns import DIFFERENCE, ChangeColumn, derivative, find_columns, without_bent
from harness.explain.fit import Projection, explaining_directions
from harness.explain.identifiable import BaseParameters, base_parameters
from harness.explain.result import Diagnosis, Finding, TriedChange, to_four_digits
from harness.explain.search import DEFAULT_LIMITS, ChangeSearch, Limits, Side, Tried
from harness.files.lint.formats import LEAST
from harness.files.model_file import ModelFile
from harness.files.text.scan import TextPlace, Watch, find_elements, tag, with_values, written
from harness.truth.compare import Certified, compare
from harness.truth.reference import Reference
from harness.verdict import AGREEMENT, Verdict

# Of directions that explain the errors of all states, those are reported that are all but as significant as the strongest.
AS_SIGNIFICANT = 0.9


class ModelSide(Side):
    """Changed texts of a model file are evaluated to the engine's answers."""

    def __init__(self, watch: Watch, certified: Certified, limits: Limits = DEFAULT_LIMITS) -> None:
        super().__init__(watch.model.path, certified, watch.healthy, limits)
        self._watch, self._model = watch, watch.model
        # Of derivatives, relative to a value or its scale.
        self.step = DIFFERENCE

    def evaluate(self, text: str) -> tuple[Certified, Array] | None:
        answers = self._watch.accelerations(text)
        return None if answers is None else (self.certified, answers)

    def answer(self, text: str) -> Array | None:
        """Those to a changed text, which are counted; None where it is refused."""
        evaluated = self.evaluated(text)
        return None if evaluated is None else evaluated[1]

    def slope(self, change: Change, value: float) -> Array | None:
        step = self.step * max(change.scale, abs(value))
        slope = derivative(self.answer, change.text, value, step)
        if slope is None:
            return None
        return without_bent(self.whitening.change(slope), self.answer, change.text, self.whitening, value, step)[self.seen]

    def columns(self, changes: Sequence[Change], step: float | None = None) -> list[ChangeColumn]:
        """Columns of all changes with a free value, at the model as it is."""
        return find_columns(self.answer, self.certified, changes, lambda: self.is_spent, self.step if step is None else step)

    def shown(self, tried: Tried) -> TriedChange:
        change, value, model = tried.change, tried.value, self._model
        place = change.place
        if value is not None and not tried.explains:
            value = to_four_digits(value, change.start or 0.0)
        found = written(model.text, model.format, place)
        shown = written(change.text(0.0 if value is None else value), model.format, place)
        if shown == found:
            # The place is where something is missing, or what changes stands elsewhere.
            shown = "" if value is None else repr(value)
        elif change.kind == NUMBER and place.index is not None:
            # A component of an axis stops at the axis's length.
            value = float(shown.split()[place.index])
        shown = f'"{shown}"' if " " in shown else shown
        return TriedChange(change.kind, change.statement, place, value, tag(place, found), shown, tried.left, tried.explains)


def diagnose(watch: Watch, reference: Reference, limits: Limits = DEFAULT_LIMITS) -> Diagnosis:
    """Find the one change of a model's text that explains why its accelerations are not the reference's.

    Args:
        watch: answers at the states of ``reference``, about 100 at rest and moving, of which every third is held out of
            fits. Made by ``harness.explain.columns.watch``, its states by ``harness.explain.columns.diagnostic_states``.
        reference: certified accelerations; states that are not certified do not count.
    """
    model, side = watch.model, ModelSide(watch, reference, limits)
    search = ChangeSearch(side)
    if not search.is_needed and not limits.factorises:
        return search.diagnosis()
    # Where lost digits are tolerated, nearly nothing explains as well as anything.
    if limits.tolerance <= AGREEMENT and (least := felt_least_inertia(watch, side)) is not None:
        return Diagnosis(model.path, Finding.EXPLAINED, side.before, (least,), limits.evaluations)
    numbers = numeric_changes(model)
    structural = [change for mistake in mended_mistakes() for change in mistake.mend(model)]
    valued = [change for change in structural if change.start is not None]
    # Numbers first: they explain most of what is wrong, should the evaluations run out.
    columns = side.columns(numbers)
    # Of a part of the columns no count would be true.
    base = None if side.is_spent else base_parameters(columns)
    # What lost digits cover is told by its direction; by its size, any change would explain it.
    if limits.factorises:
        _try_directions(search, side, reference, columns)
    if search.is_needed and not search.explaining:
        search.try_outright(numbers)
        whole = [change for change in structural if change.start is None]
        if search.is_large:
            # Each takes one evaluation; a fit takes many, and beside a large error nearly every number is worth one.
            search.try_outright(whole)
        search.fit_best(columns)
        _fit_closely(search, side, columns)
        if not search.is_large and not search.explaining:
            search.try_outright(whole)
        search.fit_best(side.columns(valued, DIFFERENCE))
        # What is left out may be felt by its square only, or there may be no answer without it.
        search.fit_from_other_starts([*numbers, *valued])
    diagnosis = search.diagnosis()
    if base is None:
        return diagnosis
    together = _together(model, diagnosis.tried[0], columns, base) if diagnosis.explaining else ()
    return replace(diagnosis, live=len(columns), rank=base.rank, together=together)


def explaining_numbers(watch: Watch, certified: Certified) -> list[TriedChange]:
    """The numbers of a model's text, each of which makes its answers to any quantity agree, the likeliest first."""
    side = ModelSide(watch, certified)
    search = ChangeSearch(side)
    if not search.is_needed:
        return []
    search.fit_best(side.columns(numeric_changes(watch.model)))
    return [side.shown(tried) for tried in search.found() if tried.explains]


def _try_directions(search: ChangeSearch, side: ModelSide, reference: Reference, columns: Sequence[ChangeColumn]) -> None:
    """Keep the numbers that explain the errors of all states, each at the value that leaves no more than lost digits."""
    here = side.whitening.residual(side.answers)
    directions = explaining_directions([Projection.of(reference, here, [column.values for column in columns])])
    for one in directions:
        change = columns[one.index].change
        value = (change.start or 0.0) - one.change
        mended = side.answer(change.text(value))
        if one.significance < AS_SIGNIFICANT * directions[0].significance or mended is None:
            continue
        if Verdict.DISAGREES.value not in compare(reference, mended, factorises=True).verdicts[reference.certified]:
            search.keep(Tried(change, value, side.left_of(reference, mended), True))


def _fit_closely(search: ChangeSearch, side: ModelSide, columns: Sequence[ChangeColumn]) -> None:
    """Fit the changes of columns again, if nothing explains a small error, by derivatives over steps as small as the error.

    Answers may bend within the usual step: where a wrong length keeps redundant rows from holding together, an engine that
    iterates with a proximal parameter feels it by its square, until the row that is new counts in full.
    """
    if search.is_large or search.explaining or not columns:
        return
    # The relative change that the number felt most would make up for the error by.
    side.step = min(DIFFERENCE, float(np.linalg.norm(side.here)) / max(column.norm * column.change.scale for column in columns))
    search.fit_best(side.columns([column.change for column in columns]))
    if not search.explaining:
        side.step = DIFFERENCE


def _together(model: ModelFile, first: TriedChange, columns: Sequence[ChangeColumn], base: BaseParameters) -> tuple[str, ...]:
    """The other values whose changes together do what a change of this one does, as the file has them."""
    of_change = first.place, first.statement
    own = next((n for n, column in enumerate(columns) if (column.change.place, column.change.statement) == of_change), None)
    partners = [columns[partner].change.place for partner in sorted(base.together_with(own))] if own is not None else []
    return tuple(dict.fromkeys(f"line {place.line} {tag(place, written(model.text, model.format, place))}" for place in partners))


_REMEDIES = {
    "mjcf": "take it off the inertia of a body that turns with this one, make the mechanism larger, or give the mass the size that it has",
    "urdf": "write 0, which a URDF may hold",
}


def felt_least_inertia(watch: Watch, side: ModelSide) -> TriedChange | None:
    """The change that explains the answers if they are right without the least inertias of the file, which point masses have; None if not.

    Less cannot be tried, for the reader refuses it. Answers change in proportion to so little: those without any inertia are as far
    from those of the file as those with twice as much, on the other side.

    Source: MuJoCo documentation, XML reference, ``body/inertial``, and ``mjMINVAL``.
    """
    model = watch.model
    held = [
        (attribute, [number for number in attribute.numbers if number.value == LEAST])
        for element in find_elements(model.text, model.format)
        for attribute in element.attributes
        if attribute.name in INERTIAS.get((model.format, element.tag), ())
    ]
    least = [(attribute, numbers) for attribute, numbers in held if numbers]
    # What agrees with them does not feel them.
    if not least or side.before <= side.limits.tolerance:
        return None
    doubled = {number: 2 * LEAST for _, numbers in least for number in numbers}
    twice = watch.accelerations(with_values(model.text, doubled))
    if twice is None or (left := side.left_of(side.certified, 2 * watch.healthy - twice)) > side.limits.tolerance:
        return None
    attribute, (number, *_) = least[0]
    place = TextPlace(attribute.line, number.element, attribute.name, None, attribute.value)
    statement = f"the least inertia that MuJoCo accepts, {LEAST:g} kg m^2, is felt here; {_REMEDIES[model.format]}"
    return TriedChange("least inertia", statement, place, None, tag(place, " ".join(attribute.value.split())), "", left, True)
