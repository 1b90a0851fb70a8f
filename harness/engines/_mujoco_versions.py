"""What differs between the versions of MuJoCo that the harness knows, from 3.3 on.

Source: MuJoCo's changelog, and the versions themselves.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from harness.arrays import Array


def batch(model: Any, count: int) -> Any:
    """A ``mujoco.batch.Batch`` of ``count`` states on one thread; for versions without that module, the same by a loop."""
    import mujoco

    try:
        import mujoco.batch
    except ModuleNotFoundError:
        return _Loop(model, count)
    return mujoco.batch.Batch(model, nsim=count, nthread=1)


def fill_mass_matrix(model: Any, data: Any, mass: Array) -> None:
    """Write M, (nv, nv), into ``mass``: ``mj_fullM``, which took the sparse matrix before it took the data."""
    import mujoco

    try:
        mujoco.mj_fullM(model, data, mass)
    except TypeError:
        mujoco.mj_fullM(model, mass, data.qM)


class _Loop:
    """``mj_forward`` at one state after another, behind the two methods of a batch that the harness calls."""

    def __init__(self, model: Any, count: int) -> None:
        import mujoco

        self.nsim = count
        self._model, self._data = model, mujoco.MjData(model)
        self._fields: dict[str, Array] = {}

    def bind(self, name: str) -> Array:
        """The field of ``MjData`` of every state, (count, size)."""
        if name not in self._fields:
            self._fields[name] = np.tile(getattr(self._data, name), (self.nsim, 1))
        return self._fields[name]

    def forward(self) -> None:
        import mujoco

        answers = self.bind("qacc")
        inputs = [(getattr(self._data, name), values) for name, values in self._fields.items() if name != "qacc"]
        for state, answer in enumerate(answers):
            for field, values in inputs:
                field[:] = values[state]
            mujoco.mj_forward(self._model, self._data)
            answer[:] = self._data.qacc
