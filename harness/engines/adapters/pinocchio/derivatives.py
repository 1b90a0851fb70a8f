"""Pinocchio's derivatives of its algorithms, with those of the springs and dampers that the harness adds to them.

Positions move along Pinocchio's tangent vectors, ``pinocchio.integrate``: the axes of the body for a ball or free joint. Forces of
springs between points are differentiated by hand, in Pinocchio's own frames and Jacobians: column i of the Jacobian of a point is turned
by a joint before it, and moved by a joint behind it,

    dJ_i/dq_j = w_j x J_i for j before i or of the same joint, else w_i x J_j,

where w are the angular velocities of the columns.

Sources: Carpentier, Mansard, Analytical derivatives of rigid body dynamics algorithms, RSS 2018; Pinocchio documentation,
``computeABADerivatives`` and ``computeRNEADerivatives``; Bruyninckx, De Schutter, Symbolic differentiation of the velocity mapping for
a serial kinematic chain, Mechanism and Machine Theory 31 (1996), for derivatives of Jacobians.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harness.arrays import Array
from harness.engines.interface import NotOffered

if TYPE_CHECKING:
    from harness.engines.adapters.pinocchio.forces import ForceElements
    from harness.engines.adapters.pinocchio.quantities import PinocchioQuantities


def forward(model: PinocchioQuantities, q: Array, v: Array, tau: Array) -> Array:
    """``computeABADerivatives``; see ``harness.engines.interface``."""
    import pinocchio

    _require_tree(model, "computeABADerivatives")
    configuration, velocity, force = model.columns(q, v, tau)
    force += model.force_elements.generalised_forces(configuration, velocity)
    found, data = np.empty((len(q), 3, model.model.nv, model.model.nv)), model.model.createData()
    for state, inputs in enumerate(zip(configuration.T, velocity.T, force.T, strict=True)):
        by_position, by_velocity, inverse = map(np.array, pinocchio.computeABADerivatives(model.model, data, *inputs))
        of_elements = derivatives_of_forces(model.force_elements, *inputs[:2])
        found[state] = by_position + inverse @ of_elements[0], by_velocity + inverse @ of_elements[1], inverse
    return _ordered(model, found)


def inverse(model: PinocchioQuantities, q: Array, v: Array, accelerations: Array) -> Array:
    """``computeRNEADerivatives``; see ``harness.engines.interface``."""
    import pinocchio

    _require_tree(model, "computeRNEADerivatives")
    configuration, velocity, acceleration = model.columns(q, v, accelerations)
    found, data = np.empty((len(q), 3, model.model.nv, model.model.nv)), model.model.createData()
    for state, inputs in enumerate(zip(configuration.T, velocity.T, acceleration.T, strict=True)):
        by_position, by_velocity, mass = map(np.array, pinocchio.computeRNEADerivatives(model.model, data, *inputs))
        of_elements = derivatives_of_forces(model.force_elements, *inputs[:2])
        found[state] = by_position - of_elements[0], by_velocity - of_elements[1], mass
    return _ordered(model, found)


def derivatives_of_forces(elements: ForceElements, configuration: Array, velocity: Array) -> tuple[Array, Array]:
    """Of the forces of springs and dampers at one configuration (nq,) and velocity (nv,), by q and by v, (nv, nv) each."""
    by_position, by_velocity = (-matrix for matrix in elements.stiffness_and_damping())
    owners = _owners(elements, len(velocity))
    for pull in elements.pulls(configuration, velocity):
        # Of the length, whose gradient is g: by rows, the derivatives of g.
        between = (pull.jacobians[1] - pull.jacobians[0])[:3]
        hessian = between.T @ (between - np.outer(pull.along, pull.gradient)) / pull.length
        first, second = (_change_of_jacobian(jacobian, owners) for jacobian in pull.jacobians)
        hessian += np.einsum("c,cij->ij", pull.along, second - first)
        of_tension = pull.spring.stiffness * pull.gradient + pull.spring.damping * (velocity @ hessian)
        by_position -= np.outer(pull.gradient, of_tension) + pull.tension * hessian
        by_velocity -= pull.spring.damping * np.outer(pull.gradient, pull.gradient)
    return by_position, by_velocity


def _owners(elements: ForceElements, nv: int) -> Array:
    """For each velocity, the number of its joint in the order of the tree."""
    owners = np.zeros(nv)
    for number, place in enumerate(sorted(elements.places.values(), key=lambda place: place.idx_v)):
        owners[place.idx_v : place.idx_v + place.nv] = number
    return owners


def _change_of_jacobian(jacobian: Array, owners: Array) -> Array:
    """d J_i / d q_j of the Jacobian (6, nv) of a point, (3, i, j); see above."""
    turned = np.cross(jacobian[3:].T[None, :, :], jacobian[:3].T[:, None, :])
    # turned[i, j] is w_j x J_i.
    is_before = owners[None, :] <= owners[:, None]
    return np.asarray(np.where(is_before[:, :, None], turned, turned.transpose(1, 0, 2)).transpose(2, 0, 1))


def _require_tree(model: PinocchioQuantities, algorithm: str) -> None:
    if model.constraints is not None:
        raise NotOffered(f"{algorithm} is of trees; constraints and mimicking joints are no part of it")


def _ordered(model: PinocchioQuantities, matrices: Array) -> Array:
    """Matrices in the order of the joints."""
    velocities = model.addresses[1]
    return np.ascontiguousarray(matrices[:, :, velocities][:, :, :, velocities])
