"""Drake's plant in discrete time, with limits of joints and contacts in points over one step of its convex problem.

See ``harness.engines.adapters.drake.step_law``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from harness.engines import ConstraintLaw, Unsupported
from harness.engines.adapters.drake import DrakeEngine
from harness.engines.adapters.drake.files import Building
from harness.engines.adapters.drake.step_law import ABSOLUTE, RELATIVE, STEP, contacts, laws
from harness.engines.loaded_file import LoadedFile
from harness.engines.request import Request, StopRule
from harness.files.equalities import Constraint
from harness.files.findings import EQUALITIES, FRICTION, TENDON_LIMITS
from harness.files.model_file import ModelFile


class DrakeStep(DrakeEngine):
    title = "Drake by steps"
    is_asked_by_name = True
    reader = "drake"
    formats = ("urdf",)
    factorises_mass_matrix = True
    contacts = staticmethod(contacts)
    step = STEP
    stops = StopRule(ABSOLUTE, RELATIVE, "expect that much, for Drake lets nobody in Python set the tolerance of its solver")
    why_off: Mapping[str, str] = {
        EQUALITIES: "the harness asks Drake's discrete steps about limits and contacts alone",
        FRICTION: "Drake 1.51 knows no dry friction of joints",
        TENDON_LIMITS: "its parser knows no tendons",
    }
    call: Mapping[str, str] = {
        "urdf": (
            "b = DiagramBuilder(); p, g = AddMultibodyPlantSceneGraph(b, h); p.SetUseSampledOutputPorts(False); "
            "p.set_contact_model(ContactModel.kPoint); p.set_discrete_contact_approximation(DiscreteContactApproximation.kSap); "
            "Parser(p).AddModels(PATH); "
            "p.WeldFrames(p.world_frame(), p.GetFrameByName(ROOT)); p.Finalize(); d = b.Build(); "
            "p.get_generalized_acceleration_output_port().Eval(c)"
        )
    }

    def refuse(self, file: ModelFile) -> None:
        """See ``harness.engines.Engine``; the metric of a step is one of the numbers of a file, and no textbook has it."""
        super().refuse(file)
        if file.acting:
            raise Unsupported(f"the harness asks Drake's discrete steps about limits of users' files alone, and not with {file.acting[0]}")

    def model(self, built_by: Building, names: Mapping[str, str], request: Request) -> LoadedFile:
        """See ``DrakeEngine``; with nothing on, that of continuous time."""
        if request.held is None or not (request.held.limited or request.held.touches):
            return super().model(built_by, names, request)
        from harness.engines.adapters.drake.stepped import stepped

        return stepped(built_by, names, request)

    def laws(self, root: Any, model_format: str, constraints: Sequence[Constraint]) -> Mapping[str, ConstraintLaw]:
        """See ``harness.engines.adapters.drake.step_law``."""
        return laws(constraints)


ENGINE = DrakeStep()
