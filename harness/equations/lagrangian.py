"""The Lagrangian of a mechanism and the terms of its Euler-Lagrange equations in float64, without any acceleration.

They come from the energy program, so that what is found with them does not rest on the equations of motion that a
motion was computed from; the mass matrix beside them is the equations', and only measures.

Source: Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., section 1.4.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.equations.kernels import MOST_INSTRUCTIONS_UNROLLED, heyoka_expressions
from harness.equations.mechanism import Mechanism
from harness.equations.program import upper_triangle
from harness.equations.states import States


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
        import heyoka

        mechanism = self.mechanism
        inputs = [heyoka.expression(f"z{i}") for i in range(len(mechanism.program.inputs))]
        energies = heyoka_expressions(mechanism.energy_programs[0], inputs)
        return inputs, {**energies, "mass": heyoka_expressions(mechanism.program, inputs)["mass"]}

    def _compiled(self, expressions: list[Any]) -> Any:
        import heyoka

        is_long = len(self.mechanism.program.instructions) > MOST_INSTRUCTIONS_UNROLLED
        return heyoka.cfunc(expressions, vars=self._symbols[0], compact_mode=is_long)

    @cached_property
    def _lagrangian(self) -> Any:
        return self._compiled(self._symbols[1]["lagrangian"])

    @cached_property
    def _terms(self) -> Any:
        import heyoka

        inputs, outputs = self._symbols
        nv = self.mechanism.nv
        gradient = heyoka.diff_tensors(outputs["lagrangian"], diff_args=inputs[: 2 * nv], diff_order=1).gradient
        return self._compiled([*gradient, *outputs["forces"], *outputs["mass"]])
