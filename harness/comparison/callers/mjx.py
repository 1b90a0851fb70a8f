"""MuJoCo XLA as its user calls it: ``mjx.put_model`` of the ``MjModel`` that MuJoCo compiles, then ``mjx.forward`` in float64.

What is off in MuJoCo is off here. Its reader is MuJoCo's. Source: MuJoCo documentation, MuJoCo XLA (MJX).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.comparison.aided import AidedEngine
from harness.comparison.callers import mujoco
from harness.comparison.questions import Caller, Loaded, Refused, Request, Run
from harness.engines import Unsupported
from harness.engines._mjx import BLOCK, keep_what_is_on


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
    """MuJoCo's model on the device, and the compiled function of a block of states; its conventions are MuJoCo's."""

    def __init__(self, compiled: mujoco.LoadedRobot) -> None:
        import jax
        from mujoco import mjx

        self._compiled = compiled
        self.joints, self.notes, self.further = compiled.joints, compiled.notes, compiled.further
        with jax.enable_x64(True):
            on_device, empty = mjx.put_model(compiled.model), mjx.make_data(compiled.model)

            def accelerations(q: Any, v: Any, tau: Any) -> Any:
                return mjx.forward(on_device, empty.replace(qpos=q, qvel=v, qfrc_applied=tau)).qacc

            self._of_a_block = jax.jit(jax.vmap(accelerations))

    @property
    def model(self) -> Any:
        raise Unsupported("the harness asks this engine for accelerations alone")

    @property
    def is_supplied_with_forces(self) -> bool:
        return self._compiled.is_supplied_with_forces

    def addresses(self, names: Sequence[str]) -> tuple[list[int], list[int]]:
        return self._compiled.addresses(names)

    def prepare(self, q: Array, v: Array, tau: Array) -> Run:
        return _Run(self._compiled.prepare(q, v, tau), self._of_a_block)


class _Run:
    """MuJoCo's run, computed by MJX; the last block is filled up with the last state."""

    def __init__(self, run: Any, of_a_block: Callable[..., Any]) -> None:
        self._run, self._of_a_block = run, of_a_block
        rows = [*run.rows, *run.rows[-1:] * (-len(run.rows) % BLOCK)]
        self._blocks = [[np.array(part) for part in zip(*rows[start : start + BLOCK], strict=True)] for start in range(0, len(rows), BLOCK)]

    def compute(self) -> None:
        import jax

        with jax.enable_x64(True):
            found = [np.asarray(self._of_a_block(*block)) for block in self._blocks]
        self._run.found[:] = np.concatenate(found)[: len(self._run.found)]

    def accelerations(self) -> Array:
        found: Array = self._run.accelerations()
        return found


CALLER = MjxCaller()
ENGINE = AidedEngine(CALLER)
