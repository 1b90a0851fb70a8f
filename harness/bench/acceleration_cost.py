"""Cost and error of every way of computing accelerations on one system.

Cost is per state and takes in neither loading nor conversion; error is the backward error against the
certified reference at the same states; where an engine documents that it solves another problem, against that one.

``harness.truth.compare`` says what an error is.

A way is a finding of its engine where answers are not finite, or further from their truth than data roundoff explains, and the engine
alone can reproduce it. What it reads as its own residual is compared with what a way that is right reads at the same states.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.bench.measuring import Effort, cost_of_each, measure, shared_fields
from harness.bench.methods import Method, Prepared
from harness.crosscheck.scene import Scene
from harness.crosscheck.stages import Truths
from harness.crosscheck.tasks import Note
from harness.results.benchmark import AccelerationCost, EngineFinding
from harness.truth.compare import Certified, Comparison, compare
from harness.truth.quantities.accelerations import AccelerationTruth
from harness.verdict import AGREEMENT, Verdict

# Residuals at the same states tell two ways apart where their medians differ by more than that factor.
TELLING = 2.0


@dataclass(frozen=True)
class Judged:
    """One way of computing accelerations after its answers were compared at states with ``reference``."""

    method: Method
    prepared: Prepared
    reference: Certified
    comparison: Comparison

    @property
    def is_right(self) -> bool:
        """True where every answer agrees."""
        return bool((self.comparison.verdicts == Verdict.AGREES.value).all())


def findings(system: str, judged: Sequence[Judged]) -> list[EngineFinding]:
    """What is wrong among the ways on one system, each with a program that shows it."""
    residuals = {one.method.name: one.prepared.residual() for one in judged if one.prepared.residual is not None}
    right = [residuals[one.method.name] for one in judged if one.is_right and one.method.name in residuals]
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
    """What the engine's own residual says, in words."""
    own = f"the engine's own residual reads {_range(residual)}"
    for other in right:
        low, high = sorted([float(np.median(residual)), float(np.median(other))])
        if high <= TELLING * low:
            return f"{own}, and {_range(other)} where the answers are right"
    return own


def _range(values: Array) -> str:
    return f"{values.min():.3g} to {values.max():.3g}"


MINIMUM_COUNT = 5


def acceleration_costs(
    scene: Scene, methods: Sequence[Method], effort: Effort, note: Note
) -> tuple[list[AccelerationCost], list[EngineFinding]]:
    """One measurement per method, in their order, at as many sampled states as it takes; and what engines get wrong.

    A method that cannot do the system, or that fails, has an entry with the reason as its note.
    """
    mechanism, states = scene.mechanism, effort.states(scene.mechanism)
    truths = Truths(states)
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
