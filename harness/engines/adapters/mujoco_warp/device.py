"""An ``MjModel`` in worlds of MuJoCo Warp: ``mujoco_warp.forward`` in blocks of states.

Warp's data are of a fixed number of worlds: states go through ``BLOCK`` of them, the last block filled up. Kernels depend on the structure
of a model and are kept in the harness's cache; on a terminal Warp says which it compiles.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import mujoco
import mujoco_warp
import numpy as np
import warp

from harness.arrays import Array
from harness.engines import HeldModel, LoadedModel, Unsupported
from harness.engines.adapters.mujoco.acting import refuse_in_float32, rub_and_limit_alone
from harness.engines.adapters.mujoco.model import MujocoModel
from harness.engines.adapters.mujoco.versions import fill_mass_matrix
from harness.files.model_file import ModelFile
from harness.storage import cache_directory

BLOCK = 64
# Of ``Data``, all that a state has.
GIVEN = ("qvel", "qfrc_applied", "qacc")


class WarpModel:
    """An ``MjModel`` that the file compiles to, and the same in worlds of Warp.

    Raises:
        NotImplementedError: Warp has no such part of a model.
    """

    def __init__(self, model: Any, joints: Sequence[str]) -> None:
        self._compiled = MujocoModel(model, joints)
        with warp.ScopedDevice("cpu"):
            self._model, self._data = mujoco_warp.put_model(model), mujoco_warp.make_data(model, nworld=BLOCK)

    def loaded(self) -> LoadedModel:
        return self._compiled.loaded()

    def held(self, positions: Mapping[str, float] | None = None, steps: Mapping[str, Sequence[float]] | None = None) -> HeldModel:
        """The ``MjModel``'s numbers, which are put into the worlds."""
        return self._compiled.held(positions, steps)

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        return self._answers(mujoco_warp.forward, "qacc", qpos=q, qvel=v, qfrc_applied=tau)[:, self._compiled.addresses[1]]

    def mass_matrix(self, q: Array) -> Array:
        """``Data.M``."""
        model, velocities = self._compiled.model, self._compiled.addresses[1]
        found, data = np.empty((len(q), model.nv, model.nv)), mujoco.MjData(model)
        for state, own in enumerate(self._answers(mujoco_warp.forward, "M", qpos=q)):
            data.M[:] = own
            fill_mass_matrix(model, data, found[state])
        return np.ascontiguousarray(found[:, velocities][:, :, velocities])

    def bias(self, q: Array, v: Array) -> Array:
        """``Data.qfrc_bias``."""
        return self._answers(mujoco_warp.forward, "qfrc_bias", qpos=q, qvel=v)[:, self._compiled.addresses[1]]

    def gravity(self, q: Array) -> Array:
        """``Data.qfrc_bias`` at rest."""
        return self.bias(q, np.zeros((len(q), len(self._compiled.addresses[1]))))

    def inverse_dynamics(self, q: Array, v: Array, qdd: Array) -> Array:
        """``mujoco_warp.inverse``."""
        return self._answers(mujoco_warp.inverse, "qfrc_inverse", qpos=q, qvel=v, qacc=qdd)[:, self._compiled.addresses[1]]

    def _answers(self, compute: Callable[..., None], found: str, **given: Array) -> Array:
        """An array of ``Data`` at each state, (n, its width), by a function of Warp; what is not given of ``GIVEN`` is zero."""
        own = dict(zip(given, self._compiled.own(*given.values()), strict=True))
        answers, states = [], len(own["qpos"])
        for start in range(0, states, BLOCK):
            block = {name: values[start : start + BLOCK] for name, values in own.items()}
            count = len(block["qpos"])
            with warp.ScopedDevice("cpu"):
                for name in GIVEN:
                    getattr(self._data, name).zero_()
                for name, values in block.items():
                    # A block that is not full repeats its first state, as zeros are no quaternion.
                    full = np.concatenate([values, np.repeat(values[:1], BLOCK - count, axis=0)])
                    getattr(self._data, name).assign(full.astype(np.float32))
                compute(self._model, self._data)
                answers.append(getattr(self._data, found).numpy().astype(np.float64)[:count])
        return np.concatenate(answers)


def keep_compiled() -> None:
    """Keep kernels in the harness's cache, and say that they are compiled on a terminal alone."""
    warp.config.kernel_cache_dir = str(cache_directory() / "warp")
    if not sys.stderr.isatty():
        warp.config.log_level = warp.LOG_WARNING


def load(file: ModelFile, joints: Sequence[str]) -> WarpModel:
    """See ``harness.engines.Engine.load``."""
    keep_compiled()
    mujoco.set_mju_user_warning(lambda message: None)
    refuse_in_float32(file)
    model = mujoco.MjModel.from_xml_string(file.text)
    rub_and_limit_alone(model, joints, file.acting)
    try:
        return WarpModel(model, joints)
    except NotImplementedError as error:
        raise Unsupported(f"MuJoCo Warp: {error}") from error
