"""The declaration of a benchmark, and how its rounds are measured."""

from __future__ import annotations

import fnmatch
import importlib
import math
import pkgutil
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from benchmarks.history import Measured

# One round of a benchmark: CPU seconds of a unit, or another number.
Measure = Callable[[], float]
# Least CPU time of a round [s]; the clock of a process has steps of a microsecond, and a switch between processes costs tens.
LEAST_SECONDS = 0.02
SECONDS = "s"


@dataclass(frozen=True)
class Benchmark:
    """What is measured, and what beside it.

    Attributes:
        name: "suite/subject".
        prepare: makes both measures ready, without being timed.
        beside: what the second measure is, in words; empty where the first is judged by itself.
        most: bar on the ratio of both.
        rounds: of both measures in turns.
        warm: whether a first round is left out of account.
        unit: of the first measure.
    """

    name: str
    prepare: Callable[[], tuple[Measure, Measure]]
    beside: str
    most: float = math.inf
    rounds: int = 10
    warm: bool = True
    unit: str = SECONDS

    def measured(self, most_rounds: int | None = None) -> Measured:
        """All rounds of both measures, taken in turns."""
        measures = self.prepare()
        if self.warm:
            for measure in measures:
                measure()
        rounds = [[measure() for measure in measures] for _ in range(min(self.rounds, most_rounds or self.rounds))]
        own, others = ([float(f"{value:.4g}") for value in values] for values in zip(*rounds, strict=True))
        return Measured(self.name, own, others, self.unit, self.beside, None if math.isinf(self.most) else self.most)


def cpu(call: Callable[[], object], units: int = 1, least: float = LEAST_SECONDS) -> Measure:
    """CPU seconds of a unit of which ``call`` does so many, over as many calls as take ``least`` seconds."""
    count = 1

    def measure() -> float:
        nonlocal count
        while True:
            started = time.process_time()
            for _ in range(count):
                call()
            seconds = time.process_time() - started
            if seconds >= least:
                return seconds / (count * units)
            count = max(2 * count, min(1000, int(1.2 * count * least / max(seconds, 1e-6))))

    return measure


def reference_work() -> Callable[[], object]:
    """Work that no change of the harness makes other: Python's own, and NumPy's on one core."""
    rng = np.random.default_rng(0)
    numbers = rng.normal(size=100_000)

    def work() -> float:
        words = {str(number): number for number in range(5_000)}
        return float(np.sort(np.sin(numbers))[0]) + sum(words.values())

    return work


REFERENCE_WORK = "a fixed piece of work of Python and NumPy"


def alone() -> float:
    """The second measure of a benchmark that is judged by itself."""
    return 1.0


def suites() -> list[str]:
    """Names of the modules that yield benchmarks."""
    from benchmarks import suites

    return sorted(module.name for module in pkgutil.iter_modules(suites.__path__))


def benchmarks_of(suite: str) -> list[Benchmark]:
    """The benchmarks that a suite yields, in its order."""
    found: Iterator[Benchmark] = importlib.import_module(f"benchmarks.suites.{suite}").benchmarks()
    return list(found)


def chosen(patterns: Iterable[str], suite: str) -> list[Benchmark]:
    """The benchmarks of a suite whose names match a pattern, or that lie below one; all without patterns."""
    patterns = list(patterns)

    def matches(name: str) -> bool:
        return not patterns or any(fnmatch.fnmatchcase(name, one) or name.startswith(f"{one.rstrip('/')}/") for one in patterns)

    return [one for one in benchmarks_of(suite) if matches(one.name)]
