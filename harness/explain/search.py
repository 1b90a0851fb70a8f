"""The search for the one change that explains a subject's answers, whoever evaluates the changes and whatever was asked.

The residual of the answers at some 100 states, whitened so that 1 is one data roundoff, is fitted by one value at a time. Linear
screening orders the fits; a change without a value is evaluated outright. A change explains the residual if what it leaves agrees at
every state, also at those that no fit has seen.

The search is limited by a number of evaluations, never by time: the same question always has the same answer.

Source: Khalil, Dombre, Modeling, Identification and Control of Robots (2002), chapter 12.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.explain.changes import NUMBER, PARAMETER, Change
from harness.explain.columns import ChangeColumn, Whitening, held_out
from harness.explain.fit import as_well, fit, screen, shortest_decimal
from harness.explain.identifiable import are_parallel
from harness.explain.result import Diagnosis, Finding, TriedChange, digits_of
from harness.truth.compare import Certified, compare
from harness.verdict import AGREEMENT, Verdict

# Evaluations of a model that a diagnosis may take.
EVALUATIONS = 1500
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


@dataclass(frozen=True)
class Limits:
    """The work that a search may take, and what explains.

    Attributes:
        evaluations: of changed texts, after which the best so far is reported.
        tolerance: the largest backward error that explains [data roundoffs].
        factorises: as of ``harness.truth.compare.compare``; a number may then explain errors below the tolerance.
    """

    evaluations: int = EVALUATIONS
    tolerance: float = AGREEMENT
    factorises: bool = False


DEFAULT_LIMITS = Limits()


@dataclass(frozen=True)
class Tried:
    """A change at a value (None for one without), and the largest backward error it leaves [data roundoffs]."""

    change: Change
    value: float | None
    left: float
    explains: bool

    @property
    def is_slight(self) -> bool:
        """True for a structural mistake of next to no size, and for a zero that should be next to nothing.

        A number that is written wrong is likelier, as by its last digits.
        """
        change, value = self.change, self.value
        if value is None or (change.kind in (NUMBER, PARAMETER) and change.start != 0):
            return False
        return abs(value - (change.start or 0.0)) <= ALL_BUT_ZERO * change.scale


class Side(ABC):
    """A side of the comparison of answers with certified values, on which changes are evaluated; each text once, and counted.

    Attributes:
        file: whose numbers change. seen: (rows,) bool, of the states that fits see. decides: of certified states.
        here: the residual at the rows that fits see. before: largest backward error at those that decide; inf where one is not finite.
    """

    def __init__(self, file: Path, certified: Certified, answers: Array, limits: Limits) -> None:
        self.file, self.certified, self.answers, self.limits = file, certified, answers, limits
        self.whitening = Whitening(certified)
        self._evaluated: dict[str, tuple[Certified, Array] | None] = {}
        here = self.whitening.residual(answers)
        self.decides = self.whitening.by_row(certified.certified)
        finite = np.isfinite(here).all(axis=1)
        self.seen = self.decides & ~self.whitening.by_row(held_out(len(certified)))
        # States without a finite residual count only in the end.
        if (self.seen & finite).any():
            self.seen &= finite
        self.here = here[self.seen]
        self.before = self._largest(here)

    @abstractmethod
    def evaluate(self, text: str) -> tuple[Certified, Array] | None:
        """The certified values and the answers that a changed text makes of these; None where it is refused."""

    @abstractmethod
    def slope(self, change: Change, value: float) -> Array | None:
        """Whitened derivative of the residual by the value of a change, at the rows that fits see; None where it has none."""

    @abstractmethod
    def shown(self, tried: Tried) -> TriedChange:
        """A change that was tried as people are told it."""

    @property
    def spent(self) -> int:
        """Number of texts that were evaluated."""
        return len(self._evaluated)

    @property
    def is_spent(self) -> bool:
        """True where the search has no evaluations left."""
        return self.spent >= SHARE_OF_SEARCH * self.limits.evaluations

    def _largest(self, residual: Array) -> float:
        """Largest backward error of a whitened residual (rows, size) over the certified states; inf where it is not finite."""
        with np.errstate(all="ignore"):
            errors = np.linalg.norm(residual[self.decides], axis=1)
        return float(np.where(np.isfinite(errors), errors, np.inf).max(initial=0.0))

    def evaluated(self, text: str) -> tuple[Certified, Array] | None:
        """``evaluate``, which is counted, once for each text."""
        if text not in self._evaluated:
            self._evaluated[text] = self.evaluate(text)
        return self._evaluated[text]

    def residual_at(self, change: Change, value: float) -> Array | None:
        """The residual with a change at a value, at the rows that fits see; None where it is refused.

        In the measure of the unchanged truth: where one term acts alone, its own roundoff shrinks with it.
        """
        evaluated = self.evaluated(change.text(value))
        if evaluated is None:
            return None
        certified, answers = evaluated
        with np.errstate(all="ignore"):
            return self.whitening.change(certified.errors(answers))[self.seen]

    def left_at(self, change: Change, value: float | None) -> float:
        """Largest backward error with a change at a value, in the measure of its own truth; inf where it is refused or not finite."""
        evaluated = self.evaluated(change.text(0.0 if value is None else value))
        return math.inf if evaluated is None else self.left_of(*evaluated)

    def left_of(self, certified: Certified, answers: Array) -> float:
        """Largest backward error of answers over the states that are certified; inf where it is not finite."""
        whitening = self.whitening if certified is self.certified else Whitening(certified)
        return self._largest(whitening.residual(answers))


class ChangeSearch:
    """The changes tried on one side.

    Attributes:
        is_large: true where the error is beyond what derivatives describe.
    """

    def __init__(self, side: Side) -> None:
        self.side, self.limits = side, side.limits
        self._tried: dict[tuple[int, float | None], Tried] = {}
        comparison = compare(side.certified, side.answers, side.limits.factorises)
        self._verdicts = set(comparison.verdicts[side.certified.certified].tolist())
        seen = side.seen.reshape(len(side.certified), -1).any(axis=1)
        with np.errstate(all="ignore"):
            self.is_large = math.isinf(side.before) or not np.nanmax(comparison.relative_error[seen], initial=0.0) < LARGE

    @property
    def is_needed(self) -> bool:
        """False where nothing is wrong, or nothing certified."""
        return bool(self.side.decides.any()) and self.side.before > self.limits.tolerance

    @property
    def explaining(self) -> list[Tried]:
        return [tried for tried in self._tried.values() if tried.explains]

    def keep(self, tried: Tried) -> None:
        self._tried[id(tried.change), tried.value] = tried

    def try_outright(self, changes: Iterable[Change]) -> None:
        """Evaluate changes without a free value; and zero in the place of numbers that are all but zero.

        From where a row appears with a number, no derivative leads there.
        """
        for change in changes:
            if self.side.is_spent:
                return
            if change.start is None:
                self._try(change, None)
            elif _is_all_but_zero(change, change.start):
                self._try(change, 0.0)

    def fit_best(self, columns: Sequence[ChangeColumn]) -> None:
        """Fit the changes whose columns explain most, until what remains cannot explain anything.

        Once something explains, no more than a few are fitted beside its class.
        """
        seen = [column.values[self.side.seen] for column in columns]
        screened = screen(seen, [column.change.scale for column in columns], self.side.here)
        for rank, (place, is_worth_it) in enumerate(screened):
            if self.side.is_spent:
                return
            change = columns[place].change
            explaining = {id(tried.change) for tried in self.explaining}
            of_class = (other for other in columns if id(other.change) in explaining)
            enough = rank >= FITTED_FOR_CLASS and explaining and not any(are_parallel(columns[place], other) for other in of_class)
            if rank < LEAST_FITTED or (is_worth_it and not enough):
                assert change.start is not None
                self._fit(change, change.start, seen[place])

    def fit_from_other_starts(self, changes: Sequence[Change]) -> None:
        """Fit the best changes from values far from those found, if the error is large and no single value explains it."""
        if not self.is_large or any(tried.change.kind in (NUMBER, PARAMETER) for tried in self.explaining):
            return
        best: list[tuple[float, int, float]] = []
        for place, change in enumerate(changes):
            assert change.start is not None
            sizes = []
            found = change.start
            for value in [factor * found for factor in OTHER_STARTS] if found else [change.scale, -change.scale]:
                if self.side.is_spent:
                    return
                residual = self.side.residual_at(change, value)
                if residual is not None and np.isfinite(residual).all():
                    sizes.append((float(np.linalg.norm(residual)), place, value))
            best += sorted(sizes, key=lambda one: one[0])[:1]
        for _, place, value in sorted(best, key=lambda one: one[:2])[:FITTED_FROM_OTHER_STARTS]:
            self._fit(changes[place], value, None)

    def _fit(self, change: Change, start: float, column: Array | None) -> None:
        side = self.side
        value = fit(partial(side.residual_at, change), partial(side.slope, change), start, column, change.scale, lambda: side.is_spent)
        if value is not None and not self._try(change, value) and _is_all_but_zero(change, value):
            # A term that is left out: the least remainder of the others is a wrong answer where that term acts alone.
            self._try(change, 0.0)

    def _try(self, change: Change, value: float | None) -> bool:
        """Keep a change that lessens the error; true where it explains it."""
        left = self.side.left_at(change, value)
        if left < self.side.before:
            self.keep(Tried(change, value, left, left <= self.limits.tolerance))
        return left <= self.limits.tolerance

    def found(self) -> list[Tried]:
        """The changes tried, at round values, best first; of those that do not explain, a few."""
        found: dict[tuple[int, float | None], tuple[Tried, float]] = {}
        for tried in self._tried.values():
            rounded = self._rounded(tried)
            found.setdefault((id(tried.change), rounded.value), (rounded, tried.left))
        best = best_first(list(found.values()))
        return best[: sum(tried.explains for tried in best) + UNEXPLAINING_SHOWN]

    def diagnosis(self) -> Diagnosis:
        """The result."""
        side, stopped = self.side, self.side.is_spent
        return Diagnosis(side.file, self._finding(), side.before, tuple(map(side.shown, self.found())), self.limits.evaluations, stopped)

    def _finding(self) -> Finding:
        if self.explaining:
            return Finding.EXPLAINED
        if not self.is_needed:
            return Finding.SOUND if self.side.decides.any() else Finding.UNDECIDED
        if not np.isfinite(self.side.answers[self.side.certified.certified]).all():
            return Finding.NOT_FINITE
        return Finding.UNEXPLAINED if Verdict.DISAGREES.value in self._verdicts else Finding.UNSTABLE

    def _rounded(self, tried: Tried) -> Tried:
        """With the shortest decimal that explains as well."""
        change, value = tried.change, tried.value
        if value is None or not tried.explains or self.side.spent >= self.limits.evaluations:
            return tried
        limit = min(self.limits.tolerance, as_well(tried.left))

        def will_do(rounded: float) -> bool:
            return self.side.left_at(change, rounded) <= limit

        if _is_all_but_zero(change, value) and will_do(0.0):
            # Engines round to zero what is next to it.
            value = 0.0
        slope = self.side.slope(change, value)
        steepest = 0.0 if slope is None else float(np.linalg.norm(slope, axis=1).max())
        short = shortest_decimal(value, 2 * limit / steepest, will_do) if 0 < steepest < math.inf else value
        return replace(tried, value=short, left=tried.left if short == value else self.side.left_at(change, short))


def _is_all_but_zero(change: Change, value: float) -> bool:
    return 0 < abs(value) <= ALL_BUT_ZERO * change.scale


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
