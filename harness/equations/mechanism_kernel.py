"""float64 accelerations and terms of a mechanism, each state in the chart that is most regular there."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.arrays import Array
from harness.equations.kernels import Float64Kernel, float64_kernel, heyoka_expressions
from harness.equations.program import OUTPUTS, StraightLineProgram, position_count, without_unused

if TYPE_CHECKING:
    from harness.equations.mechanism import Mechanism

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
        return np.asarray(np.nan_to_num(self.regularity(q), nan=-1.0).argmax(axis=0))

    def split(self, q: Array) -> Iterator[tuple[int, Indices]]:
        """The charts in use, each with the indices of its states; at least one chart."""
        best = self.most_regular(q)
        for chart in np.unique(best).tolist() or [0]:
            yield chart, np.flatnonzero(best == chart)

    @cached_property
    def _regularity(self) -> Any:
        import heyoka

        inputs = [heyoka.expression(f"z{i}") for i in range(len(self.programs[0].inputs))]
        outputs = []
        for program in self.programs:
            alone = StraightLineProgram(program.inputs, program.instructions, {"regularity": program.outputs["regularity"]})
            outputs += heyoka_expressions(without_unused(alone), inputs)["regularity"]
        return heyoka.cfunc(outputs, vars=inputs[: position_count(self.programs[0])])


class MechanismKernel:
    """The float64 evaluator of one mechanism's equations at its own parameters.

    ``linear_velocity_in_body`` says in which frame the states give the linear velocity of a free joint.
    """

    def __init__(self, mechanism: Mechanism, linear_velocity_in_body: bool = False) -> None:
        self._mechanism = mechanism
        self._charts = Charts(mechanism.charts(linear_velocity_in_body))

    def accelerations(self, q: Array, v: Array, tau: Array) -> Array:
        """qdd, (n, nv), at q (n, nq), v and tau (n, nv); the time is 0."""
        inputs = self.inputs(q, v, tau)
        if len(self._charts.programs) == 1:
            return np.ascontiguousarray(self.chart(0).accelerations(inputs).T)
        found = np.empty_like(v)
        for chart, chosen in self._charts.split(q):
            found[chosen] = self.chart(chart).accelerations(np.ascontiguousarray(inputs[:, chosen])).T
        return found

    def terms(self, q: Array, v: Array, tau: Array) -> dict[str, Array]:
        """As ``Float64Kernel.terms``."""
        inputs = self.inputs(q, v, tau)
        found = {name: np.empty((*v.shape, v.shape[1]) if name == OUTPUTS[0] else v.shape) for name in OUTPUTS}
        for chart, chosen in self._charts.split(q):
            for name, term in self.chart(chart).terms(np.ascontiguousarray(inputs[:, chosen])).items():
                found[name][chosen] = term
        return found

    def chart(self, number: int) -> Float64Kernel:
        """The kernel of one chart, for the columns of ``inputs``."""
        return float64_kernel(self._charts.programs[number], self._parameters)

    def inputs(self, q: Array, v: Array, tau: Array) -> Array:
        """Columns for the charts' kernels, whole turns taken from large angles."""
        rows = [self._within_a_turn(q).T, v.T, tau.T, np.zeros((1, len(q)))]
        if self._parameters is None:
            values = np.array(self._mechanism.parameter_values, dtype=np.float64)[:, None]
            rows.append(np.broadcast_to(values, (len(values), len(q))))
        return np.ascontiguousarray(np.vstack(rows))

    @cached_property
    def _parameters(self) -> tuple[float, ...] | None:
        is_long = len(self._charts.programs[0].instructions) >= LEAST_WITH_PARAMETERS
        return self._mechanism.parameter_values if is_long else None

    def _within_a_turn(self, q: Array) -> Array:
        """Positions with whole turns taken from large angles: in a sum with another angle they would round its digits away."""
        large = np.zeros(q.shape, dtype=bool)
        large[:, self._turning] = np.abs(q[:, self._turning]) > LARGE_ANGLE
        return np.where(large, np.arctan2(np.sin(q), np.cos(q)), q) if large.any() else q

    @cached_property
    def _turning(self) -> list[int]:
        return [place for place in self._charts.programs[0].turning if place < self._mechanism.nq]
