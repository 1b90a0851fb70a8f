"""Quantities that Pinocchio computes beside accelerations; ``harness.engines.interface`` says what each is.

What springs and dampers do is added from the file, as for ``aba``. Positions move along Pinocchio's tangent vectors,
``pinocchio.integrate``: the axes of the body for a ball or free joint.

Sources: Pinocchio documentation; Carpentier, Mansard, Analytical derivatives of rigid body dynamics algorithms, RSS 2018, for
``computeABADerivatives`` and ``computeRNEADerivatives``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio

from harness.arrays import Array
from harness.engines.adapters.pinocchio.forces import ForceElements
from harness.engines.adapters.pinocchio.versions import Columns, mass_matrix, states
from harness.engines.interface import NotOffered


class PlacedJoints:
    """Joints of a ``pinocchio.Model`` with force elements: their places in its vectors, and states there.

    ``constraints`` is what holds the accelerations of a mechanism with constraints, None for a tree.
    """

    def __init__(self, model: Any, joints: Iterable[str], force_elements: ForceElements, constraints: Any = None) -> None:
        self.model, self.force_elements, self.constraints = model, force_elements, constraints
        self._joints = list(dict.fromkeys(joints))
        self._data = model.createData()

    @cached_property
    def numbers(self) -> list[int]:
        """Numbers of the joint of the model that each joint is, or a part of.

        A ``KeyError`` where the file has another name, which the static audit tells and which no acceleration needs.
        """
        return [self.force_elements.places[name].joint for name in self._joints]

    @cached_property
    def addresses(self) -> tuple[list[int], list[int]]:
        """Places of the joints in Pinocchio's own q and v, in their order; its quaternions end with w."""
        positions: list[int] = []
        velocities: list[int] = []
        for place in map(self.force_elements.places.__getitem__, self._joints):
            own = list(place.positions)
            if place.kind.has_attitude:
                own[-4:] = [own[-1], *own[-4:-1]]
            positions += own
            velocities += place.velocities
        return positions, velocities

    def columns(self, q: Array, v: Array, tau: Array) -> Columns:
        """Pinocchio's own q, v and tau; force elements are not added."""
        positions, velocities = self.addresses
        if len(positions) != q.shape[1]:
            q = self._with_sines(q)
        configuration = np.tile(pinocchio.neutral(self.model), (len(q), 1)).T
        velocity, force = np.zeros((2, len(q), self.model.nv)).transpose(0, 2, 1)
        configuration[positions], velocity[velocities], force[velocities] = q.T, v.T, tau.T
        return configuration, velocity, force

    def _with_sines(self, q: Array) -> Array:
        """Positions with the cosine and sine of those turns that stand so in Pinocchio's q."""
        parts, start = [], 0
        for place in map(self.force_elements.places.__getitem__, self._joints):
            own = q[:, start : start + place.kind.positions]
            start += place.kind.positions
            is_turn = place.nq > place.kind.positions
            parts.append(np.hstack([own[:, :-1], np.cos(own[:, -1:]), np.sin(own[:, -1:])]) if is_turn else own)
        return np.hstack([q[:, :0], *parts])

    def pulled(self, q: Array, v: Array, tau: Array) -> Columns:
        """``columns`` with the forces of the force elements."""
        configuration, velocity, force = self.columns(q, v, tau)
        if not self.force_elements.empty:
            force += self.force_elements.generalised_forces(configuration, velocity)
        return configuration, velocity, force

    def _states(self, q: Array, *rates: Array) -> Iterator[tuple[Array, ...]]:
        """Pinocchio's own q of each state, and its v where that is given."""
        v = rates[0] if rates else np.zeros((len(q), len(self.addresses[1])))
        return states(*self.columns(q, v, v)[: 1 + len(rates)])

    def _vectors(self, found: Any) -> Array:
        """(n, nv) in the order of the joints."""
        return np.ascontiguousarray(np.array(found).reshape(-1, self.model.nv)[:, self.addresses[1]])

    def _matrices(self, found: Any) -> Array:
        """(n, ..., nv, nv) in the order of the joints."""
        velocities = self.addresses[1]
        matrices = np.array(found)
        return np.ascontiguousarray(matrices[..., velocities, :][..., velocities])


class PinocchioQuantities(PlacedJoints):
    """The quantities that a model computes beside accelerations."""

    def mass_matrix(self, q: Array) -> Array:
        """``crba``."""
        return self._matrices([mass_matrix(self.model, self._data, *state) for state in self._states(q)])

    def bias(self, q: Array, v: Array) -> Array:
        """``nonLinearEffects``."""
        return self._vectors([np.array(pinocchio.nonLinearEffects(self.model, self._data, *state)) for state in self._states(q, v)])

    def gravity(self, q: Array) -> Array:
        """``computeGeneralizedGravity``."""
        return self._vectors([np.array(pinocchio.computeGeneralizedGravity(self.model, self._data, *state)) for state in self._states(q)])

    def inverse_dynamics(self, q: Array, v: Array, qdd: Array) -> Array:
        """``rnea``."""
        columns = self.columns(q, v, qdd)
        passive = self.force_elements.generalised_forces(*columns[:2])
        forces = [np.array(pinocchio.rnea(self.model, self._data, *state)) for state in states(*columns)]
        return self._vectors([force - own for force, own in zip(forces, passive.T, strict=True)])

    def forward_dynamics_derivatives(self, q: Array, v: Array, tau: Array) -> Array:
        """``computeABADerivatives``."""
        return self._derivatives("computeABADerivatives", q, v, tau)

    def inverse_dynamics_derivatives(self, q: Array, v: Array, qdd: Array) -> Array:
        """``computeRNEADerivatives``."""
        return self._derivatives("computeRNEADerivatives", q, v, qdd)

    def _derivatives(self, algorithm: str, q: Array, v: Array, third: Array) -> Array:
        """Derivatives of accelerations by q, v and forces, or of forces by q, v and accelerations, with those of springs and dampers."""
        if self.constraints is not None:
            raise NotOffered(f"{algorithm} is of trees; constraints and mimicking joints are no part of it")
        is_forward, elements = algorithm == "computeABADerivatives", self.force_elements
        columns = self.pulled(q, v, third) if is_forward else self.columns(q, v, third)
        found, data = np.empty((len(q), 3, self.model.nv, self.model.nv)), self.model.createData()
        for state, inputs in enumerate(states(*columns)):
            by_position, by_velocity, by_third = map(np.array, getattr(pinocchio, algorithm)(self.model, data, *inputs))
            of_position, of_velocity = (by_third @ one if is_forward else -one for one in elements.derivatives(*inputs[:2]))
            found[state] = by_position + of_position, by_velocity + of_velocity, by_third
        return self._matrices(found)

    def regressor(self, q: Array, v: Array, qdd: Array) -> Array:
        """``computeJointTorqueRegressor``."""
        found = np.empty((len(q), self.model.nv, self.model.njoints - 1, 10))
        for state, inputs in enumerate(states(*self.columns(q, v, qdd))):
            found[state] = np.reshape(pinocchio.computeJointTorqueRegressor(self.model, self._data, *inputs), found[state].shape)
        # The universe has no parameters.
        return np.ascontiguousarray(found[:, self.addresses[1]][:, :, [number - 1 for number in self.numbers]])

    def energies(self, q: Array, v: Array) -> Array:
        """``computeKineticEnergy`` and ``computePotentialEnergy``."""
        # Of a hinge about another axis than x, y or z the armature is left out: docs/issues/pinocchio-energy-armature-unaligned.md.
        found = np.empty((len(q), 2))
        for state, (position, rate) in enumerate(self._states(q, v)):
            kinetic = pinocchio.computeKineticEnergy(self.model, self._data, position, rate)
            potential = pinocchio.computePotentialEnergy(self.model, self._data, position)
            found[state] = kinetic, potential + self.force_elements.potential_energy(position)
        return found

    def momenta(self, q: Array, v: Array) -> Array:
        """``computeCentroidalMomentum``."""
        found = np.empty((len(q), 9))
        for state, inputs in enumerate(self._states(q, v)):
            momentum = pinocchio.computeCentroidalMomentum(self.model, self._data, *inputs)
            about_origin = momentum.angular + np.cross(self._data.com[0], momentum.linear)
            found[state] = *momentum.linear, *about_origin, *momentum.angular
        return found

    def positions(self, q: Array) -> Array:
        """``forwardKinematics``, ``data.oMi``."""
        found = np.empty((len(q), len(self.numbers), 12))
        for state, position in enumerate(self._states(q)):
            pinocchio.forwardKinematics(self.model, self._data, *position)
            for place, pose in enumerate(self._data.oMi[number] for number in self.numbers):
                found[state, place] = *pose.translation, *pose.rotation.ravel()
        return found

    def velocities(self, q: Array, v: Array) -> Array:
        """``getVelocity`` along the world's axes."""
        found, axes = np.empty((len(q), len(self.numbers), 6)), pinocchio.LOCAL_WORLD_ALIGNED
        for state, inputs in enumerate(self._states(q, v)):
            pinocchio.forwardKinematics(self.model, self._data, *inputs)
            for place, number in enumerate(self.numbers):
                found[state, place] = pinocchio.getVelocity(self.model, self._data, number, axes).vector
        return found

    def jacobians(self, q: Array) -> Array:
        """``getJointJacobian`` along the world's axes."""
        velocities, axes = self.addresses[1], pinocchio.LOCAL_WORLD_ALIGNED
        found = np.empty((len(q), len(self.numbers), 6, len(velocities)))
        for state, position in enumerate(self._states(q)):
            pinocchio.computeJointJacobians(self.model, self._data, *position)
            for place, number in enumerate(self.numbers):
                # A single column comes back with one axis.
                own = np.reshape(pinocchio.getJointJacobian(self.model, self._data, number, axes), (6, -1))
                found[state, place] = own[:, velocities]
        return found
