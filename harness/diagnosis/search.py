"""The search for the one change that explains a subject's answers: the part that the model's and the textbook's side share.

The residual of a subject's answers at some 100 states, whitened so that 1 is one data roundoff, is fitted by one value at a
time. Linear screening orders the fits; a change without a value is evaluated outright. A change explains the residual if
what it leaves agrees at every state, also at those that no fit has seen.

The search is limited by a number of evaluations, never by time: the same question always has the same answer.

Source: Khalil, Dombre, Modeling, Identification and Control of Robots (2002), chapter 12.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np

from harness.arrays import Array
from harness.certify.compare import compare
from harness.certify.reference import Reference
from harness.crosscheck.perturbation import NUMBER, Column, Whitening, held_out
from harness.diagnosis.base_parameters import are_parallel
from harness.diagnosis.fit import as_well, fit, screen, settled
from harness.diagnosis.hypotheses import Candidate
from harness.diagnosis.result import PARAMETER, Conclusion, Diagnosis, TriedChange, digits_of
from harness.verdict import Verdict

# The best that are fitted in any case, and the number that are fitted where something explains already.
LEAST_FITTED, FITTED_FOR_CLASS = 8, 16
# Where a fit may also start, as factors of the value found: missing, sign, factors of two, other units.
OTHER_STARTS = (0.0, -1.0, 2.0, 0.5, math.pi / 180, 180 / math.pi, 1e3, 1e-3)
FITTED_FROM_OTHER_STARTS = 12
# Share of the evaluations that the search may take; the rest is for rounding the values found.
SHARE_OF_SEARCH = 0.85
# Number of changes reported that do not explain.
UNEXPLAINING_SHOWN = 12
# Relative error from which on a fit may need another start.
LARGE = 1e-3
# Relative size of a value that may be a rounded zero.
ALL_BUT_ZERO = 1e-6

Evaluated = TypeVar("Evaluated")


@dataclass(frozen=True)
class Tried:
    """A candidate at a value (None for one without), and the largest backward error it leaves [data roundoffs]."""

    candidate: Candidate
    value: float | None
    left: float
    explains: bool

    @property
    def is_slight(self) -> bool:
        """True for a structural mistake of next to no size, and for a zero that should be next to nothing.

        A number that is written wrong is likelier, as by its last digits.
        """
        candidate, value = self.candidate, self.value
        if value is None or (candidate.hypothesis in (NUMBER, PARAMETER) and candidate.start != 0):
            return False
        return abs(value - (candidate.start or 0.0)) <= ALL_BUT_ZERO * candidate.scale


class Search(ABC, Generic[Evaluated]):
    """One subject's answers that are not the reference's, and the changes tried on them.

    A side of the comparison defines the evaluation of a text, and the residual that follows from it.

    Attributes:
        before: largest backward error over the certified states without a change; inf where an answer is not finite.
        seen: (n,) bool, the states that fits see. certified: those that decide.
        is_large: true where the error is beyond what derivatives describe.
    """

    def __init__(self, reference: Reference, accelerations: Array, tolerance: float, evaluations: int, factorises: bool = False) -> None:
        self.reference, self.accelerations, self.tolerance, self.evaluations = reference, accelerations, tolerance, evaluations
        self.whitening = Whitening(reference)
        self.certified = reference.certified
        self._evaluated: dict[str, Evaluated | None] = {}
        self._tried: dict[tuple[int, float | None], Tried] = {}
        here = self.whitening.residual(accelerations)
        comparison = compare(reference, accelerations, factorises)
        self._verdicts = set(comparison.verdicts[self.certified].tolist())
        finite = np.isfinite(here).all(axis=1)
        self.seen = self.certified & ~held_out(len(reference))
        # States without a finite residual count only in the end.
        if (self.seen & finite).any():
            self.seen &= finite
        self.here = here[self.seen]
        self.before = self.largest(here)
        with np.errstate(all="ignore"):
            self.is_large = math.isinf(self.before) or not np.nanmax(comparison.relative_error[self.seen], initial=0.0) < LARGE

    @abstractmethod
    def evaluate(self, text: str) -> Evaluated | None:
        """One evaluation of a changed text; None where it is refused."""

    @abstractmethod
    def residual_of(self, evaluated: Evaluated) -> Array:
        """Whitened residual in the measure of the unchanged reference, (n, nv)."""

    def left_of(self, evaluated: Evaluated) -> float:
        """Largest backward error over the certified states; inf where it is not finite."""
        return self.largest(self.residual_of(evaluated))

    @abstractmethod
    def slope(self, candidate: Candidate, value: float) -> Array | None:
        """Whitened derivative of the residual by the value of a candidate, at the states that fits see; None where it has none."""

    @property
    def is_spent(self) -> bool:
        """True where the search has no evaluations left."""
        return len(self._evaluated) >= SHARE_OF_SEARCH * self.evaluations

    @property
    def is_needed(self) -> bool:
        """False where nothing is wrong, or nothing certified."""
        return bool(self.certified.any()) and self.before > self.tolerance

    def _conclusion(self) -> Conclusion:
        if self.explaining:
            return Conclusion.EXPLAINED
        if not self.is_needed:
            return Conclusion.SOUND if self.certified.any() else Conclusion.UNDECIDED
        if not np.isfinite(self.accelerations[self.certified]).all():
            return Conclusion.NOT_FINITE
        return Conclusion.UNEXPLAINED if Verdict.DISAGREES.value in self._verdicts else Conclusion.UNSTABLE

    @property
    def explaining(self) -> list[Tried]:
        return [tried for tried in self._tried.values() if tried.explains]

    def largest(self, residual: Array) -> float:
        """Largest backward error of a whitened residual (n, nv) over the certified states; inf where it is not finite."""
        with np.errstate(all="ignore"):
            errors = np.linalg.norm(residual[self.certified], axis=1)
        return float(np.where(np.isfinite(errors), errors, np.inf).max(initial=0.0))

    def evaluated(self, text: str) -> Evaluated | None:
        """``evaluate``, which is counted, once for each text."""
        if text not in self._evaluated:
            self._evaluated[text] = self.evaluate(text)
        return self._evaluated[text]

    def try_without_value(self, candidates: Iterable[Candidate]) -> None:
        """Evaluate candidates without a free value."""
        for candidate in candidates:
            if self.is_spent:
                return
            self._try(candidate, None)

    def try_zeros(self, candidates: Iterable[Candidate]) -> None:
        """Evaluate zero in the place of numbers that are all but zero: from where a row appears with one, no derivative leads there."""
        for candidate in candidates:
            if self.is_spent:
                return
            if candidate.start is not None and 0 < abs(candidate.start) <= ALL_BUT_ZERO * candidate.scale:
                self._try(candidate, 0.0)

    def fit_best(self, columns: Sequence[Column]) -> None:
        """Fit the candidates whose columns explain most, until what remains cannot explain anything.

        Once something explains, no more than a few are fitted beside its class.
        """
        seen = [column.values[self.seen] for column in columns]
        screened = screen(seen, [column.candidate.scale for column in columns], self.here)
        for rank, (place, is_worth_it) in enumerate(screened):
            if self.is_spent:
                return
            candidate = columns[place].candidate
            explaining = {id(tried.candidate) for tried in self.explaining}
            of_class = (other for other in columns if id(other.candidate) in explaining)
            enough = rank >= FITTED_FOR_CLASS and explaining and not any(are_parallel(columns[place], other) for other in of_class)
            if rank < LEAST_FITTED or (is_worth_it and not enough):
                assert candidate.start is not None
                self._fit(candidate, candidate.start, seen[place])

    def fit_from_other_starts(self, candidates: Sequence[Candidate]) -> None:
        """Fit the best candidates from values far from those found, if the error is large and no single value explains it."""
        if not self.is_large or any(tried.candidate.hypothesis in (NUMBER, PARAMETER) for tried in self.explaining):
            return
        best: list[tuple[float, int, float]] = []
        for place, candidate in enumerate(candidates):
            assert candidate.start is not None
            sizes = []
            found = candidate.start
            for value in [factor * found for factor in OTHER_STARTS] if found else [candidate.scale, -candidate.scale]:
                if self.is_spent:
                    return
                residual = self._residual(candidate, value)
                if residual is not None and np.isfinite(residual).all():
                    sizes.append((float(np.linalg.norm(residual)), place, value))
            best += sorted(sizes, key=lambda one: one[0])[:1]
        for _, place, value in sorted(best, key=lambda one: one[:2])[:FITTED_FROM_OTHER_STARTS]:
            self._fit(candidates[place], value, None)

    def _fit(self, candidate: Candidate, start: float, column: Array | None) -> None:
        residual, slope = partial(self._residual, candidate), partial(self.slope, candidate)
        value = fit(residual, slope, start, column, candidate.scale, lambda: self.is_spent)
        if value is not None and not self._try(candidate, value) and 0 < abs(value) <= ALL_BUT_ZERO * candidate.scale:
            # A term that is left out: the least remainder of the others is a wrong answer where that term acts alone.
            self._try(candidate, 0.0)

    def _residual(self, candidate: Candidate, value: float) -> Array | None:
        evaluated = self.evaluated(candidate.text(value))
        return None if evaluated is None else self.residual_of(evaluated)[self.seen]

    def _left(self, candidate: Candidate, value: float | None) -> float:
        evaluated = self.evaluated(candidate.text(0.0 if value is None else value))
        return math.inf if evaluated is None else self.left_of(evaluated)

    def _try(self, candidate: Candidate, value: float | None) -> bool:
        """Keep a candidate that lessens the error; true where it explains it."""
        left = self._left(candidate, value)
        if left < self.before:
            self._tried[id(candidate), value] = Tried(candidate, value, left, left <= self.tolerance)
        return left <= self.tolerance

    def diagnosis(self, file: Path, as_change: Callable[[Tried], TriedChange]) -> Diagnosis:
        """The result, of changes of ``file``."""
        stopped = self.is_spent
        tried = tuple(map(as_change, self._result()))
        return Diagnosis(file, self._conclusion(), self.before, tried, self.evaluations, stopped)

    def _result(self) -> list[Tried]:
        """The changes tried, at round values, best first; of those that do not explain, a few."""
        found: dict[tuple[int, float | None], tuple[Tried, float]] = {}
        for tried in self._tried.values():
            rounded = self._rounded(tried)
            found.setdefault((id(tried.candidate), rounded.value), (rounded, tried.left))
        best = best_first(list(found.values()))
        return best[: sum(tried.explains for tried in best) + UNEXPLAINING_SHOWN]

    def _rounded(self, tried: Tried) -> Tried:
        """With the shortest decimal that explains as well."""
        candidate, value = tried.candidate, tried.value
        if value is None or not tried.explains or len(self._evaluated) >= self.evaluations:
            return tried
        slope, left_at = self.slope(candidate, value), partial(self._left, candidate)
        value, left = settled(value, slope, tried.left, self.tolerance, left_at)
        return replace(tried, value=value, left=left)


def best_first(tried: Sequence[tuple[Tried, float]]) -> list[Tried]:
    """Changes at round values, each beside what its fitted value leaves [data roundoffs], the likeliest first.

    What explains comes before what does not. Of what explains, first is what leaves about as little as the least; then comes what is
    not slight, then what has no free value, a value of few digits, and little residual.
    """
    enough = as_well(min((left for one, left in tried if one.explains), default=0.0))

    def rank(pair: tuple[Tried, float]) -> tuple[Any, ...]:
        one, left = pair
        if not one.explains:
            return True, one.left
        return False, left > enough, one.is_slight, one.value is not None, digits_of(one.value), one.left

    return [one for one, _ in sorted(tried, key=rank)]
