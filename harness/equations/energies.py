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
        inputs = self._mechanism.inputs(states)
        results = np.stack([np.asarray(chart(inputs)) for chart in self._charts])
        best = np.argmax(np.abs(results[:, len(ENERGY_OUTPUTS)]), axis=0) if len(self._charts) > 1 else np.zeros(len(states), dtype=int)
        chosen = results[best, : len(ENERGY_OUTPUTS), np.arange(len(states))]
        return Energies(*np.ascontiguousarray(chosen.T))

    def along(self, q: Array, v: Array, time: Array | None = None) -> Energies:
        """The energies of states without applied forces, q of shape (n, nq), v (n, nv), time (n,) [s] or 0."""
        from harness.equations.states import States

        return self.evaluate(States.at(q, v, np.zeros_like(v), time))

    @cached_property
    def _charts(self) -> list[Any]:
        import heyoka

        from harness.equations.kernels import heyoka_expressions

        compiled = []
        for program in self._mechanism.energy_programs:
            inputs = [heyoka.expression(f"z{i}") for i in range(len(program.inputs))]
            outputs = heyoka_expressions(program, inputs)
            names = [name for name in (*ENERGY_OUTPUTS, "regularity") if name in outputs]
            compiled.append(heyoka.cfunc([expression for name in names for expression in outputs[name]], vars=inputs))
        return compiled
