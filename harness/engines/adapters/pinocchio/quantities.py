"""What Pinocchio computes beside accelerations; ``harness.engines.interface`` says what each is.

What springs and dampers do is added from the file, as for ``aba``.
Source: Pinocchio documentation.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines.adapters.pinocchio import derivatives
from harness.engines.adapters.pinocchio.forces import ForceElements


class PinocchioQuantities:
    """The methods of a ``pinocchio.Model`` whose joints have places in q and v."""

    model: Any
    force_elements: ForceElements
    constraints: Any
    columns: Callable[[Array, Array, Array], tuple[Array, Array, Array]]
    _joints: Sequence[str]
    _data: Any

    @cached_property
    def numbers(self) -> list[int]:
        """Of the joint of the model that each joint is, or a part of; each joint once.

        A ``KeyError`` where the file has another name, which the static audit tells and which no acceleration needs.
        """
        return [self.force_elements.places[name].joint for name in dict.fromkeys(self._joints)]

    @property
    @abstractmethod
    def addresses(self) -> tuple[list[int], list[int]]:
        """Places of the joints in the engine's own q and v."""

    def mass_matrix(self, q: Array) -> Array:
        """``crba``, whose lower triangle is not written."""
        import pinocchio

        velocities, found = self.addresses[1], np.empty((len(q), self.model.nv, self.model.nv))
        for state, position in enumerate(self._configurations(q)):
            upper = np.triu(pinocchio.crba(self.model, self._data, position))
            found[state] = upper + np.triu(upper, 1).T
        return np.ascontiguousarray(found[:, velocities][:, :, velocities])

    def bias(self, q: Array, v: Array) -> Array:
        """``nonLinearEffects``."""
        import pinocchio

        configuration, velocity, _ = self.columns(q, v, v)
        states = zip(configuration.T, velocity.T, strict=True)
        return _ordered(self, [np.array(pinocchio.nonLinearEffects(self.model, self._data, *state)) for state in states])

    def gravity(self, q: Array) -> Array:
        """``computeGeneralizedGravity``."""
        import pinocchio

        positions = self._configurations(q)
        return _ordered(self, [np.array(pinocchio.computeGeneralizedGravity(self.model, self._data, position)) for position in positions])

    def inverse_dynamics(self, q: Array, v: Array, qdd: Array) -> Array:
        """``rnea``."""
        import pinocchio

        configuration, velocity, acceleration = self.columns(q, v, qdd)
        passive = self.force_elements.generalised_forces(configuration, velocity)
        states = zip(configuration.T, velocity.T, acceleration.T, strict=True)
        forces = [np.array(pinocchio.rnea(self.model, self._data, *state)) for state in states]
        return _ordered(self, [force - own for force, own in zip(forces, passive.T, strict=True)])

    def forward_dynamics_derivatives(self, q: Array, v: Array, tau: Array) -> Array:
        """``computeABADerivatives``."""
        return derivatives.forward(self, q, v, tau)

    def inverse_dynamics_derivatives(self, q: Array, v: Array, qdd: Array) -> Array:
        """``computeRNEADerivatives``."""
        return derivatives.inverse(self, q, v, qdd)

    def regressor(self, q: Array, v: Array, qdd: Array) -> Array:
        """``computeJointTorqueRegressor``."""
        import pinocchio

        configuration, velocity, acceleration = self.columns(q, v, qdd)
        found = np.empty((len(q), self.model.nv, self.model.njoints - 1, 10))
        for state, inputs in enumerate(zip(configuration.T, velocity.T, acceleration.T, strict=True)):
            found[state] = np.reshape(pinocchio.computeJointTorqueRegressor(self.model, self._data, *inputs), found[state].shape)
        # The universe has no parameters.
        return np.ascontiguousarray(found[:, self.addresses[1]][:, :, [number - 1 for number in self.numbers]])

    def energies(self, q: Array, v: Array) -> Array:
        """``computeKineticEnergy`` and ``computePotentialEnergy``."""
        import pinocchio

        configuration, velocity, _ = self.columns(q, v, v)
        found = np.empty((len(q), 2))
        for state, (position, rate) in enumerate(zip(configuration.T, velocity.T, strict=True)):
            kinetic = pinocchio.computeKineticEnergy(self.model, self._data, position, rate)
            potential = pinocchio.computePotentialEnergy(self.model, self._data, position)
            found[state] = kinetic, potential + self.force_elements.potential_energy(position)
        return found

    def momenta(self, q: Array, v: Array) -> Array:
        """``computeCentroidalMomentum``."""
        import pinocchio

        configuration, velocity, _ = self.columns(q, v, v)
        found = np.empty((len(q), 9))
        for state, inputs in enumerate(zip(configuration.T, velocity.T, strict=True)):
            momentum = pinocchio.computeCentroidalMomentum(self.model, self._data, *inputs)
            about_origin = momentum.angular + np.cross(self._data.com[0], momentum.linear)
            found[state] = *momentum.linear, *about_origin, *momentum.angular
        return found

    def positions(self, q: Array) -> Array:
        """``forwardKinematics``, ``data.oMi``."""
        import pinocchio

        found = np.empty((len(q), len(self.numbers), 12))
        for state, position in enumerate(self._configurations(q)):
            pinocchio.forwardKinematics(self.model, self._data, position)
            for place, number in enumerate(self.numbers):
                pose = self._data.oMi[number]
                found[state, place] = *pose.translation, *pose.rotation.ravel()
        return found

    def velocities(self, q: Array, v: Array) -> Array:
        """``getVelocity`` along the world's axes."""
        import pinocchio

        configuration, velocity, _ = self.columns(q, v, v)
        found = np.empty((len(q), len(self.numbers), 6))
        for state, inputs in enumerate(zip(configuration.T, velocity.T, strict=True)):
            pinocchio.forwardKinematics(self.model, self._data, *inputs)
            for place, number in enumerate(self.numbers):
                found[state, place] = pinocchio.getVelocity(self.model, self._data, number, pinocchio.LOCAL_WORLD_ALIGNED).vector
        return found

    def jacobians(self, q: Array) -> Array:
        """``getJointJacobian`` along the world's axes."""
        import pinocchio

        velocities, found = self.addresses[1], np.empty((len(q), len(self.numbers), 6, len(self.addresses[1])))
        for state, position in enumerate(self._configurations(q)):
            pinocchio.computeJointJacobians(self.model, self._data, position)
            for place, number in enumerate(self.numbers):
                own = pinocchio.getJointJacobian(self.model, self._data, number, pinocchio.LOCAL_WORLD_ALIGNED)
                # A single column comes back with one axis.
                found[state, place] = np.reshape(own, (6, -1))[:, velocities]
        return found

    def _configurations(self, q: Array) -> Array:
        still = np.zeros((len(q), len(self.addresses[1])))
        return self.columns(q, still, still)[0].T


def _ordered(model: PinocchioQuantities, forces: Sequence[Array]) -> Array:
    """Vectors in the order of the joints."""
    return np.ascontiguousarray(np.array(forces).reshape(-1, model.model.nv)[:, model.addresses[1]])
