"""float64 accelerations, terms and derivatives of a mechanism, compiled, each state in the chart that is most regular there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.arrays import Array
from harness.programs.kernels import Float64Kernel, float64_kernel, symbols_of
from harness.programs.machine_code import load_heyoka
from harness.programs.program import StraightLineProgram, position_count, without_unused

if TYPE_CHECKING:
    from harness.programs.mechanisms.mechanism import Mechanism


from collections.abc import Callable
from typing import TYPE_CHECKING

from harness.programs.kernels import MOST_STRAIGHT, evaluated
from harness.programs.mechanisms.dynamics_derivatives import forward_dynamics_derivatives, inverse_dynamics_derivatives
from harness.storage import Kept

if TYPE_CHECKING:
    from harness.programs.mechanisms.mechanism import Mechanism

# Half an ulp of a larger angle [rad] hides what taking turns from it rounds.
LARGE_ANGLE = 64.0
# Instructions from which the parameters are compiled into the machine code. A shorter program is fast enough without, and
# mechanisms that differ in parameter values alone then share its kernel.
LEAST_WITH_PARAMETERS = 200
Indices = np.ndarray[Any, np.dtype[np.int64]]


class Charts:
    """The choice among the charts of one mechanism, which is by positions alone; compiled on first use."""

    def __init__(self, programs: tuple[StraightLineProgram, ...]) -> None:
        self.programs = programs

    def regularity(self, q: Array) -> Array:
        """|regularity| of each chart at q (n, nq), (number of charts, n): 0 where it is singular; not finite at no rotation at all."""
        if len(self.programs) == 1:
            return np.ones((1, len(q)))
        return np.asarray(np.abs(self._regularity(np.ascontiguousarray(q.T, dtype=np.float64))))

    def most_regular(self, q: Array) -> Indices:
        """The chart for each state, (n,)."""
        if len(self.programs) == 1:
            return np.zeros(len(q), dtype=np.int64)
        highest, *others = np.fmax(self.regularity(q), -1.0)
        best = np.zeros(len(q), dtype=np.int64)
        for chart, regularity in enumerate(others, 1):
            best[regularity > highest] = chart
            highest = np.maximum(highest, regularity)
        return best

    def at(self, q: Array) -> int:
        """The chart for one state, q (nq,)."""
        return int(self.most_regular(q[None])[0]) if len(self.programs) > 1 else 0

    def split(self, q: Array) -> Iterator[tuple[int, Indices]]:
        """The charts in use, each with the indices of its states; at least one chart."""
        best = self.most_regular(q)
        for chart in range(len(self.programs)):
            chosen = np.flatnonzero(best == chart)
            if len(chosen) or not (chart or len(q)):
                yield chart, chosen

    @cached_property
    def _regularity(self) -> Any:
        heyoka = load_heyoka()

        alone = [without_unused(replace(program, outputs={"regularity": program.outputs["regularity"]})) for program in self.programs]
        inputs, _ = symbols_of(alone[0])
        outputs = [symbols_of(program)[1]["regularity"][0] for program in alone]
        return heyoka.cfunc(outputs, vars=inputs[: position_count(self.programs[0])])


class MechanismKernel:
    """The float64 evaluator of one mechanism's equations at its own parameters.

    ``linear_velocity_in_body`` says in which frame the states give the linear velocity of a free joint.
    """

    def __init__(self, mechanism: Mechanism, linear_velocity_in_body: bool = False) -> None:
        self._mechanism = mechanism
        self._programs = mechanism.charts(linear_velocity_in_body)

    def accelerations(self, q: Array, v: Array, tau: Array, time: Array | None = None) -> Array:
        """qdd, (n, nv), at q (n, nq), v and tau (n, nv), and time (n,) [s], 0 for None."""
        return np.ascontiguousarray(self.compiled.accelerations(self.inputs(q, v, tau, time)).T)

    def terms(self, q: Array, v: Array, tau: Array) -> dict[str, Array]:
        """As ``Float64Kernel.terms``."""
        return self.compiled.terms(self.inputs(q, v, tau))

    @property
    def compiled(self) -> Float64Kernel:
        """The kernel for the columns of ``inputs``."""
        program, *others = self._programs
        return float64_kernel(program, self._parameters, tuple(others))

    def inputs(self, q: Array, v: Array, tau: Array, time: Array | None = None) -> Array:
        """Columns for the kernel, whole turns taken from large angles."""
        nq, nv = q.shape[1], v.shape[1]
        values = () if self._parameters is not None else self._mechanism.parameter_values
        columns = np.empty((nq + 2 * nv + 1 + len(values), len(q)))
        columns[:nq], columns[nq : nq + nv], columns[nq + nv : nq + 2 * nv], columns[nq + 2 * nv] = (
            q.T,
            v.T,
            tau.T,
            0.0 if time is None else time,
        )
        columns[nq + 2 * nv + 1 :] = np.reshape(values, (-1, 1))
        # In a sum with another angle a large one would round its digits away.
        if (np.abs(columns[:nq]) > LARGE_ANGLE).any():
            for place in self._turning:
                angle, large = columns[place], np.abs(columns[place]) > LARGE_ANGLE
                angle[large] = np.arctan2(np.sin(angle[large]), np.cos(angle[large]))
        return columns

    @cached_property
    def _parameters(self) -> tuple[float, ...] | None:
        is_long = len(self._programs[0].instructions) >= LEAST_WITH_PARAMETERS
        return self._mechanism.parameter_values if is_long else None

    @cached_property
    def _turning(self) -> list[int]:
        return [place for place in self._programs[0].turning if place < self._mechanism.nq]


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

        Those by q are along the velocities, see ``harness.programs.mechanisms.dynamics_derivatives``.
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
