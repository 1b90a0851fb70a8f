"""Wall time of a call: the median over repetitions, and their spread.

Source: Chen, Revels, Robust benchmarking in noisy environments, IEEE HPEC (2016): the noise of a machine
only ever adds time, so the fastest repetition is reported beside the median.
"""

from __future__ import annotations

import gc
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Timing:
    """Wall time of one call [s].

    Attributes:
        median, fastest, slowest: over the repetitions.
        repetitions: how often it was timed; the warm-up is not among them.
    """

    median: float
    fastest: float
    slowest: float
    repetitions: int


def measure(function: Callable[[], object], minimum_count: int = 5, minimum_seconds: float = 0.2) -> Timing:
    """Time ``function`` by a monotonic clock, after one call to warm up, until both minima are met.

    Python's garbage collector rests meanwhile. What ``function`` raises is passed on.

    Raises:
        ValueError: ``minimum_count`` is less than 1.
    """
    if minimum_count < 1:
        raise ValueError(f"minimum_count is {minimum_count}; expected at least 1")
    function()
    seconds: list[float] = []
    total = 0.0
    collecting = gc.isenabled()
    gc.disable()
    try:
        while len(seconds) < minimum_count or total < minimum_seconds:
            started = time.perf_counter()
            function()
            seconds.append(time.perf_counter() - started)
            total += seconds[-1]
    finally:
        if collecting:
            gc.enable()
    return Timing(statistics.median(seconds), min(seconds), max(seconds), len(seconds))
