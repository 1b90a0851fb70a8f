"""Motions of a file by ``mujoco_warp.step`` in one world, with everything on that the file says, in float32.

MuJoCo reads the file. A step takes milliseconds on a CPU, where each of its kernels is called by itself.

Source: MuJoCo documentation, MuJoCo Warp (MJWarp), ``mujoco_warp.step``.
"""

from __future__ import annotations

import mujoco_warp
import numpy as np
import warp

from harness.arrays import Array
from harness.engines.adapters.mujoco.moving import compiled_file, places_of
from harness.engines.moving import MotionsRequest, SimulatedFile
from harness.engines.request import Refused
from harness.engines.warp_kernels import keep_compiled

# Steps of a motion.
MOST_STEPS = 2000


def moved(motion: SimulatedFile, request: MotionsRequest) -> tuple[Array, Array]:
    """q and v, (k, nq) and (k, nv) over the joints of the request, after the recorded steps of one motion.

    Raises:
        Refused: MuJoCo does not read the file, MuJoCo Warp has no such part of it, or the motion is too long for a CPU.
    """
    if motion.counts[-1] > MOST_STEPS:
        raise Refused(f"MuJoCo Warp is asked for {MOST_STEPS:,} steps at most on a CPU, and this motion has {motion.counts[-1]:,}")
    keep_compiled(warp)
    compiled = compiled_file(motion.file)
    positions, velocities = places_of(compiled, request.joints)
    q, v = compiled.qpos0.copy(), np.zeros(compiled.nv)
    q[positions], v[velocities] = request.q, request.v
    found, done = [], 0
    with warp.ScopedDevice("cpu"):
        try:
            model, data = mujoco_warp.put_model(compiled), mujoco_warp.make_data(compiled, nworld=1)
        except NotImplementedError as error:
            raise Refused(f"MuJoCo Warp: {' '.join(str(error).split())}") from error
        data.qpos.assign(q[None].astype(np.float32))
        data.qvel.assign(v[None].astype(np.float32))
        for until in motion.counts:
            for _ in range(done, until):
                mujoco_warp.step(model, data)
            done = until
            found.append((data.qpos.numpy()[0, positions].astype(np.float64), data.qvel.numpy()[0, velocities].astype(np.float64)))
    return np.array([q for q, _ in found]), np.array([v for _, v in found])
