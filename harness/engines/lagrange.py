"""The harness's own float64 kernel of the equations of motion, judged like any other engine."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines import EQUATIONS, Terms
from harness.equations.kernels import Float64Kernel
from harness.equations.mechanism import Mechanism
from harness.equations.program import OUTPUTS, StraightLineProgram
from harness.equations.states import States
from harness.models.model_file import ModelFile

# Half an ulp of a larger angle [rad] hides what taking turns from it rounds.
LARGE_ANGLE = 64.0


class LagrangeModel:
    """A mechanism's float64 kernels, each state in the chart that is most regular there."""

    def __init__(self, mechanism: Mechanism) -> None:
        self._mechanism = mechanism
        self._charts = [_kernel(program) for program in mechanism.charts(linear_velocity_in_body=False)]

    def loaded(self) -> None:
        return None

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        inputs = self._mechanism.inputs(States.at(self._within_a_turn(q), v, tau))
        if len(self._charts) == 1:
            return np.ascontiguousarray(self._charts[0].accelerations(inputs).T)
        accelerations = np.empty_like(v)
        for chart, chosen in self._chosen(inputs):
            accelerations[chosen] = chart.accelerations(np.ascontiguousarray(inputs[:, chosen])).T
        return accelerations

    def terms(self, q: Array, v: Array, tau: Array) -> Terms:
        inputs = self._mechanism.inputs(States.at(self._within_a_turn(q), v, tau))
        mass, velocity, gravity, passive = np.empty((*v.shape, v.shape[1])), np.empty_like(v), np.empty_like(v), np.empty_like(v)
        for chart, chosen in self._chosen(inputs):
            terms = chart.terms(np.ascontiguousarray(inputs[:, chosen]))
            mass[chosen], velocity[chosen], gravity[chosen], passive[chosen] = (terms[name] for name in OUTPUTS)
        return Terms(mass, velocity, gravity, passive, np.array(tau))

    def _chosen(self, inputs: Array) -> Iterator[tuple[Float64Kernel, np.ndarray[Any, np.dtype[np.bool_]]]]:
        """Each chart with the states at which it is the most regular one."""
        best = np.argmax([chart.regularity(inputs) for chart in self._charts], axis=0)
        for number, chart in enumerate(self._charts):
            yield chart, best == number

    def _within_a_turn(self, q: Array) -> Array:
        """Positions with whole turns taken from large angles: in a sum with another angle they would round its digits away."""
        turning = [place for place in self._charts[0].program.turning if place < self._mechanism.nq]
        large = np.zeros(q.shape, dtype=bool)
        large[:, turning] = np.abs(q[:, turning]) > LARGE_ANGLE
        return np.where(large, np.arctan2(np.sin(q), np.cos(q)), q) if large.any() else q


# The last few: mechanisms that differ in parameter values alone share their program, and one kernel.
_KERNELS: deque[Float64Kernel] = deque(maxlen=8)


def _kernel(program: StraightLineProgram) -> Float64Kernel:
    """The kernel of ``program``, compiled once for as long as it is among the last few."""
    for kernel in _KERNELS:
        if kernel.program is program:
            return kernel
    _KERNELS.append(Float64Kernel(program))
    return _KERNELS[-1]


class LagrangeEngine:
    requires = ("heyoka", "heyoka")
    formats = (EQUATIONS,)

    def load(self, source: ModelFile | Mechanism, joints: Sequence[str], gravity: float) -> LagrangeModel:
        if not isinstance(source, Mechanism):
            raise TypeError(f"lagrange takes equations, not a {type(source).__name__}")
        return LagrangeModel(source)


ENGINE = LagrangeEngine()
