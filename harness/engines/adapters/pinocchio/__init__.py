"""Pinocchio's articulated-body algorithm on a URDF or MJCF model, as ``pinocchio.aba`` computes it.

``abaInParallel`` is faster, but not the same algorithm: it works in the world's frame, where an inertia
about a joint is what is left of one about the origin, and loses digits that ``aba`` keeps.

ABA applies no springs and dampers; those the file declares are added to the applied forces by
``harness.engines.adapters.pinocchio.forces``. The reflected inertias a URDF declares become the model's armature, which ABA
adds to a joint's own inertia. A URDF holds no gravity, so the harness gives it; an MJCF does, and Pinocchio's
reader passes over it, as over much else that ``harness.explain.changes.readings.pinocchio_mjcf`` declares.

A model with constraints is computed by ``pinocchio.constraintDynamics`` instead, with the settings that
``harness.engines.adapters.pinocchio.constraints`` names and the reasons for them; the constraints are those of the file. Joints that mimic
others are left to ``harness.engines.adapters.pinocchio.constraints``, since all forward dynamics refuse them.

Source: Featherstone, Rigid Body Dynamics Algorithms, section 7.3; Pinocchio 4 documentation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from harness.engines import Engine
from harness.engines.interface import CompiledNumber
from harness.engines.request import Request
from harness.files.findings import EFFORT, EQUALITIES, FRICTION, LIMITS, TENDON_LIMITS, TRANSMISSIONS
from harness.files.model_file import ModelFile

if TYPE_CHECKING:
    from harness.engines.adapters.pinocchio.model import PinocchioModel
    from harness.engines.adapters.pinocchio.robot import PinocchioFile


class PinocchioEngine(Engine):
    title = "Pinocchio"
    requires = ("pinocchio", "pin")
    formats: tuple[str, ...] = ("urdf", "mjcf")
    oldest: Mapping[str, str] = {"urdf": "2.7.0", "mjcf": "3.3.1"}
    # Wheels of that time take whatever versions of these there are.
    companions: Mapping[str, Sequence[str]] = {">=3,<4": ("cmeel-urdfdom<5", "cmeel-tinyxml2<11", "numpy<2.4")}
    linear_velocity_in_body = True
    supplied: Mapping[str, str] = dict.fromkeys(
        formats,
        "gravity, dampers, springs and rotor inertias of joints, springs between points and a ball joint are supplied from the file",
    )
    beside_tau: Mapping[str, str] = {
        EFFORT: "Pinocchio stores both, and ABA applies neither (Pinocchio 4.1, multibody/model.hpp, effortLimit and velocityLimit)",
        TRANSMISSIONS: "Pinocchio reads none (Pinocchio 4.1, parsers/urdf/model.cpp)",
    }
    why_off: Mapping[str, str] = {
        EQUALITIES: "pin.aba holds no equality, whatever its readers make of it",
        FRICTION: "pin.aba applies no dry friction",
        LIMITS: "pin.aba knows no joint limits",
        TENDON_LIMITS: "pin.aba knows no tendons",
    }
    call: Mapping[str, str] = {
        "urdf": "pin.aba(m := pin.buildModelFromUrdf(PATH), m.createData(), q, v, tau)",
        "mjcf": "pin.aba(m := pin.buildModelFromMJCF(PATH), m.createData(), q, v, tau)",
    }

    def read(self, request: Request) -> PinocchioFile:
        from harness.engines.adapters.pinocchio.robot import read

        return read(request)

    def compiled(self, request: Request) -> tuple[CompiledNumber, ...]:
        from harness.engines.adapters.pinocchio.compiled import compiled
        from harness.engines.adapters.pinocchio.robot import model_of

        return tuple(compiled(model_of(request)))

    def load_model(self, file: ModelFile, joints: Sequence[str], gravity: float) -> PinocchioModel:
        from harness.engines.adapters.pinocchio.model import load

        return load(file, joints, gravity)


ENGINE = PinocchioEngine()
