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
from typing import Any

import numpy as np
import pinocchio

from harness.arrays import Array
from harness.engines import Unsupported
from harness.engines.adapters.pinocchio.solver import Solver
from harness.engines.adapters.pinocchio.versions import (
    Columns,
    carrier,
    has_body,
    mass_matrix,
    read_mimics,
    ready_for_constraints,
    reasons,
    require,
    states,
)
from harness.files.equalities import Equality, Meeting, Weld
from harness.files.facts import UNTURNED, point_of, turn_of
from harness.files.given import Pose
from harness.files.model_file import ModelFile

ACCURATE = Solver()


class LoopConstraints:
    """The constraints of one model as Pinocchio's solver takes them.

    No Baumgarte gains are set, so that J qdd = -J' v holds as it is; forces are in the frame of the first end.

    Raises:
        Unsupported: one that Pinocchio has no model of.
    """

    def __init__(self, model: Any, constraints: Sequence[Equality]) -> None:
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
        memory = self._model.createData()
        ready_for_constraints(self._model, memory, self.models, self.data)
        if self.solver.algorithm == "lcaba":
            pinocchio.computeJointMinimalOrdering(self._model, memory, self.models)
        return memory

    def accelerations(self, columns: Columns) -> Array:
        """(n, nv) accelerations at ``PinocchioModel.columns`` with all forces added; NaN where the solver fails."""
        found = np.empty((columns[0].shape[1], self._model.nv))
        settings = self.solver.settings()
        for state, inputs in enumerate(states(*columns)):
            found[state] = self._solve(inputs, settings)
        return found

    def residuals(self, columns: Columns) -> Array:
        """(n,) what ``ProximalSettings.absolute_residual`` reads after each solution; NaN of a call without settings."""
        found = np.full(columns[0].shape[1], np.nan)
        for state, inputs in enumerate(states(*columns)):
            settings = self.solver.settings()
            self._solve(inputs, settings)
            found[state] = settings[0].absolute_residual if settings else np.nan
        return found

    def _solve(self, inputs: tuple[Array, ...], settings: tuple[Any, ...]) -> Array:
        function = getattr(pinocchio, self.solver.algorithm)
        return np.asarray(function(self._model, self._memory, *inputs, self.models, self.data, *settings))

    def generalised_forces(self, columns: Columns) -> Array:
        """J' f of the constraint forces, (n, nv) [N or N m], at the same columns."""
        found = np.empty((columns[0].shape[1], self._model.nv))
        for state, inputs in enumerate(states(*columns)):
            pinocchio.constraintDynamics(self._model, self._memory, *inputs, self.models, self.data, *ACCURATE.settings())
            jacobian = pinocchio.getConstraintsJacobian(self._model, self._memory, self.models, self.data)
            found[state] = jacobian.T @ self._memory.lambda_c
        return found

    def with_forces_on_bodies(self, inputs: tuple[Array, ...]) -> tuple[Array, list[Any]]:
        """Accelerations, (nv,), at one q, v and tau, and what the constraints do to the body of each joint, in the frame of the joint.

        ``lambda_c`` has the force on the first end and then, of frames, the moment, in the frame of that end; the second end bears
        the opposite.
        """
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
        """The gaps that each constraint's rows leave, (n, 3) [m] of points and (n, 6) [m and rad] of frames, at q (nq, n)."""
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
        if not has_body(self._model, body):
            raise Unsupported(f"body {body!r}, which a constraint holds, is not in the model: the reader leaves it out")
        w, x, y, z = turn_of(pose) if turned else UNTURNED
        turn = pinocchio.Quaternion(w, x, y, z).normalized().toRotationMatrix() if any((x, y, z)) else np.eye(3)
        local = pinocchio.SE3(turn, np.array(point_of(pose)))
        joint, frame = carrier(self._model, body)
        return joint, frame * local


class MimicJoints:
    """The coupled model of a file beside ``tree``, the same with each follower as a joint of its own; ``root`` as the reader takes it.

    All forward dynamics refuse such a model. Its ``crba`` and ``rnea`` accept it, so that M and the bias are the engine's, of the joints
    that move by themselves; what is left is one solve. Forces on a follower reach its leader through the engine's own ratio.

    Source: Pinocchio 4.1, JointModelMimic; Featherstone, Rigid Body Dynamics Algorithms, section 3.2 (explicit constraints).

    Raises:
        Unsupported: the reader refuses it, as where a follower is in another branch, and before its leader by name.
    """

    def __init__(self, tree: Any, file: ModelFile, root: Sequence[Any]) -> None:
        self._tree, self._tree_data = tree, tree.createData()
        # It takes joints by name, children and all, and wants a leader to come first.
        with reasons(lambda words: Unsupported(f"Pinocchio's reader of joints that mimic: {' '.join(words.split())}")):
            self.model = model = read_mimics(file.text, *root)
        self._data = model.createData()
        model.gravity.linear = tree.gravity.linear
        # Velocities of the tree by those of the coupled model, and the tree's positions that the coupled model has.
        self.ratios = np.zeros((tree.nv, model.nv))
        self.positions, self.velocities = np.zeros(model.nq, dtype=int), np.zeros(model.nv, dtype=int)
        # Follower to its place in q, that of its leader, ratio and offset.
        self._followers: dict[str, tuple[int, int, float, float]] = {}
        for name in list(tree.names)[1:]:
            own, coupled = tree.joints[tree.getJointId(name)], model.joints[model.getJointId(name)]
            if coupled.shortname() == "JointModelMimic":
                mimic = coupled.extract()
                leader = tree.joints[tree.getJointId(model.names[self._leader(name)])]
                self.ratios[own.idx_v, coupled.idx_v] = mimic.scaling
                self._followers[name] = own.idx_q, leader.idx_q, float(mimic.scaling), float(mimic.offset)
                continue
            self.positions[coupled.idx_q : coupled.idx_q + own.nq] = range(own.idx_q, own.idx_q + own.nq)
            self.velocities[coupled.idx_v : coupled.idx_v + own.nv] = range(own.idx_v, own.idx_v + own.nv)
            self.ratios[own.idx_v : own.idx_v + own.nv, coupled.idx_v : coupled.idx_v + own.nv] = np.eye(own.nv)
        model.armature = tree.armature[self.velocities]

    def _leader(self, follower: str) -> int:
        place = list(self.model.mimicking_joints).index(self.model.getJointId(follower))
        return int(self.model.mimicked_joints[place])

    def accelerations(self, columns: Columns) -> Array:
        """(n, nv) accelerations of the tree at ``PinocchioModel.columns`` with all forces added."""
        found, still = np.empty((columns[0].shape[1], self._tree.nv)), np.zeros(self.model.nv)
        for state, (q, v, tau) in enumerate(states(*columns)):
            q, v = q[self.positions], v[self.velocities]
            mass = mass_matrix(self.model, self._data, q)
            found[state] = self.ratios @ np.linalg.solve(mass, self.ratios.T @ tau - pinocchio.rnea(self.model, self._data, q, v, still))
        return found

    def with_forces_on_bodies(self, inputs: tuple[Array, ...]) -> tuple[Array, list[Any]]:
        """Accelerations of the tree, (nv,), at one q, v and tau, and no forces: couplings act through the joints."""
        [accelerations] = self.accelerations((inputs[0][:, None], inputs[1][:, None], inputs[2][:, None]))
        return accelerations, [pinocchio.Force.Zero() for _ in range(self._tree.njoints)]

    def generalised_forces(self, columns: Columns) -> Array:
        """The forces of the couplings on the joints of the tree, (n, nv) [N or N m]: its inverse dynamics without the forces given."""
        moved = states(*columns, self.accelerations(columns).T)
        return np.array([pinocchio.rnea(self._tree, self._tree_data, q, v, a) - tau for q, v, tau, a in moved])

    def gaps(self, configuration: Array) -> dict[str, Array]:
        """Follower's position beyond what its leader says, (n, 1) [m or rad], by the follower's name."""
        return {
            name: (configuration[own] - ratio * configuration[leader] - offset)[:, None]
            for name, (own, leader, ratio, offset) in self._followers.items()
        }

    def reproducer(self, source: str) -> tuple[str, str]:
        """Python text that makes the coupled model of the tree ``m``, and that evaluates the tree's accelerations at q, v and tau."""
        made = (
            f"r = pin.buildModelFromXML({source}, mimic=True); r.gravity.linear = m.gravity.linear\n"
            f"r.armature = m.armature[{self.velocities.tolist()}]; G = np.array({self.ratios.tolist()})\n"
            f"a, b = q[{self.positions.tolist()}], v[{self.velocities.tolist()}]\n"
            "M = np.triu(pin.crba(r, r.createData(), a)); M = M + np.triu(M, 1).T\n"
        )
        return made, "(G @ np.linalg.solve(M, G.T @ tau - pin.rnea(r, r.createData(), a, b, 0 * b)))"
