"""What callers share whose engines are asked at one state after the other, with joints of one axis and a base that is fixed or floats.

An engine's part is to take a state, and to give the accelerations there, or M and the bias forces that they follow from. States, forces
and answers are turned between the harness's order and axes and the engine's here, and what the harness supplies is added.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.comparison.questions import Asked, Refused, Request, projected
from harness.engines import Unsupported
from harness.engines.rotations import Columns, rotation

_SINGLE_AXIS = ("hinge", "slide")


class StateByState:
    """A file in such an engine. What begins with an underscore and is abstract is the engine's part.

    Attributes:
        places: the engine's first velocity of each joint. width: number of the engine's velocities.
        rotation_first: whether it has the angular velocity of a base that floats before the linear one; both are along the world's axes.
        applies_dampers: whether the engine applies the dampers of joints itself.
    """

    notes: tuple[str, ...] = ()
    rotation_first = False
    applies_dampers = False

    def __init__(self, request: Request, places: Mapping[str, int], width: int) -> None:
        self.request, self.places, self.width = request, places, width
        self.found = tuple(joint for joint in request.joints if joint.name in places)
        self.further = tuple(name for name in places if name not in {joint.name for joint in request.joints})
        self.columns = Columns(
            [joint.name for joint in self.found], {joint.name: (len(joint.positions), len(joint.velocities)) for joint in self.found}
        )
        self.q_columns = [column for joint in self.found for column in joint.positions]
        self.v_columns = [column for joint in self.found for column in joint.velocities]
        self.couplings = None if request.couplings is None else request.couplings[self.v_columns]
        self.joints = self.found if request.aid is None or self.couplings is None else request.aid.leaders
        self._armature = np.zeros(width)
        if request.aid is not None:
            for joint in self.found:
                self._armature[self._own(joint)] = request.aid.armature[list(joint.velocities)]

    @abstractmethod
    def _go_to(self, q: Array, v: Array) -> None:
        """Take a state: q by ``columns``, v (width,) in the engine's own order and axes."""

    @abstractmethod
    def _mass_matrix(self) -> Array:
        """(width, width), in the engine's own order and axes, without the rotor inertias that the harness supplies."""

    @abstractmethod
    def _bias(self) -> Array:
        """(width,) [N or N m]: the generalised forces at which no acceleration results."""

    def _accelerations(self, force: Array) -> Array:
        """(width,) under generalised forces (width,), at the state that was taken."""
        return np.asarray(np.linalg.solve(self._mass_matrix() + np.diag(self._armature), force - self._bias()))

    def _own(self, joint: Asked) -> slice:
        return slice(self.places[joint.name], self.places[joint.name] + len(joint.velocities))

    @property
    def model(self) -> Any:
        raise Unsupported("the harness asks this engine for accelerations alone")

    @property
    def is_supplied_with_forces(self) -> bool:
        aid = self.request.aid
        return aid is not None and (bool(aid.forces.springs) or (bool(aid.forces.damping.any()) and not self.applies_dampers))

    def addresses(self, names: Sequence[str]) -> tuple[list[int], list[int]]:
        raise Unsupported("the harness asks this engine for accelerations alone")

    def prepare(self, q: Array, v: Array, tau: Array) -> _Run:
        if self.request.aid is not None:
            forces = self.request.aid.forces
            tau = tau + forces.of_springs(q) + (0.0 if self.applies_dampers else forces.of_dampers(v))
        return _Run(self, q[:, self.q_columns], v[:, self.v_columns], tau[:, self.v_columns])

    def turn(self, q: Array) -> Array:
        """(velocities of the joints found, width): takes the engine's velocities, accelerations and forces to the harness's."""
        return self.columns.turn(q, self.places, self.width, self.rotation_first)

    def at(self, q: Array, v: Array, force: Array, turn: Array) -> Array:
        """Accelerations at one state: q by ``columns``, v and force (width,) the engine's own; with couplings those of the leaders."""
        self._go_to(q, v)
        try:
            if self.couplings is None:
                return np.asarray(turn @ self._accelerations(force))
            mass = turn @ (self._mass_matrix() + np.diag(self._armature)) @ turn.T
            return projected(mass, turn @ (force - self._bias()), self.couplings)
        except np.linalg.LinAlgError:
            return np.full(sum(len(joint.velocities) for joint in self.joints), np.nan)


class _Run:
    """States in the engine's own v and forces."""

    def __init__(self, loaded: StateByState, q: Array, v: Array, tau: Array) -> None:
        self._loaded = loaded
        turns = [loaded.turn(row) for row in q]
        self._states = [(row, v[state] @ turns[state], tau[state] @ turns[state], turns[state]) for state, row in enumerate(q)]
        self._found = np.full((len(q), sum(len(joint.velocities) for joint in loaded.joints)), np.nan)

    def compute(self) -> None:
        for state, own in enumerate(self._states):
            self._found[state] = self._loaded.at(*own)

    def accelerations(self) -> Array:
        return self._found


class FloatingBase(StateByState):
    """An engine all of whose models have a base that floats: its six velocities stand first, and are left out where the base is fixed.

    Attributes:
        base: its pose (4, 4). positions, velocities: of ``own_joints``, in the engine's order. base_velocity: (6,), along the world's axes.
    """

    def __init__(self, request: Request, own_joints: Sequence[str]) -> None:
        self._first = 6 if request.floating_base else 0
        places = {name: self._first + number for number, name in enumerate(own_joints)}
        if request.floating_base:
            places[request.floating_base] = 0
        super().__init__(request, places, self._first + len(own_joints))
        self.base, self.base_velocity = np.eye(4), np.zeros(6)
        self.positions, self.velocities = np.zeros(len(own_joints)), np.zeros(len(own_joints))

    @abstractmethod
    def _take(self) -> None:
        """Have the engine take the base and the joints as they stand in the attributes."""

    @abstractmethod
    def _whole_mass_matrix(self) -> Array:
        """(6 + n, 6 + n), with the base."""

    @abstractmethod
    def _whole_bias(self) -> Array:
        """(6 + n,), with the base."""

    def _go_to(self, q: Array, v: Array) -> None:
        for name in self.columns.sizes:
            given = q[self.columns.spans(name)[0]]
            if name == self.request.floating_base:
                self.base[:3, :3], self.base[:3, 3] = rotation(given[3:]), given[:3]
                self.base_velocity = v[:6]
            else:
                self.positions[self.places[name] - self._first] = given[0]
        self.velocities = v[self._first :]
        self._take()

    def _mass_matrix(self) -> Array:
        rows = slice(6 - self._first, None)
        return self._whole_mass_matrix()[rows, rows]

    def _bias(self) -> Array:
        return self._whole_bias()[6 - self._first :]


def refuse_joints(request: Request, engine: str, floating: Collection[str]) -> None:
    """Raises Refused for joints that the harness does not ask the engine about: all of several axes but the free ones ``floating``."""
    for joint in request.joints:
        is_asked = joint.name in floating and joint.kind == "free" and joint.is_measured_in_the_world
        if joint.kind not in _SINGLE_AXIS and not is_asked:
            raise Refused(f"the harness asks {engine} about no {joint.kind} joint, as {joint.name!r} is", joint.name)
