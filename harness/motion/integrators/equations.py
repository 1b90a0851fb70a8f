"""Integrators of the derived equations, with whole steps compiled into one function where they are short enough.

Quaternions are integrated as four numbers and brought back to unit length after each step, which no order feels:
the equations hold for any length.

Sources: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., sections II.1 and II.5 (RK4 and
DOP853); Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., section I.1 (symplectic Euler), called
Euler-Cromer after Cromer, Stable solutions using the Euler approximation, Am. J. Phys. 49 (1981); heyoka.py
documentation, ``cfunc`` and ``taylor_adaptive``.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.crosscheck.scene import Scene
from harness.crosscheck.variation import quaternion_columns
from harness.motion.integrators import KINDS, Advance, Integrator, keep
from harness.motion.taylor import FirstOrderSystem, Path, Taylor
from harness.motion.trajectories import Start
from harness.programs.machine_code import load_heyoka

# A function of more instructions takes longer to compile than it saves.
MOST_INSTRUCTIONS = 1100
MOST_STEPS_AT_ONCE = 16
# Below it SciPy's step control fights rounding.
LEAST_TOLERANCE = 3e-14

# (accelerations, position rates, q, v, time, step) to (q, v), on arrays of numbers or of expressions alike.
Scheme = Callable[..., tuple[Any, Any]]


def _euler_cromer(accelerations: Any, position_rates: Any, q: Any, v: Any, now: Any, step: Any) -> tuple[Any, Any]:
    v = v + step * accelerations(q, v, now)
    return q + step * position_rates(q, v), v


def _runge_kutta(accelerations: Any, position_rates: Any, q: Any, v: Any, now: Any, step: Any) -> tuple[Any, Any]:
    half = 0.5 * step
    q1, v1 = position_rates(q, v), accelerations(q, v, now)
    at_q, at_v = q + half * q1, v + half * v1
    q2, v2 = position_rates(at_q, at_v), accelerations(at_q, at_v, now + half)
    at_q, at_v = q + half * q2, v + half * v2
    q3, v3 = position_rates(at_q, at_v), accelerations(at_q, at_v, now + half)
    at_q, at_v = q + step * q3, v + step * v3
    q4, v4 = position_rates(at_q, at_v), accelerations(at_q, at_v, now + step)
    return q + step * ((q1 + q4) + 2.0 * (q2 + q3)) / 6.0, v + step * ((v1 + v4) + 2.0 * (v2 + v3)) / 6.0


class CompiledSteps:
    """A one-step method on a mechanism: as many whole steps in a compiled function as are worth their compilation."""

    def __init__(self, scene: Scene, scheme: Scheme, stages: int) -> None:
        self._mechanism = scene.mechanism
        self._scheme = scheme
        self._stages = stages
        systems, self._charts = FirstOrderSystem.each(scene.mechanism)
        room = MOST_INSTRUCTIONS // (stages * len(scene.mechanism.program.instructions))
        # The chart is chosen before each step where there are several.
        self._at_once = 1 if room < 1 or len(systems) > 1 else 2 ** int(np.log2(min(room, MOST_STEPS_AT_ONCE)))
        make = self._whole_steps if room else self._separate_stages
        # By chart and number of steps; each changes a state in place.
        self._compiled = {(chart, count): make(system, count) for chart, system in enumerate(systems) for count in {1, self._at_once}}

    def advance(self, start: Start, step: float, steps: int, every: int) -> Path:
        nq, nv = self._mechanism.nq, self._mechanism.nv
        # q, v, time and step.
        state = np.array([*start.q, *start.v, 0.0, step])

        def go(count: int) -> tuple[Array, Array]:
            many, one = divmod(count, self._at_once)
            for size, times in ((self._at_once, many), (1, one)):
                for _ in range(times):
                    self._compiled[self._charts.at(state[:nq]), size](state)
            return state[:nq], state[nq : nq + nv]

        return keep(start, step, steps, every, self._stages, go)

    def _whole_steps(self, system: FirstOrderSystem, count: int) -> Callable[[Array], None]:
        heyoka = load_heyoka()

        positions, velocities = system.variables()
        now, step = heyoka.expression("now"), heyoka.expression("step")
        q, v, later = np.array(positions), np.array(velocities), now
        for _ in range(count):
            q, v = self._scheme(
                lambda *at: np.array(system.accelerations(*at)), lambda *at: np.array(system.position_rates(*at)), q, v, later, step
            )
            q = self._normalised(q, heyoka.sqrt)
            later = later + step
        function = system.compiled([*q, *v, later], [*positions, *velocities, now, step])
        outputs = np.empty(len(q) + len(v) + 1)

        def go(state: Array) -> None:
            function(state, outputs=outputs)
            state[:-1] = outputs

        return go

    def _separate_stages(self, system: FirstOrderSystem, count: int) -> Callable[[Array], None]:
        positions, velocities = system.variables()
        now, nq, nv = load_heyoka().expression("now"), len(positions), len(velocities)
        function = system.compiled(system.accelerations(positions, velocities, now), [*positions, *velocities, now])

        def accelerations(q: Array, v: Array, at: float) -> Array:
            return np.asarray(function(np.array([*q, *v, at])))

        def go(state: Array) -> None:
            for _ in range(count):
                q, v = self._scheme(
                    accelerations, lambda *at: np.array(system.position_rates(*at)), state[:nq], state[nq : nq + nv], state[-2], state[-1]
                )
                state[:nq], state[nq : nq + nv] = self._normalised(q, np.sqrt), v
                state[-2] += state[-1]

        return go

    def _normalised(self, q: Any, square_root: Any) -> Any:
        for columns in quaternion_columns(self._mechanism):
            w, x, y, z = q[columns]
            q[columns] = q[columns] / square_root((w * w + x * x) + (y * y + z * z))
        return q


def _dormand_prince(scene: Scene) -> Advance:
    systems, charts = FirstOrderSystem.each(scene.mechanism)
    nq, now = scene.mechanism.nq, load_heyoka().expression("now")
    functions = []
    for system in systems:
        q, v = system.variables()
        functions.append(system.compiled(system.rates(q, v, now), [*q, *v, now]))

    def rates_at(at: float, state: Array) -> Array:
        return np.asarray(functions[charts.at(state[:nq])](np.append(state, at)))

    def advance(start: Start, tolerance: float, intervals: int, every: int) -> Path:
        import scipy.integrate

        times = np.linspace(0.0, start.horizon, intervals + 1)
        state = np.concatenate([start.q, start.v])
        # An absolute part, for what passes through 0, is as far below the relative one as the state is below 1.
        size = float(np.abs(state).max()) or 1.0
        allowed = max(tolerance, LEAST_TOLERANCE)
        began = time.perf_counter()
        found = scipy.integrate.solve_ivp(
            rates_at, (0.0, start.horizon), state, method="DOP853", t_eval=times, rtol=allowed, atol=allowed * size
        )
        seconds = time.perf_counter() - began
        states = np.full((len(times), len(state)), np.nan)
        states[: found.y.shape[1]] = found.y.T
        return Path(times, states[:, :nq], states[:, nq:], None, found.nfev, seconds)

    return advance


def _taylor(scene: Scene) -> Advance:
    solvers: dict[float, Taylor] = {}

    def advance(start: Start, tolerance: float, intervals: int, every: int) -> Path:
        solver = solvers.setdefault(tolerance, Taylor(scene.mechanism, tolerance=tolerance))
        return solver.solve(start.q, start.v, np.linspace(0.0, start.horizon, intervals + 1))

    return advance


# Symplectic, with an energy that stays bounded, only where M is constant: else theory is silent on its energy.
EULER_CROMER = Integrator(
    name="equations Euler-Cromer",
    format="equations",
    order=1,
    prepare=lambda scene: CompiledSteps(scene, _euler_cromer, 1).advance,
    of=KINDS,
)
RUNGE_KUTTA = Integrator(
    name="equations RK4",
    format="equations",
    order=4,
    prepare=lambda scene: CompiledSteps(scene, _runge_kutta, 4).advance,
    long_run="secular",
    of=KINDS,
)
DORMAND_PRINCE = Integrator(name="equations DOP853", format="equations", order=None, prepare=_dormand_prince, adaptive=True, of=KINDS)
TAYLOR = Integrator(name="equations Taylor", format="equations", order=None, prepare=_taylor, adaptive=True, of=KINDS)
