"""Parts of adapters whose engines are asked at one state after the other, with joints of one axis and a base that is fixed or floats.

An engine's part is to take a state, and to give the accelerations there, or M and the bias forces that they follow from: then
M qdd + bias = tau + springs and dampers is solved by a factorisation of M. States, forces and answers are turned between the harness's
order and axes and the engine's here, and what the harness supplies is added. ``FloatingBase`` is for engines all of whose models have a
base that floats: a model that hangs on the world is the rows of its joints; one on a ball joint, those and the base's rotation.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from harness.arrays import Array
from harness.engines.coordinates import FREE, Columns, cross_matrix, rotation
from harness.engines.interface import NotOffered, Terms
from harness.engines.loaded_file import LoadedFile
from harness.engines.request import Request, projected
from harness.files.facts import PointSpring
from harness.files.joint_kinds import JointKind
from harness.files.tree import WORLD

# World position (3,) of a point of a body, given in the body's frame, and its Jacobian, (3, nv) or with that of the body's rotation.
PointOf = Callable[[str, Array], tuple[Array, Array]]


class StateByState(LoadedFile):
    """A file in such an engine. What begins with an underscore and is abstract is the engine's part.

    Attributes:
        places: the engine's first velocity of each joint. sizes: its numbers of positions and velocities. width: number of all velocities.
        rotation_first: whether it has the angular velocity of a base that floats before the linear one; both are along the world's axes.
        turn: takes the engine's velocities, accelerations and forces to the harness's at the last state, (nv, width).
    """

    rotation_first = False

    def __init__(self, request: Request, places: Mapping[str, int], width: int) -> None:
        super().__init__(request, places)
        self.places, self.width = places, width
        self.columns = Columns([joint.name for joint in self.found], {joint.name: joint.kind.sizes for joint in self.found})
        self.sizes = {name: self.columns.sizes.get(name, (1, 1)) for name in places}
        self.turn = np.zeros((self.columns.nv, width))
        self.armature = self.aid.armature[self.v_columns]

    @abstractmethod
    def _go_to(self, q: Array, v: Array) -> None:
        """Take a state: q by ``columns``, v (width,) in the engine's own order and axes."""

    @abstractmethod
    def _mass_matrix(self) -> Array:
        """(width, width), in the engine's own order and axes, without the rotor inertias that the harness supplies."""

    @abstractmethod
    def _bias(self) -> Array:
        """(width,) [N or N m]: the generalised forces at which no acceleration results."""

    @abstractmethod
    def _parts_of_bias(self) -> tuple[Array, Array, Array]:
        """Its terms of velocity and of gravity, neither what is left of a difference, and less the springs and dampers that the engine
        applies itself; each (width,)."""

    def _accelerations(self, force: Array) -> Array | None:
        """(width,) under generalised forces (width,), at the state that was taken; None of an engine that leaves that to its caller."""
        return None

    def _link(self, body: str) -> tuple[Array, Array, Array]:
        """A link: the rotation of its frame to the world (3, 3), its origin (3,), and the Jacobian (6, width) of the origin's velocity and
        the angular velocity, along the world's axes."""
        raise NotOffered("the engine gives no places of links")

    def _point(self, body: str, local: Array) -> tuple[Array, Array]:
        """World position (3,) of a point of a body, given in the body's frame, and its Jacobian (3, nv)."""
        if body == WORLD:
            return local, np.zeros((3, self.columns.nv))
        turn, origin, jacobian = self._link(body)
        arm = turn @ local
        return origin + arm, (jacobian[:3] - cross_matrix(arm) @ jacobian[3:]) @ self.turn.T

    def take(self, q: Array, v: Array) -> Array:
        """Take one state over the columns of the joints found; (nv,) forces of springs between points that are supplied there."""
        self.turn = self.columns.turn(q, self.places, self.width, self.rotation_first)
        self._go_to(q, v @ self.turn)
        forces = np.zeros(len(v))
        for spring in () if self.applies_springs else self.aid.springs:
            pull = pull_of(spring, self._point, v)
            forces -= pull.tension * pull.gradient
        return forces

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        tau = tau + self.supplied(q, v)
        q, v, tau = q[:, self.q_columns], v[:, self.v_columns], tau[:, self.v_columns]
        return np.array([self._at(*state) for state in zip(q, v, tau, strict=True)]).reshape(len(q), -1)

    def _at(self, q: Array, v: Array, tau: Array) -> Array:
        """Accelerations at one state; with couplings those of the leaders."""
        tau = tau + self.take(q, v)
        if self.couplings is None and (found := self._accelerations(tau @ self.turn)) is not None:
            return np.asarray(self.turn @ found)
        mass, right = self._turned_mass(), tau - self.turn @ self._bias()
        try:
            return np.asarray(np.linalg.solve(mass, right)) if self.couplings is None else projected(mass, right, self.couplings)
        except np.linalg.LinAlgError:
            return np.full(sum(len(joint.velocities) for joint in self.joints), np.nan)

    @property
    def quantities(self) -> OneByOne:
        return OneByOne(self)

    def _turned_mass(self) -> Array:
        return np.asarray(self.turn @ self._mass_matrix() @ self.turn.T + np.diag(self.armature))

    def terms(self, q: Array, v: Array, tau: Array) -> Terms:
        """The terms of the equations that ``forward_dynamics`` solves; passive with what the harness supplies."""
        found = self.turned_terms(q, v)
        return replace(found, passive=found.passive + self.supplied(q, v), applied=tau.copy())

    def turned_terms(self, q: Array, v: Array) -> Terms:
        """The same over the columns of the joints found, of dampers and springs those that the engine applies and those between points."""
        mass, (velocity, gravity, passive) = np.empty((*v.shape, v.shape[1])), np.empty((3, *v.shape))
        for state, (position, rate) in enumerate(zip(q, v, strict=True)):
            passive[state] = self.take(position, rate)
            mass[state] = self._turned_mass()
            velocity[state], gravity[state], own = (self.turn @ part for part in self._parts_of_bias())
            passive[state] -= own
        return Terms(mass, velocity, gravity, passive, np.zeros_like(v))


class OneByOne:
    """The terms of a user's file in such an engine as quantities, q and v over the joints found, see ``harness.engines.interface``."""

    def __init__(self, loaded: StateByState) -> None:
        self._loaded = loaded

    def mass_matrix(self, q: Array) -> Array:
        """With the rotor inertias that the harness supplies."""
        return self._terms(q, None).mass

    def gravity(self, q: Array) -> Array:
        return self._terms(q, None).gravity

    def bias(self, q: Array, v: Array) -> Array:
        terms = self._terms(q, v)
        return terms.velocity + terms.gravity

    def _terms(self, q: Array, v: Array | None) -> Terms:
        v = np.zeros((len(q), self._loaded.columns.nv)) if v is None else v
        return self._loaded.turned_terms(q, v)


class Pull(NamedTuple):
    """A stretched spring at one state.

    Attributes:
        spring: as the file has it. points: its ends in the world, (2, 3) [m]. jacobians: of their velocities, (2, 3, nv), or (2, 6, nv)
            with the angular velocities of their bodies. length: between the ends [m]; along: the direction from the first to the second.
        gradient: of the length, (nv,). tension: (spring and damper) [N].
    """

    spring: PointSpring
    points: Array
    jacobians: Array
    length: float
    along: Array
    gradient: Array
    tension: float


def pull_of(spring: PointSpring, point_of: PointOf, v: Array) -> Pull:
    """A spring between points at the state that the engine is at, by its positions and Jacobians.

    Source: Drake documentation, ``LinearSpringDamper``.
    """
    ends = [point_of(body, np.array(point)) for body, point in spring.ends]
    points, jacobians = np.array([point for point, _ in ends]), np.array([jacobian for _, jacobian in ends])
    span = points[1] - points[0]
    length = float(np.linalg.norm(span))
    along = span / length
    # Rate of the length is (its gradient) . velocity; the tension does work along it.
    gradient = along @ (jacobians[1] - jacobians[0])[:3]
    tension = spring.stiffness * (length - spring.free_length) + spring.damping * (gradient @ v)
    return Pull(spring, points, jacobians, length, along, gradient, float(tension))


class FloatingBase:
    """The base of an engine all of whose models float; its velocities are the base's, along the world's axes, then the joints'.

    Attributes:
        root: the joint that the base hangs by, "" for none. places: the engine's first velocity of each joint.
        pose: (4, 4). positions, velocities: of the joints, in the engine's order. velocity: of the base, (6,), along the world's axes.
    """

    def __init__(self, request: Request, own_joints: Sequence[str], root: str) -> None:
        self.root, self.places = root, {name: 6 + number for number, name in enumerate(own_joints)}
        if root:
            (kind,) = (joint.kind for joint in request.joints if joint.name == root)
            self.places[root] = 3 if kind == JointKind.BALL else 0
        self.width = 6 + len(own_joints)
        self.pose, self.velocity = np.eye(4), np.zeros(6)
        self.positions, self.velocities = np.zeros((2, len(own_joints)))

    def go_to(self, columns: Columns, q: Array, v: Array) -> None:
        """Take a state as of ``StateByState``."""
        for name, size in columns.sizes.items():
            given = q[columns.spans(name)[0]]
            if name == self.root:
                self.pose[:3, :3] = rotation(given[-4:])
                self.pose[:3, 3] = given[:-4] if size == FREE else 0.0
            else:
                self.positions[self.places[name] - 6] = given[0]
        self.velocity, self.velocities = v[:6], v[6:]
