"""Cost and error of every way of computing accelerations on one system.

Cost is per state and takes in neither loading nor conversion; error is the backward error against the
certified reference at the same states; where an engine documents that it solves another problem, against that one.

``harness.certify.compare`` says what an error is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from harness.bench.findings import Judged, findings
from harness.bench.measuring import Effort, cost_of_each, measure, shared_fields
from harness.bench.methods import Method
from harness.certify.certified import Certified
from harness.certify.compare import compare
from harness.certify.quantities.accelerations import AccelerationTruth
from harness.certify.sampling import generic_sample
from harness.crosscheck.scene import Scene
from harness.crosscheck.stages import Truths
from harness.crosscheck.tasks import Note
from harness.results.benchmark import AccelerationCost, EngineFinding

MINIMUM_COUNT = 5


def acceleration_costs(
    scene: Scene, methods: Sequence[Method], effort: Effort, note: Note
) -> tuple[list[AccelerationCost], list[EngineFinding]]:
    """One measurement per method, in their order, at as many sampled states as it takes; and what engines get wrong.

    A method that cannot do the system, or that fails, has an entry with the reason as its note.
    """
    mechanism = scene.mechanism
    states = generic_sample(mechanism, effort.most, effort.seed)
    truths = Truths(states)
    judged: list[Judged] = []

    def cost(method: Method) -> Iterator[AccelerationCost]:
        def reference(truth: AccelerationTruth) -> Certified:
            return truths.of(truth)[: method.most_states]

        prepared = method.prepare(scene, states[: method.most_states])
        times = measure(prepared.compute, MINIMUM_COUNT, effort.minimum_seconds)
        rigid = AccelerationTruth(mechanism, method.linear_velocity_in_body and bool(mechanism.charts_in_body))
        own = reference(prepared.truth or rigid)
        one = Judged(method, prepared, own, compare(own, prepared.accelerations()))
        found = _cost(mechanism.name, one, times)
        if prepared.truth is not None:
            from_rigid = compare(reference(rigid), prepared.accelerations()).known("relative_error")
            found = replace(found, from_rigid=float(np.median(from_rigid)) if len(from_rigid) else None)
        judged.append(one)
        yield found

    def missing(method: Method, why: str, failed: bool) -> AccelerationCost:
        about: dict[str, Any] = {"system": mechanism.name, "method": method.name, "loop": method.loop}
        return AccelerationCost(**about, states=0, seconds_per_state=None, note=why, failed=failed)

    costs = cost_of_each([(f"{mechanism.name}: {method.name}", method) for method in methods], cost, missing, note)
    return costs, findings(mechanism.name, judged)


def _cost(system: str, one: Judged, times: Sequence[float]) -> AccelerationCost:
    n = len(one.reference)
    measured = shared_fields(one.comparison, one.reference.certified, times, n, one.prepared.note)
    return AccelerationCost(system=system, method=one.method.name, states=n, loop=one.method.loop, **measured)
