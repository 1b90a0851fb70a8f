"""The engine of Pinocchio's constraint solvers; see ``stepping`` for how they are asked, and ``step_law`` for the problem."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from harness.engines import ConstraintLaw, Unsupported
from harness.engines.adapters.pinocchio import PinocchioEngine
from harness.engines.adapters.pinocchio.step_law import AND, COMPLIANCE, EXACT, EXACT_WITH_CONES, ITERATIONS, contacts, laws
from harness.engines.interface import CompiledNumber
from harness.engines.moving import MotionsRequest, Moved, moved_as_they_stand
from harness.engines.request import Ending, Request, SolverSettings
from harness.files.equalities import Constraint
from harness.files.findings import EQUALITIES, TENDON_LIMITS
from harness.files.model_file import ModelFile

if TYPE_CHECKING:
    from harness.engines.adapters.pinocchio.model import PinocchioModel
    from harness.engines.adapters.pinocchio.robot import PinocchioFile


_REMEDY = (
    f"use pin.{EXACT}ConstraintSolver with the four tolerances of its settings at 0 and max_iterations = {ITERATIONS}, "
    "and solve again from the impulses that it finds until they stay"
)
_WITH_CONES = (
    f"; where bodies touch, pin.{EXACT_WITH_CONES}ConstraintSolver so, with admm_update_rule = pin.ADMMUpdateRule.CONSTANT "
    "and no limits in the problem that the step does not reach"
)
_UNEVEN = (
    f"pin.{EXACT}ConstraintSolver does not converge at a contact that should stick and whose tangents weigh unlike, as on planar robots"
)


class PinocchioStepper(PinocchioEngine):
    """Pinocchio over one step with dry friction and limits of joints, and with contacts in points, by "ADMM" or "PGS"."""

    is_asked_by_name = True
    reader = "pinocchio"
    formats = ("urdf",)
    oldest: Mapping[str, str] = {"urdf": "4.1.0"}
    factorises_mass_matrix = True
    why_off: Mapping[str, str] = {
        EQUALITIES: "the harness asks Pinocchio's constraint solvers about dry friction, limits and contacts alone",
        TENDON_LIMITS: "Pinocchio knows no tendons",
    }

    def __init__(self, solver: str, is_convex: bool = False) -> None:
        """``is_convex``: with ``solve_ncp`` off, in place of its default."""
        self._solver, self._is_convex, self.contacts = solver, is_convex, contacts
        both = Ending(SolverSettings(f"{EXACT}{AND}{EXACT_WITH_CONES}", ITERATIONS, 0.0), _REMEDY + _WITH_CONES)
        alone = Ending(SolverSettings(EXACT, ITERATIONS, 0.0), _REMEDY)
        self.endings = (both,) if solver == EXACT_WITH_CONES else (alone, replace(both, fault=_UNEVEN))
        self.title = f"Pinocchio by {solver}{', convex' * is_convex}"
        settings = f"pin.{solver}SolverSettings"
        heeded = "s.solve_ncp = False; " * is_convex
        self.call = {
            "urdf": (
                "m = pin.buildModelFromUrdf(PATH); d = m.createData(); c = pin.JointFrictionConstraintModel(m, joints); c.setTimeStep(h); "
                f"s = {settings}(); {heeded}delassus.updateCompliance(R) with R = {COMPLIANCE!r} where bodies touch; "
                f"pin.{solver}ConstraintSolver().solve(delassus, J @ (v + h * pin.aba(m, d, q, v, tau)), cs, cds, s, x); "
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

        return read(request, self._solver, self._is_convex)

    def moved(self, request: MotionsRequest) -> Moved:
        """See ``harness.engines.Engine``; of files as they stand, with contacts and with what its solver has by default otherwise."""
        from harness.engines.adapters.pinocchio.simulated import simulated

        return moved_as_they_stand(self.title, request, partial(simulated, solver=self._solver, is_convex=self._is_convex))

    def compiled(self, request: Request) -> tuple[CompiledNumber, ...]:
        """None: what it holds is said of ``pinocchio``."""
        return ()

    def laws(self, root: Any, model_format: str, constraints: Sequence[Constraint]) -> Mapping[str, ConstraintLaw]:
        """See ``harness.engines.adapters.pinocchio.step_law``."""
        return laws(constraints, self._is_convex)
