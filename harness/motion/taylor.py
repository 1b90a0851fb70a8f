"""Taylor's method of high order on the equations of motion, to the precision of the floating-point type.

Where Euler angles come near their singularity the motion goes on in another chart; its state, in joint
positions and velocities, is the same in both.

Source: Biscani, Izzo, Revisiting high-order Taylor methods for astrodynamics and celestial mechanics, MNRAS 504
(2021); heyoka.py documentation, ``taylor_adaptive``.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.motion.first_order import FirstOrderSystem
from harness.programs.machine_code import load_heyoka
from harness.programs.mechanisms.kernel import Charts
from harness.programs.mechanisms.mechanism import Mechanism

# Below it the chart is left, if another one is more regular.
LEAST_REGULARITY = 0.3


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
        self._systems = [FirstOrderSystem(mechanism, chart) for chart in range(len(mechanism.charts(False)))]
        self._compiled: dict[int, Any] = {}
        self._charts = Charts(mechanism.charts(linear_velocity_in_body=False))

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
        heyoka = load_heyoka()

        if chart not in self._compiled:
            system = self._systems[chart]
            q, v = system.variables()
            work = heyoka.expression("work")
            # Without energies it is not known which forces are conservative, and no work is counted.
            power = system.energies(q, v, heyoka.time)["power"] if self.mechanism.energy_programs else heyoka.expression(0.0)
            rates = [*system.position_rates(q, v), *system.accelerations(q, v, heyoka.time), power]
            self._compiled[chart] = heyoka.taylor_adaptive(
                list(zip([*q, *v, work], rates, strict=True)),
                np.zeros(len(rates), dtype=self._type),
                pars=self._parameters,
                fp_type=self._type,
                high_accuracy=True,
                # Unrolled, wider types run no faster and compile up to thirty times as long.
                compact_mode=system.is_long or self._type is not np.float64,
                **({"tol": self._type(self._tolerance)} if self._tolerance else {}),
            )
        return self._compiled[chart]
