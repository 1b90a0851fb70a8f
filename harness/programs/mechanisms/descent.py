"""The least of F(a) = 1/2 |a - a0|_M^2 + s(J a - aref) in float64, where a proof of which rows act how begins.

``Problem.linear`` is a step of Newton's method for forces that are no derivative of any s.

Newton's method with a search along each direction, at all states at once: F is convex and once differentiable, and its derivative along
a line rises, so that the least on the line is where that is zero.

Source: Nocedal, Wright, Numerical Optimization, 2nd ed., section 3.1; MuJoCo documentation, Computation, section Primal problem.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from harness.arrays import Array, Indices
from harness.programs.evaluation import values
from harness.programs.kernels import full_matrices
from harness.programs.loops.interpreter import approximate_outputs
from harness.programs.mechanisms.clamps import Ranges
from harness.programs.mechanisms.cones import ASSOCIATED, Cone, Flow
from harness.programs.mechanisms.mechanism import JACOBIAN
from harness.programs.mechanisms.zones import Sides, Zones
from harness.programs.program import StraightLineProgram

# Steps of Newton's method, and of the search along one.
_STEPS, _HALVINGS = 100, 60
# Of the derivative at the start of a line, what may be left; and of the length of a, the last step, whose square is below all roundings.
_FLAT, _LEAST_STEP = 0.5, 1e-12


@dataclass(frozen=True)
class _RoundRows:
    """The rows of an elliptic cone among all; friction (n, rows - 1) and ratio (n,) of n states."""

    rows: slice
    friction: Array
    ratio: Array
    flow: Flow

    @classmethod
    def of(cls, cone: Cone, rows: slice, found: Array) -> _RoundRows:
        return cls(rows, found[:, list(cone.friction)], found[:, cone.ratio], cone.flow)

    def __getitem__(self, states: Indices) -> _RoundRows:
        return _RoundRows(self.rows, self.friction[states], self.ratio[states], self.flow)

    def act(self, y: Array, weights: Array, force: Array, weighted: tuple[Array, Array] | None = None) -> None:
        """Set forces, (n, rows), and the Jacobian times minus their derivative by y, where the rows do not act by themselves.

        ``weighted`` is the Jacobian, (n, rows, nv), and that product. Where a contact sticks its rows do act by themselves.
        """
        own = y[:, self.rows]
        sticking, parting = self.flow.edges([self.ratio, *self.friction.T], own.T, np.sqrt)
        sticks, parts = sticking <= 0, parting >= 0
        others, slides = np.flatnonzero(~sticks), np.flatnonzero(~(sticks | parts))
        force[others, self.rows] = 0.0
        bent = self.flow.weights_at(weights[slides, self.rows.start], self.friction[slides], self.ratio[slides], own[slides])
        force[slides, self.rows] = -np.einsum("nij,nj->ni", bent, own[slides])
        if weighted is not None:
            jacobian, product = weighted
            product[others, self.rows] = 0.0
            product[slides, self.rows] = bent @ jacobian[slides, self.rows]


@dataclass(frozen=True)
class Problem:
    """F at n states: M, M a0, J, aref and D, the least and the largest force of each row, and the rows whose forces lie in cones."""

    mass: Array
    force: Array
    jacobian: Array
    wanted: Array
    weights: Array
    low: Array
    high: Array
    cones: Sequence[_RoundRows]

    def __getitem__(self, states: Indices) -> Problem:
        own = (self.mass, self.force, self.jacobian, self.wanted, self.weights, self.low, self.high)
        mass, force, jacobian, wanted, weights, low, high = (one[states] for one in own)
        return Problem(mass, force, jacobian, wanted, weights, low, high, [one[states] for one in self.cones])

    def forces(self, y: Array) -> Array:
        """Forces of rows that leave ``y``, (n, rows)."""
        force: Array = np.clip(-self.weights * y, self.low, self.high)
        for one in self.cones:
            one.act(y, self.weights, force)
        return force

    def stiffness(self, y: Array) -> tuple[Array, Array]:
        """The same, and J' S J with minus their derivative by y for S, (n, nv, nv)."""
        free = -self.weights * y
        inside = (free > self.low) & (free < self.high)
        force, weighted = np.clip(free, self.low, self.high), np.where(inside, self.weights, 0.0)[:, :, None] * self.jacobian
        for one in self.cones:
            one.act(y, self.weights, force, (self.jacobian, weighted))
        return force, self.jacobian.transpose(0, 2, 1) @ weighted

    @property
    def associated(self) -> Problem:
        """The convex problem of the same rows."""
        return replace(self, cones=[replace(one, flow=ASSOCIATED) for one in self.cones])

    def system(self, y: Array) -> tuple[Array, Array, Array]:
        """Forces of rows that leave ``y``, minus their derivatives by it, W, (n, rows, rows), and M + J' W J."""
        free, count = -self.weights * y, self.weights.shape[1]
        inside, force = (free > self.low) & (free < self.high), np.clip(free, self.low, self.high)
        unit = np.tile(np.eye(count), (len(y), 1, 1))
        bent = np.where(inside, self.weights, 0.0)[:, :, None] * unit
        for one in self.cones:
            one.act(y, self.weights, force, (unit, bent))
        return force, bent, self.mass + self.jacobian.transpose(0, 2, 1) @ bent @ self.jacobian

    def linear(self, y: Array) -> Array:
        """(n, nv) accelerations by the forces of rows that leave ``y`` and by their derivatives there."""
        force, bent, system = self.system(y)
        pushed = force + _times(bent, self.wanted + y)
        return _solved(system, self.force + _times(self.jacobian.transpose(0, 2, 1), pushed))

    @np.errstate(all="ignore")
    def least(self) -> Array:
        """y = J a - aref at the least, (n, rows), or where the search ends."""
        a = np.zeros_like(self.force)
        left = np.arange(len(a))
        for _ in range(_STEPS):
            own = self[left]
            y = own.left_by(a[left])
            force, stiffness = own.stiffness(y)
            gradient = _times(own.mass, a[left]) - own.force - np.einsum("nri,nr->ni", own.jacobian, force)
            metric = own.mass + stiffness
            direction = -_solved(metric, gradient)
            # A search that breaks down ends where it is.
            direction = np.where(np.isfinite(direction).all(axis=1, keepdims=True), direction, 0.0)
            step = own._lengths(a[left], y, direction)[:, None] * direction
            a[left] += np.where(np.isfinite(step), step, 0.0)
            sizes = [np.sqrt(np.einsum("ni,nij,nj->n", one, metric, one)) for one in (direction, a[left])]
            left = left[np.flatnonzero(~np.asarray(sizes[0] <= _LEAST_STEP * sizes[1]))]
            if not len(left):
                break
        return self.left_by(a)

    def left_by(self, a: Array) -> Array:
        """y of accelerations, (n, rows)."""
        return np.asarray(_times(self.jacobian, a) - self.wanted)

    def _lengths(self, a: Array, y: Array, direction: Array) -> Array:
        """Step along each direction, (n,)."""
        along = _times(self.jacobian, direction)
        constant = np.einsum("ni,ni->n", direction, _times(self.mass, a) - self.force)
        linear = np.einsum("ni,nij,nj->n", direction, self.mass, direction)

        def slope(step: Array) -> Array:
            return np.asarray(constant + step * linear - np.einsum("nr,nr->n", along, self.forces(y + step[:, None] * along)))

        low, high = np.zeros(len(a)), np.ones(len(a))
        start, found = np.abs(slope(low)), slope(high)
        is_done = np.abs(found) <= _FLAT * start
        length = np.where(is_done, high, 0.0)
        for _ in range(_HALVINGS):
            goes_on = ~is_done & (found < 0)
            if not goes_on.any():
                break
            low, high = np.where(goes_on, high, low), np.where(goes_on, 2 * high, high)
            found = np.where(goes_on, slope(high), found)
        for _ in range(_HALVINGS):
            if is_done.all():
                break
            middle = (low + high) / 2
            found = slope(middle)
            length = np.where(is_done, length, middle)
            is_done |= np.abs(found) <= _FLAT**4 * start
            low, high = np.where(found < 0, middle, low), np.where(found < 0, high, middle)
        return length


def _times(matrices: Array, vectors: Array) -> Array:
    return np.asarray(np.einsum("nij,nj->ni", matrices, vectors))


def _solved(matrices: Array, vectors: Array) -> Array:
    """The solutions of n systems, or where one is singular the vectors of least length that are nearest to them."""
    try:
        return np.asarray(np.linalg.solve(matrices, vectors[:, :, None])[:, :, 0])
    except np.linalg.LinAlgError:
        return np.array([np.linalg.lstsq(matrix, vector, rcond=None)[0] for matrix, vector in zip(matrices, vectors, strict=True)])


def left_at(
    zones: Zones, problem: StraightLineProgram, inputs: Array, ranges: Ranges, found: Array, a: Array
) -> tuple[Array, Array, Array]:
    """M, (n, nv, nv), the derivative of F at accelerations a, and J' f there, (n, nv) each; arguments as of ``sides_at_least``."""
    own = problem_of(zones, problem, inputs, found, ranges)
    pushed = np.einsum("nri,nr->ni", own.jacobian, own.forces(own.left_by(a)))
    return own.mass, _times(own.mass, a) - own.force - pushed, pushed


def sides_at_least(zones: Zones, problem: StraightLineProgram, inputs: Array, found: Array, ranges: Ranges | None) -> Sides:
    """The sides of all forces and contacts at the least of F, for inputs (number of inputs, n) and parameters (n, ...) of n states.

    ``problem`` and ``ranges``: as of ``SoftenedProgram`` and of ``Zones.settle``.
    """
    own, clamps = problem_of(zones, problem, inputs, found, ranges), len(zones.clamps)
    y = own.least()
    free, least, most = -own.weights[:, :clamps] * y[:, :clamps], own.low[:, :clamps], own.high[:, :clamps]
    sides = np.where(free < least, -1.0, np.where(free > most, 1.0, 0.0))
    return zones.sides(sides, y[:, clamps : clamps + sum(cone.size for cone in zones.cones)], found)


def problem_of(zones: Zones, problem: StraightLineProgram, inputs: Array, found: Array, ranges: Ranges | None) -> Problem:
    with np.errstate(all="ignore"):
        inputs = inputs[: len(problem.inputs)]
        outputs = approximate_outputs(problem, inputs) or values(problem, inputs)
    clamps, nv, rows = len(zones.clamps), len(outputs["force"]), len(outputs["weights"])
    least, most = zones.bounds(found) if ranges is None else ranges
    low, beyond = np.full((len(found), rows), -np.inf), np.full((len(found), rows), np.inf)
    low[:, :clamps], beyond[:, :clamps] = least, most
    cones = [
        _RoundRows.of(cone, slice(clamps + part.start, clamps + part.stop), found)
        for cone, part in zip(zones.cones, zones.parts, strict=True)
    ]
    mass, jacobian = full_matrices(outputs["mass"]), outputs[JACOBIAN].T.reshape(len(found), rows, nv)
    force, wanted, weights = (np.ascontiguousarray(outputs[name].T) for name in ("force", "wanted", "weights"))
    return Problem(mass, force, jacobian, wanted, weights, low, beyond, cones)
