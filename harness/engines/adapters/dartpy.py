"""DART's ``Skeleton.computeForwardDynamics`` on a URDF: its articulated-body algorithm.

DART treats joint dampers implicitly, as its time step needs: with the default step of 1 ms an acceleration is that of the end of the
step. The step is set to zero here, which leaves the acceleration of the state. A free joint's position is a rotation vector, then a
place; its velocity is the angular, then the linear one, both along the axes of its parent. Springs, which DART's loader does not
read, are supplied by the harness.

Source: DART documentation, dart::dynamics::Skeleton and FreeJoint; https://github.com/dartsim/dart/issues/1450.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.arrays import Array
from harness.engines import LoadedModel, Terms, Unsupported, require_model
from harness.engines.output import captured_standard_error
from harness.engines.rotations import FREE, Columns, rotation
from harness.engines.supplied_forces import SuppliedForces
from harness.files.tree import WORLD
from harness.models.model_file import JointDamper, ModelFile

if TYPE_CHECKING:
    from harness.equations.mechanism import Mechanism


class DartModel:
    """A ``Skeleton`` and what the harness supplies to it."""

    def __init__(self, skeleton: Any, file: ModelFile, joints: Sequence[str]) -> None:
        self.skeleton = skeleton
        self._moving = {joint.getName(): joint for joint in skeleton.getJoints() if joint.getNumDofs()}
        self._sizes = {name: (1, 1) if joint.getNumDofs() == 1 else FREE for name, joint in self._moving.items()}
        self.columns = Columns(joints, {name: self._sizes.get(name, (1, 1)) for name in joints})
        self._turn = np.eye(self.columns.nv)
        self._supplied = SuppliedForces(file, self.columns, by_engine=JointDamper)
        self._places = {name: joint.getIndexInSkeleton(0) for name, joint in self._moving.items()}

    def _own_columns(self, name: str) -> Any:
        return self._places[name] + np.arange(self._sizes[name][1])

    def loaded(self) -> LoadedModel:
        x, y, z = self.skeleton.getGravity()
        fixed = {body.getName() for body in self.skeleton.getBodyNodes() if body.getNumDependentGenCoords() == 0}
        mass = sum(body.getMass() for body in self.skeleton.getBodyNodes() if body.getName() not in fixed)
        return LoadedModel(dict(self._sizes), (float(x), float(y), float(z)), float(mass))

    def _states(self, q: Array, v: Array, tau: Array) -> Iterator[tuple[int, Array]]:
        """The number of each state, to which the skeleton is taken, and the forces that are supplied there."""
        import dartpy

        for state in range(len(q)):
            positions = np.empty(self.columns.nv)
            for name, size in self.columns.sizes.items():
                given = q[state, self.columns.spans(name)[0]]
                if size == FREE:
                    pose = dartpy.math.Isometry3()
                    pose.set_rotation(rotation(given[3:]))
                    pose.set_translation(given[:3])
                    given = dartpy.dynamics.FreeJoint.convertToPositions(pose)
                positions[self._own_columns(name)] = given
            self.skeleton.setPositions(positions)
            self._turn = self.columns.turn(q[state], self._places, self.columns.nv, rotation_first=True)
            self.skeleton.setVelocities(v[state] @ self._turn)
            passive = self._supplied.at(q[state], v[state], self._point)
            self.skeleton.setForces((tau[state] + passive) @ self._turn)
            yield state, passive

    def _point(self, body: str, local: Array) -> tuple[Array, Array]:
        if body == WORLD:
            return local, np.zeros((3, self.columns.nv))
        node = self.skeleton.getBodyNode(body)
        pose = node.getWorldTransform()
        jacobian = self.skeleton.getLinearJacobian(node, local)
        return pose.translation() + pose.rotation() @ local, jacobian @ self._turn.T

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        answer = np.empty(v.shape)
        for state, _ in self._states(q, v, tau):
            self.skeleton.computeForwardDynamics()
            answer[state] = self._turn @ self.skeleton.getAccelerations()
        return answer

    def terms(self, q: Array, v: Array, tau: Array) -> Terms:
        """Terms as DART computes them; passive are its dampers and what the harness supplies.

        Source: DART documentation, ``getMassMatrix``, ``getCoriolisForces``, ``getGravityForces``.
        """
        count = self.columns.nv
        mass, (velocity, gravity, passive) = np.empty((len(q), count, count)), np.empty((3, len(q), count))
        damping = np.zeros(count)
        for name, joint in self._moving.items():
            damping[self._own_columns(name)] = [joint.getDampingCoefficient(index) for index in range(joint.getNumDofs())]
        for state, supplied in self._states(q, v, tau):
            mass[state] = self._turn @ self.skeleton.getMassMatrix() @ self._turn.T
            velocity[state] = self._turn @ self.skeleton.getCoriolisForces()
            gravity[state] = self._turn @ self.skeleton.getGravityForces()
            passive[state] = supplied - (self._turn @ damping) * v[state]
        return Terms(mass, velocity, gravity, passive, tau.copy())


class DartEngine:
    requires = ("dartpy", "dartpy")
    formats = ("urdf",)
    optional = True

    def load(self, source: ModelFile | Mechanism, joints: Sequence[str], gravity: float) -> DartModel:
        import dartpy

        file = require_model(source, "dartpy")
        refused = [(one.line, f"{one.kind} constraint {one.name!r} is none of what its loader reads") for one in file.constraints]
        refused += [(one.line, f"reflected inertia of joint {one.joint!r}, which its algorithm does not know") for one in file.armatures]
        if file.ball_joint is not None:
            line = file.joint_lines[file.ball_joint]
            refused.append((line, f"ball joint {file.ball_joint!r}, while its loader hangs a root link by a free or a fixed joint alone"))
        if refused:
            raise Unsupported("DART: " + "; ".join(f"line {line}: {what}" for line, what in sorted(refused)))
        # The reasons go to standard error alone.
        with captured_standard_error() as captured:
            skeleton = dartpy.utils.DartLoader().parseSkeletonString(file.text, dartpy.common.Uri(""))
        if skeleton is None:
            raise ValueError(captured() or "its loader refuses the model without a reason")
        skeleton.setGravity([0.0, 0.0, -gravity])
        skeleton.setTimeStep(0.0)
        if unknown := {joint.getType() for joint in skeleton.getJoints() if joint.getNumDofs() not in (0, 1, 6)}:
            raise Unsupported(f"joints of the kinds {', '.join(sorted(unknown))} are not known to the harness's adapter of DART")
        return DartModel(skeleton, file, joints)


ENGINE = DartEngine()
