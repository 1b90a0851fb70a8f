"""Mechanisms with constraints: their motion exactly on the manifold, and the two ways of having their accelerations side by side."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import flint
import mpmath
import numpy as np

from harness.arrays import Array
from harness.certify.manifold import enclosed
from harness.certify.reference import Reference, ReferenceKernel, energy_norm
from harness.equations.constraint_forces import by_reduction, constrained_program
from harness.equations.kernels import BallKernel
from harness.equations.mechanism import Mechanism
from harness.equations.program import upper_triangle
from harness.equations.states import States

# Of the balls, which leave 40 digits; and of mpmath, whose central differences with STEP leave as many.
BITS = 192
DIGITS = 80


class Manifold:
    """A mechanism where only its independent coordinates are doubles, and the others what its constraints make of them."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self._kernel = BallKernel(mechanism.program, len(mechanism.parameters))

    def at(self, states: States, index: int) -> tuple[list[mpmath.mpf], list[mpmath.mpf], list[mpmath.mpf]]:
        """Positions, rates and accelerations at the independent coordinates of a state, with 40 digits."""
        mechanism = self.mechanism
        found = enclosed(mechanism, states.q[index], states.v[index])
        assert mechanism.constraints is not None and found is not None
        with flint.ctx.workprec(BITS), mpmath.workdps(DIGITS):
            q, v, tau = (_balls(values[index]) for values in (states.q, states.v, states.tau))
            for places, values, balls in (
                (mechanism.constraints.positions, q, found.positions),
                (mechanism.constraints.rates, v, found.rates),
            ):
                for place, ball in zip(places, balls, strict=True):
                    values[place] = ball
            evaluate = self._kernel.bind(mechanism.parameter_values)
            a = self._solved(iter(evaluate(*q, *v, *tau, flint.arb(float(states.time[index])))), tau)
            return tuple([_middle(ball) for ball in balls] for balls in (q, v, a))  # type: ignore[return-value]

    def _solved(self, outputs: Any, tau: list[Any]) -> list[Any]:
        nv = self.mechanism.nv
        parts = {name: [next(outputs) for _ in places] for name, places in self.mechanism.program.outputs.items()}
        mass = flint.arb_mat(nv, nv)
        for (i, j), entry in zip(upper_triangle(nv), parts["mass"], strict=True):
            mass[i, j] = mass[j, i] = entry
        terms = zip(tau, parts["passive"], parts["velocity"], parts["gravity"], strict=True)
        found = mass.solve(flint.arb_mat(nv, 1, [force + p - c - g for force, p, c, g in terms]))
        return [found[place, 0] for place in range(nv)]


def _balls(values: Array) -> list[Any]:
    return [flint.arb(value) for value in values.tolist()]


def _middle(ball: Any) -> mpmath.mpf:
    mantissa, exponent = ball.mid().man_exp()
    return mpmath.ldexp(mpmath.mpf(int(mantissa)), int(exponent))


def by_both_ways(mechanism: Mechanism) -> tuple[ReferenceKernel, ReferenceKernel]:
    """The certified truth by multipliers, and by the reduced equations."""
    assert mechanism.constraints is not None
    reduced = replace(mechanism, program=constrained_program(mechanism.constraints, by_reduction))
    return ReferenceKernel(mechanism), ReferenceKernel(reduced)


def enclose_each_other(first: Reference, second: Reference) -> Any:
    """(n,) whether the certified answers are no further from each other than their radii and the rounding of ``low`` allow."""
    apart = energy_norm(first.norm_factor, (first.high - second.high) + (first.low - second.low))
    rounded = 2.0**-104 * energy_norm(first.norm_factor, np.abs(first.high) + np.abs(second.high))
    return apart <= first.radius + second.radius + rounded
