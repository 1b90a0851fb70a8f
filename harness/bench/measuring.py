"""The measuring that all costs of a benchmark share: calls that are timed, errors at the same states, and ways that fail by themselves."""

from __future__ import annotations

import statistics
import time
import timeit
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from harness.crosscheck.tasks import Note
from harness.engines import Unsupported
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.study import sentence
from harness.truth.compare import Comparison, Flags
from harness.truth.sampling import generic_sample

Way = TypeVar("Way")
Cost = TypeVar("Cost")


@dataclass(frozen=True)
class Effort:
    """Work that measuring one way of computing something takes.

    Attributes:
        counts: numbers of states that are asked for at once. judged: states at which errors are measured. seed: of the sampled states.
        minimum_seconds: of each timing.
    """

    counts: Sequence[int]
    judged: int
    seed: int
    minimum_seconds: float

    @property
    def most(self) -> int:
        """Number of states that are sampled."""
        return max(self.judged, *self.counts)

    def states(self, mechanism: Mechanism) -> States:
        """The states that are sampled."""
        return generic_sample(mechanism, self.most, self.seed)


def cost_of_each(
    kind: Callable[..., Cost],
    ways: Iterable[Way],
    about: Callable[[Way], Mapping[str, Any]],
    cost: Callable[[Way], Iterable[Mapping[str, Any]]],
    note: Note,
) -> list[Cost]:
    """Costs of each way, of the fields that are ``about`` it and those that are measured; each is noted before.

    One that cannot do the system raises ``Unsupported``. It has one cost that says so, as has one that fails.
    """
    found: list[Cost] = []
    for way in ways:
        own = about(way)
        note(f"{own['system']}: {' of '.join(own[name] for name in ('quantity', 'method') if name in own)}")
        try:
            found += [kind(**{**own, **measured}) for measured in cost(way)]
        except Unsupported as reason:
            found.append(kind(**own, note=str(reason)))
        except Exception as error:
            # What one way raises or answers is not the others' fault.
            found.append(kind(**own, note=sentence(error), failed=True))
    return found


def measure(function: Callable[[], object], minimum_count: int, minimum_seconds: float) -> list[float]:
    """Wall times of calls of ``function`` [s] by a monotonic clock, after one call to warm up, until both minima are met.

    ``timeit`` keeps Python's garbage collector out of what is timed. What ``function`` raises is passed on.

    Source: Chen, Revels, Robust benchmarking in noisy environments, IEEE HPEC (2016): the noise of a machine only ever adds
    time, so the fastest call is reported beside the median.
    """
    function()
    timer = timeit.Timer(function, timer=time.perf_counter)
    seconds: list[float] = []
    total = 0.0
    while len(seconds) < minimum_count or total < minimum_seconds:
        seconds.append(timer.timeit(1))
        total += seconds[-1]
    return seconds


def shared_fields(comparison: Comparison, certified: Flags, times: Sequence[float], count: int, remark: str) -> dict[str, Any]:
    """Common fields of costs of accelerations and of other quantities, by their names.

    ``comparison`` and ``certified`` are of the states at which errors are measured, ``times`` [s] of calls for ``count`` states each.
    """
    n, decided = len(certified), int(certified.sum())
    backward, relative = comparison.known("backward_error"), comparison.known("relative_error")
    remarks = [remark]
    if decided < n:
        remarks.append(f"{n - decided} of {n} states are undecided")
    if len(backward) < decided:
        remarks.append(f"{decided - len(backward)} of {n} answers are not finite")
    return {
        "seconds_per_state": statistics.median(times) / count,
        "fastest": min(times) / count,
        "slowest": max(times) / count,
        "repetitions": len(times),
        "backward_error": max(backward.tolist(), default=None),
        "median_backward_error": float(np.median(backward)) if len(backward) else None,
        "relative_error": max(relative.tolist(), default=None),
        "note": "; ".join(filter(None, remarks)),
    }
