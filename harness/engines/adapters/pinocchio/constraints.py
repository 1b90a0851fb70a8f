"""Loops closed in Pinocchio: the constraints of a model file as its rigid constraint models, and its solver's settings.

Pinocchio solves M qdd - J' f = tau - c, J qdd = -J' v by proximal iterations, each of which solves with J M^-1 J' + mu 1. Their limit
does not depend on ``mu``, redundant rows included. What is measured on loops of three bodies, in data roundoffs:

- the default ``ProximalSettings`` have mu = 0 and one iteration, and answer NaN where a row is redundant, without an exception;
- one iteration at mu leaves an error in proportion to mu, 910 to 14,000 at 1e-12;
- mu from 1e-2 to 1e-14 with accuracy 0 ends below 2 in up to 10 iterations, or in all that are allowed where rows are redundant;
- 1e-6 rad from a state that loses rank, J M^-1 J' has an eigenvalue of 1e-12 of its others, where only a mu of that size converges;
- ``lcaba`` keeps unit roundoff over mu of an answer, however many iterations: 2e-9 at mu = 1e-6, and all digits lost at 1e-14,
  while its ``absolute_residual`` reads 1e-13 at most;
- ``absolute_residual`` of the settings reads the same afterwards, 9 to 550, for answers that are right and that are wrong.

Source: Carpentier, Budhiraja, Mansard, Proximal and sparse resolution of constrained dynamic equations, Robotics: Science and
Systems, 2021; Sathya, Carpentier, Constrained articulated body dynamics algorithms, IEEE Transactions on Robotics, 2024, for lcaba;
Pinocchio 4.1, algorithm/constrained-dynamics and algorithm/loop-constrained-aba.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from harness.arrays import Array
from harness.engines import Unsupported
from harness.engines.adapters.pinocchio.versions import parent_joint, ready_for_constraints, require
from harness.files.equalities import Equality, Meeting, Weld
from harness.files.facts import UNTURNED, point_of, turn_of
from harness.files.tree import WORLD, Pose

_UNIVERSE = 0

Columns = tuple[Array, Array, Array]


@dataclass(frozen=True)
class Solver:
    """One of Pinocchio's algorithms for constraints, and what it is told.

    Attributes:
        algorithm: the function of ``pinocchio``. ``lcaba`` wants a mu above 0.
        mu: proximal parameter; None for a call without settings, which ``lcaba`` does not take.
        iterations: at most so many. accuracy: residual at which they end; with 0, where it no longer changes.
    """

    algorithm: Literal["constraintDynamics", "lcaba"] = "constraintDynamics"
    mu: float | None = 1e-12
    iterations: int = 100
    accuracy: float = 0.0

    def settings(self) -> tuple[Any, ...]:
        """The last arguments of the call, into which the algorithm writes its counts and residuals."""
        import pinocchio

        return () if self.mu is None else (pinocchio.ProximalSettings(self.accuracy, self.mu, self.iterations),)

    def written(self) -> tuple[str, str]:
        """Python text: a statement that readies the data ``d``, and the call."""
        last = "" if self.mu is None else f", pin.ProximalSettings({self.accuracy}, {self.mu}, {self.iterations})"
        ready = "computeJointMinimalOrdering(m, d, cs)" if self.algorithm == "lcaba" else "initConstraintDynamics(m, d, cs, cd)"
        return f"pin.{ready}", f"pin.{self.algorithm}(m, d, q, v, tau, cs, cd{last})"


ACCURATE = Solver()


class LoopConstraints:
    """The constraints of one model as Pinocchio's solver takes them.

    No Baumgarte gains are set, so that J qdd = -J' v holds as it is; forces are in the frame of the first end.

    Raises:
        Unsupported: one that Pinocchio has no model of.
    """

    def __init__(self, model: Any, constraints: Sequence[Equality]) -> None:
        import pinocchio

        require("constraints", "StdVec_RigidConstraintModel")
        self._model, self._names = model, [constraint.name for constraint in constraints]
        self.models, self.data = pinocchio.StdVec_RigidConstraintModel(), pinocchio.StdVec_RigidConstraintData()
        for constraint in constraints:
            says = constraint.says
            if not isinstance(says, Meeting):
                why = f"couples {constraint.couples}s, of which Pinocchio's solver has no constraint model"
                raise Unsupported(f"line {constraint.line}: constraint {constraint.name!r} {why}")
            turned = isinstance(says, Weld)
            places = [part for body, pose in says.ends for part in self._place(body, pose, turned)]
            kind = pinocchio.ContactType.CONTACT_6D if turned else pinocchio.ContactType.CONTACT_3D
            self.models.append(pinocchio.RigidConstraintModel(kind, model, *places, pinocchio.ReferenceFrame.LOCAL))
        for one in self.models:
            self.data.append(one.createData())
        self.solver = ACCURATE
        self._memory = self._ready()

    def solved_by(self, solver: Solver) -> LoopConstraints:
        """The same constraints with another solver, and a memory of its own."""
        other = copy.copy(self)
        other.solver = solver
        other._memory = other._ready()
        return other

    def _ready(self) -> Any:
        import pinocchio

        memory = self._model.createData()
        ready_for_constraints(self._model, memory, self.models, self.data)
        if self.solver.algorithm == "lcaba":
            pinocchio.computeJointMinimalOrdering(self._model, memory, self.models)
        return memory

    def accelerations(self, columns: Columns) -> Array:
        """(n, nv) accelerations at ``PinocchioModel.columns`` with all forces added; NaN where the solver fails."""
        found = np.empty((columns[0].shape[1], self._model.nv))
        settings = self.solver.settings()
        for state, inputs in enumerate(zip(*(each.T for each in columns), strict=True)):
            found[state] = self._solve(inputs, settings)
        return found

    def residuals(self, columns: Columns) -> Array:
        """(n,) what ``ProximalSettings.absolute_residual`` reads after each solution; NaN of a call without settings."""
        found = np.full(columns[0].shape[1], np.nan)
        for state, inputs in enumerate(zip(*(each.T for each in columns), strict=True)):
            settings = self.solver.settings()
            self._solve(inputs, settings)
            found[state] = settings[0].absolute_residual if settings else np.nan
        return found

    def _solve(self, inputs: tuple[Array, ...], settings: tuple[Any, ...]) -> Array:
        import pinocchio

        function = getattr(pinocchio, self.solver.algorithm)
        return np.asarray(function(self._model, self._memory, *inputs, self.models, self.data, *settings))

    def generalised_forces(self, columns: Columns) -> Array:
        """J' f of the constraint forces, (n, nv) [N or N m], at the same columns."""
        import pinocchio

        found = np.empty((columns[0].shape[1], self._model.nv))
        for state, inputs in enumerate(zip(*(each.T for each in columns), strict=True)):
            pinocchio.constraintDynamics(self._model, self._memory, *inputs, self.models, self.data, *ACCURATE.settings())
            jacobian = pinocchio.getConstraintsJacobian(self._model, self._memory, self.models, self.data)
            found[state] = jacobian.T @ self._memory.lambda_c
        return found

    def with_forces_on_bodies(self, inputs: tuple[Array, ...]) -> tuple[Array, list[Any]]:
        """Accelerations, (nv,), at one q, v and tau, and what the constraints do to the body of each joint, in the frame of the joint.

        ``lambda_c`` has the force on the first end and then, of frames, the moment, in the frame of that end; the second end bears
        the opposite.
        """
        import pinocchio

        answer = pinocchio.constraintDynamics(self._model, self._memory, *inputs, self.models, self.data, *ACCURATE.settings())
        accelerations = np.array(answer)
        found, multipliers, first = [pinocchio.Force.Zero() for _ in range(self._model.njoints)], self._memory.lambda_c, 0
        for one in self.models:
            size = 6 if one.type == pinocchio.ContactType.CONTACT_6D else 3
            own = np.concatenate([multipliers[first : first + size], np.zeros(6 - size)])
            first += size
            force = pinocchio.Force(own[:3], own[3:])
            places = [
                (joint, self._memory.oMi[joint] * placement, placement)
                for joint, placement in ((one.joint1_id, one.joint1_placement), (one.joint2_id, one.joint2_placement))
            ]
            (_, frame, _), (_, other, _) = places
            # Turned into the second end's frame, at its own origin.
            turn = other.rotation.T @ frame.rotation
            opposite = pinocchio.Force(-(turn @ force.linear), -(turn @ force.angular))
            for (joint, _, placement), acting in zip(places, (force, opposite), strict=True):
                found[joint] += placement.act(acting)
        return accelerations, found

    def gaps(self, configuration: Array) -> dict[str, Array]:
        """What each constraint's rows leave, (n, 3) [m] of points and (n, 6) [m and rad] of frames, at q (nq, n)."""
        import pinocchio

        found: dict[str, list[Array]] = {name: [] for name in self._names}
        for position in configuration.T:
            pinocchio.forwardKinematics(self._model, self._memory, position)
            for name, one in zip(self._names, self.models, strict=True):
                first, second = (
                    self._memory.oMi[joint] * placement
                    for joint, placement in ((one.joint1_id, one.joint1_placement), (one.joint2_id, one.joint2_placement))
                )
                turned = pinocchio.log3(second.rotation.T @ first.rotation) if one.type == pinocchio.ContactType.CONTACT_6D else ()
                found[name].append(np.array([*(first.translation - second.translation), *turned]))
        return {name: np.array(rows) for name, rows in found.items()}

    def reproducer(self, _source: str) -> tuple[str, str]:
        """Python text that makes the constraints of the model ``m``, and that evaluates its accelerations at q, v and tau."""
        made = ", ".join(
            f"pin.RigidConstraintModel(pin.ContactType.{one.type.name}, m, {self._written_end(one.joint1_id, one.joint1_placement)}, "
            f"{self._written_end(one.joint2_id, one.joint2_placement)}, pin.LOCAL)"
            for one in self.models
        )
        ready, call = self.solver.written()
        return (
            f"cs, cd, d = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData(), m.createData(); cs.extend([{made}]); "
            f"cd.extend([c.createData() for c in cs]); {ready}; ",
            call,
        )

    def _written_end(self, joint: int, placement: Any) -> str:
        return f"{joint}, pin.SE3(np.array({placement.rotation.tolist()}), np.array({placement.translation.tolist()}))"

    def _place(self, body: str, pose: Pose, turned: bool) -> tuple[int, Any]:
        """The joint that carries a body, and a frame of the body in that of the joint."""
        import pinocchio

        w, x, y, z = turn_of(pose) if turned else UNTURNED
        turn = pinocchio.Quaternion(w, x, y, z).normalized().toRotationMatrix() if any((x, y, z)) else np.eye(3)
        local = pinocchio.SE3(turn, np.array(point_of(pose)))
        if body == WORLD and not self._model.existFrame(WORLD, pinocchio.FrameType.BODY):
            return _UNIVERSE, local
        frame = self._model.frames[self._model.getFrameId(body, pinocchio.FrameType.BODY)]
        return parent_joint(frame), frame.placement * local
