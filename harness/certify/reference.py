"""The certified acceleration at the exact float64 inputs, and its data roundoff.

M and the right-hand side are evaluated in balls and solved rigorously; precision doubles until the
radius is negligible beside the data roundoff, which comes from ``harness.certify.sensitivity``.

Beside it stands the share of the motion: half an ulp of twice the kinetic energy, as a torque on every rotating
coordinate. Engines work in Cartesian frames, in which centripetal forces and v x (m v) are formed and cancel; the
equations have lost these terms to algebra, so no derivative shows them. Without this share a wheel that is carried
along at 10 m/s, or a pendulum at its dead centre, would condemn every general algorithm. It depends on the observer, and
``compare`` grants it only to an answer that would fail without it.

Norms are kinetic-energy norms |x|_M = sqrt(x' M x), which make metres and radians comparable and do
not depend on the choice of coordinates.

Sources: Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., chapter 7; Demmel, Underflow
and the reliability of numerical software, SIAM J. Sci. Stat. Comput. 5 (1984), for inputs near zero.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array, Rows
from harness.certify.factorisation import (
    cholesky_in_balls,
    condition_number,
    forward_substitute,
    norm_over_first_axis,
    scaled_cholesky,
    scaled_condition_number,
)
from harness.certify.sensitivity import PRECISIONS as PRECISIONS
from harness.certify.sensitivity import SMALLEST_SCALE as SMALLEST_SCALE
from harness.certify.sensitivity import UNIT_ROUNDOFF as UNIT_ROUNDOFF
from harness.certify.sensitivity import Sensitivity
from harness.equations.kernels import BallKernel, float64_kernel
from harness.equations.mechanism import Mechanism
from harness.equations.mechanism_kernel import Charts, Indices
from harness.equations.program import OUTPUTS, StraightLineProgram, right_hand_side, upper_triangle
from harness.equations.states import States
from harness.storage import Kept

# Radii relative to the sensitivity (data roundoff over UNIT_ROUNDOFF).
SOUGHT_RADIUS = 2.0**-80
CERTIFIED_RADIUS = 2.0**-60
_STATES_AT_ONCE = 2048
# Of every entry of M that an unstable factorisation may lose.
ROUNDINGS = 16
# Of kappa_s; beyond, rounding M costs its factor too many digits, and it is computed in balls.
MOST_IN_FLOAT64 = 1e8
# Parameter sets whose constants are kept in balls.
_MOST_BOUND = 256


@dataclass(frozen=True)
class Reference(Rows):
    """Certified accelerations of n states, as arrays whose first axis is the state.

    Attributes:
        high, low: (n, nv); the certified midpoint is high + low.
        radius: (n,) energy norm of the radius [sqrt(J)/s].
        norm_factor: (n, nv, nv) upper triangular R with |x|_M = |R x|.
        sensitivity: (n,) sum over inputs z of |dqdd/dz z|_M; the data roundoff is UNIT_ROUNDOFF times it.
        motion: (n,) sum over rotating coordinates i of 2 T |M^-1 e_i|_M; the share of the motion is UNIT_ROUNDOFF times it.
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
    motion: Array
    instability: Array
    certified: np.ndarray[Any, np.dtype[np.bool_]]
    bits: Indices

    def __len__(self) -> int:
        return len(self.high)

    @functools.cached_property
    def size(self) -> Array:
        """(n,) energy norm of the accelerations [sqrt(J)/s]."""
        return energy_norm(self.norm_factor, self.high)

    @property
    def condition(self) -> Array:
        """(n,) kappa_s, the condition number of M scaled to unit diagonal; infinite where M has no Cholesky factor."""
        return scaled_condition_number(self.norm_factor)

    @property
    def data_roundoff(self) -> Array:
        """(n,) energy norm [sqrt(J)/s] of what half an ulp in every input does to qdd."""
        return UNIT_ROUNDOFF * self.sensitivity

    @property
    def roundoff_in_motion(self) -> Array:
        """(n,) data roundoff with the share of the motion [sqrt(J)/s]."""
        return UNIT_ROUNDOFF * (self.sensitivity + self.motion)


class ReferenceKernel:
    """Certified accelerations of one mechanism; compile once, evaluate many batches.

    ``linear_velocity_in_body`` says in which frame the states give the linear velocity of a free joint.
    Each state is evaluated in the chart that is most regular there.
    """

    def __init__(self, mechanism: Mechanism, linear_velocity_in_body: bool = False) -> None:
        self.mechanism = mechanism
        self._choice = Charts(mechanism.charts(linear_velocity_in_body))
        self._charts = [ChartKernel(mechanism, program) for program in self._choice.programs]

    def evaluate(self, states: States, parameters: Array | None = None) -> Reference:
        """The reference at ``states``; a state that cannot be certified is marked, never dropped.

        ``parameters``, (n, number of parameters) in the mechanism's order and units, gives each state its own; by
        default all have the mechanism's. Nothing is derived or compiled anew for them.
        """
        count = len(self.mechanism.parameters)
        if parameters is None:
            parameters = np.broadcast_to(np.array(self.mechanism.parameter_values, dtype=np.float64), (len(states), count))
        if parameters.shape != (len(states), count):
            raise ValueError(f"parameters have shape {parameters.shape}; expected {(len(states), count)}")
        starts = range(0, max(len(states), 1), _STATES_AT_ONCE)
        batches = [slice(start, start + _STATES_AT_ONCE) for start in starts]
        return Reference.concatenate([self._evaluate(states[batch], parameters[batch]) for batch in batches])

    def by_chart(self, states: States) -> Iterator[tuple[ChartKernel, Indices]]:
        """The charts in use, each with the indices of the states at which it is the most regular one; at least one chart."""
        for number, chosen in self._choice.split(states.q):
            yield self._charts[number], chosen

    def _evaluate(self, states: States, parameters: Array) -> Reference:
        parts = [(chart.evaluate(states[chosen], parameters[chosen]), chosen) for chart, chosen in self.by_chart(states)]
        if len(parts) == 1:
            return parts[0][0]
        return Reference.concatenate([part for part, _ in parts])[np.argsort(np.concatenate([chosen for _, chosen in parts]))]


class ChartKernel:
    """The reference of one mechanism by one of its programs."""

    def __init__(self, mechanism: Mechanism, program: StraightLineProgram) -> None:
        self.mechanism = mechanism
        self.float64 = float64_kernel(program)
        self._sensitivity = Sensitivity(self.float64)
        self._balls = BallKernel(program, len(mechanism.parameters))
        self._bound: Kept[Callable[..., tuple[Any, ...]]] = Kept(_MOST_BOUND)

    def evaluate(self, states: States, parameters: Array) -> Reference:
        """The reference of a batch that fits into memory at once, each state with its row of ``parameters``."""
        n, nv = len(states), self.mechanism.nv
        high, low, radii, scale, factor = np.empty((n, nv)), np.empty((n, nv)), np.empty((n, nv)), np.empty((nv, n)), np.empty((nv, nv, n))
        norm_factor, sensitivity, motion, instability = np.empty((n, nv, nv)), np.empty(n), np.empty(n), np.empty(n)
        bits, radius = np.zeros(n, dtype=np.int64), np.empty(n)
        with np.errstate(all="ignore"):
            pending = np.arange(n)
            for precision in PRECISIONS:
                now, values = states[pending], parameters[pending]
                results = self._certify(now, values, precision)
                high[pending], low[pending], radii[pending], scale[:, pending], factor[:, :, pending] = results
                bits[pending] = precision
                inputs, found = self.mechanism.inputs(now, values), (results[0], scale[:, pending], factor[:, :, pending])
                condition = condition_number(found[-1])
                sensitivity[pending] = self._sensitivity.evaluate(inputs, *found, condition)
                norm_factor[pending], motion[pending], instability[pending] = self._norms(now, inputs, *found, condition)
                radius[pending] = energy_norm(np.abs(norm_factor[pending]), radii[pending])
                pending = pending[~(radius[pending] <= SOUGHT_RADIUS * sensitivity[pending]) & np.isfinite(now.q).all(axis=1)]
                if not len(pending):
                    break
            certified = (radius <= CERTIFIED_RADIUS * sensitivity) & np.isfinite(sensitivity)
        return Reference(high, low, radius, norm_factor, sensitivity, motion, instability, certified, bits)

    def _certify(self, states: States, parameters: Array, precision: int) -> tuple[Array, Array, Array, Array, Array]:
        """(high, low, radius), (n, nv) each, of the accelerations at one precision; scale and factor of M, see ``scaled_cholesky``."""
        import flint

        nv = self.mechanism.nv
        pairs = upper_triangle(nv)
        results = np.empty((len(states), 3, nv))
        exact: list[tuple[Any, ...]] = []
        with flint.ctx.workprec(precision):
            for index, (row, values) in enumerate(self.in_balls(states, parameters)):
                outputs = {name: values[len(pairs) + k * nv :][:nv] for k, name in enumerate(OUTPUTS[1:])}
                force = right_hand_side(outputs, [flint.arb(applied) for applied in row[self.mechanism.nq + nv :][:nv]])
                exact.append(values[: len(pairs)])
                solution = _solve(values[: len(pairs)], pairs, force, nv)
                for i, ball in enumerate(solution):
                    results[index, :, i] = parts_of(ball)
            scale, factor = factorise(exact, nv)
        return results[:, 0], results[:, 1], results[:, 2], scale, factor

    def in_balls(self, states: States, parameters: Array) -> Iterator[tuple[list[float], tuple[Any, ...]]]:
        """q, v, tau and time of each state, and the program's outputs there as ``arb`` at the working precision."""
        import flint

        rows = np.hstack([states.q, states.v, states.tau, states.time[:, None]]).tolist()
        for row, values_of_parameters in zip(rows, map(tuple, parameters.tolist()), strict=True):
            bind = functools.partial(self._balls.bind, values_of_parameters)
            yield row, self._bound.get((flint.ctx.prec, values_of_parameters), bind)(*row)

    def _norms(
        self, states: States, inputs: Array, accelerations: Array, scale: Array, factor: Array, condition: Array
    ) -> tuple[Array, Array, Array]:
        """``norm_factor``, ``motion`` and ``instability`` at the given accelerations, factors of M and their condition numbers."""
        nv = self.mechanism.nv
        terms = self.float64.terms(inputs)
        norm_factor = factor.transpose(2, 1, 0) * scale.T[:, None, :]
        torques = np.broadcast_to(np.diag(np.array(self.mechanism.rotating, dtype=np.float64))[:, :, None], (nv, nv, len(states)))
        of_torques = norm_over_first_axis(forward_substitute(factor, torques / scale[:, None])).sum(axis=0)
        motion = energy_norm(norm_factor, states.v) ** 2 * of_torques
        separate = np.stack([states.tau, terms["velocity"], terms["gravity"], terms["passive"]], axis=1).T
        of_terms = norm_over_first_axis(forward_substitute(factor, separate / scale[:, None])).sum(axis=0)
        instability = ROUNDINGS * nv * condition * (energy_norm(norm_factor, accelerations) + of_terms)
        return norm_factor, motion, instability


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


def energy_norm(norm_factor: Array, vectors: Array) -> Array:
    """|x|_M per state, for norm_factor (n, nv, nv) and vectors (n, nv)."""
    # Reductions over the first axis of what numpy would lay out by states take four times as long.
    return norm_over_first_axis(np.einsum("nij,nj->in", norm_factor, vectors, order="C"))
