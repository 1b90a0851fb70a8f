"""The harness's own float64 kernel of the equations of motion, judged like any other engine."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from harness.engines import EQUATIONS
from harness.kernels import Array, Float64Kernel
from harness.mechanism import Mechanism
from harness.models import ModelFile
from harness.program import StraightLineProgram
from harness.states import States


class LagrangeModel:
    """A mechanism's float64 kernels, each state in the chart that is most regular there."""

    def __init__(self, mechanism: Mechanism) -> None:
        self._mechanism = mechanism
        self._charts = [_kernel(program) for program in mechanism.charts(linear_velocity_in_body=False)]

    def loaded(self) -> None:
        return None

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        inputs = self._mechanism.inputs(States.at(q, v, tau))
        if len(self._charts) == 1:
            return np.ascontiguousarray(self._charts[0].accelerations(inputs).T)
        best = np.argmax([chart.regularity(inputs) for chart in self._charts], axis=0)
        accelerations = np.empty_like(v)
        for number, chart in enumerate(self._charts):
            chosen = best == number
            accelerations[chosen] = chart.accelerations(np.ascontiguousarray(inputs[:, chosen])).T
        return accelerations


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
