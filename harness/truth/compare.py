"""Certified values of a quantity at many states, and the backward error and verdict of an engine's answers against them.

The values come in blocks, vectors whose length says how large an error is; each block is judged by itself, and the worst counts.

Source: Oettli, Prager, Compatibility of approximate solution of linear equations
with given error bounds, Numer. Math. 6 (1964); Higham, Accuracy and Stability, chapter 7.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Self, TypeVar

import numpy as np

from harness.arrays import Array, Indices, Rows
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.results.table import Column, Table, counted, error_text
from harness.verdict import AGREEMENT, SEVERITY, Verdict

# Bits of the numbers of ``harness.programs.loops.interpreter``, beyond which balls are evaluated.
DOUBLE_DOUBLE = 106
# Radii relative to the sensitivity (data roundoff over UNIT_ROUNDOFF).
SOUGHT_RADIUS = 2.0**-80
CERTIFIED_RADIUS = 2.0**-60
# Of a sensitivity: a backward error is read to three digits.
MOST_DOUBT = 2.0**-10
Flags = np.ndarray[Any, np.dtype[np.bool_]]
Parts = TypeVar("Parts", bound=Rows)


@dataclass(frozen=True)
class Certified(Rows):
    """Certified values of n states in blocks of one size; a quantity of one block may leave out the axis of the blocks.

    Attributes:
        high, low: (n, blocks, size); the certified midpoint is high + low.
        radius: (n, blocks) length of the radius.
        norm_factor: (n, size, size) R, where the length of a block x is |R x|.
        sensitivity: (n, blocks) how far a block moves when each input, and each value between, moves by the whole of itself; the data
            roundoff is UNIT_ROUNDOFF times it.
        share: (n, blocks) length of the parts that an algorithm may form and cancel, 0 where none are known; UNIT_ROUNDOFF times it is
            granted to an answer that would fail without.
        instability: (n,) length over UNIT_ROUNDOFF of what a factorisation of M may lose; 0 for what takes none.
        condition: (n,) kappa_s, the condition number of M scaled to unit diagonal; infinite where M has no Cholesky factor, NaN for what
            is not solved for.
        certified: (n,) whether every radius is at most ``CERTIFIED_RADIUS`` times what an answer is held against.
        bits: (n,) precision that was needed, ``DOUBLE_DOUBLE`` where no balls were; 0 where a state is not finite.
    """

    high: Array
    low: Array
    radius: Array
    norm_factor: Array
    sensitivity: Array
    share: Array
    instability: Array
    condition: Array
    certified: Flags
    bits: Indices

    @property
    def in_balls(self) -> Flags:
        """(n,) whether the state took ball arithmetic."""
        return np.asarray(self.bits > DOUBLE_DOUBLE)

    @property
    def data_roundoff(self) -> Array:
        """Length of what one unit roundoff in every input does to a block: inputs z move by 2^-53 |z|."""
        return UNIT_ROUNDOFF * self.sensitivity

    @property
    def roundoff_with_share(self) -> Array:
        """The data roundoff with the share."""
        return UNIT_ROUNDOFF * (self.sensitivity + self.share)

    def why_undecided(self) -> Iterator[str]:
        """The reason of each state that is not certified, as far as it is known."""
        yield from ()

    def for_unit_roundoff(self, unit_roundoff: float) -> Self:
        """The same values for an answer that is computed, and whose inputs are rounded, with another unit roundoff than float64's."""
        more = unit_roundoff / UNIT_ROUNDOFF
        return replace(self, sensitivity=more * self.sensitivity, share=more * self.share, instability=more * self.instability)

    @functools.cached_property
    def size(self) -> Array:
        """Lengths of the values."""
        return self.lengths(self.high)

    def errors(self, answers: np.ndarray[Any, np.dtype[np.floating[Any]]]) -> Array:
        """Errors of answers, shaped as the values."""
        return np.asarray((answers - self.high) - self.low)

    def lengths(self, vectors: Array) -> Array:
        """Lengths of vectors that are shaped as the values."""
        return np.asarray(np.linalg.norm(self._in_metric(vectors), axis=2))

    def _in_metric(self, vectors: Array) -> Array:
        return np.asarray(vectors @ self.norm_factor.transpose(0, 2, 1))


def in_order(parts: Iterable[tuple[Parts, Indices]]) -> Parts:
    """Values that were certified in parts, each with the places of its states, in the order of these."""
    values, places = map(list, zip(*parts, strict=True))
    found: Parts = values[0].concatenate(values)[np.argsort(np.concatenate(places))]
    return found


# Largest relative error of an answer that lost digits; one that is further off has too few left to be excused.
LEAST_DIGITS = 1e-3
# Answers that a comparison prints.
_MOST_SHOWN = 10


@dataclass(frozen=True)
class Comparison(Rows):
    """Judgement of n answers.

    Attributes:
        backward_error: (n,) error of the worst block in units of data roundoff; NaN where the answer is not finite or the truth is
            not certified.
        granted: (n,) bool; whether the answer passes only with the share of the truth, with which its backward error is taken.
        relative_error: (n,) |a - a*| / |a*| of that block, for the reader; decides nothing. NaN beside a zero or
            subnormal answer too.
        verdicts: (n,) ``Verdict`` values as strings.
        in_balls: (n,) bool; whether the truth took ball arithmetic, which costs a hundred times as much.
        left_of_zero: (n,) largest component of an answer that the share is granted to where the exact one is zero; 0 elsewhere.
    """

    backward_error: Array
    relative_error: Array
    granted: np.ndarray[Any, np.dtype[np.bool_]]
    verdicts: np.ndarray[Any, np.dtype[np.str_]]
    in_balls: np.ndarray[Any, np.dtype[np.bool_]]
    left_of_zero: Array

    def known(self, name: str) -> Array:
        """The values of "backward_error" or "relative_error" that are numbers."""
        values: Array = getattr(self, name)
        return values[~np.isnan(values)]

    def are_all(self, *allowed: str) -> bool:
        """True where each answer with a certified truth has one of these verdicts, and one has such a truth."""
        verdicts = set(self.verdicts.tolist())
        return bool(verdicts & {*allowed}) and verdicts <= {*allowed, Verdict.UNDECIDED.value}

    def relative_error_at(self, index: int) -> float | None:
        """The relative error of an answer, None where it says nothing.

        That is where the data leave open whether the exact answer is zero, and where that is lost in one rounding of the error.
        """
        backward, relative = float(self.backward_error[index]), float(self.relative_error[index])
        return relative if relative <= min(backward, 1 / UNIT_ROUNDOFF) else None

    @property
    def worst(self) -> int:
        """Index of the answer that decides: the gravest verdict, then the largest backward error."""
        return int(np.lexsort(self._order)[-1])

    @property
    def largest(self) -> int:
        """Index of the answer with the largest backward error; where none has one, of the gravest verdict."""
        return int(np.lexsort(self._order[::-1])[-1])

    def table(self) -> Table:
        """A row for each answer, the worst first."""
        places = np.lexsort(self._order)[::-1].tolist()
        known = (None if math.isnan(error) else error for error in self.backward_error[places].tolist())
        rows = [
            [place, str(self.verdicts[place]), error, self.relative_error_at(place)] for place, error in zip(places, known, strict=True)
        ]
        verdict, backward, relative = Column("verdict"), Column("backward error", "error"), Column("relative error", "relative")
        return Table([Column("state", "count"), verdict, backward, relative], rows)

    @property
    def headline(self) -> str:
        """Number of answers that agree, and the error of the worst, in a sentence."""
        agreeing, largest = int((self.verdicts == Verdict.AGREES.value).sum()), self.known("backward_error").max(initial=-1.0)
        off = (
            f"; the largest backward error is {error_text(float(largest))} data roundoffs, and up to {AGREEMENT:g} agrees"
            if largest >= 0
            else ""
        )
        if len(self.verdicts) == 1:
            return f"the answer {'agrees' if agreeing else 'does not agree'} with the truth{off}"
        return f"{agreeing:,} of {len(self.verdicts):,} answers agree with the truth{off}"

    def __repr__(self) -> str:
        table = self.table()
        shown = str(replace(table, rows=table.rows[:_MOST_SHOWN]))
        return "\n".join([self.headline, shown, *self._not_shown()])

    def _repr_html_(self) -> str:
        table = self.table()
        rest = "".join(f"<p>{line}</p>" for line in self._not_shown())
        return f"<p>{self.headline}</p>{replace(table, rows=table.rows[:_MOST_SHOWN]).html()}{rest}"

    def _not_shown(self) -> list[str]:
        further = len(self.verdicts) - _MOST_SHOWN
        return [f"and {counted(further, 'answer')} more, none of them worse; .table() has all"] if further > 0 else []

    @property
    def _order(self) -> tuple[Array, Array]:
        severity = np.array([SEVERITY[verdict] for verdict in self.verdicts.tolist()])
        return np.nan_to_num(self.backward_error, nan=-1.0, posinf=np.inf), severity


def compare(certified: Certified, answers: np.ndarray[Any, np.dtype[np.floating[Any]]], factorises: bool = False) -> Comparison:
    """Judge ``answers``, shaped as the values and of any precision, by the certified values of the same states.

    ``factorises`` says that they are accelerations from a factorisation of M, in which digits are lost where M is ill-conditioned.
    Without it no answer is ``unstable``; with it, none whose relative error is above ``LEAST_DIGITS``.
    """
    if answers.shape != certified.high.shape:
        raise ValueError(f"answers have shape {answers.shape}; the certified values have {certified.high.shape}")
    with np.errstate(all="ignore"):
        lengths, errors, granted = _in_roundoffs(certified, answers)
        worst = np.arange(len(errors)), errors.argmax(axis=1)
        backward, error, size = errors[worst], lengths[worst], _by_block(certified.size)[worst]
        # Beside a subnormal answer a relative error says nothing.
        relative = np.where(size >= np.finfo(np.float64).tiny, error / size, np.nan)
        lost_digits = factorises & (error <= np.minimum(UNIT_ROUNDOFF * certified.instability, LEAST_DIGITS * size))
    finite = np.isfinite(answers.T).all(axis=tuple(range(answers.ndim - 1)))
    verdicts = np.select(
        [~finite, ~certified.certified, backward <= AGREEMENT, lost_digits],
        [Verdict.ERROR.value, Verdict.UNDECIDED.value, Verdict.AGREES.value, Verdict.UNSTABLE.value],
        Verdict.DISAGREES.value,
    )
    judged = finite & certified.certified
    backward, relative = (np.where(judged, error, np.nan) for error in (backward, relative))
    granted, components = granted & finite, tuple(range(1, answers.ndim))
    is_zero = granted & ~certified.high.any(axis=components)
    left = np.where(is_zero, np.abs(answers).max(axis=components, initial=0.0), 0.0)
    return Comparison(backward, relative, granted, verdicts, certified.in_balls, left)


def errors_in_roundoffs(certified: Certified, answers: Array) -> Array:
    """Errors of each block, (n, blocks) [data roundoffs], of which ``compare`` takes the largest."""
    with np.errstate(all="ignore"):
        return _in_roundoffs(certified, answers)[1]


def farthest_block(certified: Certified, answers: Array) -> int:
    """The block that is farthest off, over all certified states."""
    errors = errors_in_roundoffs(certified, answers)
    return int(np.nan_to_num(errors[certified.certified], nan=-1.0, posinf=np.inf).max(axis=0, initial=-1.0).argmax())


def _in_roundoffs(certified: Certified, answers: np.ndarray[Any, np.dtype[np.floating[Any]]]) -> tuple[Array, Array, Flags]:
    """(n, blocks) errors, and in data roundoffs, with the share in the blocks that fail without; the states (n,) that agree only so."""
    lengths = _by_block(certified.lengths(certified.errors(answers)))
    plain, shared = (
        np.where(lengths == 0, 0.0, lengths / _by_block(roundoff)) for roundoff in (certified.data_roundoff, certified.roundoff_with_share)
    )
    needing = ~(plain <= AGREEMENT) & (shared <= AGREEMENT)
    errors = np.where(needing, shared, plain)
    return lengths, errors, needing.any(axis=1) & (errors.max(axis=1) <= AGREEMENT) & certified.certified


def _by_block(values: Array) -> Array:
    """(n, blocks), of values with or without an axis of blocks."""
    return values if values.ndim > 1 else values[:, None]
