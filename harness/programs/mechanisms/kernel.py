"""Compiled programs of a mechanism in float64, each state in the chart that is most regular there.

``MechanismKernel`` has accelerations, terms and their derivatives, and ``EnergyKernel`` and ``LagrangianKernel`` the energies: what a
computed motion keeps, and what its dampers take. A mechanism's energy programs stand beside its equations, one for each chart, so that
certification does not pay for them. Their inputs are those of the equations; their outputs are ``energy`` (Jacobi's energy function h),
``lagrangian`` (T - V), ``kinetic`` (T), ``power`` (Q . v), one number each, ``forces`` (the nv non-conservative generalised forces Q),
and ``regularity`` where a chart can be singular. Along a motion

    dh/dt = power + tau . v - dL/dt,   the last term by explicit time.

Nothing there rests on the equations of motion that a motion was computed from, but for the mass matrix, which only measures.

Source: Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., sections 1.4 and 2.7 (energy function, equation 2.53).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.arrays import Array, Indices
from harness.programs.kernels import (
    MOST_INSTRUCTIONS_UNROLLED,
    MOST_STRAIGHT,
    Float64Kernel,
    compiled,
    evaluated,
    full_matrices,
    symbols_of,
)
from harness.programs.machine_code import load_heyoka
from harness.programs.mechanisms.dynamics_derivatives import forward_dynamics_derivatives, inverse_dynamics_derivatives
from harness.programs.program import ENERGY_OUTPUTS, StraightLineProgram, position_count, without_unused
from harness.programs.states import States
from harness.storage import Kept

if TYPE_CHECKING:
    from harness.programs.mechanisms.mechanism import Mechanism

# Half an ulp of a larger angle [rad] hides what taking turns from it rounds.
LARGE_ANGLE = 64.0
# Instructions from which the parameters are compiled into the machine code. A shorter program is fast enough without, and
# mechanisms that differ in parameter values alone then share its kernel.
LEAST_WITH_PARAMETERS = 200
_KERNELS: Kept[Float64Kernel] = Kept(64)
_COMPILED: Kept[Any] = Kept(32)


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
        """The chart for each state, (n,); of charts that are as regular the first."""
        return np.asarray(np.fmax(self.regularity(q), -1.0).argmax(axis=0))

    def at(self, q: Array) -> int:
        """The chart for one state, q (nq,)."""
        return int(self.most_regular(q[None])[0])

    def split(self, q: Array) -> Iterator[tuple[int, Indices]]:
        """The charts in use, each with the indices of its states; at least one chart."""
        best = self.most_regular(q)
        for chart in range(len(self.programs)):
            chosen = np.flatnonzero(best == chart)
            if len(chosen) or not (chart or len(q)):
                yield chart, chosen

    @cached_property
    def _regularity(self) -> Any:
        alone = [without_unused(replace(program, outputs={"regularity": program.outputs["regularity"]})) for program in self.programs]
        (inputs, _), *_ = symbols = list(map(symbols_of, alone))
        return load_heyoka().cfunc([outputs["regularity"][0] for _, outputs in symbols], vars=inputs[: position_count(self.programs[0])])


class MechanismKernel:
    """The float64 evaluator of one mechanism's equations, and of their derivatives, at its own parameters."""

    def __init__(self, mechanism: Mechanism) -> None:
        self._mechanism, self._charts = mechanism, Charts(mechanism.charts(linear_velocity_in_body=False))

    def accelerations(self, q: Array, v: Array, tau: Array, time: Array | None = None, *driving: Array) -> Array:
        """qdd, (n, nv), at q (n, nq), v and tau (n, nv), and time (n,) [s], 0 for None; ``driving`` as of ``inputs``."""
        return np.ascontiguousarray(self.compiled.accelerations(self.inputs(q, v, tau, time, *driving)).T)

    def terms(self, q: Array, v: Array, tau: Array, *driving: Array) -> dict[str, Array]:
        """As ``Float64Kernel.terms``."""
        return self.compiled.terms(self.inputs(q, v, tau, None, *driving))

    def forward_derivatives(self, q: Array, v: Array, tau: Array, time: Array | None = None) -> Array:
        """d qdd by q, v and tau, (n, 3, nv, nv) with the rows of qdd; arguments as of ``accelerations``.

        Those by q are along the velocities, see ``harness.programs.mechanisms.dynamics_derivatives``.
        """
        return self._derivatives(forward_dynamics_derivatives, q, v, tau, time)

    def inverse_derivatives(self, q: Array, v: Array, accelerations: Array, time: Array | None = None) -> Array:
        """d tau by q, v and accelerations, (n, 3, nv, nv) with the rows of tau; arguments as of ``forward_derivatives``."""
        return self._derivatives(inverse_dynamics_derivatives, q, v, accelerations, time)

    def _derivatives(self, write: Callable[..., StraightLineProgram], q: Array, v: Array, third: Array, time: Array | None) -> Array:
        nq, nv = self._mechanism.nq, self._mechanism.nv
        inputs, found = self.inputs(q, v, third, time)[: nq + 2 * nv + 1], np.empty((len(q), 3, nv, nv))
        for chart, chosen in self._charts.split(q):
            columns = evaluated(self._compiled(write, chart), np.ascontiguousarray(inputs[:, chosen]))
            found[chosen] = columns.T.reshape(-1, 3, nv, nv).transpose(0, 1, 3, 2)
        return found

    def _compiled(self, write: Callable[..., StraightLineProgram], chart: int) -> Any:
        """heyoka's function of q, v, the third vector and time, of the derivatives that ``write`` writes of a chart, by columns."""
        mechanism = self._mechanism

        def make() -> Any:
            program = write(mechanism, self._charts.programs[chart])
            inputs, outputs = symbols_of(program, mechanism.parameter_values)
            return compiled(inputs, outputs, outputs, len(program.instructions) > MOST_STRAIGHT)

        return _COMPILED.get((mechanism.key, write.__name__, chart), make)

    @property
    def compiled(self) -> Float64Kernel:
        """The kernel for the columns of ``inputs``, which is compiled once per process."""
        program, *others = self._charts.programs
        key = self._parameters, *(chart.key for chart in self._charts.programs)
        return _KERNELS.get(key, lambda: Float64Kernel(program, self._parameters, others))

    def inputs(self, q: Array, v: Array, tau: Array, time: Array | None = None, *driving: Array) -> Array:
        """Columns for the kernel, whole turns taken from large angles; ``driving`` are controls and activations (n, actuators)."""
        nq, nv = q.shape[1], v.shape[1]
        own = np.reshape(() if self._parameters is not None else self._mechanism.parameter_values, (-1, 1))
        if self._is_by_state:
            # Which forces there are beside the smooth ones each state decides.
            own = self._mechanism.parameters_at(States.at(q, v, tau, time, *driving)).T
        columns = np.empty((nq + 2 * nv + 1 + len(own), len(q)))
        columns[:nq], columns[nq : nq + nv], columns[nq + nv : nq + 2 * nv] = q.T, v.T, tau.T
        columns[nq + 2 * nv] = 0.0 if time is None else time
        columns[nq + 2 * nv + 1 :] = own
        # In a sum with another angle a large one would round its digits away.
        if (np.abs(columns[:nq]) > LARGE_ANGLE).any():
            for place in self._turning:
                angle, large = columns[place], np.abs(columns[place]) > LARGE_ANGLE
                angle[large] = np.arctan2(np.sin(angle[large]), np.cos(angle[large]))
        return columns

    @property
    def _is_by_state(self) -> bool:
        return self._mechanism.softened is not None or self._mechanism.actuation is not None

    @cached_property
    def _parameters(self) -> tuple[float, ...] | None:
        is_long = not self._is_by_state and len(self._charts.programs[0].instructions) >= LEAST_WITH_PARAMETERS
        return self._mechanism.parameter_values if is_long else None

    @cached_property
    def _turning(self) -> list[int]:
        return [place for place in self._charts.programs[0].turning if place < self._mechanism.nq]


@dataclass(frozen=True)
class Energies:
    """Energies of n states, (n,) each.

    Attributes:
        energy: Jacobi's energy function [J]; T + V where T is quadratic in the rates.
        lagrangian: T - V [J].
        kinetic: T [J].
        power: of the non-conservative generalised forces [W], without that of applied forces.
    """

    energy: Array
    lagrangian: Array
    kinetic: Array
    power: Array


class EnergyKernel:
    """The energies of a mechanism, each state in the chart that is most regular there; compiled on first use."""

    def __init__(self, mechanism: Mechanism) -> None:
        self._mechanism, self._charts = mechanism, Charts(mechanism.energy_programs)

    def evaluate(self, states: States) -> Energies:
        """The energies at ``states``; a state that no chart covers gives numbers that are not finite."""
        inputs, found = self._mechanism.inputs(states), np.empty((len(ENERGY_OUTPUTS), len(states)))
        for chart, chosen in self._charts.split(states.q):
            found[:, chosen] = self._compiled[chart](np.ascontiguousarray(inputs[:, chosen]))
        return Energies(*found)

    def along(self, q: Array, v: Array, time: Array | None = None) -> Energies:
        """The energies of states without applied forces, q of shape (n, nq), v (n, nv), time (n,) [s] or 0."""
        return self.evaluate(States.at(q, v, np.zeros_like(v), time))

    @cached_property
    def _compiled(self) -> list[Any]:
        return [compiled(*symbols_of(program), ENERGY_OUTPUTS) for program in self._mechanism.energy_programs]


@dataclass(frozen=True)
class LagrangianTerms:
    """The terms of the Euler-Lagrange equations at n states.

    Attributes:
        of_positions: dL/dq, (n, nv) [N or N m]; momenta: dL/dv, (n, nv); forces: Q without applied ones, (n, nv).
        mass: d2L/dv2, (n, nv, nv).
    """

    of_positions: Array
    momenta: Array
    forces: Array
    mass: Array


class LagrangianKernel:
    """T - V of a mechanism, its derivatives, and the non-conservative generalised forces; compiled on first use.

    Raises:
        ValueError: the mechanism has ball or free joints.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        if mechanism.attitudes:
            raise ValueError(f"{mechanism.name} has a ball or free joint; dL/dq needs positions that are coordinates")
        self.mechanism = mechanism

    def lagrangian(self, q: Array, v: Array, time: Array) -> Array:
        """L [J], (n,), at q, v (n, nv) and time (n,) [s]."""
        return np.asarray(self._evaluate(self._lagrangian, q, v, time)[0])

    def terms(self, q: Array, v: Array, time: Array) -> LagrangianTerms:
        """The terms of the Euler-Lagrange equations at q, v (n, nv) and time (n,) [s]."""
        nv = self.mechanism.nv
        flat = self._evaluate(self._terms, q, v, time)
        of_positions, momenta, forces = flat[: 3 * nv].reshape(3, nv, -1).transpose(0, 2, 1)
        return LagrangianTerms(of_positions, momenta, forces, full_matrices(flat[3 * nv :]))

    def _evaluate(self, function: Any, q: Array, v: Array, time: Array) -> Array:
        return np.asarray(function(self.mechanism.inputs(States(q, v, np.zeros_like(v), time))))

    @cached_property
    def _symbols(self) -> tuple[list[Any], dict[str, list[Any]]]:
        inputs, energies = symbols_of(self.mechanism.energy_programs[0])
        tensors = load_heyoka().diff_tensors(energies["lagrangian"], diff_args=inputs[: 2 * self.mechanism.nv], diff_order=1)
        return inputs, {**energies, "gradient": tensors.gradient, "mass": symbols_of(self.mechanism.program)[1]["mass"]}

    def _compiled(self, *names: str) -> Any:
        return compiled(*self._symbols, names, len(self.mechanism.program.instructions) > MOST_INSTRUCTIONS_UNROLLED)

    @cached_property
    def _lagrangian(self) -> Any:
        return self._compiled("lagrangian")

    @cached_property
    def _terms(self) -> Any:
        return self._compiled("gradient", "forces", "mass")
