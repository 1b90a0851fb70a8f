"""States kept along a motion in steps, and the clock that runs beside it."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from harness.arrays import Array
from harness.motion.taylor import Path
from harness.motion.trajectories import Start

# A state beyond it is broken down, and the rest of the motion is not computed.
LARGEST = 1e12


def keep(start: Start, step: float, steps: int, every: int, evaluations_per_step: int, go: Callable[[int], tuple[Array, Array]]) -> Path:
    """The path of ``go(n)``, which makes n steps and returns q and v.

    The kept states are the start and every ``every``-th one, and the last whether or not it is one. What follows a
    breakdown is not a number.
    """
    counts = [*range(every, steps, every), steps]
    q, v = np.full((len(counts) + 1, len(start.q)), np.nan), np.full((len(counts) + 1, len(start.v)), np.nan)
    q[0], v[0] = start.q, start.v
    done = 0
    began = time.perf_counter()
    for row, count in enumerate(counts, start=1):
        q[row], v[row] = go(count - done)
        done = count
        if not (np.abs(q[row]).max() < LARGEST and np.abs(v[row]).max() < LARGEST):
            break
    seconds = time.perf_counter() - began
    return Path(np.array([0, *counts]) * step, q, v, None, done * evaluations_per_step, seconds)
