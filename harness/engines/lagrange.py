"""The harness's own float64 kernel of the equations of motion, judged like any other engine."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from harness.engines import EQUATIONS
from harness.kernels import Array, Float64Kernel
from harness.mechanism import Mechanism
from harness.models import ModelFile
from harness.states import States


class LagrangeModel:
    """A mechanism's float64 kernel."""

    def __init__(self, mechanism: Mechanism) -> None:
        self._mechanism = mechanism
        self._kernel = Float64Kernel(mechanism.program)

    def loaded(self) -> None:
        return None

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        inputs = self._mechanism.inputs(States.at(q, v, tau))
        return np.ascontiguousarray(self._kernel.accelerations(inputs).T)


class LagrangeEngine:
    requires = ("heyoka", "heyoka")
    formats = (EQUATIONS,)

    def load(self, source: ModelFile | Mechanism, joints: Sequence[str], gravity: float) -> LagrangeModel:
        if not isinstance(source, Mechanism):
            raise TypeError(f"lagrange takes equations, not a {type(source).__name__}")
        return LagrangeModel(source)


ENGINE = LagrangeEngine()
