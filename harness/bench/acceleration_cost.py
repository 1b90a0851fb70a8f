"""Cost and error of every way of computing accelerations, on one system and over the sizes of a family.

Cost is per state and takes in neither loading nor conversion; error is the backward error against the
certified reference at the same states.

``harness.certify.compare`` says what an error is.
"""

from __future__ import annotations

import statistics
import time
import timeit
from collections.abc import Callable, Sequence

import numpy as np

from harness.bench.methods import Method
from harness.certify.compare import compare
from harness.certify.reference import Reference
from harness.certify.sampling import generic_sample
from harness.crosscheck.scene import Scene
from harness.crosscheck.tasks import Note
from harness.crosscheck.truth import reference_kernel
from harness.engines import Unsupported
from harness.equations.states import States
from harness.library import Library
from harness.results.benchmark import AccelerationCost, Growth
from harness.study import sentence

MINIMUM_COUNT = 5
FAMILY = "chain"
# Where a state costs this many times what the cheapest costs, at most half is the call's own.
HIDDEN_BELOW = 2.0
FEWEST_SIZES = 2
FEWEST_STATES = 64


def acceleration_costs(
    scene: Scene, methods: Sequence[Method], count: int, seed: int, minimum_seconds: float, note: Note
) -> list[AccelerationCost]:
    """One measurement per method, in their order, at up to ``count`` sampled states each.

    A method that cannot do the system, or that fails, has an entry with the reason as its note. ``minimum_seconds`` is how long each
    method is timed at least.
    """
    mechanism = scene.mechanism
    states = generic_sample(mechanism, count, seed)
    references: dict[bool, Reference] = {}
    costs = []
    for method in methods:
        note(f"{mechanism.name}: {method.name}")
        in_body = method.linear_velocity_in_body and bool(mechanism.charts_in_body)
        if in_body not in references:
            references[in_body] = reference_kernel(mechanism, in_body).evaluate(states)
        chosen = slice(method.most_states)
        try:
            costs.append(_cost(method, scene, states[chosen], references[in_body][chosen], minimum_seconds))
        except Exception as error:
            # What one method raises or answers is not the others' fault.
            costs.append(_missing(mechanism.name, method, sentence(error), failed=True))
    return costs


def _cost(method: Method, scene: Scene, states: States, reference: Reference, minimum_seconds: float) -> AccelerationCost:
    name, n = scene.mechanism.name, len(states)
    try:
        prepared = method.prepare(scene, states)
    except Unsupported as reason:
        return _missing(name, method, str(reason))
    times = measure(prepared.compute, MINIMUM_COUNT, minimum_seconds)
    comparison = compare(reference, prepared.accelerations())
    backward, relative = comparison.known("backward_error"), comparison.known("relative_error")
    remarks = [prepared.note]
    undecided, useless = n - int(reference.certified.sum()), int(reference.certified.sum()) - len(backward)
    if undecided:
        remarks.append(f"{undecided} of {n} states are undecided")
    if useless:
        remarks.append(f"{useless} of {n} answers are not finite")
    return AccelerationCost(
        system=name,
        method=method.name,
        states=n,
        seconds_per_state=statistics.median(times) / n,
        fastest=min(times) / n,
        slowest=max(times) / n,
        repetitions=len(times),
        backward_error=max(backward.tolist(), default=None),
        median_backward_error=float(np.median(backward)) if len(backward) else None,
        relative_error=max(relative.tolist(), default=None),
        note="; ".join(filter(None, remarks)),
        loop=method.loop,
    )


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
        measured.append(acceleration_costs(scene, methods, max(FEWEST_STATES, count // size), seed, minimum_seconds, note))
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
