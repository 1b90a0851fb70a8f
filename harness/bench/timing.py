"""Wall time of a call: the median over repetitions, and their spread.

Source: Chen, Revels, Robust benchmarking in noisy environments, IEEE HPEC (2016): the noise of a machine
only ever adds time, so the fastest repetition is reported beside the median.
"""

from __future__ import annotations

import statistics
import time
import timeit
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

    ``timeit`` keeps Python's garbage collector out of what is timed. What ``function`` raises is passed on.
    """
    function()
    timer = timeit.Timer(function, timer=time.perf_counter)
    seconds: list[float] = []
    total = 0.0
    while len(seconds) < minimum_count or total < minimum_seconds:
        seconds.append(timer.timeit(1))
        total += seconds[-1]
    return Timing(statistics.median(seconds), min(seconds), max(seconds), len(seconds))
