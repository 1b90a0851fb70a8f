"""Backward error and verdict of an engine's answers against certified values.

Source: Oettli, Prager, Compatibility of approximate solution of linear equations
with given error bounds, Numer. Math. 6 (1964); Higham, Accuracy and Stability, chapter 7.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array, Rows
from harness.certify.certified import Certified, Flags
from harness.certify.numbers import UNIT_ROUNDOFF
from harness.verdict import AGREEMENT, SEVERITY, Verdict

# Largest relative error of an answer that lost digits; one that is further off has too few left to be excused.
LEAST_DIGITS = 1e-3


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
    """

    backward_error: Array
    relative_error: Array
    granted: np.ndarray[Any, np.dtype[np.bool_]]
    verdicts: np.ndarray[Any, np.dtype[np.str_]]
    in_balls: np.ndarray[Any, np.dtype[np.bool_]]

    def known(self, name: str) -> Array:
        """The values of "backward_error" or "relative_error" that are numbers."""
        values: Array = getattr(self, name)
        return values[~np.isnan(values)]

    def relative_error_at(self, index: int) -> float | None:
        """The relative error of an answer, None where it says nothing.

        That is where the data leave open whether the exact answer is zero, and where that is lost in one rounding of the error.
        """
        backward, relative = float(self.backward_error[index]), float(self.relative_error[index])
        return relative if relative <= min(backward, 1 / UNIT_ROUNDOFF) else None

    def __len__(self) -> int:
        return len(self.verdicts)

    @property
    def worst(self) -> int:
        """Index of the answer that decides: the gravest verdict, then the largest backward error."""
        return int(np.lexsort(self._order)[-1])

    @property
    def largest(self) -> int:
        """Index of the answer with the largest backward error; where none has one, of the gravest verdict."""
        return int(np.lexsort(self._order[::-1])[-1])

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
        lengths = _by_block(certified.lengths(certified.errors(answers)))
        errors, granted = _in_roundoffs(certified, lengths)
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
    return Comparison(backward, relative, granted & finite, verdicts, certified.in_balls)


def errors_in_roundoffs(certified: Certified, answers: Array) -> Array:
    """Errors of each block, (n, blocks) [data roundoffs], of which ``compare`` takes the largest."""
    with np.errstate(all="ignore"):
        return _in_roundoffs(certified, _by_block(certified.lengths(certified.errors(answers))))[0]


def farthest_block(certified: Certified, answers: Array) -> int:
    """The block that is farthest off, over all certified states."""
    errors = errors_in_roundoffs(certified, answers)
    return int(np.nan_to_num(errors[certified.certified], nan=-1.0, posinf=np.inf).max(axis=0, initial=-1.0).argmax())


def _in_roundoffs(certified: Certified, lengths: Array) -> tuple[Array, Flags]:
    """(n, blocks) errors in data roundoffs, with the share in the blocks that fail without; the states (n,) that agree only so."""
    plain, shared = (
        np.where(lengths == 0, 0.0, lengths / _by_block(roundoff)) for roundoff in (certified.data_roundoff, certified.roundoff_with_share)
    )
    needing = ~(plain <= AGREEMENT) & (shared <= AGREEMENT)
    errors = np.where(needing, shared, plain)
    return errors, needing.any(axis=1) & (errors.max(axis=1) <= AGREEMENT) & certified.certified


def _by_block(values: Array) -> Array:
    """(n, blocks), of values with or without an axis of blocks."""
    return values if values.ndim > 1 else values[:, None]
