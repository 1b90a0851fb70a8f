"""Numbers that MuJoCo holds, and quantities that it computes beside accelerations; ``harness.engines.interface`` says what each is.

What it holds is placed in the world by its own kinematics.

Source: MuJoCo documentation, API reference; Computation, "Kinematic tree"; XML reference, body/inertial and body/joint.
"""

from __future__ import annotations

import copy
from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import mujoco
import numpy as np

from harness.arrays import Array
from harness.engines import HeldBody, HeldJoint, HeldModel, HeldSpring
from harness.engines.adapters.mujoco import versions
from harness.engines.interface import NotOffered
from harness.files.joint_kinds import JointKind
from harness.files.tree import SensorKind

# By the names of MuJoCo's types of joints.
KINDS: dict[str, JointKind] = {kind.value: kind for kind in JointKind}
# MuJoCo's names of kinds of sensors, where they are others than the tags.
_SENSORS = {SensorKind.JOINT_ACTUATOR_FORCE: "jointactfrc"}


class MujocoQuantities:
    """The methods of an ``MjModel`` whose joints have places in q and v."""

    model: Any
    _joints: Sequence[Sequence[Any]]

    @property
    @abstractmethod
    def addresses(self) -> tuple[list[int], list[int]]:
        """Places of the joints in the engine's own q and v."""

    def mass_matrix(self, q: Array) -> Array:
        """``mj_fullM``."""
        velocities = self.addresses[1]
        found = np.empty((len(q), self.model.nv, self.model.nv))
        for state, data in enumerate(self._placed(q)):
            versions.fill_mass_matrix(self.model, data, found[state])
        return np.ascontiguousarray(found[:, velocities][:, :, velocities])

    def bias(self, q: Array, v: Array) -> Array:
        """``qfrc_bias``."""
        return np.array([data.qfrc_bias[self.addresses[1]] for data in self._placed(q, v)])

    def gravity(self, q: Array) -> Array:
        """``qfrc_bias`` at rest."""
        return self.bias(q, np.zeros((len(q), len(self.addresses[1]))))

    def inverse_dynamics(self, q: Array, v: Array, qdd: Array) -> Array:
        """``mj_inverse``."""
        velocities, found = self.addresses[1], np.empty_like(v)
        for state, data in enumerate(self._placed(q, v)):
            data.qacc[velocities] = qdd[state]
            mujoco.mj_inverse(self.model, data)
            found[state] = data.qfrc_inverse[velocities]
        return found

    def forward_dynamics_derivatives(self, q: Array, v: Array, tau: Array) -> Array:
        """``mjd_transitionFD`` are differences of a step."""
        raise NotOffered("MuJoCo has finite differences of a step alone, mjd_transitionFD, which harness bench measures")

    def inverse_dynamics_derivatives(self, q: Array, v: Array, qdd: Array) -> Array:
        """``mjd_inverseFD`` are differences."""
        raise NotOffered("MuJoCo has finite differences of it alone, mjd_inverseFD, which harness bench measures")

    def energies(self, q: Array, v: Array) -> Array:
        """``mj_energyVel`` and ``mj_energyPos``."""
        found = np.empty((len(q), 2))
        for state, data in enumerate(self._placed(q, v)):
            mujoco.mj_energyPos(self.model, data)
            mujoco.mj_energyVel(self.model, data)
            found[state] = data.energy[::-1]
        return found

    def momenta(self, q: Array, v: Array) -> Array:
        """``mj_subtreeVel`` of the world, whose centre of mass includes that of bodies which stand still."""
        model, found = self.model, np.empty((len(q), 9))
        moving = model.body_weldid != 0
        masses = np.where(moving, model.body_mass, 0.0)
        stands_still = bool((model.body_mass[~moving] > 0).any())
        for state, data in enumerate(self._placed(q, v)):
            mujoco.mj_subtreeVel(model, data)
            momentum = model.body_subtreemass[0] * data.subtree_linvel[0]
            about_origin = data.subtree_angmom[0] + np.cross(data.subtree_com[0], momentum)
            about_centre = data.subtree_angmom[0]
            if stands_still:
                about_centre = about_origin - np.cross(masses @ data.xipos / masses.sum(), momentum)
            found[state] = *momentum, *about_origin, *about_centre
        return found

    def positions(self, q: Array) -> Array:
        """``xpos`` and ``xmat``."""
        bodies = self._bodies
        found = np.empty((len(q), len(bodies), 12))
        for state, data in enumerate(self._placed(q)):
            found[state, :, :3], found[state, :, 3:] = self.anchors(data), data.xmat[bodies]
        return found

    def velocities(self, q: Array, v: Array) -> Array:
        """``mj_objectVelocity``, moved from the origin of the body to the anchor."""
        bodies, found, velocity = self._bodies, np.empty((len(q), len(self._bodies), 6)), np.empty(6)
        for state, data in enumerate(self._placed(q, v)):
            for place, (body, anchor) in enumerate(zip(bodies, self.anchors(data), strict=True)):
                mujoco.mj_objectVelocity(self.model, data, mujoco.mjtObj.mjOBJ_XBODY, body, velocity, 0)
                spin, linear = velocity[:3], velocity[3:]
                found[state, place, :3], found[state, place, 3:] = linear + np.cross(spin, anchor - data.xpos[body]), spin
        return found

    def jacobians(self, q: Array) -> Array:
        """``mj_jac``."""
        model, velocities = self.model, self.addresses[1]
        found, linear, angular = np.empty((len(q), len(self._bodies), 6, len(velocities))), *np.empty((2, 3, model.nv))
        for state, data in enumerate(self._placed(q)):
            for place, (body, anchor) in enumerate(zip(self._bodies, self.anchors(data), strict=True)):
                mujoco.mj_jac(model, data, linear, angular, anchor, body)
                found[state, place] = np.concatenate([linear, angular])[:, velocities]
        return found

    def anchors(self, data: Any) -> Array:
        """The anchor of the last joint of each joint's body, (joints, 3); that of a slide in ``xanchor`` is where it stood before."""
        bodies, model = self._bodies, self.model
        last = model.body_jntadr[bodies] + model.body_jntnum[bodies] - 1
        arms = np.einsum("bij,bj->bi", data.xmat[bodies].reshape(-1, 3, 3), model.jnt_pos[last])
        return np.asarray(data.xpos[bodies] + arms)

    @cached_property
    def _bodies(self) -> Any:
        """The body of each joint."""
        return np.array([self.model.joint(parts[0]).bodyid[0] for parts in self._joints])

    def _placed(self, q: Array, v: Array | None = None, tau: Array | None = None, control: Array | None = None) -> Iterator[Any]:
        """The same ``MjData`` after ``mj_forward`` at each state; ``control`` is in MuJoCo's places."""
        data, (positions, velocities) = mujoco.MjData(self.model), self.addresses
        for state in range(len(q)):
            data.qpos[positions], data.qvel[velocities] = q[state], 0.0 if v is None else v[state]
            if tau is not None:
                data.qfrc_applied[velocities] = tau[state]
            if control is not None:
                data.ctrl[:] = control[state]
            mujoco.mj_forward(self.model, data)
            yield data


def measuring(model: Any) -> Any:
    """The same with its sensors on."""
    other = copy.copy(model)
    other.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
    return other


def measured(model: Any, sensordata: Sequence[Array]) -> Array:
    """``sensordata`` of n states as of ``harness.engines.interface``."""
    kinds = {int(getattr(mujoco.mjtSensor, f"mjSENS_{_SENSORS.get(kind, kind).upper()}")) for kind in SensorKind}
    own = [number for number in range(model.nsensor) if model.sensor_type[number] in kinds]
    found = np.zeros((len(sensordata), len(own), 3))
    for place, number in enumerate(own):
        first, count = int(model.sensor_adr[number]), int(model.sensor_dim[number])
        for state, data in enumerate(sensordata):
            found[state, place, :count] = data[first : first + count]
    return found


def gravity_of(model: Any) -> Array:
    """(3,) gravity [m/s^2] that an ``MjModel`` applies: zero where it switches it off."""
    is_off = int(model.opt.disableflags) & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    return np.zeros(3) if is_off else np.array(model.opt.gravity)


def held(model: Any, positions: Mapping[str, float], steps: Mapping[str, Sequence[float]]) -> HeldModel:
    """``model`` in the configuration of ``Model``; zero is 0 or the quaternion (1, 0, 0, 0), whatever its ``ref`` and ``qpos0``.

    Bodies welded together are one. Of several joints of one body the last carries it, and each the next. Stiffness and
    damping are the linear coefficients, and 0 where the model switches them off.
    """
    data = mujoco.MjData(model)
    kinds = [KINDS[mujoco.mjtJoint(kind).name.removeprefix("mjJNT_").lower()] for kind in model.jnt_type]
    data.qpos[:] = 0.0
    for kind, place in zip(kinds, model.jnt_qposadr, strict=True):
        if kind.has_attitude:
            data.qpos[place + kind.linear] = 1.0
    for name, value in positions.items():
        data.joint(name).qpos[:] = value
    if steps:
        velocity = np.zeros(model.nv)
        for name, step in steps.items():
            address = model.joint(name).dofadr[0]
            velocity[address : address + len(step)] = step
        mujoco.mj_integratePos(model, data.qpos, velocity, 1.0)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_tendon(model, data)
    off = int(model.opt.disableflags)
    springs, dampers = (0.0 if off & versions.flag(part) else 1.0 for part in ("spring", "damper"))

    names = [model.joint(number).name for number in range(model.njnt)]
    # Weld group, which is numbered as the body that has its joints, to its last joint; the world has none.
    last = {int(model.jnt_bodyid[number]): name for number, name in enumerate(names)}
    joints = {}
    for number, name in enumerate(names):
        body, kind = int(model.jnt_bodyid[number]), kinds[number]
        above = int(model.body_weldid[model.body_parentid[body]])
        turning, column, place = kind.has_attitude, model.jnt_dofadr[number], model.jnt_qposadr[number]
        slid = data.qpos[place] - model.qpos0[place] if kind == JointKind.SLIDE else 0.0
        joints[name] = HeldJoint(
            kind=kind,
            parent=names[number - 1] if number > model.body_jntadr[body] else last.get(above, ""),
            anchor=data.xanchor[number].copy(),
            moved=data.xanchor[number] + slid * data.xaxis[number],
            axis=np.zeros(3) if turning else data.xaxis[number].copy(),
            armature=float(model.dof_armature[column]),
            damping=dampers * float(model.dof_damping[column]),
            stiffness=springs * float(model.jnt_stiffness[number]),
            spring_reference=0.0 if turning else float(model.qpos_spring[place]),
            frame=data.xmat[body].reshape(3, 3).copy() if turning else np.eye(3),
        )
    parts: dict[int, list[tuple[float, Array, Array]]] = {}
    for body in range(1, model.nbody):
        if group := int(model.body_weldid[body]):
            turned = data.ximat[body].reshape(3, 3).astype(np.longdouble)
            inertia = turned * model.body_inertia[body] @ turned.T
            parts.setdefault(group, []).append((float(model.body_mass[body]), data.xipos[body], inertia))
    return HeldModel(
        gravity=gravity_of(model),
        joints=joints,
        bodies={last[group]: fused(welded, model.body(group).name) for group, welded in parts.items()},
        springs=tuple(_springs(model, data, springs, dampers)),
    )


def fused(parts: Sequence[tuple[float, Array, Array]], name: str = "") -> HeldBody:
    """One body of several (mass [kg], centre [m], inertia about it [kg m^2]), by parallel axes in extended precision."""
    masses = np.array([mass for mass, _, _ in parts], dtype=np.longdouble)
    centres = np.array([centre for _, centre, _ in parts], dtype=np.longdouble)
    total = masses.sum()
    centre = masses @ centres / total if total else centres[0]
    inertia = np.zeros((3, 3), dtype=np.longdouble)
    for mass, arm, (_, _, own) in zip(masses, centres - centre, parts, strict=True):
        inertia += own + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return HeldBody(float(total), centre.astype(np.float64), inertia.astype(np.float64), name)


def _springs(model: Any, data: Any, springs: float, dampers: float) -> list[HeldSpring]:
    """Spatial tendons that are springs or dampers, switched on; of a slack range the lower length is the free one."""
    found = []
    for tendon in range(model.ntendon):
        first, count = int(data.ten_wrapadr[tendon]), int(data.ten_wrapnum[tendon])
        stiffness, damping = springs * float(model.tendon_stiffness[tendon]), dampers * float(model.tendon_damping[tendon])
        if count > 1 and (stiffness or damping):
            found.append(
                HeldSpring(
                    points=data.wrap_xpos.reshape(-1, 3)[first : first + count].copy(),
                    stiffness=stiffness,
                    damping=damping,
                    free_length=float(model.tendon_lengthspring[tendon, 0]),
                )
            )
    return found
