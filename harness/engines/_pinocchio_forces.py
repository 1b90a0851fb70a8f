"""The springs and dampers a model file declares, as generalised forces from Pinocchio's frames and Jacobians.

Pinocchio's dynamics apply none of them. They are computed from the file and the engine's own
kinematics, never from the symbolic potential, so that the comparison stays independent.

Sources: SDFormat specification, joint ``dynamics``, for joint springs and dampers; Drake
documentation, ``LinearSpringDamper``, for springs between points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines._pinocchio_joints import JointPlace, joint_places
from harness.models.mjcf_forces import WORLD
from harness.models.model_file import ForceElement, JointDamper, JointSpring, PointSpring


class ForceElements:
    """Force elements of one ``pinocchio.Model``.

    Joint springs and dampers are applied to all states at once; springs between points run through
    Pinocchio's kinematics state by state.
    """

    def __init__(self, model: Any, elements: Sequence[ForceElement], places: Mapping[str, JointPlace] | None = None) -> None:
        self._model = model
        self._places = joint_places(model) if places is None else places
        self._data = model.createData()
        self.elements = tuple(elements)
        self._joint_springs = [element for element in elements if isinstance(element, JointSpring)]
        self._joint_dampers = [element for element in elements if isinstance(element, JointDamper)]
        self._point_springs = [element for element in elements if isinstance(element, PointSpring)]
        springs = [(self._joint(spring.joint), spring) for spring in self._joint_springs]
        dampers = [(self._joint(damper.joint), damper) for damper in self._joint_dampers]
        # Numbers of a step by step motion, where looking a joint up would cost more than the dynamics.
        self._springs_at = [(joint.idx_q, joint.idx_v, spring.stiffness, spring.reference) for joint, spring in springs]
        self._dampers_at = [(slice(joint.idx_v, joint.idx_v + joint.nv), damper.damping) for joint, damper in dampers]

    @property
    def empty(self) -> bool:
        """Whether there are none."""
        return not (self._joint_springs or self._joint_dampers or self._point_springs)

    def generalised_forces(self, configuration: Array, velocity: Array) -> Array:
        """(nv, n) forces [N or N m] at configurations (nq, n) and velocities (nv, n)."""
        forces = np.zeros_like(velocity)
        for spring in self._joint_springs:
            joint = self._joint(spring.joint)
            forces[joint.idx_v] -= spring.stiffness * (configuration[joint.idx_q] - spring.reference)
        for damper in self._joint_dampers:
            joint = self._joint(damper.joint)
            rows = slice(joint.idx_v, joint.idx_v + joint.nv)
            forces[rows] -= damper.damping * velocity[rows]
        if self._point_springs:
            for column in range(velocity.shape[1]):
                forces[:, column] += self._of_point_springs(configuration[:, column], velocity[:, column])
        return forces

    def at(self, configuration: Array, velocity: Array) -> Array:
        """(nv,) forces [N or N m] at one configuration (nq,) and velocity (nv,), without the overhead of a batch."""
        forces = self._of_point_springs(configuration, velocity) if self._point_springs else np.zeros(self._model.nv)
        for position, row, stiffness, reference in self._springs_at:
            forces[row] -= stiffness * (configuration[position] - reference)
        for rows, damping in self._dampers_at:
            forces[rows] -= damping * velocity[rows]
        return forces

    def ends_of_point_springs(self, configuration: Array) -> list[tuple[PointSpring, Array]]:
        """Each spring between points with its ends in the world at one configuration (nq,) [m], (2, 3)."""
        import pinocchio

        pinocchio.computeJointJacobians(self._model, self._data, configuration)
        return [
            (spring, np.array([self._point(body, np.array(point))[0] for body, point in spring.ends])) for spring in self._point_springs
        ]

    def _joint(self, name: str) -> JointPlace:
        return self._places[name]

    def _of_point_springs(self, configuration: Array, velocity: Array) -> Array:
        import pinocchio

        pinocchio.computeJointJacobians(self._model, self._data, configuration)
        total = np.zeros(self._model.nv)
        for spring in self._point_springs:
            point_a, jacobian_a = self._point(spring.body_a, np.array(spring.point_a))
            point_b, jacobian_b = self._point(spring.body_b, np.array(spring.point_b))
            span = point_b - point_a
            length = np.linalg.norm(span)
            # Rate of the length is (its gradient) . velocity; the tension does work along it.
            gradient = (span / length) @ (jacobian_b - jacobian_a)
            tension = spring.stiffness * (length - spring.free_length) + spring.damping * (gradient @ velocity)
            total -= tension * gradient
        return total

    def _point(self, body: str, local: Array) -> tuple[Array, Array]:
        """World position (3,) and translational Jacobian (3, nv) of a point fixed in ``body``."""
        import pinocchio

        if body == WORLD and not self._model.existFrame(body, pinocchio.FrameType.BODY):
            return local, np.zeros((3, self._model.nv))
        frame = self._model.frames[self._model.getFrameId(body, pinocchio.FrameType.BODY)]
        placement = self._data.oMi[frame.parentJoint] * frame.placement
        position = placement.act(local)
        if frame.parentJoint == 0:
            return position, np.zeros((3, self._model.nv))
        # A single column comes back with one axis.
        jacobian = pinocchio.getJointJacobian(self._model, self._data, frame.parentJoint, pinocchio.LOCAL_WORLD_ALIGNED).reshape(6, -1)
        arm = position - self._data.oMi[frame.parentJoint].translation
        return position, jacobian[:3] - pinocchio.skew(arm) @ jacobian[3:]
