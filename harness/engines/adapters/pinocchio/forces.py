"""Places of joints in Pinocchio's vectors, and a file's springs and dampers as forces from its frames and Jacobians.

Pinocchio's dynamics apply none of them. They are computed from the file and the engine's own
kinematics, never from the symbolic potential, so that the comparison stays independent.

Forces of springs between points are differentiated by hand, in Pinocchio's own frames and Jacobians: column i of the Jacobian of a point
is turned by a joint before it, and moved by a joint behind it,

    dJ_i/dq_j = w_j x J_i for j before i or of the same joint, else w_i x J_j,

where w are the angular velocities of the columns.

Sources: SDFormat specification, joint ``dynamics``, for joint springs and dampers; Drake
documentation, ``LinearSpringDamper``, for springs between points; Bruyninckx, De Schutter, Symbolic differentiation of the velocity
mapping for a serial kinematic chain, Mechanism and Machine Theory 31 (1996), for derivatives of Jacobians.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio

from harness.arrays import Array
from harness.engines.adapters.pinocchio.versions import carrier, has_body
from harness.engines.request import AskedJoint
from harness.engines.state_by_state import Pull, pull_of
from harness.files.joint_kinds import JointKind
from harness.files.model_file import ForceElement, JointDamper, JointSpring, PointSpring

# Several joints of one body; its first gives the name. A joint without name, as the tree names it.
_COMPOSITE, _UNNAMED = "Composite_", re.compile(r"\(joint (\d+) of (.+)\)")


class JointPlace(NamedTuple):
    """First index and number of a joint's positions and velocities, and the number of the joint of the model that it is, or a part of.

    Attributes:
        kind: of the joint in the file.
    """

    idx_q: int
    nq: int
    idx_v: int
    nv: int
    joint: int
    kind: JointKind

    @property
    def positions(self) -> range:
        return range(self.idx_q, self.idx_q + self.nq)

    @property
    def velocities(self) -> range:
        return range(self.idx_v, self.idx_v + self.nv)


def places_of(model: Any, joints: Sequence[AskedJoint]) -> dict[str, JointPlace]:
    """The places of the joints that the model has; one of several in a body is part of a composite."""
    found = dict[str, JointPlace]()
    for number, parts in _joints_of_file(model, joints).items():
        q, v = model.joints[number].idx_q, model.joints[number].idx_v
        for part in parts:
            # One joint of the file may have other positions here.
            nq, nv = (len(part.positions), len(part.velocities)) if len(parts) > 1 else (model.joints[number].nq, model.joints[number].nv)
            found[part.name] = JointPlace(q, nq, v, nv, number, part.kind)
            q, v = q + nq, v + nv
    return found


def _joints_of_file(model: Any, joints: Sequence[AskedJoint]) -> dict[int, list[AskedJoint]]:
    """The joint of the file that each of the model is, or those that it is made of, by its number.

    They have the same name. A joint without one is called after its body by the MJCF reader, and a body without one after its parent, as
    is the next in that parent: there, joints are each other's that stand behind the same joint in the same order.
    """
    by_name, names = {joint.name: joint for joint in joints}, _names_of_reader(joints)
    found: dict[int, list[AskedJoint]] = {}
    for number in range(1, model.njoints):
        own = str(model.names[number])
        name = own if own in by_name else own.removeprefix(_COMPOSITE)
        if (known := by_name.get(names.get(name, name))) is not None:
            found[number] = _parts(model.joints[number], known, joints)
    for parent in range(model.njoints):
        if parent and parent not in found:
            continue
        carrier, taken = found[parent][-1].name if parent else "", {part.name for parts in found.values() for part in parts}
        numbers = [number for number in range(1, model.njoints) if model.parents[number] == parent and number not in found]
        behind = [joint for joint in joints if joint.is_unnamed and joint.carrier == carrier and joint.name not in taken]
        made = [_parts(model.joints[number], joint, joints) for number, joint in zip(numbers, behind, strict=False)]
        sizes = [sum(len(part.velocities) for part in parts) for parts in made]
        # Where the reader left some out, they are those that come later, as further trees.
        if len(numbers) <= len(behind) and sizes == [model.joints[number].nv for number in numbers]:
            found |= zip(numbers, made, strict=True)
    return found


def _names_of_reader(joints: Sequence[AskedJoint]) -> dict[str, str]:
    """Names of joints without one in named bodies, by those that the MJCF reader gives them."""
    found: dict[str, str] = {}
    for joint in joints:
        if unnamed := _UNNAMED.fullmatch(joint.name):
            number, body = unnamed.groups()
            found |= dict.fromkeys([f"{body}Joint_{int(number) - 1}", f"{body}_free"], joint.name)
    return found


def _parts(joint: Any, first: AskedJoint, joints: Sequence[AskedJoint]) -> list[AskedJoint]:
    """The joints of the file that one of the model is made of, in their order, of which a composite has several."""
    found: list[AskedJoint] = []
    for one in joints[joints.index(first) :] if joint.shortname() == "JointModelComposite" else [first]:
        if sum(len(part.velocities) for part in found) < joint.nv:
            found.append(one)
    return found


class ForceElements:
    """Force elements of one ``pinocchio.Model``, whose joints have these places.

    Joint springs and dampers are applied to all states at once; springs between points run through
    Pinocchio's kinematics state by state.
    """

    def __init__(self, model: Any, elements: Sequence[ForceElement], places: Mapping[str, JointPlace]) -> None:
        # A reader that leaves joints and bodies out leaves nothing for these to act at.
        elements = [one for one in elements if _has_ends(model, one, places)]
        self.model = model
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
        forces = self._of_point_springs(configuration, velocity) if self._point_springs else np.zeros(self.model.nv)
        self._add_of_joints(forces, configuration, velocity)
        return forces

    def _add_of_joints(self, forces: Array, configuration: Array, velocity: Array) -> None:
        for position, row, stiffness, reference in self._joint_springs:
            forces[row] -= stiffness * (configuration[position] - reference)
        for rows, damping in self._joint_dampers:
            forces[rows] -= damping * velocity[rows]

    def potential_energy(self, configuration: Array) -> float:
        """The potential energy of the springs [J], at one configuration (nq,)."""
        found = sum(stiffness * (configuration[at] - reference) ** 2 / 2 for at, _, stiffness, reference in self._joint_springs)
        for spring, (first, second) in self.ends_of_point_springs(configuration) if self._point_springs else ():
            found += spring.stiffness * (float(np.linalg.norm(second - first)) - spring.free_length) ** 2 / 2
        return float(found)

    def ends_of_point_springs(self, configuration: Array) -> list[tuple[PointSpring, Array]]:
        """Each spring between points with its ends in the world at one configuration (nq,) [m], (2, 3)."""
        pinocchio.computeJointJacobians(self.model, self._data, configuration)
        return [
            (spring, np.array([self._point(body, np.array(point))[0] for body, point in spring.ends])) for spring in self._point_springs
        ]

    def _of_point_springs(self, configuration: Array, velocity: Array) -> Array:
        total = np.zeros(self.model.nv)
        for pull in self.pulls(configuration, velocity):
            total -= pull.tension * pull.gradient
        return total

    def pulls(self, configuration: Array, velocity: Array) -> list[Pull]:
        """The springs between points at one configuration (nq,) and velocity (nv,)."""
        if self._point_springs:
            pinocchio.computeJointJacobians(self.model, self._data, configuration)
        return [pull_of(spring, self._point, velocity) for spring in self._point_springs]

    def derivatives(self, configuration: Array, velocity: Array) -> tuple[Array, Array]:
        """Derivatives of the forces by q and by v, (nv, nv) each, at one configuration (nq,) and velocity (nv,)."""
        by_position, by_velocity = np.zeros((2, len(velocity), len(velocity)))
        for _, row, stiffness, _ in self._joint_springs:
            by_position[row, row] -= stiffness
        for rows, damping in self._joint_dampers:
            by_velocity[rows, rows] -= damping * np.eye(rows.stop - rows.start)
        owners = _owners(self.places, len(velocity))
        for pull in self.pulls(configuration, velocity):
            # Of the length, whose gradient is g: by rows, the derivatives of g.
            between = (pull.jacobians[1] - pull.jacobians[0])[:3]
            hessian = between.T @ (between - np.outer(pull.along, pull.gradient)) / pull.length
            first, second = (_change_of_jacobian(jacobian, owners) for jacobian in pull.jacobians)
            hessian += np.einsum("c,cij->ij", pull.along, second - first)
            of_tension = pull.spring.stiffness * pull.gradient + pull.spring.damping * (velocity @ hessian)
            by_position -= np.outer(pull.gradient, of_tension) + pull.tension * hessian
            by_velocity -= pull.spring.damping * np.outer(pull.gradient, pull.gradient)
        return by_position, by_velocity

    def on_bodies(self, configuration: Array, velocity: Array) -> list[Any]:
        """The force of springs between points on each joint's body, as a ``pinocchio.Force`` in the frame of the joint, at one state."""
        found = [pinocchio.Force.Zero() for _ in range(self.model.njoints)]
        for pull in self.pulls(configuration, velocity):
            for (body, _), point, sign in zip(pull.spring.ends, pull.points, (1.0, -1.0), strict=True):
                if joint := carrier(self.model, body)[0]:
                    place = self._data.oMi[joint]
                    force = sign * pull.tension * pull.along
                    turn = place.rotation.T
                    found[joint] += pinocchio.Force(turn @ force, turn @ np.cross(point - place.translation, force))
        return found

    def _point(self, body: str, local: Array) -> tuple[Array, Array]:
        """World position (3,) of a point fixed in ``body``; Jacobian (6, nv) of its velocity and of the body's angular velocity."""
        joint, frame = carrier(self.model, body)
        position = (self._data.oMi[joint] * frame).act(local)
        if joint == 0:
            return position, np.zeros((6, self.model.nv))
        # A single column comes back with one axis.
        jacobian = pinocchio.getJointJacobian(self.model, self._data, joint, pinocchio.LOCAL_WORLD_ALIGNED).reshape(6, -1)
        arm = position - self._data.oMi[joint].translation
        return position, np.concatenate([jacobian[:3] - pinocchio.skew(arm) @ jacobian[3:], jacobian[3:]])


def _has_ends(model: Any, element: ForceElement, places: Mapping[str, JointPlace]) -> bool:
    if isinstance(element, PointSpring):
        return all(has_body(model, body) for body, _ in element.ends)
    return element.joint in places


def _owners(places: Mapping[str, JointPlace], nv: int) -> Array:
    """For each velocity, the number of its joint in the order of the tree."""
    owners = np.zeros(nv)
    for number, place in enumerate(sorted(places.values(), key=lambda place: place.idx_v)):
        owners[place.idx_v : place.idx_v + place.nv] = number
    return owners


def _change_of_jacobian(jacobian: Array, owners: Array) -> Array:
    """d J_i / d q_j of the Jacobian (6, nv) of a point, (3, i, j); see above."""
    turned = np.cross(jacobian[3:].T[None, :, :], jacobian[:3].T[:, None, :])
    # turned[i, j] is w_j x J_i.
    is_before = owners[None, :] <= owners[:, None]
    return np.asarray(np.where(is_before[:, :, None], turned, turned.transpose(1, 0, 2)).transpose(2, 0, 1))
