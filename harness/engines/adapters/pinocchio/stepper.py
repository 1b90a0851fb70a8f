"""The engine of Pinocchio's constraint solvers; see ``stepping`` for how they are asked, and ``step_law`` for the problem."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from harness.engines import ConstraintLaw, Unsupported
from harness.engines.adapters.pinocchio import PinocchioEngine
from harness.engines.adapters.pinocchio.step_law import EXACT, ITERATIONS, laws
from harness.engines.interface import CompiledNumber
from harness.engines.request import Ending, Request, SolverSettings
from harness.files.equalities import Constraint
from harness.files.findings import EQUALITIES, TENDON_LIMITS
from harness.files.model_file import ModelFile

if TYPE_CHECKING:
    from harness.engines.adapters.pinocchio.model import PinocchioModel
    from harness.engines.adapters.pinocchio.robot import PinocchioFile


class PinocchioStepper(PinocchioEngine):
    """Pinocchio with dry friction and limits of joints over one step, by one of its constraint solvers: "ADMM" or "PGS"."""

    is_asked_by_name = True
    endings = (
        Ending(
            SolverSettings(EXACT, ITERATIONS, 0.0),
            f"use pin.{EXACT}ConstraintSolver with the four tolerances of its settings at 0 and max_iterations = {ITERATIONS}, "
            "and solve again from the impulses that it finds until they stay",
        ),
    )
    reader = "pinocchio"
    formats = ("urdf",)
    oldest: Mapping[str, str] = {"urdf": "4.1.0"}
    factorises_mass_matrix = True
    why_off: Mapping[str, str] = {
        EQUALITIES: "the harness asks Pinocchio's constraint solvers about dry friction and limits alone",
        TENDON_LIMITS: "Pinocchio knows no tendons",
    }

    def __init__(self, solver: str) -> None:
        self._solver = solver
        self.title = f"Pinocchio by {solver}"
        settings = f"pin.{solver}SolverSettings"
        self.call = {
            "urdf": (
                "m = pin.buildModelFromUrdf(PATH); d = m.createData(); c = pin.JointFrictionConstraintModel(m, joints); c.setTimeStep(h); "
                f"pin.{solver}ConstraintSolver().solve(delassus, J @ (v + h * pin.aba(m, d, q, v, tau)), cs, cds, {settings}(), x); "
                "pin.aba(m, d, q, v, tau + J.T @ x.retrieveConstraintImpulses() / h)"
            )
        }

    def load_model(self, file: ModelFile, joints: Sequence[str], gravity: float) -> PinocchioModel:
        """See ``harness.engines.Engine``; the problem of a step is one of the numbers of a file, and no textbook has it.

        Raises:
            Unsupported: dry friction or limits of a textbook are to act.
        """
        if file.acting:
            raise Unsupported(f"the harness asks Pinocchio's constraint solvers about users' files alone, and not with {file.acting[0]}")
        return super().load_model(file, joints, gravity)

    def read(self, request: Request) -> PinocchioFile:
        from harness.engines.adapters.pinocchio.stepping import read

        return read(request, self._solver)

    def compiled(self, request: Request) -> tuple[CompiledNumber, ...]:
        """None: what it holds is said of ``pinocchio``."""
        return ()

    def laws(self, root: Any, model_format: str, constraints: Sequence[Constraint]) -> Mapping[str, ConstraintLaw]:
        """See ``harness.engines.adapters.pinocchio.step_law``."""
        return laws(constraints)
