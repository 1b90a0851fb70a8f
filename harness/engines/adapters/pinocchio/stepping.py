"""Accelerations over one step under dry friction and limits of joints, by one of Pinocchio's constraint solvers.

The problem is put together as Pinocchio's own example does: G x + g of the Delassus operator and of g = J v_free, the velocity that rows
have after the step without impulses x, and besides the distance to a limit over the step; where a limit is passed, Kp of that, which is 0
by default. Bounds of friction are forces, which the constraint model makes impulses by its time step: it is 1 s unless it is set.

Source: Pinocchio 4.1, examples/g1-constraint-simulation.py; constraints/joint-friction-constraint.hxx, setTimeStep.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any

import numpy as np
import pinocchio

from harness.arrays import Array
from harness.engines.adapters.pinocchio.robot import PinocchioFile, model_of
from harness.engines.adapters.pinocchio.step_law import STEP
from harness.engines.adapters.pinocchio.versions import require
from harness.engines.request import Request, SolverSettings

_PARTS = ("ConstraintSolver", "SolverResult", "SolverSettings")
_TOLERANCES = tuple(f"{kind}_{what}_tol" for kind in ("absolute", "relative") for what in ("feasibility", "complementarity"))


def read(request: Request, solver: str) -> SteppedFile:
    """A file as its user loads it, whose bounded rows a solver holds: "ADMM" or "PGS"; see ``harness.engines.Engine``."""
    require("dry friction and limits", "JointFrictionConstraintModel", f"{solver}ConstraintSolver")
    return SteppedFile(model_of(request), request, solver)


class SteppedFile(PinocchioFile):
    """A ``pinocchio.Model`` whose dry friction and limits act over one step."""

    def __init__(self, model: Any, request: Request, solver: str) -> None:
        super().__init__(model, request)
        self._solver = solver

    def accelerating(self) -> Callable[..., Array]:
        held = self.request.held
        if held is None or not (held.rubbing or held.limited):
            return super().accelerating()
        return _Step(self.model, self._numbers(held.rubbing), self._numbers(held.limited), self._solver, held.solver).accelerations

    def _numbers(self, owners: Collection[str]) -> list[int]:
        """Numbers of the joints called "joint NAME" in the model, in its order."""
        return sorted(self.model.getJointId(owner.removeprefix("joint ")) for owner in owners)


class _Step:
    """The constraint models of a model, and their solver."""

    def __init__(self, model: Any, rubbing: Sequence[int], limited: Sequence[int], solver: str, set_by: SolverSettings | None) -> None:
        self._model, self._limited, self._most = model, bool(limited), (set_by and set_by.iterations) or 0
        self._models, self._data = pinocchio.StdVec_ConstraintModel(), pinocchio.StdVec_ConstraintData()
        if limited:
            bounds = model.lowerPositionLimit, model.upperPositionLimit
            self._limits = pinocchio.JointLimitConstraintModel(model, list(limited), *bounds)
            self._models.append(pinocchio.ConstraintModel(self._limits))
        if rubbing:
            friction = pinocchio.JointFrictionConstraintModel(model, list(rubbing))
            friction.setTimeStep(STEP)
            self._models.append(pinocchio.ConstraintModel(friction))
        for one in self._models:
            self._data.append(one.createData())
        self._memory = model.createData()
        method = solver if set_by is None else set_by.method
        self._make, self._result, settings = (getattr(pinocchio, f"{method}{what}") for what in _PARTS)
        self._settings = settings()
        if set_by is not None and set_by.iterations is not None:
            self._settings.max_iterations = set_by.iterations
        if set_by is not None and set_by.tolerance is not None:
            for tolerance in _TOLERANCES:
                setattr(self._settings, tolerance, set_by.tolerance)

    def accelerations(self, q: Array, v: Array, tau: Array) -> Array:
        """(nv,) of ``aba`` under the impulses that the solver finds, spread over the step."""
        model, memory, models, data = self._model, self._memory, self._models, self._data
        free = v + STEP * pinocchio.aba(model, memory, q, v, tau)
        memory.q_in, memory.v_in, memory.tau_in = q, v, tau
        pinocchio.computeJointJacobians(model, memory, q)
        for one, own in zip(models, data, strict=True):
            one.calc(model, memory, own)
        jacobian = np.array(pinocchio.getConstraintsJacobian(model, memory, models, data)).reshape(-1, model.nv)
        drift = jacobian @ free
        if self._limited:
            distance = np.array(data[0].extract().constraint_residual)
            behind = self._limits.baumgarte_corrector_parameters.Kp
            drift[: len(distance)] += np.where(distance < 0, behind, 1.0) * distance / STEP
        upper = np.triu(pinocchio.computeMinverse(model, memory, q))
        inverse = upper + np.triu(upper, 1).T
        impulses = self._impulses(pinocchio.DelassusOperatorDense(jacobian @ inverse @ jacobian.T), drift)
        return np.array(pinocchio.aba(model, memory, q, v, tau + jacobian.T @ impulses / STEP))

    def _impulses(self, delassus: Any, drift: Array) -> Array:
        """(rows,); with settings, solved for again from where the solver has ended until that changes nothing."""
        guess: Array | None = None
        sweeps = 0
        while True:
            result = self._result()
            if guess is not None:
                result.setConstraintImpulseGuess(guess)
            self._make().solve(delassus, drift, self._models, self._data, self._settings, result)
            found, sweeps = np.array(result.retrieveConstraintImpulses()), sweeps + 1 + result.iterations
            # What goes on for so long moves to and fro by the last bit.
            if sweeps > self._most or (guess is not None and np.array_equal(found, guess)):
                return found
            guess = found
