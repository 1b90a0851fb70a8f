"""Backward error and verdict of an engine's accelerations against the reference.

Source: Oettli, Prager, Compatibility of approximate solution of linear equations
with given error bounds, Numer. Math. 6 (1964); Higham, Accuracy and Stability, chapter 7.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array, Rows
from harness.certify.reference import UNIT_ROUNDOFF, Reference, energy_norm
from harness.verdict import AGREEMENT, SEVERITY, Verdict

# Largest relative error of an answer that lost digits; one that is further off has too few left to be excused.
LEAST_DIGITS = 1e-3


@dataclass(frozen=True)
class Comparison(Rows):
    """Judgement of n answers.

    Attributes:
        backward_error: (n,) error in units of data roundoff; NaN where the answer is not finite or the
            reference is not certified.
        granted: (n,) bool; whether the answer passes only with the share of the motion, with which its backward error is taken.
        relative_error: (n,) |a - a*|_M / |a*|_M, for the reader; decides nothing. NaN beside a zero or
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


def compare(reference: Reference, accelerations: np.ndarray[Any, np.dtype[np.floating[Any]]], factorises: bool = False) -> Comparison:
    """Judge ``accelerations``, (n, nv) of any precision [SI per s^2], against the reference of the same states.

    ``factorises`` says that they come from a factorisation of M, in which digits are lost where M is ill-conditioned. Without
    it no answer is ``unstable``; with it, none whose relative error is above ``LEAST_DIGITS``.
    """
    if accelerations.shape != reference.high.shape:
        raise ValueError(f"accelerations have shape {accelerations.shape}; the reference has {reference.high.shape}")
    with np.errstate(all="ignore"):
        difference = (accelerations - reference.high) - reference.low
        error = energy_norm(reference.norm_factor, difference)
        backward, in_motion = error / reference.data_roundoff, error / reference.roundoff_in_motion
        granted = ~(backward <= AGREEMENT) & (in_motion <= AGREEMENT) & reference.certified
        backward = np.where(granted, in_motion, backward)
        # Beside a subnormal answer a relative error says nothing.
        relative = np.where(reference.size >= np.finfo(np.float64).tiny, error / reference.size, np.nan)
        lost_digits = factorises & (error <= np.minimum(UNIT_ROUNDOFF * reference.instability, LEAST_DIGITS * reference.size))
    finite = np.isfinite(np.ascontiguousarray(accelerations.T)).all(axis=0)
    verdicts = np.select(
        [~finite, ~reference.certified, backward <= AGREEMENT, lost_digits],
        [Verdict.ERROR.value, Verdict.UNDECIDED.value, Verdict.AGREES.value, Verdict.UNSTABLE.value],
        Verdict.DISAGREES.value,
    )
    judged = finite & reference.certified
    backward, relative = (np.where(judged, error, np.nan) for error in (backward, relative))
    return Comparison(backward, relative, granted & finite, verdicts, reference.in_balls)
