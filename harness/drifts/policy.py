"""A trained policy in the ONNX format as a control: what it makes of the state is what its actuators are given.

Source: ONNX Runtime, Python API, ``InferenceSession``.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.errors import DISTRIBUTION, InvalidRequest, not_installed

# Names of inputs that are the time, positions or velocities; an only input of another name is positions before velocities.
_TIME, _POSITIONS, _VELOCITIES = "time", "q", "v"
_KINDS = {"tensor(float)": np.float32, "tensor(double)": np.float64}


class OnnxPolicy:
    """A function (t, q, v) to the first output of a network, in the order of the actuators; goes to other processes as its path.

    Raises:
        InvalidRequest: onnxruntime is not installed, the file is no network, or it takes something else than the state.
    """

    def __init__(self, path: Path) -> None:
        try:
            onnxruntime = importlib.import_module("onnxruntime")
        except ImportError as error:
            raise InvalidRequest(f"{path} is a policy: {not_installed('onnxruntime')}; pip install '{DISTRIBUTION}[policy]'") from error
        self._path, options = path, onnxruntime.SessionOptions()
        # One thread adds in one order.
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        try:
            self._session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        except Exception as error:
            raise InvalidRequest(f"{path}: onnxruntime reads no network there: {error}") from error
        inputs = {one.name: one.type for one in self._session.get_inputs()}
        if not set(inputs.values()) <= _KINDS.keys() or not (inputs.keys() <= {_TIME, _POSITIONS, _VELOCITIES} or len(inputs) == 1):
            found = ", ".join(f"{name}: {kind}" for name, kind in inputs.items())
            raise InvalidRequest(f"{path} takes {found}; expected inputs among time, q and v, or one of q and v together, of floats")
        self._kinds = {name: _KINDS[kind] for name, kind in inputs.items()}

    def __reduce__(self) -> tuple[Any, ...]:
        return OnnxPolicy, (self._path,)

    def __call__(self, time: float, q: Array, v: Array) -> Array:
        known = {_TIME: np.array([time]), _POSITIONS: q, _VELOCITIES: v}
        given = {name: known.get(name, np.concatenate([q, v]))[None].astype(kind) for name, kind in self._kinds.items()}
        try:
            return np.asarray(self._session.run(None, given)[0], dtype=np.float64).reshape(-1)
        except Exception as error:
            raise ValueError(f"{self._path} takes no state of {len(q)} positions and {len(v)} velocities: {error}") from error
