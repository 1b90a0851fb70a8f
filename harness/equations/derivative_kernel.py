"""float64 derivatives of forward and inverse dynamics, compiled, each state in the chart that is most regular there."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.arrays import Array
from harness.equations.dynamics_derivatives import forward_dynamics_derivatives, inverse_dynamics_derivatives
from harness.equations.kernels import MOST_STRAIGHT, evaluated, symbols_of
from harness.equations.machine_code import load_heyoka
from harness.equations.mechanism_kernel import Charts
from harness.equations.program import StraightLineProgram
from harness.storage import Kept

if TYPE_CHECKING:
    from harness.equations.mechanism import Mechanism


class DerivativeKernel:
    """The derivatives of one mechanism at its own parameters; compiled on first use, and kept in the process.

    ``linear_velocity_in_body`` says in which frame the states give the linear velocity of a free joint.
    """

    def __init__(self, mechanism: Mechanism, linear_velocity_in_body: bool = False) -> None:
        self._mechanism, self._in_body = mechanism, linear_velocity_in_body
        self._charts = Charts(mechanism.charts(linear_velocity_in_body))
        self._inputs = mechanism.float64().inputs

    def forward(self, q: Array, v: Array, tau: Array, time: Array | None = None) -> Array:
        """d qdd by q, v and tau, (n, 3, nv, nv) with the rows of qdd, at q (n, nq), v and tau (n, nv), and time (n,) [s], 0 for None.

        Those by q are along the velocities, see ``harness.equations.dynamics_derivatives``.
        """
        return self._evaluate(forward_dynamics_derivatives, q, v, tau, time)

    def inverse(self, q: Array, v: Array, accelerations: Array, time: Array | None = None) -> Array:
        """d tau by q, v and accelerations, (n, 3, nv, nv) with the rows of tau; arguments as of ``forward``."""
        return self._evaluate(inverse_dynamics_derivatives, q, v, accelerations, time)

    def compiled(self, write: Callable[..., StraightLineProgram], chart: int) -> Any:
        """heyoka's function of q, v, the third vector and time, of the derivatives that ``write`` writes of a chart, by columns."""
        mechanism = self._mechanism
        key = mechanism.key, self._in_body, write.__name__, chart
        return _COMPILED.get(
            key, lambda: _compiled(write(mechanism, self._charts.programs[chart], self._in_body), mechanism.parameter_values)
        )

    def _evaluate(self, write: Callable[..., StraightLineProgram], q: Array, v: Array, third: Array, time: Array | None) -> Array:
        nv = self._mechanism.nv
        inputs, found = self._inputs(q, v, third, time)[: self._mechanism.nq + 2 * nv + 1], np.empty((len(q), 3, nv, nv))
        for chart, chosen in self._charts.split(q):
            columns = evaluated(self.compiled(write, chart), np.ascontiguousarray(inputs[:, chosen]))
            found[chosen] = columns.T.reshape(-1, 3, nv, nv).transpose(0, 1, 3, 2)
        return found


def _compiled(program: StraightLineProgram, parameters: tuple[float, ...]) -> Any:
    heyoka = load_heyoka()

    inputs, outputs = symbols_of(program, parameters)
    expressions = [expression for entries in outputs.values() for expression in entries]
    return heyoka.cfunc(expressions, vars=inputs, compact_mode=len(program.instructions) > MOST_STRAIGHT)


_COMPILED: Kept[Any] = Kept(32)
