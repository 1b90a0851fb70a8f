"""Places of joints in Pinocchio's vectors, and a file's springs and dampers as forces from its frames and Jacobians.

Pinocchio's dynamics apply none of them. They are computed from the file and the engine's own
kinematics, never from the symbolic potential, so that the comparison stays independent.

Sources: SDFormat specification, joint ``dynamics``, for joint springs and dampers; Drake
documentation, ``LinearSpringDamper``, for springs between points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from harness.arrays import Array
from harness.engines.adapters.pinocchio.versions import parent_joint
from harness.files.model_file import ForceElement, JointDamper, JointSpring, PointSpring
from harness.files.tree import WORLD


class JointPlace(NamedTuple):
    """First index and number of a joint's positions and velocities, and the number of the joint of the model that it is, or a part of."""

    idx_q: int
    nq: int
    idx_v: int
    nv: int
    joint: int

    @property
    def positions(self) -> range:
        return range(self.idx_q, self.idx_q + self.nq)

    @property
    def velocities(self) -> range:
        return range(self.idx_v, self.idx_v + self.nv)


class Pull(NamedTuple):
    """A stretched spring at one state.

    Attributes:
        spring: as the file has it. points: its ends in the world, (2, 3) [m]. jacobians: of their velocities and of the angular
            velocities of their bodies, (2, 6, nv). length: between the ends [m]; along: the direction from the first to the second.
        gradient: of the length, (nv,). tension: (spring and damper) [N].
    """

    spring: PointSpring
    points: Array
    jacobians: Array
    length: float
    along: Array
    gradient: Array
    tension: float


def joint_places(model: Any, composites: Mapping[str, Sequence[str]]) -> dict[str, JointPlace]:
    """The joints of a file by name, in Pinocchio's order: several joints of one body are one composite joint of another name."""
    places: dict[str, JointPlace] = {}
    for number, (name, joint) in enumerate(zip(list(model.names)[1:], list(model.joints)[1:], strict=True), start=1):
        parts = [(name, joint)] if name not in composites else zip(composites[name], joint.extract().joints, strict=True)
        places |= {part: JointPlace(one.idx_q, one.nq, one.idx_v, one.nv, number) for part, one in parts}
    return places


def has_body(model: Any, body: str) -> bool:
    """True for a body of the model, and for the world."""
    import pinocchio

    return body == WORLD or bool(model.existFrame(body, pinocchio.FrameType.BODY))


class ForceElements:
    """Force elements of one ``pinocchio.Model``, whose joints have these places.

    Joint springs and dampers are applied to all states at once; springs between points run through
    Pinocchio's kinematics state by state.
    """

    def __init__(self, model: Any, elements: Sequence[ForceElement], places: Mapping[str, JointPlace]) -> None:
        self._model = model
        self._data = model.createData()
        self.elements = tuple(elements)
        self.places = places
        springs = [(self.places[element.joint], element) for element in elements if isinstance(element, JointSpring)]
        dampers = [(self.places[element.joint], element) for element in elements if isinstance(element, JointDamper)]
        # Numbers of a step by step motion, where looking a joint up would cost more than the dynamics.
        self._joint_springs = [(joint.idx_q, joint.idx_v, spring.stiffness, spring.reference) for joint, spring in springs]
        self._joint_dampers = [(slice(joint.idx_v, joint.idx_v + joint.nv), damper.damping) for joint, damper in dampers]
        self._point_springs = [element for element in elements if isinstance(element, PointSpring)]

    @property
    def empty(self) -> bool:
        """True where there are none."""
        return not self.elements

    def generalised_forces(self, configuration: Array, velocity: Array) -> Array:
        """(nv, n) forces [N or N m] at configurations (nq, n) and velocities (nv, n)."""
        forces = np.zeros_like(velocity)
        self._add_of_joints(forces, configuration, velocity)
        if self._point_springs:
            for column in range(velocity.shape[1]):
                forces[:, column] += self._of_point_springs(configuration[:, column], velocity[:, column])
        return forces

    def at(self, configuration: Array, velocity: Array) -> Array:
        """(nv,) forces [N or N m] at one configuration (nq,) and velocity (nv,), without the overhead of a batch."""
        forces = self._of_point_springs(configuration, velocity) if self._point_springs else np.zeros(self._model.nv)
        self._add_of_joints(forces, configuration, velocity)
        return forces

    def _add_of_joints(self, forces: Array, configuration: Array, velocity: Array) -> None:
        for position, row, stiffness, reference in self._joint_springs:
            forces[row] -= stiffness * (configuration[position] - reference)
        for rows, damping in self._joint_dampers:
            forces[rows] -= damping * velocity[rows]

    def potential_energy(self, configuration: Array) -> float:
        """Of the springs [J], at one configuration (nq,)."""
        found = sum(stiffness * (configuration[at] - reference) ** 2 / 2 for at, _, stiffness, reference in self._joint_springs)
        for spring, (first, second) in self.ends_of_point_springs(configuration) if self._point_springs else ():
            found += spring.stiffness * (float(np.linalg.norm(second - first)) - spring.free_length) ** 2 / 2
        return float(found)

    def ends_of_point_springs(self, configuration: Array) -> list[tuple[PointSpring, Array]]:
        """Each spring between points with its ends in the world at one configuration (nq,) [m], (2, 3)."""
        import pinocchio

        pinocchio.computeJointJacobians(self._model, self._data, configuration)
        return [
            (spring, np.array([self._point(body, np.array(point))[0] for body, point in spring.ends])) for spring in self._point_springs
        ]

    def _of_point_springs(self, configuration: Array, velocity: Array) -> Array:
        total = np.zeros(self._model.nv)
        for pull in self.pulls(configuration, velocity):
            total -= pull.tension * pull.gradient
        return total

    def pulls(self, configuration: Array, velocity: Array) -> list[Pull]:
        """The springs between points at one configuration (nq,) and velocity (nv,)."""
        import pinocchio

        if self._point_springs:
            pinocchio.computeJointJacobians(self._model, self._data, configuration)
        return [self._pull(spring, velocity) for spring in self._point_springs]

    def stiffness_and_damping(self) -> tuple[Array, Array]:
        """By how much the forces of springs and dampers in joints fall with positions and with velocities, (nv, nv) each."""
        stiffness, damping = np.zeros((self._model.nv, self._model.nv)), np.zeros((self._model.nv, self._model.nv))
        for _, row, of_spring, _ in self._joint_springs:
            stiffness[row, row] += of_spring
        for rows, of_damper in self._joint_dampers:
            damping[rows, rows] += of_damper * np.eye(rows.stop - rows.start)
        return stiffness, damping

    def on_bodies(self, configuration: Array, velocity: Array) -> list[Any]:
        """What springs between points do to the body of each joint, as a ``pinocchio.Force`` in the frame of the joint, at one state."""
        import pinocchio

        found = [pinocchio.Force.Zero() for _ in range(self._model.njoints)]
        for pull in self.pulls(configuration, velocity):
            for (body, _), point, sign in zip(pull.spring.ends, pull.points, (1.0, -1.0), strict=True):
                if joint := self._joint_of(body):
                    place = self._data.oMi[joint]
                    force = sign * pull.tension * pull.along
                    turn = place.rotation.T
                    found[joint] += pinocchio.Force(turn @ force, turn @ np.cross(point - place.translation, force))
        return found

    def _pull(self, spring: PointSpring, velocity: Array) -> Pull:
        """A spring at the configuration of the Jacobians in ``_data``."""
        ends = [self._point(body, np.array(point)) for body, point in spring.ends]
        points, jacobians = np.array([point for point, _ in ends]), np.array([jacobian for _, jacobian in ends])
        span = points[1] - points[0]
        length = float(np.linalg.norm(span))
        along = span / length
        # Rate of the length is (its gradient) . velocity; the tension does work along it.
        gradient = along @ (jacobians[1] - jacobians[0])[:3]
        tension = spring.stiffness * (length - spring.free_length) + spring.damping * (gradient @ velocity)
        return Pull(spring, points, jacobians, length, along, gradient, float(tension))

    def _joint_of(self, body: str) -> int:
        """The joint of the model that carries a body; 0 for the world."""
        import pinocchio

        if body == WORLD and not self._model.existFrame(body, pinocchio.FrameType.BODY):
            return 0
        return parent_joint(self._model.frames[self._model.getFrameId(body, pinocchio.FrameType.BODY)])

    def _point(self, body: str, local: Array) -> tuple[Array, Array]:
        """World position (3,) of a point fixed in ``body``; Jacobian (6, nv) of its velocity and of the body's angular velocity."""
        import pinocchio

        if body == WORLD and not self._model.existFrame(body, pinocchio.FrameType.BODY):
            return local, np.zeros((6, self._model.nv))
        frame = self._model.frames[self._model.getFrameId(body, pinocchio.FrameType.BODY)]
        joint = parent_joint(frame)
        placement = self._data.oMi[joint] * frame.placement
        position = placement.act(local)
        if joint == 0:
            return position, np.zeros((6, self._model.nv))
        # A single column comes back with one axis.
        jacobian = pinocchio.getJointJacobian(self._model, self._data, joint, pinocchio.LOCAL_WORLD_ALIGNED).reshape(6, -1)
        arm = position - self._data.oMi[joint].translation
        return position, np.concatenate([jacobian[:3] - pinocchio.skew(arm) @ jacobian[3:], jacobian[3:]])
