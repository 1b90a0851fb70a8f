"""Newton's ``SolverFeatherstone`` on an MJCF, a URDF or a robot in USD: composite rigid bodies in many worlds at once, in float32.

Its kernels are compiled at the first question of a cache, which takes minutes on a CPU, and kept there. A step's accelerations are those
that it integrates, ``SolverFeatherstone.joint_qdd``. Newton's importers make no constraint of limits: a joint beyond one is pushed back by
a spring, whose stiffness is set to zero here, as are the gains of drives; equalities are left out.

Source: Newton documentation, ``ModelBuilder.add_mjcf``, ``add_urdf``, ``add_usd`` and ``SolverFeatherstone``; its sources of 1.8.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from harness.engines import Engine
from harness.engines.moving import MotionsRequest, Moved, moved_as_they_stand
from harness.engines.request import Request
from harness.files.findings import EQUALITIES, FRICTION, LIMITS

if TYPE_CHECKING:
    from harness.engines.loaded_file import LoadedFile

_CALL = (
    "b = newton.ModelBuilder(); b.{read}; m = b.finalize(); s = newton.solvers.SolverFeatherstone(m); "
    "m.joint_limit_ke.zero_(); m.joint_limit_kd.zero_(); m.joint_target_ke.zero_(); m.joint_target_kd.zero_(); "
    "s.step(state, m.state(), control, None, 1e-3); s.joint_qdd"
)


class NewtonEngine(Engine):
    title = "Newton"
    requires = ("newton", "newton")
    formats: tuple[str, ...] = ("mjcf", "urdf", "usd")
    optional = True
    companions: Mapping[str, tuple[str, ...]] = {">=1.8": ("usd-core", "newton-usd-schemas")}
    factorises_mass_matrix = True
    inertias_about = "world"
    unit_roundoff = 2.0**-24
    supplied: Mapping[str, str] = {
        "mjcf": "gravity and springs between points are supplied from the file, and inertias are taken as the file has them",
        "urdf": "gravity and springs are supplied from the file, and inertias are taken as the file has them",
        "usd": "gravity, springs, dampers and rotor inertias of joints are supplied from the file, and inertias are taken as it has them",
    }
    why_off: Mapping[str, str] = {
        EQUALITIES: "SolverFeatherstone holds no equality but joints that mimic",
        FRICTION: "SolverFeatherstone does not support joint_friction",
        LIMITS: "SolverFeatherstone pushes a joint back by a spring beyond its limit, by gains that no file gives",
    }
    why_no_constraints = "SolverFeatherstone holds joints together that mimic others in a URDF, and nothing else"
    call: Mapping[str, str] = {
        "mjcf": _CALL.format(read="add_mjcf(PATH, skip_equality_constraints=True)"),
        "urdf": _CALL.format(read="add_urdf(PATH)"),
        "usd": _CALL.format(read="add_usd(PATH)"),
    }

    def read(self, request: Request) -> LoadedFile:
        from harness.engines.adapters.newton.worlds import read

        return read(request)

    def moved(self, request: MotionsRequest) -> Moved:
        """See ``harness.engines.Engine``; of files as they stand."""
        from harness.engines.adapters.newton.moving import moved

        return moved_as_they_stand(self.title, request, moved)


ENGINE = NewtonEngine()
