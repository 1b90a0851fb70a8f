"""The measuring that all costs of a benchmark share, and cost and error of every way of computing accelerations on one system.

Calls are timed, errors are at the same states, and a way that fails does so by itself. Cost is per state and takes in neither loading
nor conversion. Error is the backward error against the certified reference; where an engine documents that it solves another problem,
against that one. ``harness.truth.compare`` says what an error is.

A way is a finding of its engine where answers are not finite, or further from their truth than data roundoff explains, and the engine
alone can reproduce it. What it reads as its own residual is compared with what a way that is right reads at the same states.
"""

from __future__ import annotations

import statistics
import time
import timeit
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from harness.arrays import Array
from harness.bench.methods import Method, Prepared
from harness.crosscheck.scene import Scene
from harness.crosscheck.stages import Truths
from harness.engines import Unsupported
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.results.benchmark import AccelerationCost, EngineFinding
from harness.study import Note, sentence
from harness.truth.compare import Certified, Comparison, Flags, compare
from harness.truth.quantities.accelerations import AccelerationTruth
from harness.truth.sampling import generic_sample
from harness.verdict import AGREEMENT, Verdict

Way = TypeVar("Way")
Cost = TypeVar("Cost")
MINIMUM_COUNT = 5
# Residuals at the same states tell two ways apart where their medians differ by more than that factor.
TELLING = 2.0


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


@dataclass(frozen=True)
class Judged:
    """One way of computing accelerations after its answers were compared at states with ``reference``."""

    method: Method
    prepared: Prepared
    reference: Certified
    comparison: Comparison


def findings(system: str, judged: Sequence[Judged]) -> list[EngineFinding]:
    """Faults among the ways on one system, each with a program that shows it."""
    residuals = {one.method.name: one.prepared.residual() for one in judged if one.prepared.residual is not None}
    agreeing = [one.method.name for one in judged if (one.comparison.verdicts == Verdict.AGREES.value).all()]
    right = [residuals[name] for name in agreeing if name in residuals]
    return [finding for one in judged for finding in _of(system, one, residuals.get(one.method.name), right)]


def _of(system: str, one: Judged, residual: Array | None, right: Sequence[Array]) -> Iterator[EngineFinding]:
    if one.prepared.reproducer is None:
        return
    errors = one.comparison.backward_error
    decided = one.reference.certified
    useless, wrong = decided & ~np.isfinite(errors), decided & (errors > AGREEMENT)
    if not (useless.any() or wrong.any()):
        return
    n = int(decided.sum())
    if useless.any():
        index = int(np.flatnonzero(useless)[0])
        statement = f"{int(useless.sum())} of {n} answers are not finite, and no exception says so"
    else:
        index = int(np.argmax(np.where(wrong, errors, -np.inf)))
        relative = one.comparison.relative_error[index]
        far = f"{int(wrong.sum())} of {n} answers are further from their truth than data roundoff explains"
        statement = f"{far}, by up to {errors[index]:.3g} data roundoffs ({relative:.2g} of their size)"
        if residual is not None:
            statement += f"; {_said(residual[decided], [each[decided] for each in right])}"
    yield EngineFinding(
        system=system,
        method=one.method.name,
        statement=statement,
        backward_error=None if useless.any() else float(errors[index]),
        reproducer=one.prepared.reproducer(index, one.reference.high[index]),
    )


def _said(residual: Array, right: Sequence[Array]) -> str:
    """The engine's own residual in words."""
    own = f"the engine's own residual reads {_range(residual)}"
    for other in right:
        low, high = sorted([float(np.median(residual)), float(np.median(other))])
        if high <= TELLING * low:
            return f"{own}, and {_range(other)} where the answers are right"
    return own


def _range(values: Array) -> str:
    return f"{values.min():.3g} to {values.max():.3g}"


def acceleration_costs(
    scene: Scene, methods: Sequence[Method], effort: Effort, note: Note
) -> tuple[list[AccelerationCost], list[EngineFinding]]:
    """One measurement per method, in their order, at as many sampled states as it takes; and what engines get wrong.

    A method that cannot do the system, or that fails, has an entry with the reason as its note.
    """
    mechanism, states = scene.mechanism, effort.states(scene.mechanism)
    truths = Truths(states, share=0.0)
    judged: list[Judged] = []

    def cost(method: Method) -> Iterator[dict[str, Any]]:
        def reference(truth: AccelerationTruth) -> Certified:
            return truths.of(truth)[: method.most_states]

        prepared: Prepared = method.prepare(scene, states[: method.most_states])
        times = measure(prepared.compute, MINIMUM_COUNT, effort.minimum_seconds)
        rigid = AccelerationTruth(mechanism, method.linear_velocity_in_body and bool(mechanism.charts_in_body))
        own = reference(prepared.truth or rigid)
        one = Judged(method, prepared, own, compare(own, prepared.accelerations()))
        found = {"states": len(own), **shared_fields(one.comparison, own.certified, times, len(own), prepared.note)}
        if prepared.truth is not None:
            from_rigid = compare(reference(rigid), prepared.accelerations()).known("relative_error")
            found["from_rigid"] = float(np.median(from_rigid)) if len(from_rigid) else None
        judged.append(one)
        yield found

    def about(method: Method) -> dict[str, Any]:
        return {"system": mechanism.name, "method": method.name, "loop": method.loop, "states": 0, "seconds_per_state": None}

    return cost_of_each(AccelerationCost, methods, about, cost, note), findings(mechanism.name, judged)
