"""Mechanisms with constraints: their motion exactly on the manifold, and the two ways of having their accelerations side by side."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import flint
import mpmath
import numpy as np

from harness.programs.kernels import BallKernel
from harness.programs.mechanisms.constraint_forces import MULTIPLIERS, Tied, constrained_program, reduced
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.program import upper_triangle
from harness.programs.states import States
from harness.programs.terms import Vector
from harness.truth.manifold import enclosed
from harness.truth.reference import Reference, ReferenceKernel, energy_norm

# Of the balls, which leave 40 digits; and of mpmath, whose central differences with STEP leave as many.
BITS = 192
DIGITS = 80


class ExactMotion:
    """Accelerations of a mechanism at inputs that are balls of BITS bits, the parameters among them."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        with flint.ctx.workprec(BITS):
            # No parameter is fixed.
            self._evaluate = BallKernel(mechanism.program, 0).bind(())

    def of(self, q: list[Any], v: list[Any], tau: list[Any], parameters: list[Any]) -> tuple[list[Any], list[Any]]:
        """Accelerations, and the multipliers of the rows that are not redundant."""
        nv, outputs = self.mechanism.nv, iter(self._evaluate(*q, *v, *tau, flint.arb(0), *parameters))
        parts = {name: [next(outputs) for _ in places] for name, places in self.mechanism.program.outputs.items()}
        mass = flint.arb_mat(nv, nv)
        for (i, j), entry in zip(upper_triangle(nv), parts["mass"], strict=True):
            mass[i, j] = mass[j, i] = entry
        terms = zip(tau, parts["passive"], parts["velocity"], parts["gravity"], strict=True)
        found = mass.solve(flint.arb_mat(nv, 1, [force + p - c - g for force, p, c, g in terms]))
        return [found[place, 0] for place in range(nv)], parts[MULTIPLIERS]

    def on_the_manifold(self, states: States, index: int) -> tuple[list[mpmath.mpf], list[mpmath.mpf]]:
        """Rates and accelerations where only the independent coordinates of a state are doubles, with 40 digits."""
        mechanism = self.mechanism
        found = enclosed(mechanism, states.q[index], states.v[index])
        assert mechanism.constraints is not None and found is not None
        with flint.ctx.workprec(BITS), mpmath.workdps(DIGITS):
            q, v, tau = (balls(values[index].tolist()) for values in (states.q, states.v, states.tau))
            for places, values, determined in (
                (mechanism.constraints.positions, q, found.positions),
                (mechanism.constraints.rates, v, found.rates),
            ):
                for place, ball in zip(places, determined, strict=True):
                    values[place] = ball
            accelerations, _ = self.of(q, v, tau, balls(mechanism.parameter_values))
            return [middle(ball) for ball in v], [middle(ball) for ball in accelerations]


def balls(values: Iterable[float | str]) -> list[Any]:
    """Balls around doubles, which are exact, or around decimal numbers."""
    return [flint.arb(value) for value in values]


def middle(ball: Any) -> mpmath.mpf:
    mantissa, exponent = ball.mid().man_exp()
    return mpmath.ldexp(mpmath.mpf(int(mantissa)), int(exponent))


def by_reduction(tied: Tied) -> tuple[Vector, Vector]:
    """The forces M a - f, (nv,), with a from the reduced equations; no multipliers."""
    return tied.mass @ reduced(tied) - tied.force, ()


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
