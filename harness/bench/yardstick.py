"""A reference computation of fixed size: what it takes says how fast the machine is by now, and nothing of any engine."""

from __future__ import annotations

import timeit
from collections.abc import Callable

import numpy as np

COUNT, CALLS = 4096, 20


def yardstick() -> Callable[[], float]:
    """A function that times the computation and gives its fastest call [s]; the noise of a machine only adds."""
    angles = np.linspace(0.0, 6.0, COUNT)
    lengths = np.linspace(1.0, 2.0, COUNT)

    def compute() -> None:
        for _ in range(4):
            np.sqrt(lengths * np.sin(angles) ** 2 + np.cos(angles) ** 2)

    return lambda: min(timeit.repeat(compute, number=1, repeat=CALLS))
