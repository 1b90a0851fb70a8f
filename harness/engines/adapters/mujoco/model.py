"""An ``MjModel`` that has been compiled, and what it is asked: many states at a time through ``mujoco.batch.Batch``.

Source: MuJoCo documentation, API reference; Python bindings, ``mujoco.batch``.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines import HeldModel, LoadedModel, Terms
from harness.engines.adapters.mujoco import held, steps, versions
from harness.engines.adapters.mujoco.quantities import MujocoQuantities


class MujocoModel(MujocoQuantities):
    """An ``MjModel`` and the batch that runs it; ``building`` is Python text that makes it of the spec of a URDF.

    ``joints`` are names, or the numbers of MuJoCo's joints that make one up.
    """

    def __init__(self, model: Any, joints: Sequence[str | Sequence[int]], building: str | None = None) -> None:
        self.model = model
        self._building = building
        self._joints = [[one] if isinstance(one, str) else one for one in dict.fromkeys(joints)]
        self._batch: Any = None

    def loaded(self) -> LoadedModel:
        model = self.model
        joints = {model.joint(number).name: sizes_of(model.joint(number)) for number in range(model.njnt)}
        moving = model.body_weldid != 0
        gravity = held.gravity_of(model).tolist()
        return LoadedModel(joints, (gravity[0], gravity[1], gravity[2]), float(model.body_mass[moving].sum()))

    def held(self, positions: Mapping[str, float] | None = None, steps: Mapping[str, Sequence[float]] | None = None) -> HeldModel:
        return held.held(self.model, positions or {}, steps or {})

    @cached_property
    def addresses(self) -> tuple[list[int], list[int]]:
        """Position and velocity addresses of the joints, in their order."""
        positions: list[int] = []
        velocities: list[int] = []
        for joint in (self.model.joint(part) for parts in self._joints for part in parts):
            q, v, (nq, nv) = int(joint.qposadr[0]), int(joint.dofadr[0]), sizes_of(joint)
            positions += range(q, q + nq)
            velocities += range(v, v + nv)
        return positions, velocities

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        if self._batch is None or self._batch.nsim != len(q):
            self._batch = versions.batch(self.model, len(q))
        positions, velocities = self.addresses
        self._batch.bind("qpos")[:, positions] = q
        self._batch.bind("qvel")[:, velocities] = v
        self._batch.bind("qfrc_applied")[:, velocities] = tau
        if self.model.neq:
            # A solver that starts from the last answer would make this one depend on it.
            self._batch.bind("qacc_warmstart")[:] = 0.0
        accelerations = self._batch.bind("qacc")
        self._batch.forward()
        return np.ascontiguousarray(accelerations[:, velocities])

    def gaps(self, q: Array) -> dict[str, Array]:
        """``efc_pos`` of each equality; see ``harness.engines``."""
        import mujoco

        # A diagnosis asks hundreds of models; of those without equalities positions would be computed for nothing.
        if not self.model.neq:
            return {}
        data, rows = mujoco.MjData(self.model), list[Array]()
        for position in q:
            data.qpos[self.addresses[0]] = position
            mujoco.mj_fwdPosition(self.model, data)
            owners = np.where(data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY, data.efc_id, -1)
            rows.append(data.efc_pos.copy())
        return {self.model.equality(one).name: np.array(rows)[:, owners == one] for one in range(self.model.neq)} if rows else {}

    def reactions(self, q: Array, v: Array, tau: Array) -> Array:
        """See ``harness.engines.interface``: ``cfrc_int`` of ``mj_rnePostConstraint``, what a body's parent does to it.

        It stands as (moment, force) along the world's axes, about the centre of mass of the whole tree that the body is in.
        Spatial tendons and equality constraints pull at bodies from outside. The solver of constraints goes on until nothing improves: by
        its default tolerance of 1e-8 it leaves forces out of balance by what accelerations hardly feel, and moments about the hinges of
        light bodies by up to 4600 data roundoffs (Andrews' squeezer).
        Source: MuJoCo documentation, API reference, ``mj_rnePostConstraint``, and ``mjData.cfrc_int``; XML reference, option, tolerance.
        """
        import mujoco

        model, (positions, velocities) = copy.copy(self.model), self.addresses
        model.opt.tolerance = 0.0
        data = mujoco.MjData(model)
        bodies = self._bodies
        found = np.empty((len(q), len(bodies), 6))
        for state in range(len(q)):
            data.qpos[positions], data.qvel[velocities], data.qfrc_applied[velocities] = q[state], v[state], tau[state]
            mujoco.mj_forward(model, data)
            mujoco.mj_rnePostConstraint(model, data)
            moments, forces = np.split(data.cfrc_int[bodies], 2, axis=1)
            found[state, :, :3] = forces
            found[state, :, 3:] = moments + np.cross(data.subtree_com[model.body_rootid[bodies]] - self.anchors(data), forces)
        return found

    def step(self, q: Array, v: Array, tau: Array, length: float, integrator: str) -> Array:
        """See ``harness.engines.interface`` and ``harness.engines.adapters.mujoco.steps``."""
        return steps.step(copy.copy(self.model), self.addresses, (q, v, tau), length, integrator, 1)

    def terms(self, q: Array, v: Array, tau: Array) -> Terms:
        """Terms as MuJoCo computes them: M of composite rigid bodies with armature, passive of springs, dampers, tendons
        and constraints.

        Gravity is the bias force at rest, velocity the bias force without gravity, so that neither is what is left of a difference.
        Source: MuJoCo documentation, Computation, general framework: M v' + c = tau + J' f; API reference, ``mj_fullM``.
        """
        import mujoco

        model, (positions, velocities) = self.model, self.addresses
        weightless = copy.copy(model)
        weightless.opt.gravity[:] = 0.0
        data, without_gravity = mujoco.MjData(model), mujoco.MjData(weightless)
        mass, (velocity, gravity, passive, applied) = np.empty((len(q), model.nv, model.nv)), np.empty((4, len(q), model.nv))
        for state in range(len(q)):
            for each in (data, without_gravity):
                each.qpos[positions], each.qvel[velocities], each.qfrc_applied[velocities] = q[state], v[state], tau[state]
                mujoco.mj_forward(each.model, each)
            versions.fill_mass_matrix(model, data, mass[state])
            applied[state], velocity[state] = data.qfrc_applied, without_gravity.qfrc_bias
            passive[state] = data.qfrc_passive + data.qfrc_constraint
            data.qvel[:] = 0.0
            mujoco.mj_forward(model, data)
            gravity[state] = data.qfrc_bias
        vectors = (np.ascontiguousarray(vector[:, velocities]) for vector in (velocity, gravity, passive, applied))
        return Terms(np.ascontiguousarray(mass[:, velocities][:, :, velocities]), *vectors)

    def reproducer(self, source: str, q: Array, v: Array, tau: Array, certified: Array) -> str:
        """See ``harness.hard.worst_cases``."""
        positions, velocities = self.addresses
        own = [np.zeros(size) for size in (self.model.nq, *[self.model.nv] * 3)]
        for values, places, given in zip(own, (positions, *[velocities] * 3), (q, v, tau, certified), strict=True):
            values[places] = given
        qpos, qvel, applied, expected = (values.tolist() for values in own)
        read = f"m = mujoco.MjModel.from_xml_string({source})"
        if self._building is not None:
            # The reader of URDF passes over springs, armatures and more; they are set in its spec.
            read = f"s = mujoco.MjSpec.from_string({source}); {self._building}"
        return (
            f"import mujoco; {read}; d = mujoco.MjData(m)\n"
            f"d.qpos[:], d.qvel[:], d.qfrc_applied[:] = {qpos}, {qvel}, {applied}\n"
            f"mujoco.mj_forward(m, d); print(d.qacc.tolist(), {expected}, sep='\\n')  # engine, certified\n"
        )


def sizes_of(joint: Any) -> tuple[int, int]:
    """Positions and velocities of one of MuJoCo's joints."""
    return len(joint.qpos0), len(joint.damping)
