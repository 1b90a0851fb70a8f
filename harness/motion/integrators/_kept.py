"""States kept along a motion in steps, and the clock that runs beside it."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from harness.arrays import Array
from harness.motion.taylor import Path
from harness.motion.trajectories import Start

# A state beyond it is broken down, and what follows is not a number.
LARGEST = 1e12
# Looking costs as much as a step of a small mechanism.
ROWS_BETWEEN_LOOKS = 64


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
    with np.errstate(over="ignore", invalid="ignore"):
        for row, count in enumerate(counts, start=1):
            q[row], v[row] = go(count - done)
            done = count
            if (row % ROWS_BETWEEN_LOOKS == 0 or count == steps) and (broken := _broken_down(q, v, row)):
                done = counts[broken - 1]
                q[broken + 1 :] = v[broken + 1 :] = np.nan
                break
    seconds = time.perf_counter() - began
    return Path(np.array([0, *counts]) * step, q, v, None, done * evaluations_per_step, seconds)


def _broken_down(q: Array, v: Array, last: int) -> int:
    """The first row up to ``last``, of those since the last look, that is broken down; 0 if none is."""
    first = max(last - ROWS_BETWEEN_LOOKS, 0) + 1
    sizes = np.abs(np.hstack([q[first : last + 1], v[first : last + 1]])).max(axis=1)
    rows = np.flatnonzero(~(sizes < LARGEST))
    return first + int(rows[0]) if len(rows) else 0
