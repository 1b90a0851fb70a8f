"""Newton's ``SolverMuJoCo`` on an MJCF or a URDF: what Newton's importer reads, converted for MuJoCo Warp, in many worlds, in float32.

Its kernels are compiled at the first question of a cache, which takes minutes on a CPU, and kept there. Its constraints are MuJoCo's, soft
by the law that an MJCF declares (``harness.engines.adapters.mujoco.law``); what it makes of the limits of a URDF is by gains of its own.

Source: Newton documentation, ``SolverMuJoCo``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from harness.engines import ConstraintLaw
from harness.engines.adapters.mujoco import law
from harness.engines.adapters.newton import NewtonEngine
from harness.engines.moving import MotionsRequest, Moved
from harness.engines.request import Ending, Request, SolverSettings
from harness.files.equalities import Constraint
from harness.files.model_file import ModelFile

if TYPE_CHECKING:
    from harness.engines.adapters.newton.through_mujoco import SolverFile

_CALL = (
    "b = newton.ModelBuilder(); newton.solvers.SolverMuJoCo.register_custom_attributes(b); b.{read}; m = b.finalize(); "
    "s = newton.solvers.SolverMuJoCo(m, disable_contacts=True); s.mjw_data.qpos.assign(q), s.mjw_data.qvel.assign(v); "
    "s.mjw_data.qfrc_applied.assign(tau); mujoco_warp.forward(s.mjw_model, s.mjw_data); s.mjw_data.qacc"
)


class NewtonMujocoEngine(NewtonEngine):
    title = "Newton's SolverMuJoCo"
    formats = ("mjcf", "urdf")
    companions: Mapping[str, tuple[str, ...]] = {">=1.8": ("newton[sim]",)}
    has_soft_constraints = True
    contacts = staticmethod(law.contacts)
    reader = "newton"
    inertias_about = "tree"
    why_off: Mapping[str, str] = {}
    why_no_constraints = "the harness asks SolverMuJoCo about constraints of users' files alone"
    endings = (Ending(SolverSettings("Newton", 100, 0.0), "pass solver='newton', iterations=100 and tolerance=0 to SolverMuJoCo"),)
    supplied: Mapping[str, str] = {
        "mjcf": "gravity is supplied from the file, and inertias are taken as the file has them",
        "urdf": "gravity, springs and rotor inertias of joints are supplied from the file, and inertias are taken as the file has them",
    }
    call: Mapping[str, str] = {
        "mjcf": _CALL.format(read="add_mjcf(PATH)"),
        "urdf": _CALL.format(read="add_urdf(PATH)"),
    }

    def read(self, request: Request) -> SolverFile:
        from harness.engines.adapters.newton.through_mujoco import read

        return read(request)

    def load_model(self, file: ModelFile, joints: Sequence[str], gravity: float) -> SolverFile:
        from harness.engines.adapters.newton.through_mujoco import load

        self.refuse(file)
        return load(file, joints, gravity)

    def laws(self, root: Any, model_format: str, constraints: Sequence[Constraint]) -> Mapping[str, ConstraintLaw]:
        """See ``harness.engines.adapters.mujoco.law``."""
        return law.laws_in(law.settings(root, model_format), constraints)

    def moved(self, request: MotionsRequest) -> Moved:
        """See ``harness.engines.Engine``: another solver than the one whose motions the harness computes."""
        return super(NewtonEngine, self).moved(request)


ENGINE = NewtonMujocoEngine()
