"""PhysX on a robot in USD: the mass matrix, the Coriolis and the gravity forces of its articulations, in float32 on a CPU; and its steps.

``massMatrix`` is without the armature that PhysX adds to it in its steps, and the forces without viscous friction; both are added here, as
the engine holds them. Drives are off.

Source: ovphysx documentation, Articulations, and Tensor bindings: inverse dynamics queries.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from harness.engines import Engine
from harness.engines.moving import MotionsRequest, Moved, moved_as_they_stand
from harness.engines.request import Request
from harness.files.findings import EQUALITIES, FRICTION, LIMITS

if TYPE_CHECKING:
    from harness.engines.adapters.physx.articulations import PhysxFile

_CALL = (
    "p = ovphysx.PhysX(); s = ovstage.Stage('s'); ovstage.population.open_usd(s, PATH, ordinal=1, domains=ovstage.PopulationDomain.ALL); "
    "s.advance_write_floor(ordinal=1).wait(); p.wait_task(p.attach_ovstage(s, read_ordinal=1)); "
    "p.create_tensor_binding(pattern='/**', tensor_type=TensorType.ARTICULATION_MASS_MATRIX).read(M), "
    "and ARTICULATION_GRAVITY_FORCE, ARTICULATION_CORIOLIS_AND_CENTRIFUGAL_FORCE"
)


class PhysxEngine(Engine):
    title = "PhysX"
    requires = ("ovphysx", "ovphysx")
    formats = ("usd",)
    optional = True
    companions: Mapping[str, tuple[str, ...]] = {">=0.7": ("usd-core", "physx-usd-schemas", "newton-usd-schemas")}
    factorises_mass_matrix = True
    unit_roundoff = 2.0**-24
    supplied: Mapping[str, str] = {
        "usd": (
            "each tree is given a root that PhysX takes, with a base where it hangs on the world, and bodies between the joints of one; "
            "springs, and dampers and rotor inertias of joints, are supplied from the file"
        )
    }
    why_off: Mapping[str, str] = {
        EQUALITIES: "PhysX couples joints in its steps, and not in its mass matrix",
        FRICTION: "PhysX applies friction of joints in its steps alone",
        LIMITS: "PhysX holds limits in its steps alone",
    }
    call: Mapping[str, str] = {"usd": _CALL}

    def read(self, request: Request) -> PhysxFile:
        from harness.engines.adapters.physx.articulations import read

        return read(request)

    def moved(self, request: MotionsRequest) -> Moved:
        """See ``harness.engines.Engine``; of files as they stand."""
        from harness.engines.adapters.physx.moving import moved

        return moved_as_they_stand(self.title, request, moved, turns_freely=True)


ENGINE = PhysxEngine()
