"""Cost and error of every way of computing accelerations, on one system and over the sizes of a family.

Cost is per state and takes in neither loading nor conversion; error is the backward error against the
certified reference at the same states; where an engine documents that it solves another problem, against that one.

``harness.certify.compare`` says what an error is.
"""

from __future__ import annotations

import statistics
import time
import timeit
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from harness.bench.findings import Judged, findings
from harness.bench.methods import Method
from harness.certify.certified import Flags
from harness.certify.compare import Comparison, compare
from harness.certify.quantities.accelerations import AccelerationTruth
from harness.certify.reference import Reference
from harness.certify.sampling import generic_sample
from harness.crosscheck.scene import Scene
from harness.crosscheck.tasks import Note
from harness.engines import Unsupported
from harness.equations.states import States
from harness.library import Library
from harness.results.benchmark import AccelerationCost, EngineFinding, Growth
from harness.study import sentence

MINIMUM_COUNT = 5
FAMILY = "chain"
# Where a state costs this many times what the cheapest costs, at most half is the call's own.
HIDDEN_BELOW = 2.0
FEWEST_SIZES = 2
FEWEST_STATES = 64


def acceleration_costs(
    scene: Scene, methods: Sequence[Method], count: int, seed: int, minimum_seconds: float, note: Note
) -> tuple[list[AccelerationCost], list[EngineFinding]]:
    """One measurement per method, in their order, at up to ``count`` sampled states each; and what engines get wrong.

    A method that cannot do the system, or that fails, has an entry with the reason as its note. ``minimum_seconds`` is how long each
    method is timed at least.
    """
    mechanism = scene.mechanism
    states = generic_sample(mechanism, count, seed)
    references = References(states)
    costs: list[AccelerationCost] = []
    judged: list[Judged] = []
    for method in methods:
        note(f"{mechanism.name}: {method.name}")
        try:
            prepared = method.prepare(scene, states[: method.most_states])
            times = measure(prepared.compute, MINIMUM_COUNT, minimum_seconds)
            rigid = AccelerationTruth(mechanism, method.linear_velocity_in_body and bool(mechanism.charts_in_body))
            reference = references.of(prepared.truth or rigid, method.most_states)
            one = Judged(method, prepared, reference, compare(reference, prepared.accelerations()))
            cost = _cost(mechanism.name, one, times)
            if prepared.truth is not None:
                from_rigid = compare(references.of(rigid, method.most_states), prepared.accelerations()).known("relative_error")
                cost = replace(cost, from_rigid=float(np.median(from_rigid)) if len(from_rigid) else None)
            costs.append(cost)
            judged.append(one)
        except Unsupported as reason:
            costs.append(_missing(mechanism.name, method, str(reason)))
        except Exception as error:
            # What one method raises or answers is not the others' fault.
            costs.append(_missing(mechanism.name, method, sentence(error), failed=True))
    return costs, findings(mechanism.name, judged)


class References:
    """The truths of methods at the same states, each certified once."""

    def __init__(self, states: States) -> None:
        self._states = states
        self._found: dict[AccelerationTruth, Reference] = {}

    def of(self, truth: AccelerationTruth, most_states: int | None) -> Reference:
        """The truth at the states, or at the first so many of them."""
        if truth not in self._found:
            self._found[truth] = truth.kernel.evaluate(self._states)
        return self._found[truth][:most_states]


def _cost(system: str, one: Judged, times: Sequence[float]) -> AccelerationCost:
    n = len(one.reference)
    measured = shared_fields(one.comparison, one.reference.certified, times, n, one.prepared.note)
    return AccelerationCost(system=system, method=one.method.name, states=n, loop=one.method.loop, **measured)


def shared_fields(comparison: Comparison, certified: Flags, times: Sequence[float], count: int, remark: str) -> dict[str, Any]:
    """What costs of accelerations and of other quantities have in common, by the names of their fields.

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


def _missing(system: str, method: Method, why: str, failed: bool = False) -> AccelerationCost:
    return AccelerationCost(system=system, method=method.name, states=0, seconds_per_state=None, loop=method.loop, note=why, failed=failed)


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


def growth(
    library: Library, methods: Sequence[Method], count: int, seed: int, minimum_seconds: float, note: Note, sizes: Sequence[int]
) -> list[Growth]:
    """Cost and error of each method over ``sizes`` of ``FAMILY``, in one process.

    ``count`` is the number of states at size 1; larger members are given fewer.
    """
    measured = []
    for size in sizes:
        note(f"{FAMILY}_{size}: derivation")
        scene = Scene.of(library, f"{FAMILY}_{size}")
        measured.append(acceleration_costs(scene, methods, max(FEWEST_STATES, count // size), seed, minimum_seconds, note)[0])
        if failed := next((cost for cost in measured[-1] if cost.failed), None):
            raise RuntimeError(f"{failed.method}: {failed.note}")
    return [
        Growth(
            family=FAMILY,
            method=method.name,
            sizes=list(sizes),
            seconds_per_state=[cost.seconds_per_state for cost in costs],
            backward_errors=[cost.backward_error for cost in costs],
            # The noise of a machine only adds, and at a few sizes one outlier would decide.
            exponent=exponent(sizes, [cost.fastest for cost in costs]),
            expected=method.growth,
        )
        for method, costs in zip(methods, zip(*measured, strict=True), strict=True)
    ]


def exponent(sizes: Sequence[int], seconds: Sequence[float | None]) -> float | None:
    """Slope of log seconds over log size by least squares, where the cost of a call no longer hides it.

    Those are the largest sizes at each of which a state costs at least ``HIDDEN_BELOW`` times what it costs
    at the cheapest; None where there are fewer than two.
    """
    known = [(size, cost) for size, cost in zip(sizes, seconds, strict=True) if cost]
    if not known:
        return None
    least = HIDDEN_BELOW * min(cost for _, cost in known)
    hidden = [place for place, (_, cost) in enumerate(known) if cost < least]
    upper = known[hidden[-1] + 1 :] if hidden else known
    if len(upper) < FEWEST_SIZES:
        return None
    logarithms = np.log(np.array(upper))
    return float(np.polyfit(logarithms[:, 0], logarithms[:, 1], 1)[0])
