"""Implicit midpoint as the variational integrator of Hamilton's principle.

The action over one step is that of the midpoint, L_d(q0, q1) = h L(q0 + h w/2, w) with w = (q1 - q0)/h, and the
work of the dampers is that of their forces there. Stationary action then reads, at the midpoint,

    p0 = dL/dv - h/2 (dL/dq + Q),     p1 = dL/dv + h/2 (dL/dq + Q)

Newton's method solves the first for w, the second gives p1; velocities come from momenta only where a state is
kept. All is built from the Lagrangian and the forces, nothing from the equations of motion.

Source: Marsden, West, Discrete mechanics and variational integrators, Acta Numerica 10 (2001), sections 1.5, 2.4
and 3.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.crosscheck.scene import Scene
from harness.engines import Unsupported
from harness.motion.integrators import Integrator, keep
from harness.motion.taylor import FirstOrderSystem, Path, named
from harness.motion.trajectories import Start
from harness.programs.machine_code import load_heyoka

# Newton's method squares its relative correction: after one below this nothing is left but rounding.
LAST_CORRECTION = 1e-8
MOST_ITERATIONS = 20
# What a compiled step begins with; a step that needs more is done again.
ITERATIONS = 2
STEPS_AT_ONCE = 4


class Variational:
    """The integrator on one mechanism whose positions are its coordinates.

    A state is, in one array: q, p, the midpoint velocities of the last two steps (n each), time and step.
    """

    def __init__(self, scene: Scene) -> None:
        self._heyoka = heyoka = load_heyoka()
        self._mechanism = mechanism = scene.mechanism
        if mechanism.attitudes:
            raise Unsupported("the midpoint of two quaternions is no rotation; expected positions that are coordinates")
        self._system = system = FirstOrderSystem(mechanism)
        n, (q, w) = mechanism.nv, system.variables()
        p, last = named("p", n), named("last", n)
        now, step = heyoka.expression("now"), heyoka.expression("step")
        state = [*q, *p, *w, *last, now, step]
        momenta, _ = self._momenta_and_impulses(q, w, now)
        constant = heyoka.subs(momenta, {str(rate): heyoka.expression(0.0) for rate in w})
        mass = [[heyoka.diff(momentum, rate) for rate in w] for momentum in momenta]
        self._momenta = system.compiled(momenta, [*q, *w, now])
        velocities = _solve(mass, [given - part for given, part in zip(p, constant, strict=True)])
        self._velocities = system.compiled(velocities, [*q, *p, now])
        self._improve = system.compiled(self._improved(q, p, w, now, step), state)
        self._finish = system.compiled(self._finished(q, p, w, now, step), state)
        self._steps = {} if system.is_long else {count: self._compiled(state, count) for count in (1, STEPS_AT_ONCE)}

    def advance(self, start: Start, step: float, steps: int, every: int) -> Path:
        """Raises nothing where Newton's method fails: the rest of the path is not a number."""
        n = self._mechanism.nv
        momenta = np.asarray(self._momenta(np.array([*start.q, *start.v, 0.0])))
        state = np.array([*start.q, *momenta, *start.v, *start.v, 0.0, step])
        out = np.empty(4 * n + 2)
        evaluations = 0

        def go(count: int) -> tuple[Array, Array]:
            nonlocal evaluations
            while count:
                size = max((size for size in self._steps if size <= count), default=0)
                if size:
                    self._steps[size](state, outputs=out)
                    evaluations += size * ITERATIONS
                # The last output is the square of the largest relative correction that came last.
                if size and out[-1] <= LAST_CORRECTION**2:
                    state[:-1] = out[:-1]
                else:
                    size = 1
                    evaluations += self._step(state)
                count -= size
            return state[:n], np.asarray(self._velocities(np.array([*state[: 2 * n], state[-2]])))

        path = keep(start, step, steps, every, 1, go)
        return replace(path, evaluations=evaluations)

    def _step(self, state: Array) -> int:
        """One step in place, by as many iterations as it needs; returns their number."""
        n = self._mechanism.nv
        new, old = slice(2 * n, 3 * n), slice(3 * n, 4 * n)
        guess = state.copy()
        guess[new] = 2 * state[new] - state[old]
        iterations = 0
        while iterations < MOST_ITERATIONS:
            iterations += 1
            improved = np.asarray(self._improve(guess))
            correction = np.abs(improved - guess[new]).max()
            guess[new] = improved
            if correction <= LAST_CORRECTION * np.abs(improved).max():
                break
        else:
            guess[:] = np.nan
        state[old], state[new] = state[new], guess[new]
        state[: 2 * n] = np.asarray(self._finish(guess))
        state[-2] += state[-1]
        return iterations

    def _momenta_and_impulses(self, q: Sequence[Any], w: Sequence[Any], now: Any) -> tuple[list[Any], list[Any]]:
        """dL/dv and dL/dq + Q."""
        heyoka, (positions, velocities) = self._heyoka, self._system.variables()
        energies = self._system.energies(positions, velocities, heyoka.expression("midtime"))
        [lagrangian] = energies["lagrangian"]
        momenta = [heyoka.diff(lagrangian, rate) for rate in velocities]
        impulses = [heyoka.diff(lagrangian, x) + force for x, force in zip(positions, energies["forces"], strict=True)]
        at = {str(symbol): value for symbol, value in zip([*positions, *velocities], [*q, *w], strict=True)}
        found = heyoka.subs([*momenta, *impulses], at | {"midtime": now})
        return found[: len(q)], found[len(q) :]

    def _improved(self, q: Sequence[Any], p: Sequence[Any], w: Sequence[Any], now: Any, step: Any) -> list[Any]:
        """w after one Newton iteration."""
        heyoka, unknowns = self._heyoka, named("unknown", len(w))
        middle = [x + 0.5 * step * rate for x, rate in zip(q, unknowns, strict=True)]
        momenta, impulses = self._momenta_and_impulses(middle, unknowns, now + 0.5 * step)
        residual = [found - 0.5 * step * impulse - given for found, impulse, given in zip(momenta, impulses, p, strict=True)]
        jacobian = [[heyoka.diff(entry, unknown) for unknown in unknowns] for entry in residual]
        corrected = [x - change for x, change in zip(unknowns, _solve(jacobian, residual), strict=True)]
        return list(heyoka.subs(corrected, {str(unknown): rate for unknown, rate in zip(unknowns, w, strict=True)}))

    def _finished(self, q: Sequence[Any], p: Sequence[Any], w: Sequence[Any], now: Any, step: Any) -> list[Any]:
        """q and p after a step with midpoint velocity w."""
        middle = [x + 0.5 * step * rate for x, rate in zip(q, w, strict=True)]
        _, impulses = self._momenta_and_impulses(middle, w, now + 0.5 * step)
        # p1 = p0 + h (dL/dq + Q), the sum of both conditions: Newton's residual does not enter twice.
        return [start + step * change for start, change in zip([*q, *p], [*w, *impulses], strict=True)]

    def _compiled(self, state: Sequence[Any], count: int) -> Any:
        """``count`` whole steps: the state after them, the last entry being the square of the largest last correction."""
        heyoka, n = self._heyoka, self._mechanism.nv
        q, p, w, last = (list(state[i * n : (i + 1) * n]) for i in range(4))
        now, step = state[-2:]
        largest = heyoka.expression(0.0)
        for _ in range(count):
            guess = [2.0 * new - old for new, old in zip(w, last, strict=True)]
            for _ in range(ITERATIONS):
                before, guess = guess, self._improved(q, p, guess, now, step)
            last, w = w, guess
            square = heyoka.sum([rate * rate for rate in w])
            correction = heyoka.sum([(a - b) * (a - b) for a, b in zip(w, before, strict=True)])
            relative = heyoka.select(heyoka.gt(square, 0.0), correction / square, correction)
            largest = heyoka.select(heyoka.gt(largest, relative), largest, relative)
            after = self._finished(q, p, w, now, step)
            q, p, now = after[:n], after[n:], now + step
        return self._system.compiled([*q, *p, *w, *last, now, largest], state)


def _solve(matrix: Sequence[Sequence[Any]], right_hand_side: Sequence[Any]) -> list[Any]:
    """Gauss elimination without pivoting, unrolled: the matrix is M and terms that vanish with the step.

    Source: Golub, Van Loan, Matrix Computations, 4th ed., section 3.2.
    """
    n = len(right_hand_side)
    rows = [[*row, b] for row, b in zip(matrix, right_hand_side, strict=True)]
    for j in range(n):
        for i in range(j + 1, n):
            factor = rows[i][j] / rows[j][j]
            rows[i] = [*rows[i][: j + 1], *(rows[i][k] - factor * rows[j][k] for k in range(j + 1, n + 1))]
    x: list[Any] = [None] * n
    for i in reversed(range(n)):
        rest = rows[i][n]
        for k in range(i + 1, n):
            rest = rest - rows[i][k] * x[k]
        x[i] = rest / rows[i][i]
    return x


MIDPOINT = Integrator(
    name="equations variational midpoint",
    format="equations",
    order=2,
    prepare=lambda scene: Variational(scene).advance,
    long_run="bounded",
)
