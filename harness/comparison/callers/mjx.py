"""MuJoCo XLA as its user calls it: ``mjx.put_model`` of the ``MjModel`` that MuJoCo compiles, then ``mjx.forward`` in float64.

What is off in MuJoCo is off here. Its reader is MuJoCo's. Source: MuJoCo documentation, MuJoCo XLA (MJX).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.comparison.aided import AidedEngine
from harness.comparison.callers import mujoco
from harness.comparison.questions import Caller, Loaded, Refused, Request, Run
from harness.engines import Unsupported
from harness.engines.adapters.mjx import OnDevice, keep_what_is_on


class MjxCaller(Caller):
    engine = "mjx"
    formats: tuple[str, ...] = ("mjcf",)
    requires = ("mujoco.mjx", "mujoco-mjx")
    optional = True
    reader = "mujoco"
    factorises_mass_matrix = True
    takes_inertias_about_tree = True
    supplied: Mapping[str, str] = {"mjcf": "springs or dampers that it leaves out because the others are switched off"}
    why_no_equalities = "the harness asks it without the file's equalities"
    call: Mapping[str, str] = {
        "mjcf": (
            "m = mujoco.MjModel.from_xml_path(PATH); m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT; "
            "mjx.forward(mjx.put_model(m), mjx.make_data(m).replace(qpos=q, qvel=v, qfrc_applied=tau)).qacc"
        )
    }

    def load(self, request: Request) -> Loaded:
        compiled = mujoco.CALLER.load(request)
        if request.aid is not None:
            keep_what_is_on(compiled.model)
        try:
            return LoadedRobot(compiled)
        except NotImplementedError as error:
            raise Refused(f"MJX: {' '.join(str(error).split())}") from error


class LoadedRobot:
    """MuJoCo's model on the device; its conventions are MuJoCo's."""

    def __init__(self, compiled: mujoco.LoadedRobot) -> None:
        self._compiled, self._on_device = compiled, OnDevice(compiled.model, in_float64=True)
        self.joints, self.notes, self.further = compiled.joints, compiled.notes, compiled.further

    @property
    def model(self) -> Any:
        raise Unsupported("the harness asks this engine for accelerations alone")

    @property
    def is_supplied_with_forces(self) -> bool:
        return self._compiled.is_supplied_with_forces

    def addresses(self, names: Sequence[str]) -> tuple[list[int], list[int]]:
        return self._compiled.addresses(names)

    def prepare(self, q: Array, v: Array, tau: Array) -> Run:
        return _Run(self._compiled.prepare(q, v, tau), self._on_device)


class _Run:
    """MuJoCo's run, computed by MJX."""

    def __init__(self, run: Any, on_device: OnDevice) -> None:
        self._run, self._on_device = run, on_device
        self._states = [np.array(part) for part in zip(*run.rows, strict=True)]

    def compute(self) -> None:
        self._run.found[:] = self._on_device.accelerations(*self._states)

    def accelerations(self) -> Array:
        found: Array = self._run.accelerations()
        return found


CALLER = MjxCaller()
ENGINE = AidedEngine(CALLER)
