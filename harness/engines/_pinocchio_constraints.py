"""Loops closed in Pinocchio: the constraints of a model file as its rigid constraint models, and its solver's settings.

Pinocchio solves M qdd - J' f = tau - c, J qdd = -J' v by proximal iterations, each of which solves with J M^-1 J' + mu 1. Their limit
does not depend on ``mu``, redundant rows included. What is measured on loops of three bodies, in data roundoffs:

- the default ``ProximalSettings`` have mu = 0 and one iteration, and answer NaN where a row is redundant, without an exception;
- one iteration at mu leaves an error in proportion to mu, 760 at 1e-12;
- mu from 1e-2 to 1e-14 with accuracy 0 ends below 2 in up to 10 iterations, or in all that are allowed where rows are redundant;
- 1e-6 rad from a state that loses rank, J M^-1 J' has an eigenvalue of 1e-12 of its others, where only a mu of that size converges;
- ``lcaba`` keeps unit roundoff over mu of an answer, however many iterations: 2e-9 at mu = 1e-6, and all digits lost at 1e-14;
- the residual that the settings report afterwards tells right from wrong by nothing.

Source: Carpentier, Budhiraja, Mansard, Proximal and sparse resolution of constrained dynamic equations, Robotics: Science and
Systems, 2021; Pinocchio 4.1, algorithm/constrained-dynamics.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines import Unsupported
from harness.models.constraints import End, FrameConstraint, ModelConstraint, PointConstraint
from harness.models.mjcf_forces import WORLD

PROXIMAL_MU = 1e-12
# Of an accuracy of 0, iterations end where the residual no longer changes.
PROXIMAL_ACCURACY = 0.0
PROXIMAL_ITERATIONS = 100
_UNIVERSE = 0

Columns = tuple[Array, Array, Array]


class LoopConstraints:
    """The constraints of one model as Pinocchio's solver takes them.

    No Baumgarte gains are set, so that J qdd = -J' v holds as it is; forces are in the frame of the first end.

    Raises:
        Unsupported: one that Pinocchio has no model of.
    """

    def __init__(self, model: Any, constraints: Sequence[ModelConstraint]) -> None:
        import pinocchio

        self._model, self._names = model, [constraint.name for constraint in constraints]
        self.models, self.data = pinocchio.StdVec_RigidConstraintModel(), pinocchio.StdVec_RigidConstraintData()
        kinds = {"point": pinocchio.ContactType.CONTACT_3D, "frame": pinocchio.ContactType.CONTACT_6D}
        for constraint in constraints:
            if constraint.kind not in kinds:
                why = f"couples {constraint.kind}s, of which Pinocchio's solver has no constraint model"
                raise Unsupported(f"line {constraint.line}: constraint {constraint.name!r} {why}")
            assert isinstance(constraint, PointConstraint | FrameConstraint)
            places = [part for end in constraint.ends for part in self._place(end)]
            self.models.append(pinocchio.RigidConstraintModel(kinds[constraint.kind], model, *places, pinocchio.ReferenceFrame.LOCAL))
        for one in self.models:
            self.data.append(one.createData())
        self._memory = model.createData()
        pinocchio.initConstraintDynamics(model, self._memory, self.models, self.data)

    def accelerations(
        self,
        columns: Columns,
        mu: float = PROXIMAL_MU,
        iterations: int = PROXIMAL_ITERATIONS,
        accuracy: float = PROXIMAL_ACCURACY,
    ) -> Array:
        """(n, nv) accelerations at ``PinocchioModel.columns`` with all forces added; NaN where the solver fails."""
        import pinocchio

        found = np.empty((columns[0].shape[1], self._model.nv))
        # The solver writes its counts and residuals into the settings.
        settings = pinocchio.ProximalSettings(accuracy, mu, iterations)
        for state, inputs in enumerate(zip(*(each.T for each in columns), strict=True)):
            found[state] = self._solve(inputs, settings)
        return found

    def by_lcaba(self, columns: Columns, mu: float, iterations: int = PROXIMAL_ITERATIONS) -> Array:
        """``accelerations`` by the articulated bodies of loops, which eliminates joints in an order of its own; mu must be above 0."""
        import pinocchio

        memory = self._model.createData()
        pinocchio.computeJointMinimalOrdering(self._model, memory, self.models)
        settings = pinocchio.ProximalSettings(PROXIMAL_ACCURACY, mu, iterations)
        inputs = zip(*(each.T for each in columns), strict=True)
        return np.array([pinocchio.lcaba(self._model, memory, *one, self.models, self.data, settings) for one in inputs])

    def _solve(self, inputs: tuple[Array, ...], settings: Any) -> Array:
        import pinocchio

        return np.asarray(pinocchio.constraintDynamics(self._model, self._memory, *inputs, self.models, self.data, settings))

    def generalised_forces(self, columns: Columns) -> Array:
        """J' f of the constraint forces, (n, nv) [N or N m], at the same columns."""
        import pinocchio

        found = np.empty((columns[0].shape[1], self._model.nv))
        for state, inputs in enumerate(zip(*(each.T for each in columns), strict=True)):
            self._solve(inputs, pinocchio.ProximalSettings(PROXIMAL_ACCURACY, PROXIMAL_MU, PROXIMAL_ITERATIONS))
            jacobian = pinocchio.getConstraintsJacobian(self._model, self._memory, self.models, self.data)
            found[state] = jacobian.T @ self._memory.lambda_c
        return found

    def with_forces_on_bodies(self, inputs: tuple[Array, ...]) -> tuple[Array, list[Any]]:
        """Accelerations, (nv,), at one q, v and tau, and what the constraints do to the body of each joint, in the frame of the joint.

        ``lambda_c`` has the force on the first end and then, of frames, the moment, in the frame of that end; the second end bears
        the opposite.
        """
        import pinocchio

        accelerations = self._solve(inputs, pinocchio.ProximalSettings(PROXIMAL_ACCURACY, PROXIMAL_MU, PROXIMAL_ITERATIONS)).copy()
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
        settings = f"pin.ProximalSettings({PROXIMAL_ACCURACY}, {PROXIMAL_MU}, {PROXIMAL_ITERATIONS})"
        return (
            f"cs, cd, d = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData(), m.createData(); cs.extend([{made}]); "
            "cd.extend([c.createData() for c in cs]); pin.initConstraintDynamics(m, d, cs, cd)\n",
            f"pin.constraintDynamics(m, d, q, v, tau, cs, cd, {settings})",
        )

    def _written_end(self, joint: int, placement: Any) -> str:
        return f"{joint}, pin.SE3(np.array({placement.rotation.tolist()}), np.array({placement.translation.tolist()}))"

    def _place(self, end: End) -> tuple[int, Any]:
        """The joint that carries an end, and the end's frame in that of the joint."""
        import pinocchio

        w, x, y, z = end.turn
        turn = pinocchio.Quaternion(w, x, y, z).normalized().toRotationMatrix() if any((x, y, z)) else np.eye(3)
        local = pinocchio.SE3(turn, np.array(end.point))
        if end.body == WORLD and not self._model.existFrame(WORLD, pinocchio.FrameType.BODY):
            return _UNIVERSE, local
        frame = self._model.frames[self._model.getFrameId(end.body, pinocchio.FrameType.BODY)]
        return int(frame.parentJoint), frame.placement * local
