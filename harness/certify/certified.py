"""Certified values of a quantity at many states, with what their errors are measured by.

The values come in blocks, vectors whose length says how large an error is; each block is judged by itself, and the worst counts.
``harness.certify.compare`` judges answers by them.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array, Rows
from harness.certify.numbers import UNIT_ROUNDOFF
from harness.equations.mechanism_kernel import Indices

# Bits of the numbers of ``harness.certify.interpreter``, beyond which balls are evaluated.
DOUBLE_DOUBLE = 106
# Radii relative to the sensitivity (data roundoff over UNIT_ROUNDOFF).
SOUGHT_RADIUS = 2.0**-80
CERTIFIED_RADIUS = 2.0**-60
# Of a sensitivity: a backward error is read to three digits.
MOST_DOUBT = 2.0**-10
Flags = np.ndarray[Any, np.dtype[np.bool_]]


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

    def __len__(self) -> int:
        return len(self.high)

    @property
    def in_balls(self) -> Flags:
        """(n,) whether the state took ball arithmetic."""
        return np.asarray(self.bits > DOUBLE_DOUBLE)

    @property
    def data_roundoff(self) -> Array:
        """Length of what half an ulp in every input does to a block."""
        return UNIT_ROUNDOFF * self.sensitivity

    @property
    def roundoff_with_share(self) -> Array:
        """The data roundoff with the share."""
        return UNIT_ROUNDOFF * (self.sensitivity + self.share)

    def why_undecided(self) -> Iterator[str]:
        """The reason of each state that is not certified, as far as it is known."""
        yield from ()

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

    def whitened(self, differences: Array) -> Array:
        """Differences of answers in multiples of ``roundoff_with_share``; 0 where nothing is certified."""
        with np.errstate(all="ignore"):
            found = self._in_metric(differences) / self.roundoff_with_share[:, :, None]
        return np.where(self.certified[:, None, None] & np.isfinite(found), found, 0.0)

    def _in_metric(self, vectors: Array) -> Array:
        return np.asarray(vectors @ self.norm_factor.transpose(0, 2, 1))
