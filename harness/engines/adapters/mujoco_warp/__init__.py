"""MuJoCo Warp, ``mujoco_warp``, on an MJCF model: ``mujoco_warp.forward`` on many worlds at once, in float32.

Its kernels are compiled at the first question of a cache, which takes minutes on a CPU, and kept there. Its constraints are MuJoCo's, soft
by the law that the file declares (``harness.engines.adapters.mujoco.law``).

Source: MuJoCo documentation, MuJoCo Warp (MJWarp), with its list of what is not implemented.
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
    from harness.engines.adapters.mujoco.on_device import DeviceFile
    from harness.engines.adapters.mujoco_warp.device import WarpModel


class MujocoWarpEngine(Engine):
    title = "MuJoCo Warp"
    requires = ("mujoco_warp", "mujoco-warp")
    formats = ("mjcf",)
    optional = True
    factorises_mass_matrix = True
    has_soft_constraints = True
    contacts = staticmethod(law.contacts)
    reader = "mujoco"
    inertias_about = "tree"
    unit_roundoff = 2.0**-24
    supplied: Mapping[str, str] = {"mjcf": "nothing: it has MuJoCo's reader"}
    # Other methods converge linearly.
    endings = (Ending(SolverSettings("Newton", 100, 0.0), 'set <option solver="Newton" iterations="100" tolerance="0"/>'),)
    call: Mapping[str, str] = {
        "mjcf": (
            "m = mujoco.MjModel.from_xml_path(PATH); m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT; "
            "w = mujoco_warp.put_model(m); d = mujoco_warp.make_data(m); d.qpos.assign(q), d.qvel.assign(v), d.qfrc_applied.assign(tau); "
            "mujoco_warp.forward(w, d); d.qacc"
        )
    }

    def read(self, request: Request) -> DeviceFile:
        from harness.engines.adapters.mujoco_warp.device import read

        return read(request)

    def laws(self, root: Any, model_format: str, constraints: Sequence[Constraint]) -> Mapping[str, ConstraintLaw]:
        """See ``harness.engines.adapters.mujoco.law``."""
        return law.laws_in(law.settings(root, model_format), constraints)

    def load_model(self, file: ModelFile, joints: Sequence[str], gravity: float) -> WarpModel:
        from harness.engines.adapters.mujoco_warp.device import load

        return load(file, joints)

    def moved(self, request: MotionsRequest) -> Moved:
        """See ``harness.engines.Engine``; of files as they stand."""
        from harness.engines.adapters.mujoco_warp.moving import moved

        return moved_as_they_stand(self.title, request, moved, turns_freely=True)


ENGINE = MujocoWarpEngine()
