"""MuJoCo XLA, ``mujoco.mjx``, on an MJCF model: ``mjx.forward`` on many states at once, in float64 or in float32.

JAX computes in float32 unless its 64 bits are switched on, so that each precision is an engine of its own. States go through one compiled
function in blocks, see its module ``device``.

Its constraints are MuJoCo's, soft by the law that the file declares (``harness.engines.adapters.mujoco.law``). In float64 its solver ends
early on elliptic cones: docs/issues/mjx-elliptic-cones-end-early.md.

Source: MuJoCo documentation, MuJoCo XLA (MJX), with its table of what is not implemented.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from harness.engines import ConstraintLaw, Engine
from harness.engines.adapters.mujoco import law
from harness.engines.moving import MotionsRequest, Moved, moved_as_they_stand
from harness.engines.request import Ending, Request, SolverSettings
from harness.files.equalities import Constraint
from harness.files.model_file import ModelFile

if TYPE_CHECKING:
    from harness.engines.adapters.mjx.device import MjxModel
    from harness.engines.adapters.mujoco.on_device import DeviceFile

FLOAT32 = 2.0**-24


class MjxEngine(Engine):
    """The engine in float64, or else in float32."""

    title = "MJX"
    requires = ("mujoco.mjx", "mujoco-mjx")
    formats = ("mjcf",)
    optional = True
    factorises_mass_matrix = True
    has_soft_constraints = True
    contacts = staticmethod(law.contacts)
    reader = "mujoco"
    inertias_about = "tree"
    supplied: Mapping[str, str] = {"mjcf": "springs or dampers that it leaves out because the others are switched off"}
    # Other methods converge linearly.
    endings = (Ending(SolverSettings("Newton", 100, 0.0), 'set <option solver="Newton" iterations="100" tolerance="0"/>'),)
    call: Mapping[str, str] = {
        "mjcf": (
            "m = mujoco.MjModel.from_xml_path(PATH); m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT; "
            "mjx.forward(mjx.put_model(m), mjx.make_data(m).replace(qpos=q, qvel=v, qfrc_applied=tau)).qacc"
        )
    }

    def __init__(self, in_float64: bool) -> None:
        self._in_float64 = in_float64
        if not in_float64:
            self.unit_roundoff, self.title = FLOAT32, "MJX in float32"

    def read(self, request: Request) -> DeviceFile:
        from harness.engines.adapters.mjx.device import read

        return read(request, self._in_float64)

    def load_model(self, file: ModelFile, joints: Sequence[str], gravity: float) -> MjxModel:
        from harness.engines.adapters.mjx.device import load

        return load(file, joints, self._in_float64)

    def moved(self, request: MotionsRequest) -> Moved:
        """See ``harness.engines.Engine``; of files as they stand, in float64."""
        if not self._in_float64:
            return super().moved(request)
        from harness.engines.adapters.mjx.moving import moved

        return moved_as_they_stand(self.title, request, moved, turns_freely=True)

    def laws(self, root: Any, model_format: str, constraints: Sequence[Constraint]) -> Mapping[str, ConstraintLaw]:
        """See ``harness.engines.adapters.mujoco.law``."""
        return law.laws_in(law.settings(root, model_format), constraints)


ENGINE = MjxEngine(in_float64=True)
