"""Accelerations of a robot by the engine whose format it is, without what the truth leaves out, and by the truth."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pinocchio

from harness.arrays import Array
from harness.programs.states import States
from harness.trees.robot import Robot


def by_mujoco(model: mujoco.MjModel, states: States) -> Array:
    """Without constraints, actuators and fluid."""
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_ACTUATION
    model.opt.density = model.opt.viscosity = 0
    data, found = mujoco.MjData(model), np.empty_like(states.v)
    for row in range(len(states)):
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = states.q[row], states.v[row], states.tau[row]
        mujoco.mj_forward(model, data)
        found[row] = data.qacc_smooth
    return found


def by_pinocchio(path: Path, robot: Robot, states: States) -> Array:
    """With the damping that ``aba`` leaves out; for joints of one axis that follow none."""
    model = pinocchio.buildModelFromUrdf(str(path))
    data, found = model.createData(), np.empty_like(states.v)
    joints = [(model.joints[model.getJointId(name)], float(robot.joint(name).damping)) for name in robot.joints]
    for row in range(len(states)):
        q, v, tau = pinocchio.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
        for place, (joint, damping) in enumerate(joints):
            angle, rate = states.q[row, place], states.v[row, place]
            q[joint.idx_q : joint.idx_q + joint.nq] = angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
            v[joint.idx_v], tau[joint.idx_v] = rate, states.tau[row, place] - damping * rate
        accelerations = pinocchio.aba(model, data, q, v, tau)
        found[row] = [accelerations[joint.idx_v] for joint, _ in joints]
    return found


def only_single_axes(robot: Robot) -> bool:
    """Whether ``by_pinocchio`` can be asked."""
    return all(joint.kind in ("hinge", "slide") and not joint.follows for joint in robot.tree.joints)
