"""Joints, bodies and springs that an ``MjModel`` holds after loading, placed in the world by MuJoCo's own kinematics.

Source: MuJoCo documentation, Computation, "Kinematic tree", and XML reference, body/inertial and body/joint.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from harness.arrays import Array
from harness.engines import HeldBody, HeldJoint, HeldModel, HeldSpring
from harness.engines.adapters.mujoco.versions import flag
from harness.files.joint_kinds import JointKind

# By the names of MuJoCo's types of joints.
KINDS: dict[str, JointKind] = {kind.value: kind for kind in JointKind}


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
    springs, dampers = (0.0 if off & flag(part) else 1.0 for part in ("spring", "damper"))

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
