"""Pinocchio on the URDF model; on models with constraints its two algorithms, by proximal parameter and number of iterations.

The forces of springs and dampers that a URDF declares are no part of Pinocchio's dynamics. The harness adds
them from Pinocchio's own kinematics, and they are part of what is timed.

``constraintDynamics`` iterates to the rigid problem from any mu above 0; called without settings, it takes mu = 0 and one iteration.
One iteration at mu solves (J M^-1 J' + mu) lambda = J M^-1 f + J' v: constraints that give with the weight 1 / mu, and nothing to bring
them back. It is held against the rigid problem, and, as "declared", against that one.
``lcaba`` eliminates joints in an order of its own, and what rounding leaves of M + J' J / mu stays, so that a smaller mu is worse.
What either says of its own answers, ``absolute_residual``, stands beside the error.

Source: Featherstone, Rigid Body Dynamics Algorithms, chapters 6 (composite rigid bodies, and the sparse
factorisation of M) and 7 (articulated bodies); Pinocchio 4.1, algorithm/constrained-dynamics, algorithm/loop-constrained-aba;
see ``harness.engines.adapters.pinocchio.constraints``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.arrays import Array
from harness.bench.methods import Method, Prepared, reproducer_of
from harness.crosscheck.scene import Scene
from harness.engines.adapters.pinocchio.solver import Solver
from harness.library import CONSTRAINED, MECHANISMS
from harness.programs.mechanisms.softened import Softness
from harness.programs.states import States
from harness.truth.declared import softened
from harness.truth.quantities.accelerations import AccelerationTruth

if TYPE_CHECKING:
    from harness.engines.adapters.pinocchio.model import PinocchioModel


class _Batch:
    """States in Pinocchio's own form, and the accelerations found for them."""

    def __init__(self, loaded: PinocchioModel, states: States) -> None:
        self.model, self._loaded = loaded.model, loaded
        self.configuration, self.velocity, self._applied = loaded.columns(states.q, states.v, states.tau)
        # ``full_like`` of a single row has the strides of rows, by which Pinocchio writes beyond its end.
        self._total, self.found = (np.zeros(self._applied.shape, order="F") for _ in range(2))
        self.found.fill(np.nan)

    def force(self) -> Array:
        """(nv, n): applied forces with those of the force elements."""
        elements = self._loaded.force_elements
        if elements.empty:
            return self._applied
        return np.add(self._applied, elements.generalised_forces(self.configuration, self.velocity), out=self._total)

    def prepared(self, compute: Callable[[], object]) -> Prepared:
        velocities = self._loaded.addresses[1]
        note = "" if self._loaded.force_elements.empty else "includes the forces of the springs and dampers in the URDF"
        return Prepared(compute, lambda: np.ascontiguousarray(self.found[velocities].T), note)

    def one_by_one(self, accelerations: Callable[..., Array]) -> Prepared:
        """``accelerations`` of (model, data, q, v, force), called for one state after the other."""
        model, data = self.model, self.model.createData()
        rows = list(zip(self.configuration.T, self.velocity.T, strict=True))

        def compute() -> None:
            force, found = self.force(), self.found
            for state, (configuration, velocity) in enumerate(rows):
                found[:, state] = accelerations(model, data, configuration, velocity, force[:, state])

        return self.prepared(compute)


def _aba(scene: Scene, states: States) -> Prepared:
    import pinocchio

    return _Batch(scene.load("pinocchio", "urdf"), states).one_by_one(pinocchio.aba)


def _aba_in_parallel(scene: Scene, states: States) -> Prepared:
    import pinocchio

    batch = _Batch(scene.load("pinocchio", "urdf"), states)
    pool = pinocchio.ModelPool(batch.model, 1)

    def compute() -> None:
        pinocchio.abaInParallel(1, pool, batch.configuration, batch.velocity, batch.force(), batch.found)

    return batch.prepared(compute)


def _composite_rigid_bodies(scene: Scene, states: States) -> Prepared:
    import pinocchio

    def accelerations(model: Any, data: Any, configuration: Array, velocity: Array, force: Array) -> Array:
        bias = pinocchio.nonLinearEffects(model, data, configuration, velocity)
        pinocchio.crba(model, data, configuration)
        pinocchio.cholesky.decompose(model, data)
        return np.asarray(pinocchio.cholesky.solve(model, data, force - bias))

    return _Batch(scene.load("pinocchio", "urdf"), states).one_by_one(accelerations)


def _solved(solver: Solver, scene: Scene, states: States, is_declared: bool = False) -> Prepared:
    model: PinocchioModel = scene.load("pinocchio", "urdf").solved_by(solver)
    constraints, batch = model.constraints, _Batch(model, states)

    def columns() -> tuple[Array, Array, Array]:
        return batch.configuration, batch.velocity, batch.force()

    return Prepared.keeping(
        lambda: constraints.accelerations(columns()),
        lambda found: np.ascontiguousarray(found[:, model.addresses[1]]),
        reproducer=reproducer_of(model, scene.models["urdf"].text, states),
        truth=_single_iteration(solver, scene) if is_declared else None,
        residual=None if solver.mu is None else lambda: constraints.residuals(columns()),
    )


def _single_iteration(solver: Solver, scene: Scene) -> AccelerationTruth:
    """The problem that one proximal iteration solves."""
    constraints = scene.mechanism.constraints
    assert constraints is not None and solver.iterations == 1 and solver.mu
    # Half of the impedance on either side: the weight d / ((1 - d) A) is 1 / mu.
    laws = {
        name: Softness(impedance=0.5, stiffness=0.0, damping=0.0, inverse_masses=(solver.mu,) * constraints.rows.count(name))
        for name in constraints.names
    }
    return AccelerationTruth(softened(scene.mechanism, laws), rigid=AccelerationTruth(scene.mechanism))


def _method(name: str, prepare: Callable[[Scene, States], Prepared], of: str, growth: str = "up to 3", loop: str = "Python") -> Method:
    return Method(f"pinocchio {name}", "urdf", prepare, loop, growth, linear_velocity_in_body=True, of=(of,))


_ONCE = Solver(mu=1e-6, iterations=1)
METHODS = (
    _method("aba", _aba, MECHANISMS, growth="1"),
    _method("abaInParallel", _aba_in_parallel, MECHANISMS, growth="1", loop="Pinocchio"),
    _method("CRBA + Cholesky", _composite_rigid_bodies, MECHANISMS),
    _method("constraintDynamics, mu 1e-6, one iteration, declared", partial(_solved, _ONCE, is_declared=True), CONSTRAINED),
    *(
        _method(name, partial(_solved, solver), CONSTRAINED)
        for name, solver in {
            "constraintDynamics, default settings": Solver(mu=None),
            "constraintDynamics, mu 1e-6, one iteration": _ONCE,
            "constraintDynamics, mu 1e-6": Solver(mu=1e-6),
            "constraintDynamics, mu 1e-12": Solver(),
            "lcaba, mu 1e-6": Solver("lcaba", mu=1e-6, iterations=20),
            "lcaba, mu 1e-10": Solver("lcaba", mu=1e-10, iterations=5),
        }.items()
    ),
)
