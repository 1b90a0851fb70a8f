"""Accelerations over one step under dry friction and limits of joints, and contacts in points, by one of Pinocchio's constraint solvers.

The problem is put together as Pinocchio's own example does: G x + g of the Delassus operator and of g = J v_free, the velocity that rows
have after the step without impulses x, and besides the distance to a limit over the step; where a limit is passed, Kp of that, which is 0
by default. Bounds of friction are forces, which the constraint model makes impulses by its time step: it is 1 s unless it is set. Where
bodies touch, all rows have one compliance.

Source: Pinocchio 4.1, examples/g1-constraint-simulation.py; constraints/joint-friction-constraint.hxx, setTimeStep;
algorithm/delassus-operator-dense.hxx, updateCompliance.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio

from harness.arrays import Array
from harness.engines.adapters.pinocchio.robot import PinocchioFile, model_of
from harness.engines.adapters.pinocchio.step_law import AND, COMPLIANCE, EXACT_WITH_CONES, STEP
from harness.engines.adapters.pinocchio.touching import TouchingShapes
from harness.engines.adapters.pinocchio.versions import require
from harness.engines.coordinates import body_turn, of_linear
from harness.engines.reading import elements_of
from harness.engines.request import Refused, Request, SolverSettings
from harness.files.contacts import FoundContact
from harness.files.joint_kinds import JointKind

# Truth values.
Flags = np.ndarray[Any, np.dtype[np.bool_]]
_PARTS = ("ConstraintSolver", "SolverResult", "SolverSettings")
_TOLERANCES = tuple(f"{kind}_{what}_tol" for kind in ("absolute", "relative") for what in ("feasibility", "complementarity"))


def read(request: Request, solver: str, is_convex: bool) -> SteppedFile:
    """A file as its user loads it, whose bounded rows a solver holds: "ADMM" or "PGS"; see ``harness.engines.Engine``.

    ``is_convex`` as of ``StepProblem``.
    """
    require("dry friction and limits", "JointFrictionConstraintModel", f"{solver}ConstraintSolver")
    return SteppedFile(model_of(request), request, solver, StepProblem(STEP, COMPLIANCE, is_convex))


class SteppedFile(PinocchioFile):
    """A ``pinocchio.Model`` whose dry friction, limits and contacts act over one step; ``contacts`` are of the states asked last."""

    def __init__(self, model: Any, request: Request, solver: str, rule: StepProblem) -> None:
        super().__init__(model, request)
        held = request.held
        self._step: SolvedStep | None = None
        if held is not None and (held.rubbing or held.limited or held.touches):
            shapes = TouchingShapes(model, request.path, elements_of(request)) if held.touches else None
            joints = self._numbers(held.rubbing), self._numbers(held.limited)
            self._step = SolvedStep(model, joints, solver, held.solver, shapes, rule)

    def accelerating(self) -> Callable[..., Array]:
        return super().accelerating() if self._step is None else self._step.accelerations

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        """See ``LoadedFile``."""
        found = super().forward_dynamics(q, v, tau)
        if self._step is not None and self._step.shapes is not None:
            # Others than those of the last call are of nobody.
            self.contacts, self._step.found = self._step.found[-len(q) :], []
        return found

    def settled(self, v: Array, steps: Sequence[int]) -> tuple[Array, Array]:
        """See ``LoadedFile``."""
        if kinds := {str(joint.kind) for joint in self.found if not joint.kind.is_single and joint.kind != JointKind.FREE}:
            raise Refused(f"the harness lets it take no steps with a {min(kinds)} joint")
        assert self._step is not None
        start = np.zeros((1, sum(len(joint.positions) for joint in self.request.joints)))
        free = [joint for joint in self.found if joint.kind == JointKind.FREE]
        for joint in free:
            start[0, joint.positions[3]] = 1.0
        q, own_v = np.tile(start, (len(v), 1)), v.copy()
        configuration = self.placed.columns(start[:, self.q_columns], *np.zeros((2, 1, len(self.v_columns))))[0][:, 0]
        for state, count in enumerate(steps):
            rates = self.placed.columns(start[:, self.q_columns], *np.tile(v[state, self.v_columns], (2, 1, 1)))[1][:, 0]
            self._put(*self._step.taken(configuration, rates, count), q[state], own_v[state])
        self._step.found = []
        for joint in free:
            columns = list(joint.velocities)
            turn = body_turn(joint.kind, q[:, list(joint.positions)])
            own_v[:, columns] = of_linear(turn, own_v[:, columns])
        return q, own_v

    def _put(self, configuration: Array, rates: Array, q: Array, v: Array) -> None:
        """Set q and v over the joints of the request, the linear velocity of a free one in its body's frame, from the model's own."""
        places = self.placed.force_elements.places
        for joint in self.found:
            place = places[joint.name]
            own = configuration[list(place.positions)]
            if joint.kind == JointKind.FREE:
                own = own[[0, 1, 2, 6, 3, 4, 5]]
            elif place.nq > 1:
                own = np.arctan2(own[1:], own[:1])
            q[list(joint.positions)], v[list(joint.velocities)] = own, rates[list(place.velocities)]

    def _numbers(self, owners: Collection[str]) -> list[int]:
        """Numbers of the joints called "joint NAME" in the model, in its order."""
        return sorted(self.model.getJointId(owner.removeprefix("joint ")) for owner in owners)


@dataclass(frozen=True)
class StepProblem:
    """The problem of a step.

    Attributes:
        length: of the step [s]. compliance: of all rows where bodies touch [1/kg]. is_convex: ``solve_ncp`` of the settings, reversed.
    """

    length: float
    compliance: float
    is_convex: bool


class SolvedStep:
    """The constraint models of a model, and their solver.

    Attributes:
        shapes: that may touch; None where bodies do not act where they touch. found: the contacts of each state that was asked.
    """

    def __init__(
        self,
        model: Any,
        joints: tuple[Sequence[int], Sequence[int]],
        solver: str,
        set_by: SolverSettings | None,
        shapes: TouchingShapes | None,
        rule: StepProblem,
    ) -> None:
        """``joints`` are the numbers of those whose dry friction acts, and of those whose limits do."""
        rubbing, limited = joints
        self._model, self._limited, self._rule = model, list(limited), rule
        self._bounds = model.lowerPositionLimit, model.upperPositionLimit
        self._columns = tuple([getattr(model.joints[number], kind) for number in limited] for kind in ("idx_q", "idx_v"))
        self._rubbing = list[Any]()
        if rubbing:
            friction = pinocchio.JointFrictionConstraintModel(model, list(rubbing))
            friction.setTimeStep(rule.length)
            self._rubbing.append(pinocchio.ConstraintModel(friction))
        every = [pinocchio.ConstraintModel(pinocchio.JointLimitConstraintModel(model, self._limited, *self._bounds))] if limited else []
        self._of_joints = [*every, *self._rubbing]
        self._memory, self.shapes, self.found = model.createData(), shapes, list[tuple[FoundContact, ...]]()
        # The second, if there is one, is for all rows where bodies touch.
        methods = (solver if set_by is None else set_by.method).split(AND)
        self._solve, self._solve_cones = (_Solver(method, set_by, rule.is_convex) for method in (methods[0], methods[-1]))

    def taken(self, q: Array, v: Array, count: int) -> tuple[Array, Array]:
        """q and v after so many steps without applied forces."""
        nothing = np.zeros_like(v)
        for _ in range(count):
            v = v + self._rule.length * self.accelerations(q, v, nothing)
            q = np.array(pinocchio.integrate(self._model, q, self._rule.length * v))
        return q, v

    def accelerations(self, q: Array, v: Array, tau: Array) -> Array:
        """(nv,) of ``aba`` under the impulses that the solver finds, spread over the step."""
        touching = list(self.shapes.at(q)) if self.shapes is not None else []
        self.found.append(tuple(one for one, _ in touching))
        if not touching:
            return self._held(q, v, tau, self._of_joints, bool(self._limited)) if self._of_joints else self._free(q, v, tau)
        # Limits that are far away would cost ADMM the digits of all impulses: one is in the problem where the step passes it.
        contacts = [pinocchio.ConstraintModel(one) for _, one in touching]
        passed = self._passed(q, v + self._rule.length * self._free(q, v, tau))
        while True:
            limits = self._limits_of(*passed)
            found = self._held(q, v, tau, [*limits, *self._rubbing, *contacts], bool(limits), touches=True)
            beyond = passed | self._passed(q, v + self._rule.length * found)
            if np.array_equal(beyond, passed):
                return found
            passed = beyond

    def _free(self, q: Array, v: Array, tau: Array) -> Array:
        return np.array(pinocchio.aba(self._model, self._memory, q, v, tau))

    def _passed(self, q: Array, v: Array) -> Flags:
        """(2, limited joints) whether the lower and the upper limit are passed at the end of a step with these velocities."""
        after = q[self._columns[0]] + self._rule.length * v[self._columns[1]]
        low, high = (bound[self._columns[0]] for bound in self._bounds)
        return np.array([after < low, after > high])

    def _limits_of(self, low: Flags, high: Flags) -> list[Any]:
        """The constraint model of some of the limits, none of none."""
        chosen = [number for number, *sides in zip(self._limited, low, high, strict=True) if any(sides)]
        if not chosen:
            return []
        bounds = [np.full(self._model.nq, infinite) for infinite in (-np.inf, np.inf)]
        for own, bound, is_chosen in zip(bounds, self._bounds, (low, high), strict=True):
            columns = np.array(self._columns[0])[is_chosen]
            own[columns] = bound[columns]
        return [pinocchio.ConstraintModel(pinocchio.JointLimitConstraintModel(self._model, chosen, *bounds))]

    def _held(self, q: Array, v: Array, tau: Array, rows: Sequence[Any], has_limits: bool, touches: bool = False) -> Array:
        """(nv,) under the constraints of some models, of which the first may be that of limits."""
        model, memory = self._model, self._memory
        models, data = pinocchio.StdVec_ConstraintModel(), pinocchio.StdVec_ConstraintData()
        models.extend(rows)
        data.extend([one.createData() for one in rows])
        free = v + self._rule.length * self._free(q, v, tau)
        memory.q_in, memory.v_in, memory.tau_in = q, v, tau
        pinocchio.computeJointJacobians(model, memory, q)
        for one, own in zip(models, data, strict=True):
            one.calc(model, memory, own)
        jacobian = np.array(pinocchio.getConstraintsJacobian(model, memory, models, data)).reshape(-1, model.nv)
        drift = jacobian @ free
        if has_limits:
            distance = np.array(data[0].extract().constraint_residual)
            behind = models[0].extract().baumgarte_corrector_parameters.Kp
            drift[: len(distance)] += np.where(distance < 0, behind, 1.0) * distance / self._rule.length
        upper = np.triu(pinocchio.computeMinverse(model, memory, q))
        inverse = upper + np.triu(upper, 1).T
        delassus = pinocchio.DelassusOperatorDense(jacobian @ inverse @ jacobian.T)
        if touches:
            delassus.updateCompliance(np.full(len(drift), self._rule.compliance))
        impulses = (self._solve_cones if touches else self._solve)(delassus, drift, models, data)
        return self._free(q, v, tau + jacobian.T @ impulses / self._rule.length)


class _Solver:
    """One of Pinocchio's solvers by its name, as it is set by default, or to go on to the end."""

    def __init__(self, method: str, set_by: SolverSettings | None, is_convex: bool) -> None:
        self._make, self._result, settings = (getattr(pinocchio, f"{method}{what}") for what in _PARTS)
        self._settings, self._most = settings(), (set_by and set_by.iterations) or 0
        # By default they are to solve what has no optimum.
        self._settings.solve_ncp = not is_convex
        if set_by is None:
            return
        if method == EXACT_WITH_CONES:
            self._settings.admm_update_rule = pinocchio.ADMMUpdateRule.CONSTANT
        if set_by.iterations is not None:
            self._settings.max_iterations = set_by.iterations
        if set_by.tolerance is not None:
            for tolerance in _TOLERANCES:
                setattr(self._settings, tolerance, set_by.tolerance)

    def __call__(self, delassus: Any, drift: Array, models: Any, data: Any) -> Array:
        """Impulses of all rows; to the end, solved for again from where the solver has ended until that changes nothing."""
        guess: Array | None = None
        sweeps = 0
        while True:
            result = self._result()
            if guess is not None:
                result.setConstraintImpulseGuess(guess)
            self._make().solve(delassus, drift, models, data, self._settings, result)
            found, sweeps = np.array(result.retrieveConstraintImpulses()), sweeps + 1 + result.iterations
            # What goes on for so long moves to and fro by the last bit.
            if sweeps > self._most or (guess is not None and np.array_equal(found, guess)):
                return found
            guess = found
