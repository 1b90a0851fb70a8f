"""Energies of a mechanism in float64: what a computed motion keeps, and what its dampers take.

A mechanism's energy programs stand beside its equations, one for each chart, so that certification does not
pay for them. Their inputs are those of the equations; their outputs are ``energy`` (Jacobi's energy function h),
``lagrangian`` (T - V), ``kinetic`` (T), ``power`` (Q . v), one number each, ``forces`` (the nv non-conservative
generalised forces Q), and ``regularity`` where a chart can be singular. Along a motion

    dh/dt = power + tau . v - dL/dt,   the last term by explicit time.

Source: Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., section 2.7 (energy function, equation 2.53).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.equations.mechanism_kernel import Charts
from harness.equations.program import ENERGY_OUTPUTS

if TYPE_CHECKING:
    from harness.arrays import Array
    from harness.equations.mechanism import Mechanism
    from harness.equations.states import States


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
        from harness.equations.states import States

        return self.evaluate(States.at(q, v, np.zeros_like(v), time))

    @cached_property
    def _compiled(self) -> list[Any]:
        import heyoka

        from harness.equations.kernels import heyoka_expressions

        compiled = []
        for program in self._mechanism.energy_programs:
            inputs = [heyoka.expression(f"z{i}") for i in range(len(program.inputs))]
            outputs = heyoka_expressions(program, inputs)
            compiled.append(heyoka.cfunc([expression for name in ENERGY_OUTPUTS for expression in outputs[name]], vars=inputs))
        return compiled
