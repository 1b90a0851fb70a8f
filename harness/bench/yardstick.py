"""A reference computation of fixed size: what it takes says how fast the machine is by now, and nothing of any engine."""

from __future__ import annotations

import math
import timeit

import numpy as np

COUNT, CALLS = 4096, 10


class Stopwatch:
    """The fastest call of the reference computation, of all that were timed; the noise of a machine only adds.

    Attributes:
        fastest: [s]; infinite before the first call.
    """

    def __init__(self) -> None:
        self.fastest = math.inf
        self._angles, self._lengths = np.linspace(0.0, 6.0, COUNT), np.linspace(1.0, 2.0, COUNT)

    def time(self) -> None:
        """Time some calls."""
        self.fastest = min(self.fastest, *timeit.repeat(self._compute, number=1, repeat=CALLS))

    def _compute(self) -> None:
        for _ in range(4):
            np.sqrt(self._lengths * np.sin(self._angles) ** 2 + np.cos(self._angles) ** 2)
