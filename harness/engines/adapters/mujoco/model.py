"""An ``MjModel`` that has been compiled, and what it is asked: many states at a time through ``mujoco.batch.Batch``.

Source: MuJoCo documentation, API reference; Python bindings, ``mujoco.batch``.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import mujoco
import numpy as np

from harness.arrays import Array
from harness.engines import HeldModel, LoadedModel, Terms
from harness.engines.adapters.mujoco import quantities, urdf, versions
from harness.engines.adapters.mujoco.acting import actuators_of, drive, placed_controls, rub_and_limit_alone
from harness.engines.adapters.mujoco.quantities import MujocoQuantities
from harness.engines.interface import NotOffered
from harness.files.model_file import ModelFile


def load(file: ModelFile, joints: Sequence[str], gravity: float) -> MujocoModel:
    """See ``harness.engines.Engine.load``."""
    # The default handler writes a log file into the current directory.
    mujoco.set_mju_user_warning(lambda message: None)
    if file.format == "urdf":
        model, building = urdf.read(file, gravity, joints)
    else:
        model, building = versions.read_mjcf(file), None
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    if model.dof_frictionloss.any() or model.jnt_limited.any():
        rub_and_limit_alone(model, joints, file.acting)
    driven = actuators_of(model, file.driven)
    if model.nu:
        drive(model, driven)
    return MujocoModel(model, joints, building, driven)


class MujocoModel(MujocoQuantities):
    """An ``MjModel`` and the batch that runs it; ``building`` is Python text that makes it of the spec of a URDF.

    ``joints`` are names, or the numbers of MuJoCo's joints that make one up. ``driven`` are the numbers of the actuators that act, in the
    order of controls.
    """

    def __init__(self, model: Any, joints: Sequence[str | Sequence[int]], building: str | None = None, driven: Sequence[int] = ()) -> None:
        self.model = model
        self.takes_driving = bool(driven)
        self._building, self.driven = building, list(driven)
        self._joints = [[one] if isinstance(one, str) else one for one in dict.fromkeys(joints)]
        self._batch: Any = None

    def loaded(self) -> LoadedModel:
        model = self.model
        joints = {model.joint(number).name: sizes_of(model.joint(number)) for number in range(model.njnt)}
        moving = model.body_weldid != 0
        return LoadedModel(joints, tuple(quantities.gravity_of(model).tolist()), float(model.body_mass[moving].sum()))

    def held(self, positions: Mapping[str, float] | None = None, steps: Mapping[str, Sequence[float]] | None = None) -> HeldModel:
        return quantities.held(self.model, positions or {}, steps or {})

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

    def own(self, q: Array, *vectors: Array) -> list[Array]:
        """Positions (n, nq), and vectors over the velocities (n, nv), in MuJoCo's order."""
        positions, velocities = self.addresses
        found = [np.zeros((len(q), size)) for size in (self.model.nq, *[self.model.nv] * len(vectors))]
        for values, places, given in zip(found, (positions, *[velocities] * len(vectors)), (q, *vectors), strict=True):
            values[:, places] = given
        return found

    def forward_dynamics(self, q: Array, v: Array, tau: Array, *driving: Array) -> Array:
        if self._batch is None or self._batch.nsim != len(q):
            self._batch = versions.batch(self.model, len(q))
        positions, velocities = self.addresses
        self._batch.bind("qpos")[:, positions] = q
        self._batch.bind("qvel")[:, velocities] = v
        self._batch.bind("qfrc_applied")[:, velocities] = tau
        if driving:
            self._batch.bind("ctrl")[:] = placed_controls(self.model, self.driven, len(q), driving[0])
        if not self.model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CONSTRAINT:
            # A solver that starts from the last answer would make this one depend on it.
            self._batch.bind("qacc_warmstart")[:] = 0.0
        accelerations = self._batch.bind("qacc")
        self._batch.forward()
        return np.ascontiguousarray(accelerations[:, velocities])

    @property
    def is_tied(self) -> bool:
        """See ``harness.engines``."""
        return bool(self.model.neq)

    def gaps(self, q: Array) -> dict[str, Array]:
        """``efc_pos`` of each equality; see ``harness.engines``."""
        data, rows, places = mujoco.MjData(self.model), list[Array](), np.array(self.addresses[0])
        for position in q:
            data.qpos[places] = position
            mujoco.mj_fwdPosition(self.model, data)
            rows.append(data.efc_pos.copy())
        if not rows:
            return {}
        # Which are the same at every state.
        owners, found = np.where(data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY, data.efc_id, -1), np.array(rows)
        return {self.model.equality(one).name: found[:, owners == one] for one in range(self.model.neq)}

    def reactions(self, q: Array, v: Array, tau: Array) -> Array:
        """See ``harness.engines.interface``: ``cfrc_int`` of ``mj_rnePostConstraint``, what a body's parent does to it.

        It stands as (moment, force) along the world's axes, about the centre of mass of the whole tree that the body is in.
        Spatial tendons and equality constraints pull at bodies from outside. The solver of constraints goes on until nothing improves: by
        its default tolerance of 1e-8 it leaves forces out of balance by what accelerations hardly feel, and moments about the hinges of
        light bodies by up to 4600 data roundoffs (Andrews' squeezer).
        Source: MuJoCo documentation, API reference, ``mj_rnePostConstraint``, and ``mjData.cfrc_int``; XML reference, option, tolerance.
        """
        other = copy.copy(self)
        other.model = model = copy.copy(self.model)
        model.opt.tolerance = 0.0
        bodies, found = self._bodies, np.empty((len(q), len(self._bodies), 6))
        for state, data in enumerate(other._placed(q, v, tau)):
            mujoco.mj_rnePostConstraint(model, data)
            moments, forces = np.split(data.cfrc_int[bodies], 2, axis=1)
            found[state, :, :3] = forces
            found[state, :, 3:] = moments + np.cross(data.subtree_com[model.body_rootid[bodies]] - self.anchors(data), forces)
        return found

    def sensors(self, q: Array, v: Array, qdd: Array) -> Array:
        """``sensordata`` of ``mj_inverse``."""
        other = copy.copy(self)
        model, found = quantities.measuring(self.model), list[Array]()
        other.model = model
        for state, data in enumerate(other._placed(q, v)):
            data.qacc[self.addresses[1]] = qdd[state]
            mujoco.mj_inverse(model, data)
            found.append(data.sensordata.copy())
        return quantities.measured(model, found)

    def driven_sensors(self, q: Array, v: Array, tau: Array, *driving: Array) -> Array:
        """``sensordata`` of ``mj_forward``, whose solver of constraints goes on until nothing improves, as for ``reactions``."""
        model, found, (positions, velocities) = quantities.measuring(self.model), list[Array](), self.addresses
        model.opt.tolerance, model.opt.iterations = 0.0, urdf.MOST_ITERATIONS
        inputs = versions.inputs_in_place(model, len(q), driving)
        for state in range(len(q)):
            data = mujoco.MjData(model)
            data.qpos[positions], data.qvel[velocities], data.qfrc_applied[velocities] = q[state], v[state], tau[state]
            data.ctrl[:], data.act[:] = (given[state] for given in inputs)
            mujoco.mj_forward(model, data)
            found.append(data.sensordata.copy())
        return quantities.measured(model, found)

    def step(self, q: Array, v: Array, tau: Array, length: float, integrator: str) -> Array:
        """See ``harness.engines.interface``; the rules are in ``harness.engines.adapters.mujoco.law``."""
        return step(copy.copy(self.model), self.addresses, (q, v, tau), length, integrator, 1)

    def to_the_end(self, tolerance: float = 0.0) -> tuple[MujocoModel, str]:
        """See ``harness.engines.interface``."""
        other = copy.copy(self)
        other.model, other._batch = copy.copy(self.model), None
        other.model.opt.tolerance, other.model.opt.iterations = tolerance, urdf.MOST_ITERATIONS
        return other, f'<option iterations="{urdf.MOST_ITERATIONS}" tolerance="{tolerance:.2g}"/>'

    def terms(self, q: Array, v: Array, tau: Array, *driving: Array) -> Terms:
        """Terms as MuJoCo computes them: M of composite rigid bodies with armature, passive of springs, dampers, tendons,
        constraints and actuators.

        Gravity is the bias force at rest, velocity the bias force without gravity, so that neither is what is left of a difference.
        Source: MuJoCo documentation, Computation, general framework: M v' + c = tau + J' f; API reference, ``mj_fullM``.
        """
        weightless, velocities = copy.copy(self), self.addresses[1]
        weightless.model = copy.copy(self.model)
        weightless.model.opt.gravity[:] = 0.0
        gravity, passive, applied = np.empty((3, len(q), self.model.nv))
        control = placed_controls(self.model, self.driven, len(q), driving[0]) if driving else None
        for state, data in enumerate(self._placed(q, v, tau, control)):
            applied[state], passive[state] = data.qfrc_applied, data.qfrc_passive + data.qfrc_constraint + data.qfrc_actuator
            data.qvel[:] = 0.0
            mujoco.mj_forward(self.model, data)
            gravity[state] = data.qfrc_bias
        vectors = (np.ascontiguousarray(vector[:, velocities]) for vector in (gravity, passive, applied))
        return Terms(self.mass_matrix(q), weightless.bias(q, v), *vectors)

    def reproducer(self, source: str, q: Array, v: Array, tau: Array, certified: Array, *driving: Array) -> str:
        """See ``harness.hard.worst_cases``."""
        qpos, qvel, applied, expected = (values[0].tolist() for values in self.own(q[None], v[None], tau[None], certified[None]))
        controls = f"; d.ctrl[:] = {placed_controls(self.model, self.driven, 1, driving[0][None])[0].tolist()}" if driving else ""
        read = f"m = mujoco.MjModel.from_xml_string({source})"
        if self._building is not None:
            # The reader of URDF passes over springs, armatures and more; they are set in its spec.
            read = f"s = mujoco.MjSpec.from_string({source}); {self._building}"
        return (
            f"import mujoco; {read}; d = mujoco.MjData(m)\n"
            f"d.qpos[:], d.qvel[:], d.qfrc_applied[:] = {qpos}, {qvel}, {applied}{controls}\n"
            f"mujoco.mj_forward(m, d); print(d.qacc.tolist(), {expected}, sep='\\n')  # engine, certified\n"
        )


def step(
    model: Any,
    addresses: tuple[Sequence[int], Sequence[int]],
    states: tuple[Array, Array, Array],
    length: float,
    integrator: str,
    steps: int,
) -> Array:
    """See ``harness.engines.interface``; ``addresses`` of positions and velocities in MuJoCo's own order. The model's options change.

    ``discrete`` solves with springs and dampers on lengths by iteration. By the default tolerance of 1e-8 it leaves velocities off by up
    to 20,000 data roundoffs (the governor at a step of 1e-5 s); by one of 0 it goes on until it divides zero by zero, and velocities are
    not finite at 1 % of the governor's states (MuJoCo 4.0).

    Raises:
        NotOffered: this version has no such integrator, or has rules of its own.
    """
    versions.require_declared_steps()
    (q, v, tau), (positions, velocities) = states, addresses
    number = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}", None)
    if number is None:
        raise NotOffered(f"MuJoCo {mujoco.mj_versionString()} has no integrator {integrator}")
    model.opt.timestep, model.opt.integrator = length, number
    data = mujoco.MjData(model)
    after: Array = np.empty((len(q), q.shape[1] + v.shape[1]))
    for state in range(len(q)):
        mujoco.mj_resetData(model, data)
        data.qpos[positions], data.qvel[velocities], data.qfrc_applied[velocities] = q[state], v[state], tau[state]
        mujoco.mj_step(model, data, nstep=steps)
        after[state] = [*data.qpos[positions], *data.qvel[velocities]]
    return after


def sizes_of(joint: Any) -> tuple[int, int]:
    """Positions and velocities of one of MuJoCo's joints."""
    return len(joint.qpos0), len(joint.damping)
