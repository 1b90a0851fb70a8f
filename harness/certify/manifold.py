"""States of a mechanism with constraints: the coordinates that constraints determine, found on the branch of its assembly.

The other coordinates are given float64 numbers. From the assembly they move straight to their values in small steps, while Newton's
method keeps the constraints closed in float64. There the determined coordinates are enclosed in balls by the Krawczyk operator, which
proves that one configuration, and no other, is within the ball; redundant rows must contain zero on it. Rates follow from the
Jacobian there. A state holds the float64 numbers nearest to what was enclosed.

Where that fails the state keeps the determined coordinates of the assembly. It does not close the constraints there, so that its truth
is undecided (``harness.certify.reference``), and nobody is judged by a state that was made up.

Source: Krawczyk, Newton-Algorithmen zur Bestimmung von Nullstellen mit Fehlerschranken, Computing 4 (1969); Rump, Verification
methods, Acta Numerica 19 (2010), section 13; Allgower, Georg, Introduction to Numerical Continuation Methods, chapter 2.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.certify.forward_mode import jacobians, values
from harness.certify.numbers import SMALLEST_SCALE, UNIT_ROUNDOFF
from harness.equations.constraints import JACOBIAN, RATE, RESIDUAL
from harness.equations.kernels import BallKernel
from harness.equations.mechanism import Mechanism
from harness.equations.program import without_unused
from harness.equations.states import States
from harness.storage import Kept

# Of the way from the assembly, which is at most half a turn of each angle; twice as many are taken where these do not arrive.
STEPS = (32, 256)
# Of Newton's method, after a step along the tangent.
_CORRECTIONS = 2
# Largest change by the last correction, relative to the coordinate or 1, for which it has converged.
_CONVERGED = 1e-6
# Bits of the balls, and the radius within which a configuration is sought around where Newton's method ended.
_PRECISION = 192
_RADIUS = 2.0**-120
_REFINEMENTS = 6
# Of data roundoffs of a row: evaluating it in float64 rounds about as often as its inputs are rounded.
_ROUNDINGS = 16
Flags = np.ndarray[Any, np.dtype[np.bool_]]


def closed(mechanism: Mechanism, states: States) -> States:
    """``states`` with the coordinates and rates that constraints determine at their values; the same states for a tree.

    A state that the branch does not reach keeps the positions of the assembly for them.
    """
    if mechanism.constraints is None or not len(states):
        return states
    return _closure(mechanism).close(states)


def enclosed(mechanism: Mechanism, q: Array, v: Array) -> Enclosure | None:
    """The configuration that has the given coordinates that no constraint determines, and the others near those of q, (nv,).

    None where no ball can be proved to hold one configuration and no other. ``mechanism`` has constraints.
    """
    return _closure(mechanism).enclose(q.tolist(), v.tolist())


def closes(mechanism: Mechanism, states: States) -> Flags:
    """(n,) whether a state closes all constraints, in positions and in rates, as far as half an ulp of each input leaves it open."""
    if mechanism.constraints is None:
        return np.ones(len(states), dtype=np.bool_)
    left, open_by_data = rows_left(mechanism, states)
    return np.asarray((np.abs(left) <= _ROUNDINGS * open_by_data).all(axis=1))


def rows_left(mechanism: Mechanism, states: States) -> tuple[Array, Array]:
    """What the rows and their rates leave, (n, rows), in float64, and the data roundoff of each; the holonomic rows come first.

    ``mechanism`` has constraints.
    """
    assert mechanism.constraints is not None
    program = mechanism.constraints.program
    rows = without_unused(replace(program, outputs={name: program.outputs[name] for name in (RESIDUAL, RATE)}))
    inputs = mechanism.inputs(states)
    left, slopes = values(rows, inputs), jacobians(rows, inputs)
    scales = np.maximum(np.abs(inputs), SMALLEST_SCALE)
    with np.errstate(all="ignore"):
        moved = [UNIT_ROUNDOFF * (np.abs(slopes[name]) * scales).sum(axis=1).T for name in (RESIDUAL, RATE)]
    return np.hstack([left[name].T for name in (RESIDUAL, RATE)]), np.hstack(moved)


@dataclass(frozen=True)
class Enclosure:
    """Balls that hold the determined positions, in the order of ``Constraints.positions``, and the rates, of ``Constraints.rates``."""

    positions: Sequence[Any]
    rates: Sequence[Any]


_CLOSURES: Kept[_Closure] = Kept(64)


def _closure(mechanism: Mechanism) -> _Closure:
    return _CLOSURES.get(mechanism.key, lambda: _Closure(mechanism))


class _Closure:
    """The constraints of one mechanism at its own parameters."""

    def __init__(self, mechanism: Mechanism) -> None:
        assert mechanism.constraints is not None
        self._mechanism, self._constraints = mechanism, mechanism.constraints
        self._rows = self._constraints.independent
        self._holding = [row for row in self._rows if row < self._constraints.holonomic]
        self._balls = BallKernel(self._constraints.program, len(mechanism.parameters))
        self._others = [place for place in range(mechanism.nv) if place not in self._constraints.positions]

    def close(self, states: States) -> States:
        q, v = self._followed(states.q), states.v.copy()
        for index in range(len(q)):
            found = self.enclose(q[index].tolist(), v[index].tolist()) if np.isfinite(q[index]).all() else None
            if found is None:
                q[index, list(self._constraints.positions)] = np.array(self._constraints.assembly)[list(self._constraints.positions)]
                continue
            q[index, list(self._constraints.positions)] = [float(ball) for ball in found.positions]
            v[index, list(self._constraints.rates)] = [float(ball) for ball in found.rates]
        return States(q, v, states.tau, states.time)

    # In float64, all states at once.

    def _followed(self, wanted: Array) -> Array:
        """The branch of the assembly at the coordinates of ``wanted`` that no row determines; NaN where it is lost."""
        found, left = wanted.copy(), np.arange(len(wanted))
        places = list(self._constraints.positions)
        if not places:
            return found
        for steps in STEPS:
            found[left[:, None], places] = self._continued(wanted[left], steps)
            left = left[~np.isfinite(found[left]).all(axis=1)]
            if not len(left):
                break
        return found

    def _continued(self, wanted: Array, steps: int) -> Array:
        """The determined positions, (n, m), after so many steps from the assembly."""
        places, others = list(self._constraints.positions), self._others
        q = np.tile(np.array(self._constraints.assembly), (len(wanted), 1))
        target = wanted.copy()
        for place in others:
            if self._turns[place]:
                # Whole turns change nothing, and the way would be long.
                away = np.arctan2(np.sin(wanted[:, place]), np.cos(wanted[:, place])) - q[0, place]
                target[:, place] = q[0, place] + away - 2 * math.pi * np.rint(away / (2 * math.pi))
        step = (target[:, others] - q[:, others]) / steps
        begun = q[:, others].copy()
        with np.errstate(all="ignore"):
            # The assembly is known to a few digits.
            change = self._corrected(q, _REFINEMENTS)
            for number in range(1, steps + 1):
                _, jacobian = self._rows_at(q)
                tangent = _solved(jacobian[:, :, places], np.einsum("nij,nj->ni", jacobian[:, :, others], step))
                q[:, places] -= tangent
                q[:, others] = begun + number * step if number < steps else target[:, others]
                change = self._corrected(q, _CORRECTIONS)
                # Another branch is as far as two roots are from one another: a step that Newton corrects by much may have left its own.
                q[change > np.maximum(1e-3, 0.5 * np.abs(tangent).max(axis=1))] = np.nan
            size = np.maximum(1.0, np.abs(q[:, places]).max(axis=1))
            final = self._corrected(q, 1)
        q[~(final <= _CONVERGED * size)] = np.nan
        return q[:, places]

    def _corrected(self, q: Array, count: int) -> Array:
        """Take ``count`` steps of Newton's method in place; the largest change of a position by the first of them, (n,)."""
        places, first = list(self._constraints.positions), np.empty(0)
        for number in range(count):
            residual, jacobian = self._rows_at(q)
            change = _solved(jacobian[:, :, places], residual)
            q[:, places] -= change
            first = np.abs(change).max(axis=1) if number == 0 else first
        return first

    def _rows_at(self, q: Array) -> tuple[Array, Array]:
        """What the holonomic rows that are not redundant leave, (n, m), and their Jacobian, (n, m, nv)."""
        still = np.zeros_like(q)
        inputs = self._mechanism.inputs(States(q, still, still, np.zeros(len(q))))
        found = values(self._constraints.program, inputs)
        jacobian = found[JACOBIAN].reshape(len(self._constraints.rows), self._mechanism.nv, -1).transpose(2, 0, 1)
        return np.ascontiguousarray(found[RESIDUAL][self._holding].T), np.ascontiguousarray(jacobian[:, self._holding])

    @functools.cached_property
    def _turns(self) -> list[bool]:
        turning = set(self._constraints.program.turning)
        return [place in turning for place in range(self._mechanism.nv)]

    # In balls, state by state.

    def enclose(self, q: Sequence[float], v: Sequence[float]) -> Enclosure | None:
        import flint

        with flint.ctx.workprec(_PRECISION):
            evaluate = self._bound
            nv, nothing = self._mechanism.nv, [0.0] * (2 * self._mechanism.nv + 1)
            positions, rates = self._constraints.positions, self._constraints.rates
            balls: list[Any] = [flint.arb(value) for value in q]
            jacobian = None
            if positions:
                for _ in range(_REFINEMENTS):
                    residual, jacobian = self._parts(evaluate(*balls, *nothing))
                    change = _in_balls(jacobian, self._holding, positions, [residual[row] for row in self._holding])
                    if change is None:
                        return None
                    for place, step in zip(positions, change, strict=True):
                        balls[place] = (balls[place] - step).mid()
                    if all(abs(float(step)) <= _RADIUS / 4 for step in change):
                        break
                if not self._is_proved(balls, evaluate, nothing):
                    return None
            residual, jacobian = self._parts(evaluate(*balls, *nothing))
            if not all(residual[row].contains(0) for row in range(self._constraints.holonomic) if row not in self._holding):
                return None
            others = [place for place in range(nv) if place not in rates]
            moved = [sum((jacobian[row][place] * v[place] for place in others), flint.arb(0)) for row in self._rows]
            found = _in_balls(jacobian, self._rows, rates, moved)
            return None if found is None else Enclosure([balls[place] for place in positions], [-rate for rate in found])

    def _is_proved(self, balls: list[Any], evaluate: Callable[..., Any], nothing: Sequence[float]) -> bool:
        """Widen the determined positions to the ball that the Krawczyk operator maps into itself; whether it does."""
        import flint

        positions = self._constraints.positions
        residual, at_middle = self._parts(evaluate(*balls, *nothing))
        middle = [balls[place] for place in positions]
        for place, ball in zip(positions, middle, strict=True):
            balls[place] = ball + flint.arb(0, _RADIUS * max(1.0, abs(float(ball))))
        _, over_ball = self._parts(evaluate(*balls, *nothing))
        try:
            approximate = _matrix(at_middle, self._holding, positions).inv()
        except ZeroDivisionError:
            return False
        m = len(positions)
        contraction = flint.arb_mat(m, m, [int(i == j) for i in range(m) for j in range(m)])
        contraction -= approximate * _matrix(over_ball, self._holding, positions)
        step = approximate * flint.arb_mat(m, 1, [residual[row] for row in self._holding])
        reach = contraction * flint.arb_mat(m, 1, [balls[place] - ball for place, ball in zip(positions, middle, strict=True)])
        for number, place in enumerate(positions):
            mapped = middle[number] - step[number, 0] + reach[number, 0]
            if not balls[place].contains_interior(mapped):
                return False
            balls[place] = mapped
        return True

    @functools.cached_property
    def _bound(self) -> Callable[..., Any]:
        return self._balls.bind(self._mechanism.parameter_values)

    def _parts(self, outputs: Sequence[Any]) -> tuple[Sequence[Any], list[Sequence[Any]]]:
        """The residual, and the Jacobian by rows."""
        nv, first, rows = self._mechanism.nv, self._constraints.holonomic, len(self._constraints.rows)
        return outputs[:first], [outputs[first + row * nv :][:nv] for row in range(rows)]


def _matrix(jacobian: Sequence[Sequence[Any]], rows: Sequence[int], places: Sequence[int]) -> Any:
    import flint

    return flint.arb_mat([[jacobian[row][place] for place in places] for row in rows])


def _in_balls(jacobian: Sequence[Sequence[Any]], rows: Sequence[int], places: Sequence[int], right: Sequence[Any]) -> list[Any] | None:
    """The solution of the rows' square part in balls; None where that is not certainly regular."""
    import flint

    try:
        found = _matrix(jacobian, rows, places).solve(flint.arb_mat(len(places), 1, list(right)))
    except ZeroDivisionError:
        return None
    solution = [found[place, 0] for place in range(len(places))]
    return solution if all(ball.is_finite() for ball in solution) else None


def _solved(matrices: Array, columns: Array) -> Array:
    """The solutions, (n, m), of n systems; NaN where one has none."""
    finite = np.asarray(np.isfinite(matrices).all(axis=(1, 2)) & np.isfinite(columns).all(axis=1))
    determinants = np.asarray(np.linalg.det(np.where(finite[:, None, None], matrices, 0.0)))
    regular = np.flatnonzero(finite & (determinants != 0))
    found = np.full_like(columns, np.nan)
    found[regular] = np.linalg.solve(matrices[regular], columns[regular][:, :, None])[:, :, 0]
    return found
