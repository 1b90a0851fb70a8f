"""Pinocchio on the URDF model.

The forces of springs and dampers that a URDF declares are no part of Pinocchio's dynamics. The harness adds
them from Pinocchio's own kinematics, and they are part of what is timed.

Source: Featherstone, Rigid Body Dynamics Algorithms, chapters 6 (composite rigid bodies, and the sparse
factorisation of M) and 7 (articulated bodies).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.bench.methods import Method, Prepared
from harness.crosscheck.scene import Scene
from harness.engines.adapters.pinocchio import PinocchioModel
from harness.programs.states import States


class _Batch:
    """States in Pinocchio's own form, and the accelerations found for them."""

    def __init__(self, scene: Scene, states: States) -> None:
        loaded: PinocchioModel = scene.load("pinocchio", "urdf")
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

    return _Batch(scene, states).one_by_one(pinocchio.aba)


def _aba_in_parallel(scene: Scene, states: States) -> Prepared:
    import pinocchio

    batch = _Batch(scene, states)
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

    return _Batch(scene, states).one_by_one(accelerations)


ABA = Method("pinocchio aba", "urdf", _aba, loop="Python", growth="1", linear_velocity_in_body=True)
ABA_IN_PARALLEL = Method("pinocchio abaInParallel", "urdf", _aba_in_parallel, loop="Pinocchio", growth="1", linear_velocity_in_body=True)
CRBA = Method("pinocchio CRBA + Cholesky", "urdf", _composite_rigid_bodies, loop="Python", growth="up to 3", linear_velocity_in_body=True)
