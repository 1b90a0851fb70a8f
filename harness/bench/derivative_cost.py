"""Error and cost of every way of computing derivatives by q and v, on one system: errors over the steps of differences, and the cost of
states by how many are asked for at once.

An error is relative: the length of the error of a matrix over the length of the matrix. Columns have the norm by which
``harness.truth.quantities.derivatives`` judges them, each taken at the unit of its coordinate that moves with the kinetic energy of
one half joule. A step is best where the median over the states is least.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.bench.measuring import Effort, cost_of_each, measure
from harness.bench.methods import DerivativeMethod
from harness.crosscheck.scene import Scene
from harness.crosscheck.tasks import Note
from harness.programs.states import States
from harness.results.benchmark import DerivativeCost
from harness.truth.compare import Certified
from harness.truth.quantities.derivatives import FORWARD, INVERSE, DerivativeTruth
from harness.truth.sampling import generic_sample

# States at which errors are measured.
STATES = 32
MINIMUM_COUNT = 3


@dataclass(frozen=True)
class _Truth:
    """Derivatives that methods of one kind are held against; ``weights``, (n, nv), are of the columns by q and by v."""

    truth: DerivativeTruth
    certified: Certified
    weights: Array

    @classmethod
    def of(cls, scene: Scene, is_inverse: bool, in_body: bool, states: States) -> _Truth:
        truth = DerivativeTruth(INVERSE if is_inverse else FORWARD, scene.mechanism, in_body)
        certified = truth.evaluate(states)
        factor = np.linalg.inv(certified.norm_factor).transpose(0, 2, 1) if is_inverse else certified.norm_factor
        return cls(truth, certified, 1 / np.linalg.norm(factor, axis=1))

    def errors(self, answers: Array) -> Array:
        """Relative errors, (n,), the larger one of both matrices, of answers (n, 2, nv, nv); of states that are certified alone."""
        nv = answers.shape[3]
        columns = np.ascontiguousarray(answers.transpose(0, 1, 3, 2)).reshape(len(answers), 2 * nv, nv)
        high, low = (values[:, : 2 * nv] for values in (self.certified.high, self.certified.low))
        error, size = (self._lengths(values) for values in ((columns - high) - low, high))
        # What is zero, as what friction does where there is none, is no yardstick.
        relative = np.divide(error, size, out=np.zeros_like(error), where=size > 0)
        return np.asarray(relative.max(axis=1)[self.certified.certified])

    def _lengths(self, columns: Array) -> Array:
        """(n, 2) lengths of the matrices by q and by v, whose columns are (n, 2 nv, nv)."""
        lengths = np.linalg.norm(columns @ self.certified.norm_factor.transpose(0, 2, 1), axis=2).reshape(len(columns), 2, -1)
        return np.asarray(np.linalg.norm(lengths * self.weights[:, None], axis=2))


def derivative_costs(scene: Scene, methods: Sequence[DerivativeMethod], effort: Effort, note: Note) -> list[DerivativeCost]:
    """One measurement per method, in their order: errors over the steps, and costs at the best step.

    A method that cannot do the system, or that fails, has an entry with the reason as its note.
    """
    mechanism = scene.mechanism
    states = generic_sample(mechanism, effort.most, effort.seed)
    few = states[: effort.judged]
    truths: dict[tuple[bool, bool], _Truth] = {}

    def cost(method: DerivativeMethod) -> Iterator[DerivativeCost]:
        of = method.is_inverse, method.linear_velocity_in_body and bool(mechanism.charts_in_body)
        if of not in truths:
            truths[of] = _Truth.of(scene, *of, few)
        truth, third = truths[of], truths[of].truth.third(states)
        errors = [truth.errors(method.prepare(scene, few, third[: len(few)], step)()) for step in method.steps or (0.0,)]
        medians = [float(np.median(one)) for one in errors]
        best = int(np.argmin(medians))
        step = method.steps[best] if method.steps else 0.0
        seconds = []
        for count in effort.counts:
            compute = method.prepare(scene, states[:count], third[:count], step)
            seconds.append(float(np.median(measure(compute, MINIMUM_COUNT, effort.minimum_seconds))) / count)
        yield DerivativeCost(
            **about(method),
            steps=list(method.steps),
            errors=medians,
            worst_errors=[float(one.max(initial=0.0)) for one in errors],
            best_step=step or None,
            error=medians[best],
            states=list(effort.counts),
            seconds_per_state=seconds,
        )

    def about(method: DerivativeMethod) -> dict[str, Any]:
        result = "tau" if method.is_inverse else "qdd"
        return {"system": mechanism.name, "method": method.name, "of": result, "loop": method.loop}

    def missing(method: DerivativeMethod, why: str, failed: bool) -> DerivativeCost:
        return DerivativeCost(**about(method), note=why, failed=failed)

    return cost_of_each([(f"{mechanism.name}: {method.name}", method) for method in methods], cost, missing, note)
