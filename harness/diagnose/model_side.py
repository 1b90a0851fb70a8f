"""From a discrepancy to the place in a model file that explains it, and the value that would.

The residual of a subject's answers at some 100 states, whitened so that 1 is one data roundoff, is fitted by a change
of one value at a time: every number of the file, and whatever the declared hypotheses would mend. Linear screening
by the perturbation columns says which to try first; Gauss and Newton's method finds their values; what has no value
is evaluated outright. A change explains the discrepancy if what it leaves agrees at every state, also at those
that no fit has seen.

Sources: Khalil, Dombre, Modeling, Identification and Control of Robots (2002), chapter 12.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from harness.arrays import Array
from harness.certify.compare import compare
from harness.certify.reference import Reference
from harness.diagnose.base_parameters import BaseParameters, are_parallel, base_parameters
from harness.diagnose.fit import Deadline, fit, settled
from harness.diagnose.hypotheses import Candidate, Hypothesis, find_hypotheses
from harness.diagnose.perturbation import (
    DIFFERENCE,
    NUMBER,
    Column,
    Whitening,
    backward_errors,
    derivative,
    find_columns,
    held_out,
    numeric_candidates,
)
from harness.diagnose.result import Diagnosis, Explanation, Finding, digits_of, tag, to_four_digits, written
from harness.diagnose.screening import fit_in_order, screen
from harness.models.model_file import ModelFile
from harness.models.text import Watch
from harness.verdict import AGREEMENT, Verdict

__all__ = ["Diagnosis", "Explanation", "diagnose"]

# Where a fit may also start, as factors of the value found: missing, sign, factors of two, other units.
OTHER_STARTS = (0.0, -1.0, 2.0, 0.5, math.pi / 180, 180 / math.pi, 1e3, 1e-3)
FITTED_FROM_OTHER_STARTS = 12
# Of the time, what the search may take; the rest is for telling.
SHARE_OF_TIME = 0.85
# So many of those that do not explain are told.
UNEXPLAINING_SHOWN = 12
# Relative error from which on a fit may need another start.
LARGE = 1e-3


def diagnose(
    watch: Watch,
    reference: Reference,
    *,
    seconds: float = 10.0,
    tolerance: float = AGREEMENT,
    hypotheses: Sequence[Hypothesis] | None = None,
) -> Diagnosis:
    """Find the one change of a model's text that explains why its accelerations are not the reference's.

    Args:
        watch: answers at the states of ``reference``, about 100 at rest and moving, of which every third is held out of
            fits. Made by ``harness.diagnose.perturbation.watch``, its states by ``harness.diagnose.perturbation.diagnostic_states``.
        reference: certified accelerations; states that are not certified do not count.
        seconds: after which the best so far is told.
        tolerance: the largest backward error that explains [data roundoffs].
        hypotheses: what may be wrong beside single numbers; all that are declared by default.
    """
    deadline, end = Deadline.after(SHARE_OF_TIME * seconds), Deadline.after(seconds)
    search = _Search(watch, reference, tolerance, deadline, end)
    if search.finding is not None:
        return Diagnosis(file=watch.model.path, finding=search.finding, before=search.before, seconds=seconds)
    hypotheses = find_hypotheses() if hypotheses is None else hypotheses
    numbers = numeric_candidates(watch.model)
    structural = [candidate for hypothesis in hypotheses for candidate in hypothesis.mend(watch.model)]
    valued = [candidate for candidate in structural if candidate.start is not None]
    # Numbers first: they explain most of what is wrong, should time run out.
    columns = find_columns(watch, reference, numbers, deadline)
    columns_stopped = deadline()
    search.fit_best(columns)
    if search.is_large or not search.explaining:
        search.evaluate(candidate for candidate in structural if candidate.start is None)
    search.fit_best(find_columns(watch, reference, valued, deadline))
    if search.is_large and not any(tried.candidate.hypothesis == NUMBER for tried in search.explaining):
        # What is left out may be felt by its square only, or there may be no answer without it.
        search.fit_from_other_starts([*numbers, *valued])
    stopped = deadline()
    tried = search.result()
    # Of a part of the columns no count would be true.
    base = None if columns_stopped else base_parameters(columns)
    return Diagnosis(
        file=watch.model.path,
        finding=search.ending,
        before=search.before,
        tried=tuple(explanation for explanation, _ in tried),
        seconds=seconds,
        stopped=stopped,
        live=0 if base is None else len(columns),
        rank=0 if base is None else base.rank,
        together=_together(watch.model, tried[0][1], columns, base) if base is not None and search.explaining else (),
    )


@dataclass
class _Tried:
    """A candidate at a value (None for one without), its residual over all states, and its largest row."""

    candidate: Candidate
    value: float | None
    left: float
    explains: bool


@dataclass
class _Search:
    """One discrepancy and what was tried on it."""

    watch: Watch
    reference: Reference
    tolerance: float
    out_of_time: Callable[[], bool]
    at_the_end: Callable[[], bool]
    tried: list[_Tried] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._whitening = Whitening(self.reference)
        self._known: dict[str, Array | None] = {}
        self._certified = self.reference.certified
        self._here = self._whitening.residual(self.watch.healthy)
        comparison = compare(self.reference, self.watch.healthy)
        self._verdicts = set(comparison.verdicts[self._certified].tolist())
        finite = np.isfinite(self._here).all(axis=1)
        # States that fits see; those with no finite answer count only in the end.
        self._seen = self._certified & ~held_out(len(self.reference))
        if (self._seen & finite).any():
            self._seen &= finite
        self.before = self._left(self._here)
        with np.errstate(all="ignore"):
            self.is_large = math.isinf(self.before) or not np.nanmax(comparison.relative_error[self._seen], initial=0.0) < LARGE

    @property
    def finding(self) -> Finding | None:
        """Why there is nothing to search for; None where there is."""
        if not self._certified.any():
            return Finding.UNDECIDED
        return Finding.SOUND if self.before <= self.tolerance else None

    @property
    def ending(self) -> Finding:
        """What the search came to."""
        if self.explaining:
            return Finding.EXPLAINED
        if not np.isfinite(self.watch.healthy[self._certified]).all():
            return Finding.NOT_FINITE
        return Finding.UNEXPLAINED if Verdict.DISAGREES.value in self._verdicts else Finding.UNSTABLE

    @property
    def explaining(self) -> list[_Tried]:
        return [tried for tried in self.tried if tried.explains]

    def _left(self, residual: Array) -> float:
        """Largest backward error at any certified state; inf where an answer is not finite."""
        errors = backward_errors(residual[self._certified])
        return float(np.where(np.isfinite(errors), errors, np.inf).max(initial=0.0))

    def _residual(self, text: str) -> Array | None:
        """Of a changed text, (n, nv); None where it is refused."""
        if text not in self._known:
            accelerations = self.watch.accelerations(text)
            self._known[text] = None if accelerations is None else self._whitening.residual(accelerations)
        return self._known[text]

    def _try(self, candidate: Candidate, value: float | None) -> None:
        """Keep what a candidate leaves, where that is less than what there was."""
        residual = self._residual(candidate.text(0.0 if value is None else value))
        left = math.inf if residual is None else self._left(residual)
        if left < self.before:
            self.tried.append(_Tried(candidate, value, left, left <= self.tolerance))

    def evaluate(self, candidates: Iterable[Candidate]) -> None:
        """Try candidates without a free value."""
        for candidate in candidates:
            if self.out_of_time():
                return
            self._try(candidate, None)

    def fit_best(self, columns: Sequence[Column]) -> None:
        """Fit the candidates whose columns explain most, until what remains cannot explain anything."""
        seen = [column.values[self._seen] for column in columns]
        promises = screen(seen, [column.candidate.scale for column in columns], self._here[self._seen])

        def fit_one(place: int) -> None:
            if not self.out_of_time():
                self._fit(columns[place].candidate, columns[place].candidate.start, seen[place])

        fit_in_order(promises, fit_one, lambda place: self._in_class(columns[place], columns), lambda: bool(self.explaining))

    def _in_class(self, column: Column, columns: Sequence[Column]) -> bool:
        """Whether a column is parallel to that of a candidate that explains."""
        explaining = [tried.candidate for tried in self.explaining]
        return any(are_parallel(column, other) for other in columns if any(other.candidate is candidate for candidate in explaining))

    def fit_from_other_starts(self, candidates: Sequence[Candidate]) -> None:
        """Try the numbers at values far from those found, and fit the best of them from there."""
        starts: list[tuple[float, int, Candidate, float]] = []
        for place, candidate in enumerate(candidates):
            assert candidate.start is not None
            found = candidate.start
            values = [factor * found for factor in OTHER_STARTS] if found else [sign * candidate.scale for sign in (1, -1)]
            for value in values:
                if self.out_of_time():
                    return
                residual = self._residual(candidate.text(value))
                if residual is not None and np.isfinite(residual[self._seen]).all():
                    starts.append((float(np.linalg.norm(residual[self._seen])), place, candidate, value))
        best: dict[int, tuple[Candidate, float]] = {}
        for _, place, candidate, value in sorted(starts, key=lambda start: start[:2]):
            best.setdefault(place, (candidate, value))
        for candidate, value in list(best.values())[:FITTED_FROM_OTHER_STARTS]:
            self._fit(candidate, value, None)

    def _fit(self, candidate: Candidate, start: float | None, column: Array | None) -> None:
        assert start is not None

        def residual(value: float) -> Array | None:
            found = self._residual(candidate.text(value))
            return None if found is None else found[self._seen]

        value = fit(residual, lambda at: self._slope(candidate, at), start, column, candidate.scale, self.out_of_time)
        if value is not None:
            self._try(candidate, value)

    def _slope(self, candidate: Candidate, at: float) -> Array | None:
        slope = derivative(self.watch.accelerations, candidate.text, at, DIFFERENCE * max(candidate.scale, abs(at)))
        return None if slope is None else self._whitening.change(slope)[self._seen]

    def result(self) -> list[tuple[Explanation, Candidate]]:
        """Everything tried, best first: what explains, of that what has no free value, then round values, then little residual."""
        rounded = [self._rounded(tried) if tried.explains else tried for tried in self.tried]
        rounded.sort(
            key=lambda tried: (not tried.explains, (tried.value is not None, digits_of(tried.value)) if tried.explains else (), tried.left)
        )
        shown = rounded[: len(self.explaining) + UNEXPLAINING_SHOWN]
        return [(_explanation(self.watch.model, tried), tried.candidate) for tried in shown]

    def _rounded(self, tried: _Tried) -> _Tried:
        """With the shortest decimal that explains as well."""
        if tried.value is None or self.at_the_end():
            return tried

        def left_at(value: float) -> float:
            residual = self._residual(tried.candidate.text(value))
            return math.inf if residual is None else self._left(residual)

        value, left = settled(tried.value, self._slope(tried.candidate, tried.value), tried.left, self.tolerance, left_at)
        return replace(tried, value=value, left=left)


def _explanation(model: ModelFile, tried: _Tried) -> Explanation:
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
    return Explanation(candidate.hypothesis, candidate.statement, place, value, tag(place, found), shown, tried.left, tried.explains)


def _together(model: ModelFile, candidate: Candidate, columns: Sequence[Column], base: BaseParameters) -> tuple[str, ...]:
    """The other values whose changes together do what a change of this one does, as the file has them."""
    own = next((number for number, column in enumerate(columns) if column.candidate is candidate), None)
    partners = [columns[partner].candidate.place for partner in sorted(base.together_with(own))] if own is not None else []
    return tuple(dict.fromkeys(f"line {place.line} {tag(place, written(model.text, model.format, place))}" for place in partners))
