"""Energies of a mechanism in float64: what a computed motion keeps, and what its dampers take.

A mechanism's energy programs stand beside its equations, one for each chart, so that certification does not
pay for them. Their inputs are those of the equations; their outputs are ``energy`` (Jacobi's energy function h),
``lagrangian`` (T - V), ``kinetic`` (T), ``power`` (Q . v), one number each, ``forces`` (the nv non-conservative
generalised forces Q), and ``regularity`` where a chart can be singular. Along a motion

    dh/dt = power + tau . v - dL/dt,   the last term by explicit time.

Nothing here rests on the equations of motion that a motion was computed from, but for the mass matrix, which only measures.

Source: Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., sections 1.4 and 2.7 (energy function, equation 2.53).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.programs.kernels import MOST_INSTRUCTIONS_UNROLLED, symbols_of
from harness.programs.machine_code import load_heyoka
from harness.programs.mechanisms.kernel import Charts
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.program import ENERGY_OUTPUTS, upper_triangle
from harness.programs.states import States


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
        self._mechanism = mechanism

    def evaluate(self, states: States) -> Energies:
        """The energies at ``states``; a state that no chart covers gives numbers that are not finite."""
        inputs, found = self._mechanism.inputs(states), np.empty((len(ENERGY_OUTPUTS), len(states)))
        for chart, chosen in Charts(self._mechanism.energy_programs).split(states.q):
            found[:, chosen] = self._compiled[chart](np.ascontiguousarray(inputs[:, chosen]))
        return Energies(*found)

    def along(self, q: Array, v: Array, time: Array | None = None) -> Energies:
        """The energies of states without applied forces, q of shape (n, nq), v (n, nv), time (n,) [s] or 0."""
        return self.evaluate(States.at(q, v, np.zeros_like(v), time))

    @cached_property
    def _compiled(self) -> list[Any]:
        heyoka = load_heyoka()

        compiled = []
        for program in self._mechanism.energy_programs:
            inputs, outputs = symbols_of(program)
            compiled.append(heyoka.cfunc([expression for name in ENERGY_OUTPUTS for expression in outputs[name]], vars=inputs))
        return compiled


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
        mass = np.empty((len(q), nv, nv))
        for row, (i, j) in zip(flat[3 * nv :], upper_triangle(nv), strict=True):
            mass[:, i, j] = mass[:, j, i] = row
        return LagrangianTerms(of_positions, momenta, forces, mass)

    def _evaluate(self, function: Any, q: Array, v: Array, time: Array) -> Array:
        return np.asarray(function(self.mechanism.inputs(States(q, v, np.zeros_like(v), time))))

    @cached_property
    def _symbols(self) -> tuple[list[Any], dict[str, list[Any]]]:
        inputs, energies = symbols_of(self.mechanism.energy_programs[0])
        return inputs, {**energies, "mass": symbols_of(self.mechanism.program)[1]["mass"]}

    def _compiled(self, expressions: list[Any]) -> Any:
        heyoka = load_heyoka()

        is_long = len(self.mechanism.program.instructions) > MOST_INSTRUCTIONS_UNROLLED
        return heyoka.cfunc(expressions, vars=self._symbols[0], compact_mode=is_long)

    @cached_property
    def _lagrangian(self) -> Any:
        return self._compiled(self._symbols[1]["lagrangian"])

    @cached_property
    def _terms(self) -> Any:
        heyoka = load_heyoka()

        inputs, outputs = self._symbols
        nv = self.mechanism.nv
        gradient = heyoka.diff_tensors(outputs["lagrangian"], diff_args=inputs[: 2 * nv], diff_order=1).gradient
        return self._compiled([*gradient, *outputs["forces"], *outputs["mass"]])
