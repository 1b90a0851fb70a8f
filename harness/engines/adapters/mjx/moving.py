"""Motions of a file by ``mjx.step``, with everything on that the file says, in float64.

MuJoCo reads the file. XLA compiles a step for each structure of a model, so that motions with other numbers share one.

Source: MuJoCo documentation, MuJoCo XLA (MJX), ``mjx.step``; JAX documentation, ``jax.lax.fori_loop``.
"""

from __future__ import annotations

import functools
from typing import Any

import jax
import numpy as np
from mujoco import mjx

from harness.arrays import Array
from harness.engines.adapters.mjx.device import keep_compiled
from harness.engines.adapters.mujoco.moving import compiled_file, places_of
from harness.engines.moving import MotionsRequest, SimulatedFile
from harness.engines.request import Refused

# A motion has thousands of steps, which XLA's fusion makes ten times as fast as those without it; LLVM's effort would take minutes.
_COMPILER_OPTIONS = {"xla_backend_optimization_level": 0}


@functools.cache
def _stepper() -> Any:
    """A function of a model, its data and a number of steps, to the data after these."""
    keep_compiled()

    def stepped(model: Any, data: Any, count: Any) -> Any:
        return jax.lax.fori_loop(0, count, lambda _, before: mjx.step(model, before), data)

    return jax.jit(stepped, compiler_options=_COMPILER_OPTIONS)


def moved(motion: SimulatedFile, request: MotionsRequest) -> tuple[Array, Array]:
    """q and v, (k, nq) and (k, nv) over the joints of the request, after the recorded steps of one motion.

    Raises:
        Refused: MuJoCo does not read the file, or MJX has no such part of it.
    """
    compiled = compiled_file(motion.file)
    positions, velocities = places_of(compiled, request.joints)
    found, done = [], 0
    with jax.enable_x64(True):
        try:
            model, data = mjx.put_model(compiled), mjx.make_data(compiled)
        except NotImplementedError as error:
            raise Refused(f"MJX: {' '.join(str(error).split())}") from error
        q, v = compiled.qpos0.copy(), np.zeros(compiled.nv)
        q[positions], v[velocities] = request.q, request.v
        data = data.replace(qpos=jax.numpy.asarray(q), qvel=jax.numpy.asarray(v))
        for until in motion.counts:
            data, done = _stepper()(model, data, until - done), until
            found.append((np.asarray(data.qpos)[positions], np.asarray(data.qvel)[velocities]))
    return np.array([q for q, _ in found]), np.array([v for _, v in found])
