"""Pinocchio on the URDF model.

The forces of springs and dampers that a URDF declares are no part of Pinocchio's dynamics. The harness adds
them from Pinocchio's own kinematics, and they are part of what is timed.

Source: Featherstone, Rigid Body Dynamics Algorithms, chapters 6 (composite rigid bodies, and the sparse
factorisation of M) and 7 (articulated bodies).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from harness.arrays import Array
from harness.bench.methods import Method, Prepared, load_model
from harness.crosscheck.scene import Scene
from harness.engines.pinocchio import PinocchioModel
from harness.equations.states import States


class _Batch:
    """States in Pinocchio's own form, and the accelerations found for them."""

    def __init__(self, scene: Scene, states: States) -> None:
        _, model = load_model(scene, "pinocchio", "urdf")
        assert isinstance(model, PinocchioModel)
        self.model, self._loaded = model.model, model
        self.configuration, self.velocity, self._applied = model.columns(states.q, states.v, states.tau)
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


def _aba(scene: Scene, states: States) -> Prepared:
    import pinocchio

    batch = _Batch(scene, states)
    model, data = batch.model, batch.model.createData()
    rows = [(state, batch.configuration[:, state], batch.velocity[:, state]) for state in range(len(states))]

    def compute() -> None:
        force, found = batch.force(), batch.found
        for state, configuration, velocity in rows:
            found[:, state] = pinocchio.aba(model, data, configuration, velocity, force[:, state])

    return batch.prepared(compute)


def _aba_in_parallel(threads: int, scene: Scene, states: States) -> Prepared:
    import pinocchio

    batch = _Batch(scene, states)
    pool = pinocchio.ModelPool(batch.model, threads)

    def compute() -> None:
        pinocchio.abaInParallel(threads, pool, batch.configuration, batch.velocity, batch.force(), batch.found)

    return batch.prepared(compute)


def _composite_rigid_bodies(scene: Scene, states: States) -> Prepared:
    import pinocchio

    batch = _Batch(scene, states)
    model, data = batch.model, batch.model.createData()
    rows = [(state, batch.configuration[:, state], batch.velocity[:, state]) for state in range(len(states))]

    def compute() -> None:
        force, found = batch.force(), batch.found
        for state, configuration, velocity in rows:
            bias = pinocchio.nonLinearEffects(model, data, configuration, velocity)
            pinocchio.crba(model, data, configuration)
            pinocchio.cholesky.decompose(model, data)
            found[:, state] = pinocchio.cholesky.solve(model, data, force[:, state] - bias)

    return batch.prepared(compute)


ABA = Method("pinocchio aba", "urdf", _aba, growth="1", linear_velocity_in_body=True)
ABA_IN_PARALLEL = Method("pinocchio abaInParallel", "urdf", partial(_aba_in_parallel, 1), growth="1", linear_velocity_in_body=True)
CRBA = Method("pinocchio CRBA + Cholesky", "urdf", _composite_rigid_bodies, growth="up to 3", linear_velocity_in_body=True)
