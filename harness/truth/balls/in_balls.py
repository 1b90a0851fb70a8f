"""Accelerations and mass matrices of a program in ball arithmetic, at any precision."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.programs.evaluation import mass_matrix, solved
from harness.programs.kernels import BallKernel
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.program import OUTPUTS, StraightLineProgram, right_hand_side, upper_triangle
from harness.programs.states import States
from harness.storage import Kept
from harness.truth.balls.factorisation import cholesky_in_balls, condition_number, scaled_cholesky

# Of kappa_s; beyond, rounding M costs its factor too many digits, and it is computed in balls.
MOST_IN_FLOAT64 = 1e8
# Parameter sets whose constants are kept in balls.
_MOST_BOUND = 256


class BallSolver:
    """The equations of one mechanism by one of its programs."""

    def __init__(self, mechanism: Mechanism, program: StraightLineProgram) -> None:
        self._mechanism = mechanism
        self._kernel = BallKernel(program, len(mechanism.parameters))
        self._bound: Kept[Callable[..., tuple[Any, ...]]] = Kept(_MOST_BOUND)

    def solve(self, states: States, parameters: Array, precision: int) -> tuple[Array, Array, Array, Array, Array, Array]:
        """High, low and radius, (n, nv) each, of the accelerations at ``precision`` bits; scale and factor of M, see
        ``scaled_cholesky``; and velocity, gravity and passive forces, (n, 3, nv)."""
        import flint

        nv = self._mechanism.nv
        pairs = upper_triangle(nv)
        results, terms = np.empty((len(states), 3, nv)), np.empty((len(states), 3, nv))
        exact: list[tuple[Any, ...]] = []
        with flint.ctx.workprec(precision):
            for index, (row, values) in enumerate(self.outputs(states, parameters)):
                outputs = {name: values[len(pairs) + k * nv :][:nv] for k, name in enumerate(OUTPUTS[1:])}
                terms[index] = [[float(entry) for entry in outputs[name]] for name in OUTPUTS[1:]]
                force = right_hand_side(outputs, [flint.arb(applied) for applied in row[self._mechanism.nq + nv :][:nv]])
                exact.append(values[: len(pairs)])
                solution = solved(mass_matrix(values[: len(pairs)], nv), force) if nv > 1 else [force[0] / values[0]]
                for i, ball in enumerate(solution):
                    results[index, :, i] = parts_of(ball)
            scale, factor = factorise(exact, nv)
        return results[:, 0], results[:, 1], results[:, 2], scale, factor, terms

    def outputs(self, states: States, parameters: Array) -> Iterator[tuple[list[float], tuple[Any, ...]]]:
        """q, v, tau and time of each state, and the program's outputs there as ``arb`` at the working precision."""
        import flint

        rows = np.hstack([states.q, states.v, states.tau, states.time[:, None]]).tolist()
        for row, values_of_parameters in zip(rows, map(tuple, parameters.tolist()), strict=True):
            bind = functools.partial(self._kernel.bind, values_of_parameters)
            yield row, self._bound.get((flint.ctx.prec, values_of_parameters), bind)(*row)


def parts_of(ball: Any) -> tuple[float, float, float]:
    """(high, low, radius): high + low is the ball's midpoint to twice the digits of float64."""
    midpoint = float(ball)
    return midpoint, float(ball - midpoint), float(ball.rad())


def factorise(exact: Sequence[Sequence[Any]], nv: int) -> tuple[Array, Array]:
    """``scaled_cholesky`` of mass matrices given by their upper triangles in balls; in balls where float64 would lose digits."""
    pairs = upper_triangle(nv)
    mass = np.empty((len(exact), nv, nv))
    for index, upper in enumerate(exact):
        for (i, j), entry in zip(pairs, upper, strict=True):
            mass[index, i, j] = mass[index, j, i] = float(entry)
    scale, factor = scaled_cholesky(mass)
    for doubtful in np.flatnonzero(~(condition_number(factor) < MOST_IN_FLOAT64)).tolist():
        factor[:, :, doubtful] = cholesky_in_balls(exact[doubtful], pairs, scale[:, doubtful].tolist())
    return scale, factor
