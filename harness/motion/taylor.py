"""Equations of motion as a first-order system, and Taylor's method of high order on them, to the precision of the floating-point type.

q' = N(q) v and v' = M^-1 (p - c - g), with the work of the forces. Quaternions turn with half of their product with the angular velocity
in the body's frame; every other position is the integral of its velocity. No forces are applied. Everything is built of heyoka
expressions, so that a Taylor integrator or a whole step of another one compiles into one function.

Where Euler angles come near their singularity the motion goes on in another chart; its state, in joint
positions and velocities, is the same in both.

Source: Featherstone, Rigid Body Dynamics Algorithms, equation 4.13 (quaternion rates); Diebel, Representing
attitude, 2006, section 6; Biscani, Izzo, Revisiting high-order Taylor methods for astrodynamics and celestial mechanics, MNRAS 504
(2021); heyoka.py documentation, ``taylor_adaptive``.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.crosscheck.variation import quaternion_columns
from harness.programs.kernels import MOST_INSTRUCTIONS_UNROLLED, heyoka_expressions, solve_symmetric
from harness.programs.machine_code import load_heyoka
from harness.programs.mechanisms.kernel import Charts
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.program import StraightLineProgram, right_hand_side

# Below it the chart is left, if another one is more regular.
LEAST_REGULARITY = 0.3
Expressions = Sequence[Any]


@dataclass(frozen=True)
class Path:
    """A computed motion at k + 1 times, not a number from where the method broke down.

    Attributes:
        times: (k + 1,) [s], from 0.
        q, v: (k + 1, nq) and (k + 1, nv); quaternions as (w, x, y, z), a free joint's linear velocity in the joint's frame.
        work: (k + 1,) work [J] of the non-conservative forces from the start; None where it was not integrated along.
        evaluations: of the accelerations, a Taylor expansion of order p counted as p.
        seconds: wall time of the motion, without loading and compiling.
    """

    times: Array
    q: Array
    v: Array
    work: Array | None = None
    evaluations: int = 0
    seconds: float = 0.0

    def __getitem__(self, selection: Any) -> Path:
        """The states, without their work, that a slice or a mask selects."""
        return Path(self.times[selection], self.q[selection], self.v[selection])


def named(name: str, count: int) -> list[Any]:
    """``count`` symbols that begin with ``name``."""
    heyoka = load_heyoka()
    return [heyoka.expression(f"{name}{i}") for i in range(count)]


@dataclass(frozen=True)
class FirstOrderSystem:
    """One chart of a mechanism as a first-order system; parameter i is heyoka's ``par[i]``.

    Attributes:
        mechanism: the mechanism; chart: which of ``mechanism.charts(False)`` the equations are from.
    """

    mechanism: Mechanism
    chart: int = 0

    @classmethod
    def each(cls, mechanism: Mechanism) -> tuple[list[FirstOrderSystem], Charts]:
        """The system in every chart, and the choice among them."""
        charts = Charts(mechanism.charts(linear_velocity_in_body=False))
        return [cls(mechanism, chart) for chart in range(len(charts.programs))], charts

    @property
    def program(self) -> StraightLineProgram:
        """The program of the chart."""
        return self.mechanism.charts(linear_velocity_in_body=False)[self.chart]

    @property
    def is_long(self) -> bool:
        """True if it is to be compiled in compact mode."""
        return len(self.program.instructions) > MOST_INSTRUCTIONS_UNROLLED

    def compiled(self, expressions: Expressions, variables: Expressions) -> Any:
        """A function (inputs, outputs=None, time=None) of arrays that evaluates ``expressions`` at the mechanism's parameters."""
        function = load_heyoka().cfunc(list(expressions), vars=list(variables), compact_mode=self.is_long)
        # heyoka wants as many parameters as the highest that occurs.
        parameters = np.array(self.mechanism.parameter_values[: function.nparams])
        return functools.partial(function, pars=parameters)

    def variables(self) -> tuple[list[Any], list[Any]]:
        """Symbols of q (nq) and v (nv), which no mechanism's names clash with."""
        return named("q", self.mechanism.nq), named("v", self.mechanism.nv)

    def position_rates(self, q: Expressions, v: Expressions) -> list[Any]:
        """q', (nq)."""
        rates: list[Any] = list(v)
        for place, columns in zip(self.mechanism.attitudes, quaternion_columns(self.mechanism), strict=True):
            (w, x, y, z), (a, b, c) = q[columns], v[place : place + 3]
            doubled = [-x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a]
            rates[columns.start : columns.start + 3] = [0.5 * rate for rate in doubled]
        return rates

    def rates(self, q: Expressions, v: Expressions, time: Any) -> list[Any]:
        """q' and v', (nq + nv)."""
        return [*self.position_rates(q, v), *self.accelerations(q, v, time)]

    def accelerations(self, q: Expressions, v: Expressions, time: Any) -> list[Any]:
        """v', (nv)."""
        terms = heyoka_expressions(self.program, self._inputs(q, v, time))
        return solve_symmetric(terms["mass"], right_hand_side(terms))

    def energies(self, q: Expressions, v: Expressions, time: Any) -> dict[str, list[Any]]:
        """The outputs of the energy program."""
        return heyoka_expressions(self.mechanism.energy_programs[self.chart], self._inputs(q, v, time))

    def _inputs(self, q: Expressions, v: Expressions, time: Any) -> list[Any]:
        heyoka = load_heyoka()

        parameters = [heyoka.par[i] for i in range(len(self.mechanism.parameters))]
        return [*q, *v, *[heyoka.expression(0.0)] * self.mechanism.nv, time, *parameters]


def conjugate_product(a: Array, b: Array) -> Array:
    """conj(a) b for quaternions (n, 4), as (w, x, y, z)."""
    scalar = np.sum(a * b, axis=-1, keepdims=True)
    vector = a[..., :1] * b[..., 1:] - b[..., :1] * a[..., 1:] - np.cross(a[..., 1:], b[..., 1:])
    return np.concatenate([scalar, vector], axis=-1)


def rotation_vectors(quaternions: Array) -> Array:
    """Rotation vectors (n, 3), no longer than pi, of quaternions (n, 4) of any length but 0."""
    scalar, vector = quaternions[..., :1], quaternions[..., 1:]
    sine = np.linalg.norm(vector.astype(np.float64), axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, np.abs(scalar).astype(np.float64))
    ratio = np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 0)
    return np.asarray(np.where(scalar < 0, -1.0, 1.0) * ratio * vector, dtype=np.float64)


def displacement(mechanism: Mechanism, start: Array, end: Array) -> Array:
    """Tangent vectors (n, nv) from positions ``start`` to ``end``, (n, nq) each: a rotation as its vector in the body's frame."""
    moved = (end - start).astype(np.float64)
    # From the last on, as each has one column less than its quaternion.
    for columns in reversed(quaternion_columns(mechanism)):
        turned = rotation_vectors(conjugate_product(start[:, columns], end[:, columns]))
        moved = np.hstack([moved[:, : columns.start], turned, moved[:, columns.stop :]])
    return moved


def linear_velocities_turned(mechanism: Mechanism, q: Array, v: Array, into_body: bool) -> Array:
    """``v`` (n, nv) with the linear velocities of free joints given in the other frame: the body's, or the joint's."""
    turned = v.copy()
    for place, columns in zip(mechanism.attitudes, quaternion_columns(mechanism), strict=True):
        if mechanism.joints.count(mechanism.joints[place]) == 6:
            quaternion = q[:, columns]
            scalar, axis = quaternion[:, :1], (-1.0 if into_body else 1.0) * quaternion[:, 1:]
            linear = v[:, place - 3 : place]
            cross = np.cross(axis, linear)
            square = np.sum(quaternion**2, axis=1, keepdims=True)
            turned[:, place - 3 : place] = linear + 2 * (scalar * cross + np.cross(axis, cross)) / square
    return turned


class Taylor:
    """Taylor's method for one mechanism; compiled where it is first needed.

    ``floating_point`` is ``numpy.float64``, ``numpy.longdouble`` or ``heyoka.real128``; ``tolerance`` the relative
    error of a step, 0 for that of the type.
    """

    def __init__(self, mechanism: Mechanism, floating_point: Any = np.float64, tolerance: float = 0.0) -> None:
        self.mechanism = mechanism
        self._type = floating_point
        self._tolerance = tolerance
        self._parameters: Array = np.array(mechanism.parameter_values, dtype=floating_point)
        self._systems, self._charts = FirstOrderSystem.each(mechanism)
        self._compiled: dict[int, Any] = {}

    def solve(self, q: Array, v: Array, times: Array) -> Path:
        """The motion from q (nq,) and v (nv,) at ``times`` (n,) [s], increasing; the first is that of the start.

        States and work are in the floating-point type of the method.
        """
        nq, nv = self.mechanism.nq, self.mechanism.nv
        out: Array = np.full((len(times), nq + nv + 1), np.nan, dtype=self._type)
        out[0] = [*q, *v, 0.0]
        state, now, done = out[0], self._type(times[0]), 1
        chart = self._charts.at(state[:nq])
        evaluations, seconds = 0, 0.0
        while done < len(times):
            integrator = self._integrator(chart)
            integrator.time = now
            integrator.state[:] = state
            grid = np.concatenate([[now], times[done:].astype(self._type)])
            started = time.perf_counter()
            outcome, _, _, taken, _, rows = integrator.propagate_grid(grid, callback=self._leaves(chart))
            seconds += time.perf_counter() - started
            evaluations += taken * integrator.order
            out[done : done + len(rows) - 1] = rows[1:]
            done += len(rows) - 1
            now, state = integrator.time, integrator.state.copy()
            if "cb_stop" not in str(outcome):
                break
            chart = self._charts.at(state[:nq])
        return Path(times, out[:, :nq], out[:, nq : nq + nv], out[:, -1], evaluations, seconds)

    def _leaves(self, chart: int) -> Any:
        """The callback that stops an integration where its chart is worse than another one."""
        if len(self._systems) == 1:
            return None

        def goes_on(integrator: Any) -> bool:
            q = integrator.state[: self.mechanism.nq]
            return bool(self._charts.regularity(q[None])[chart, 0] >= LEAST_REGULARITY) or self._charts.at(q) == chart

        return goes_on

    def _integrator(self, chart: int) -> Any:
        if chart not in self._compiled:
            heyoka, system = load_heyoka(), self._systems[chart]
            q, v = system.variables()
            work = heyoka.expression("work")
            # Without energies it is not known which forces are conservative, and no work is counted.
            power = system.energies(q, v, heyoka.time)["power"][0] if self.mechanism.energy_programs else heyoka.expression(0.0)
            rates = [*system.rates(q, v, heyoka.time), power]
            self._compiled[chart] = integrator = heyoka.taylor_adaptive(
                list(zip([*q, *v, work], rates, strict=True)),
                np.zeros(len(rates), dtype=self._type),
                fp_type=self._type,
                high_accuracy=True,
                # Unrolled, wider types run no faster and compile up to thirty times as long.
                compact_mode=system.is_long or self._type is not np.float64,
                **({"tol": self._type(self._tolerance)} if self._tolerance else {}),
            )
            # It has those up to the highest that occurs: none of balls between impacts, whose masses move nothing.
            integrator.pars[:] = self._parameters[: len(integrator.pars)]
        return self._compiled[chart]
