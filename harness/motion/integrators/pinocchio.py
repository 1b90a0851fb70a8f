"""Pinocchio's ABA on the URDF model, stepped on the configuration manifold by ``pinocchio.integrate``.

The fourth-order method is that of Runge, Kutta and Munthe-Kaas: stages live in the tangent space at the start of the step, u with q = q0
+ u, where the velocity at q becomes u' = J v by the derivative J of the manifold's difference. For joints without quaternions J is the
identity and the method the classical one. Springs and dampers of the file are applied by ``harness.engines.adapters.pinocchio.forces``.
Under constraints accelerations are those of the engine's solver, and nothing brings positions back that drift from where the constraints
hold.

Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., section IV.8; Pinocchio 4 documentation,
``integrate``, ``difference`` and ``dDifference``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.crosscheck.scene import Scene
from harness.library import CONSTRAINED, MECHANISMS
from harness.motion.integrators import Advance, Integrator, keep
from harness.motion.taylor import Path, linear_velocities_turned
from harness.motion.trajectories import Start

# (rates, model, q, v, step) to (q, v).
Scheme = Callable[..., tuple[Array, Array]]


def _semi_implicit_euler(accelerations: Any, model: Any, q: Array, v: Array, step: float) -> tuple[Array, Array]:
    import pinocchio

    v = v + step * accelerations(q, v)
    return pinocchio.integrate(model, q, step * v), v


def _munthe_kaas(accelerations: Any, model: Any, q: Array, v: Array, step: float) -> tuple[Array, Array]:
    import pinocchio

    curved = model.nq > model.nv

    def stage(u: Array, velocity: Array) -> tuple[Array, Array]:
        at = pinocchio.integrate(model, q, u)
        rate = pinocchio.dDifference(model, q, at)[1] @ velocity if curved else velocity
        return rate, accelerations(at, velocity)

    half = step / 2
    u1, v1 = v, accelerations(q, v)
    u2, v2 = stage(half * u1, v + half * v1)
    u3, v3 = stage(half * u2, v + half * v2)
    u4, v4 = stage(step * u3, v + step * v3)
    return pinocchio.integrate(model, q, step * ((u1 + u4) + 2 * (u2 + u3)) / 6), v + step * ((v1 + v4) + 2 * (v2 + v3)) / 6


def prepare(scheme: Scheme, evaluations_per_step: int, scene: Scene) -> Advance:
    """``scheme`` as ``Integrator.prepare``."""
    import pinocchio

    mechanism = scene.mechanism
    loaded = scene.load("pinocchio", "urdf")
    model, force_elements, constraints = loaded.model, loaded.force_elements, loaded.constraints
    data = model.createData()
    positions, velocities = loaded.addresses

    def accelerations(q: Array, v: Array) -> Array:
        if constraints is not None:
            columns = q[:, None], v[:, None], np.asarray(force_elements.at(q, v))[:, None]
            return np.asarray(constraints.accelerations(columns)[0])
        return np.asarray(pinocchio.aba(model, data, q, v, force_elements.at(q, v)))

    def advance(start: Start, step: float, steps: int, every: int) -> Path:
        q, v = np.zeros(model.nq), np.zeros(model.nv)
        q[positions] = start.q
        v[velocities] = linear_velocities_turned(mechanism, start.q[None], start.v[None], into_body=True)[0]

        def go(count: int) -> tuple[Array, Array]:
            nonlocal q, v
            for _ in range(count):
                q, v = scheme(accelerations, model, q, v, step)
            found = q[positions]
            return found, linear_velocities_turned(mechanism, found[None], v[velocities][None], into_body=False)[0]

        return keep(start, step, steps, every, evaluations_per_step, go)

    return advance


SEMI_IMPLICIT_EULER, RUNGE_KUTTA = (
    Integrator(
        name=name,
        format="urdf",
        order=order,
        prepare=partial(prepare, scheme, order),
        long_run=long_run,
        of=(MECHANISMS, CONSTRAINED),
        # Steps are made in Python.
        nominal_seconds=lambda mechanism: 6e-6 + 5e-7 * mechanism.nv,
    )
    for name, order, scheme, long_run in (
        ("pinocchio semi-implicit Euler", 1, _semi_implicit_euler, ""),
        ("pinocchio RK4", 4, _munthe_kaas, "secular"),
    )
)
