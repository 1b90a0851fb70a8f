"""Places of joints, bodies and springs by MuJoCo's kinematics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from harness.engines._mujoco_held import joint_kinds
from harness.engines._placement import WORLD, PlacedBody, PlacedJoint, Placement, Vector, as_vector


def place(loaded: Any, positions: Mapping[str, float], steps: Mapping[str, Sequence[float]]) -> Placement:
    """A loaded model with joints of one position at ``positions`` [m or rad], then moved by ``steps`` along its velocities."""
    import mujoco

    kinds = joint_kinds()
    moving = [body for body in range(1, loaded.nbody) if loaded.body_weldid[body] != 0]
    data = mujoco.MjData(loaded)
    for name, value in positions.items():
        data.joint(name).qpos[:] = value
    velocity = np.zeros(loaded.nv)
    for name, step in steps.items():
        address = loaded.joint(name).dofadr[0]
        velocity[address : address + len(step)] = step
    mujoco.mj_integratePos(loaded, data.qpos, velocity, 1.0)
    mujoco.mj_kinematics(loaded, data)
    mujoco.mj_comPos(loaded, data)
    mujoco.mj_tendon(loaded, data)
    # A body without joints of its own is part of the one it is welded to.
    solid = [body for body in moving if loaded.body_jntnum[body]]
    bodies = [
        PlacedBody(
            loaded.body(body).name or f"body {body}",
            WORLD if loaded.body_weldid[loaded.body_parentid[body]] == 0 else solid.index(loaded.body_weldid[loaded.body_parentid[body]]),
            *_mass_and_centre([(loaded.body_mass[part], data.xipos[part]) for part in moving if loaded.body_weldid[part] == body]),
        )
        for body in solid
    ]
    joints = []
    for number in range(loaded.njnt):
        joint, kind = loaded.joint(number), kinds[int(loaded.jnt_type[number])]
        anchor, axis = data.xanchor[number], data.xaxis[number]
        slid = data.qpos[joint.qposadr[0]] - loaded.qpos0[joint.qposadr[0]] if kind == "slide" else 0.0
        joints.append(
            PlacedJoint(
                joint.name, kind, solid.index(int(joint.bodyid[0])), as_vector(anchor), as_vector(anchor + slid * axis), as_vector(axis)
            )
        )
    springs = []
    for tendon in range(loaded.ntendon):
        first, count = data.ten_wrapadr[tendon], data.ten_wrapnum[tendon]
        if count > 1:
            springs.append(tuple(as_vector(point) for point in data.wrap_xpos.reshape(-1, 3)[first : first + count]))
    return Placement(tuple(bodies), tuple(joints), tuple(springs))


def _mass_and_centre(parts: list[tuple[float, Any]]) -> tuple[float, Vector]:
    mass = float(sum(part for part, _ in parts))
    return mass, as_vector(sum(part * centre for part, centre in parts) / mass if mass else parts[0][1])
