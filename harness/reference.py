"""The certified acceleration at the exact float64 inputs, and its data roundoff.

M and the right-hand side are evaluated in balls and solved rigorously; precision doubles until the
radius is negligible beside the data roundoff. Data roundoff comes from M dqdd = d(rhs) - dM qdd with
exact derivatives, compiled to float64.

To it is added half an ulp of twice the kinetic energy, as a torque on every rotating coordinate. Engines
work in Cartesian frames, in which centripetal forces and v x (m v) are formed and cancel; the equations
have lost these terms to algebra, so no derivative shows them. Without this share a wheel that is carried
along at 10 m/s, or a pendulum at its dead centre, would condemn every general algorithm.

Norms are kinetic-energy norms |x|_M = sqrt(x' M x), which make metres and radians comparable and do
not depend on the choice of coordinates.

Sources: Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., chapter 7; Demmel, Underflow
and the reliability of numerical software, SIAM J. Sci. Stat. Comput. 5 (1984), for inputs near zero.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from harness.kernels import Array, BallKernel, Float64Kernel, upper_triangle
from harness.mechanism import Mechanism
from harness.program import StraightLineProgram
from harness.states import States

UNIT_ROUNDOFF = 2.0**-53
FIRST_PRECISION = 128
LAST_PRECISION = 4096
# Radii relative to the sensitivity (data roundoff over UNIT_ROUNDOFF).
SOUGHT_RADIUS = 2.0**-80
CERTIFIED_RADIUS = 2.0**-60
# Half an ulp stops shrinking at the smallest subnormal number, 2^-1074: the roundoff of an input z is
# UNIT_ROUNDOFF * max(|z|, SMALLEST_SCALE).
SMALLEST_SCALE = 2.0**-1021
_STATES_AT_ONCE = 2048


@dataclass(frozen=True)
class Reference:
    """Certified accelerations of n states, as arrays whose first axis is the state.

    Attributes:
        high, low: (n, nv); the certified midpoint is high + low.
        radius: (n,) energy norm of the radius [sqrt(J)/s].
        norm_factor: (n, nv, nv) upper triangular R with |x|_M = |R x|.
        sensitivity: (n,) sum over inputs z of |dqdd/dz z|_M, and over rotating coordinates i of
            2 T |M^-1 e_i|_M; the data roundoff is UNIT_ROUNDOFF times it.
        instability: (n,) 16 nv kappa_s (|qdd|_M + norms of the separate terms of qdd); an error up to
            UNIT_ROUNDOFF times it is within what an unstable factorisation of M can lose.
        certified: (n,) whether radius <= CERTIFIED_RADIUS * sensitivity.
        bits: (n,) precision that was needed.
    """

    high: Array
    low: Array
    radius: Array
    norm_factor: Array
    sensitivity: Array
    instability: Array
    certified: np.ndarray[Any, np.dtype[np.bool_]]
    bits: np.ndarray[Any, np.dtype[np.int64]]

    def __len__(self) -> int:
        return len(self.high)

    def __getitem__(self, selection: Any) -> Reference:
        """The references that a slice or an index array selects."""
        return Reference(*(getattr(self, field.name)[selection] for field in fields(Reference)))

    @property
    def data_roundoff(self) -> Array:
        """(n,) energy norm [sqrt(J)/s] of what half an ulp in every input does to qdd."""
        return UNIT_ROUNDOFF * self.sensitivity

    @staticmethod
    def concatenate(parts: list[Reference]) -> Reference:
        """The references of consecutive batches as one."""
        return Reference(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Reference)))


class ReferenceKernel:
    """Certified accelerations of one mechanism; compile once, evaluate many batches.

    ``linear_velocity_in_body`` says in which frame the states give the linear velocity of a free joint.
    Each state is evaluated in the chart that is most regular there.
    """

    def __init__(self, mechanism: Mechanism, linear_velocity_in_body: bool = False) -> None:
        self.mechanism = mechanism
        self._charts = [_ChartKernel(mechanism, program) for program in mechanism.charts(linear_velocity_in_body)]

    def evaluate(self, states: States) -> Reference:
        """The reference at ``states``; a state that cannot be certified is marked, never dropped."""
        parts = [self._evaluate(states[start : start + _STATES_AT_ONCE]) for start in range(0, max(len(states), 1), _STATES_AT_ONCE)]
        return Reference.concatenate(parts)

    def _evaluate(self, states: States) -> Reference:
        if len(self._charts) == 1 or not len(states):
            return self._charts[0].evaluate(states)
        with np.errstate(all="ignore"):
            regularity = np.array([chart.float64.regularity(self.mechanism.inputs(states)) for chart in self._charts])
        best = np.nan_to_num(regularity, nan=-1.0).argmax(axis=0)
        parts, places = [], []
        for number, chart in enumerate(self._charts):
            chosen = np.flatnonzero(best == number)
            if len(chosen):
                parts.append(chart.evaluate(states[chosen]))
                places.append(chosen)
        return Reference.concatenate(parts)[np.argsort(np.concatenate(places))]


class _ChartKernel:
    """The reference of one mechanism by one of its programs."""

    def __init__(self, mechanism: Mechanism, program: StraightLineProgram) -> None:
        self.mechanism = mechanism
        self.float64 = Float64Kernel(program)
        self._balls = BallKernel(program, len(mechanism.parameters))
        self._bound: dict[int, Callable[..., tuple[Any, ...]]] = {}

    def evaluate(self, states: States) -> Reference:
        """The reference of a batch that fits into memory at once."""
        n, nv = len(states), self.mechanism.nv
        high, low, radii, mass = np.empty((n, nv)), np.empty((n, nv)), np.empty((n, nv)), np.empty((n, nv, nv))
        bits = np.zeros(n, dtype=np.int64)
        with np.errstate(all="ignore"):
            pending = np.arange(n)
            precision = FIRST_PRECISION
            while True:
                high[pending], low[pending], radii[pending], mass[pending] = self._certify(states[pending], precision)
                bits[pending] = precision
                norm_factor, sensitivity, instability = self._norms(states, high, mass)
                radius = energy_norm(np.abs(norm_factor), radii)
                pending = np.flatnonzero(~(radius <= SOUGHT_RADIUS * sensitivity) & np.isfinite(states.q).all(axis=1))
                precision *= 2
                if precision > LAST_PRECISION or not len(pending):
                    break
            certified = (radius <= CERTIFIED_RADIUS * sensitivity) & np.isfinite(sensitivity)
        return Reference(high, low, radius, norm_factor, sensitivity, instability, certified, bits)

    def _certify(self, states: States, precision: int) -> tuple[Array, Array, Array, Array]:
        """(high, low, radius), (n, nv) each, of the accelerations at one precision, and M rounded, (n, nv, nv)."""
        import flint

        nv = self.mechanism.nv
        pairs = upper_triangle(nv)
        n = len(states)
        results = np.empty((n, 3, nv))
        mass = np.empty((n, nv, nv))
        previous, flint.ctx.prec = flint.ctx.prec, precision
        try:
            if precision not in self._bound:
                self._bound[precision] = self._balls.bind(self.mechanism.parameter_values)
            evaluate = self._bound[precision]
            rows = np.hstack([states.q, states.v, states.tau, states.time[:, None]]).tolist()
            for index, row in enumerate(rows):
                values = evaluate(*row)
                velocity, gravity, passive = (values[len(pairs) + k * nv : len(pairs) + (k + 1) * nv] for k in range(3))
                force = [flint.arb(row[self.mechanism.nq + nv + i]) + passive[i] - velocity[i] - gravity[i] for i in range(nv)]
                for (i, j), entry in zip(pairs, values, strict=False):
                    mass[index, i, j] = mass[index, j, i] = float(entry)
                solution = _solve(values[: len(pairs)], pairs, force, nv)
                for i, ball in enumerate(solution):
                    midpoint = float(ball)
                    results[index, 0, i] = midpoint
                    results[index, 1, i] = float(ball - midpoint)
                    results[index, 2, i] = float(ball.rad())
        finally:
            flint.ctx.prec = previous
        return results[:, 0], results[:, 1], results[:, 2], mass

    def _norms(self, states: States, accelerations: Array, mass: Array) -> tuple[Array, Array, Array]:
        """``norm_factor``, ``sensitivity`` and ``instability`` at the given accelerations and mass matrices."""
        nv = self.mechanism.nv
        inputs = self.mechanism.inputs(states)
        terms = self.float64.terms(inputs)
        scale, factor = _scaled_cholesky(mass)
        derivatives = self.float64.input_derivatives(inputs, np.ascontiguousarray(accelerations.T))
        columns = derivatives * np.maximum(np.abs(inputs), SMALLEST_SCALE)[None]
        sensitivity = _norm_over_first_axis(_forward_substitute(factor, columns / scale[:, None])).sum(axis=0)
        norm_factor = factor.transpose(2, 1, 0) * scale.T[:, None, :]
        torques = np.broadcast_to(np.diag(np.array(self.mechanism.rotating, dtype=np.float64))[:, :, None], (nv, nv, len(states)))
        of_torques = _norm_over_first_axis(_forward_substitute(factor, torques / scale[:, None])).sum(axis=0)
        sensitivity = sensitivity + energy_norm(norm_factor, states.v) ** 2 * of_torques
        separate = np.stack([states.tau, terms["velocity"], terms["gravity"], terms["passive"]], axis=1).T
        of_terms = _norm_over_first_axis(_forward_substitute(factor, separate / scale[:, None])).sum(axis=0)
        correlation = mass / scale.T[:, :, None] / scale.T[:, None, :]
        instability = 16 * nv * _condition_number(correlation) * (energy_norm(norm_factor, accelerations) + of_terms)
        return norm_factor, sensitivity, instability


def _solve(upper: Any, pairs: list[tuple[int, int]], force: list[Any], nv: int) -> list[Any]:
    """M qdd = force in balls; all indeterminate where M is not certainly regular."""
    import flint

    if nv == 1:
        return [force[0] / upper[0]]
    entries = dict(zip(pairs, upper, strict=True))
    mass = flint.arb_mat([[entries[min(i, j), max(i, j)] for j in range(nv)] for i in range(nv)])
    try:
        solution = mass.solve(flint.arb_mat([[entry] for entry in force]))
    except ZeroDivisionError:
        return [flint.arb.nan()] * nv
    return [solution[i, 0] for i in range(nv)]


def _scaled_cholesky(mass: Array) -> tuple[Array, Array]:
    """Scale (nv, n) and lower factor (nv, nv, n) of M = diag(scale) L L' diag(scale), L L' of unit diagonal.

    NaN where M is not positive definite in float64. Scaling first costs no digits and saves those that
    badly scaled coordinates would lose (van der Sluis).
    """
    n, nv = mass.shape[:2]
    scale = np.sqrt(np.diagonal(mass, axis1=1, axis2=2).T)
    scaled = mass.transpose(1, 2, 0) / scale[:, None] / scale[None]
    factor = np.zeros((nv, nv, n))
    for j in range(nv):
        factor[j, j] = np.sqrt(scaled[j, j] - (factor[j, :j] ** 2).sum(axis=0))
        for i in range(j + 1, nv):
            factor[i, j] = (scaled[i, j] - (factor[i, :j] * factor[j, :j]).sum(axis=0)) / factor[j, j]
    return scale, factor


def _forward_substitute(factor: Array, columns: Array) -> Array:
    """L^-1 columns, for factor (nv, nv, n) and columns (nv, k, n)."""
    solution = np.empty_like(columns)
    for i in range(len(columns)):
        known = (factor[i, :i, None] * solution[:i]).sum(axis=0)
        solution[i] = (columns[i] - known) / factor[i, i]
    return solution


def _norm_over_first_axis(vectors: Array) -> Array:
    """Euclidean norms along axis 0, without overflow or underflow in the squares."""
    largest = np.abs(vectors).max(axis=0)
    divisor = np.where(largest > 0, largest, 1.0)
    return np.asarray(largest * np.sqrt(((vectors / divisor) ** 2).sum(axis=0)))


def energy_norm(norm_factor: Array, vectors: Array) -> Array:
    """|x|_M per state, for norm_factor (n, nv, nv) and vectors (n, nv)."""
    return _norm_over_first_axis(np.einsum("nij,nj->in", norm_factor, vectors))


def _condition_number(matrices: Array) -> Array:
    """2-norm condition numbers of symmetric matrices (n, nv, nv); infinite where not positive definite."""
    usable = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    eigenvalues = np.linalg.eigvalsh(np.where(usable[:, None, None], matrices, 0.0))
    smallest, largest = eigenvalues[:, 0], eigenvalues[:, -1]
    return np.where(usable & (smallest > 0), largest / np.where(smallest > 0, smallest, 1.0), np.inf)
