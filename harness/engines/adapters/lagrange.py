"""The harness's own float64 kernel of the equations of motion, judged like any other engine.

It imports nothing of the equations: the mechanism that it is handed brings the evaluator.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.arrays import Array
from harness.engines import EQUATIONS, Engine, Terms
from harness.engines.request import Request
from harness.files.model_file import ModelFile

if TYPE_CHECKING:
    from harness.programs.mechanisms.mechanism import Mechanism


class LagrangeModel:
    """A mechanism's float64 evaluator."""

    takes_time = True

    def __init__(self, mechanism: Mechanism) -> None:
        self._kernel = mechanism.float64()
        self.takes_driving = mechanism.actuation is not None

    def loaded(self) -> None:
        return None

    def forward_dynamics(self, q: Array, v: Array, tau: Array, time: Array | None = None, *driving: Array) -> Array:
        return self._kernel.accelerations(q, v, tau, time, *driving)

    def forward_dynamics_derivatives(self, q: Array, v: Array, tau: Array, time: Array | None = None) -> Array:
        return self._kernel.forward_derivatives(q, v, tau, time)

    def inverse_dynamics_derivatives(self, q: Array, v: Array, qdd: Array, time: Array | None = None) -> Array:
        return self._kernel.inverse_derivatives(q, v, qdd, time)

    def terms(self, q: Array, v: Array, tau: Array, *driving: Array) -> Terms:
        return Terms(**self._kernel.terms(q, v, tau, *driving), applied=np.array(tau))

    def bias(self, q: Array, v: Array) -> Array:
        """See ``harness.engines.interface``."""
        terms = self._kernel.terms(q, v, np.zeros_like(v))
        return np.asarray(terms["velocity"] + terms["gravity"])

    def inverse_dynamics(self, q: Array, v: Array, qdd: Array) -> Array:
        """See ``harness.engines.interface``."""
        terms = self._kernel.terms(q, v, np.zeros_like(v))
        return np.asarray(np.einsum("nij,nj->ni", terms["mass"], qdd) + terms["velocity"] + terms["gravity"] - terms["passive"])


class LagrangeEngine(Engine):
    requires = ("heyoka", "heyoka")
    optional = True
    formats = (EQUATIONS,)
    factorises_mass_matrix = True

    def load(self, source: ModelFile | Mechanism | Request, joints: Sequence[str], gravity: float) -> Any:
        if isinstance(source, ModelFile | Request):
            raise TypeError("lagrange takes equations, not a model file")
        return LagrangeModel(source)


ENGINE = LagrangeEngine()
