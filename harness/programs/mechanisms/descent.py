"""The least of F(a) = 1/2 |a - a0|_M^2 + s(J a - aref) in float64, where a proof of which rows act how begins.

Newton's method with a search along each direction: F is convex and once differentiable, and its derivative along a line rises, so that
the least on the line is where that is zero.

Source: Nocedal, Wright, Numerical Optimization, 2nd ed., section 3.1; MuJoCo documentation, Computation, section Primal problem.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from harness.arrays import Array
from harness.programs.evaluation import values
from harness.programs.mechanisms.clamps import Ranges
from harness.programs.mechanisms.cones import Cone, Zone, sliding_weights_at
from harness.programs.mechanisms.mechanism import JACOBIAN
from harness.programs.mechanisms.zones import Sides, Zones
from harness.programs.program import StraightLineProgram
from harness.programs.terms import symmetric

# Steps of Newton's method, and of the search along one.
_STEPS, _HALVINGS = 100, 60
# Of the derivative at the start of a line, what may be left; and of the length of a, the last step.
_FLAT, _LEAST_STEP = 0.5, 1e-15


@dataclass(frozen=True)
class _RoundRows:
    """The rows of an elliptic cone among all, and the parameters of the state."""

    cone: Cone
    rows: Sequence[int]
    found: Array

    def slope(self, y: Array, weights: Array) -> Array | None:
        """Minus the derivative of the forces by y, (rows, rows); None where the rows act by themselves, as where the contact sticks."""
        zone = self.cone.zone(self.found, y.tolist(), math.sqrt)
        if zone == Zone.STICKS:
            return None
        if zone != Zone.SLIDES:
            return np.zeros((len(y), len(y)))
        return sliding_weights_at(float(weights[0]), self.found[list(self.cone.friction)], float(self.found[self.cone.ratio]), y)


@dataclass(frozen=True)
class _Problem:
    """F at one state: M, M a0, J, aref and D, the least and the largest force of each row, and the rows whose forces lie in cones."""

    mass: Array
    force: Array
    jacobian: Array
    wanted: Array
    weights: Array
    low: Array
    high: Array
    cones: Sequence[_RoundRows]

    def forces(self, y: Array) -> tuple[Array, Array]:
        """Forces of rows that leave ``y``, and minus their derivative by it, (rows, rows)."""
        free = -self.weights * y
        inside = (free > self.low) & (free < self.high)
        force, slope = np.clip(free, self.low, self.high), np.diag(np.where(inside, self.weights, 0.0))
        for one in self.cones:
            own = one.slope(y[one.rows], self.weights[one.rows])
            if own is not None:
                slope[np.ix_(one.rows, one.rows)], force[one.rows] = own, -own @ y[one.rows]
        return force, slope

    @np.errstate(all="ignore")
    def least(self) -> Array:
        """y = J a - aref at the least, (rows,), or where the search ends."""
        a = _solved(self.mass, self.force)
        for _ in range(_STEPS):
            y = self.jacobian @ a - self.wanted
            force, slope = self.forces(y)
            gradient = self.mass @ a - self.force - self.jacobian.T @ force
            metric = self.mass + self.jacobian.T @ slope @ self.jacobian
            direction = -_solved(metric, gradient)
            if not np.isfinite(direction).all():
                break
            a = a + self._length(a, y, direction) * direction
            if np.sqrt(direction @ metric @ direction) <= _LEAST_STEP * np.sqrt(a @ metric @ a):
                break
        return np.asarray(self.jacobian @ a - self.wanted)

    def _length(self, a: Array, y: Array, direction: Array) -> float:
        along = self.jacobian @ direction
        constant, linear = direction @ (self.mass @ a - self.force), direction @ self.mass @ direction

        def slope(step: float) -> float:
            return float(constant + step * linear - along @ self.forces(y + step * along)[0])

        start, low, high = slope(0.0), 0.0, 1.0
        if abs(slope(high)) <= _FLAT * abs(start):
            return high
        while slope(high) < 0 and high < 2.0**_HALVINGS:
            low, high = high, 2 * high
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            found = slope(middle)
            if abs(found) <= _FLAT**4 * abs(start):
                return middle
            low, high = (middle, high) if found < 0 else (low, middle)
        return (low + high) / 2


def _solved(matrix: Array, vector: Array) -> Array:
    """The solution of a system, or the vector of least length that is nearest to one."""
    return np.asarray(np.linalg.lstsq(matrix, vector, rcond=None)[0], dtype=np.float64)


def sides_at_least(zones: Zones, problem: StraightLineProgram, inputs: Array, found: Array, ranges: Ranges | None) -> Sides:
    """The sides of all forces and contacts at the least of F, for inputs (number of inputs, n) and parameters (n, ...) of n states.

    ``problem`` and ``ranges``: as of ``SoftenedProgram`` and of ``Zones.settle``.
    """
    with np.errstate(all="ignore"):
        outputs = values(problem, inputs[: len(problem.inputs)])
    clamps, nv, rows = len(zones.clamps), len(outputs["force"]), len(outputs["weights"])
    least, most = zones.bounds(found) if ranges is None else ranges
    low, beyond = np.full((len(found), rows), -np.inf), np.full((len(found), rows), np.inf)
    low[:, :clamps], beyond[:, :clamps] = least, most
    y = np.zeros((len(found), rows))
    for state in range(len(found)):
        cones = [
            _RoundRows(cone, range(clamps + part.start, clamps + part.stop), found[state])
            for cone, part in zip(zones.cones, zones.parts, strict=True)
        ]
        mass = symmetric(outputs["mass"][:, state].tolist(), nv).astype(np.float64)
        jacobian = outputs[JACOBIAN][:, state].reshape(rows, nv)
        own = [outputs[name][:, state] for name in ("force", "wanted", "weights")]
        y[state] = _Problem(mass, own[0], jacobian, own[1], own[2], low[state], beyond[state], cones).least()
    free = -outputs["weights"].T[:, :clamps] * y[:, :clamps]
    sides = np.where(free < least, -1.0, np.where(free > most, 1.0, 0.0))
    return zones.sides(sides, y[:, clamps : clamps + sum(cone.size for cone in zones.cones)], found)
