"""Pinocchio on URDF models with constraints: its two algorithms, by proximal parameter and number of iterations.

``constraintDynamics`` iterates to the rigid problem from any mu above 0; called without settings, it takes mu = 0 and one iteration.
One iteration at mu solves (J M^-1 J' + mu) lambda = J M^-1 f + J' v: constraints that give with the weight 1 / mu, and nothing to bring
them back. It is held against the rigid problem, and, as "declared", against that one.
``lcaba`` eliminates joints in an order of its own, and what rounding leaves of M + J' J / mu stays, so that a smaller mu is worse.
What either says of its own answers, ``absolute_residual``, stands beside the error.

Source: Pinocchio 4.1, algorithm/constrained-dynamics, algorithm/loop-constrained-aba;
see ``harness.engines.adapters.pinocchio.constraints``.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from harness.arrays import Array
from harness.bench.methods import Method, Prepared
from harness.crosscheck.scene import Scene
from harness.engines.adapters.pinocchio import PinocchioModel
from harness.engines.adapters.pinocchio.constraints import ACCURATE, LoopConstraints, Solver
from harness.files.text.scan import compact
from harness.library import CONSTRAINED
from harness.programs.mechanisms.constraint_forces import Softness
from harness.programs.states import States
from harness.truth.quantities.accelerations import AccelerationTruth, softened


def _solved(solver: Solver, scene: Scene, states: States, is_declared: bool = False) -> Prepared:
    loaded: PinocchioModel = scene.load("pinocchio", "urdf")
    model = loaded.solved_by(solver)
    constraints, elements = model.constraints, model.force_elements
    assert isinstance(constraints, LoopConstraints)
    configuration, velocity, applied = model.columns(states.q, states.v, states.tau)
    last = [np.full_like(states.v, np.nan)]

    def columns() -> tuple[Array, Array, Array]:
        return configuration, velocity, applied if elements.empty else applied + elements.generalised_forces(configuration, velocity)

    def compute() -> None:
        last[0] = constraints.accelerations(columns())

    def reproducer(state: int, certified: Array) -> str:
        source = repr(compact(scene.models["urdf"].text))
        return model.reproducer(source, states.q[state], states.v[state], states.tau[state], certified)

    return Prepared(
        compute,
        lambda: np.ascontiguousarray(last[0][:, model.addresses[1]]),
        reproducer=reproducer,
        truth=_single_iteration(solver, scene) if is_declared else None,
        residual=None if solver.mu is None else lambda: constraints.residuals(columns()),
    )


def _single_iteration(solver: Solver, scene: Scene) -> AccelerationTruth:
    """The problem that one proximal iteration solves."""
    constraints = scene.mechanism.constraints
    assert constraints is not None and solver.iterations == 1 and solver.mu
    # Half of the impedance on either side: the weight d / ((1 - d) A) is 1 / mu.
    law = Softness(impedance=0.5, stiffness=0.0, damping=0.0, inverse_mass=solver.mu)
    return AccelerationTruth(softened(scene.mechanism, [law] * len(constraints.rows)), rigid=AccelerationTruth(scene.mechanism))


def _method(name: str, solver: Solver, is_declared: bool = False) -> Method:
    prepare = partial(_solved, solver, is_declared=is_declared)
    return Method(f"pinocchio {name}", "urdf", prepare, "Python", "up to 3", linear_velocity_in_body=True, of=(CONSTRAINED,))


DEFAULTS = _method("constraintDynamics, default settings", Solver(mu=None))
ONE_ITERATION = _method("constraintDynamics, mu 1e-6, one iteration", Solver(mu=1e-6, iterations=1))
DECLARED_ITERATION = _method("constraintDynamics, mu 1e-6, one iteration, declared", Solver(mu=1e-6, iterations=1), is_declared=True)
LARGE_MU = _method("constraintDynamics, mu 1e-6", Solver(mu=1e-6))
SMALL_MU = _method("constraintDynamics, mu 1e-12", ACCURATE)
LOOP_BODIES = _method("lcaba, mu 1e-6", Solver("lcaba", mu=1e-6, iterations=20))
LOOP_BODIES_SMALL_MU = _method("lcaba, mu 1e-10", Solver("lcaba", mu=1e-10, iterations=5))
