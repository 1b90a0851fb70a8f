"""An ``MjModel`` in worlds of MuJoCo Warp: ``mujoco_warp.forward`` in blocks of states.

Warp's data are of a fixed number of worlds: states go through ``BLOCK`` of them, the last block filled up. Kernels depend on the structure
of a model and are kept in the harness's cache; on a terminal Warp says which it compiles.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import mujoco_warp
import numpy as np
import warp

from harness.arrays import Array
from harness.engines import HeldModel, LoadedModel, Unsupported
from harness.engines.adapters.mujoco.acting import refuse_in_float32, rub_and_limit_alone
from harness.engines.adapters.mujoco.model import MujocoModel
from harness.files.model_file import ModelFile
from harness.storage import cache_directory

BLOCK = 64


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
        given, answers = self._compiled.own(q, v, tau), []
        for start in range(0, len(q), BLOCK):
            block = [values[start : start + BLOCK] for values in given]
            count = len(block[0])
            # A block that is not full repeats its first state, as zeros are no quaternion.
            full = [np.concatenate([values, np.repeat(values[:1], BLOCK - count, axis=0)]).astype(np.float32) for values in block]
            with warp.ScopedDevice("cpu"):
                for own, values in zip((self._data.qpos, self._data.qvel, self._data.qfrc_applied), full, strict=True):
                    own.assign(values)
                mujoco_warp.forward(self._model, self._data)
                answers.append(self._data.qacc.numpy().astype(np.float64)[:count])
        return np.concatenate(answers)[:, self._compiled.addresses[1]]


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
