"""Energies, momenta, and where the bodies are and how they move."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from harness.arrays import Array
from harness.engines import Model, answer_of
from harness.trees.quantities import motion
from harness.trees.quantities.tree_motion import Block, TreeMotion
from harness.truth.quantities import Quantity
from harness.truth.quantities._file_truth import AskedMotion, FileTruth


def _quantity(name: str, blocks_of: Callable[[TreeMotion], Iterable[Block]], answer: Callable[[Model, AskedMotion], Array]) -> Quantity:
    return Quantity(name, lambda basis: FileTruth(basis, blocks_of, answer))


def _energies(model: Model, asked: AskedMotion) -> Array:
    """The potential energy beyond that at zero."""
    found = np.array(answer_of(model, "energies", (asked.q, asked.v), (len(asked.q), 2)))
    at_zero = answer_of(model, "energies", (asked.zero, np.zeros((1, asked.v.shape[1]))), (1, 2))
    found[:, 1] -= at_zero[0, 1]
    return found


def _momenta(model: Model, asked: AskedMotion) -> Array:
    return answer_of(model, "momenta", (asked.q, asked.v), (len(asked.q), 9))


def _positions(model: Model, asked: AskedMotion) -> Array:
    """Anchors, and the columns of how the bodies are turned from where they stand at zero."""
    count = len(asked.joints)
    found, (at_zero,) = (answer_of(model, "positions", (q,), (len(q), count, 12)) for q in (asked.q, asked.zero))
    turned = np.einsum("njab,jcb->njca", found[:, :, 3:].reshape(-1, count, 3, 3), at_zero[:, 3:].reshape(-1, 3, 3))
    return np.concatenate([found[:, :, :3], turned.reshape(-1, count, 9)], axis=2)


def _velocities(model: Model, asked: AskedMotion) -> Array:
    return answer_of(model, "velocities", (asked.q, asked.v), (len(asked.q), len(asked.joints), 6))


def _jacobians(model: Model, asked: AskedMotion) -> Array:
    """By joint and velocity, linear before angular."""
    found = answer_of(model, "jacobians", (asked.q,), (len(asked.q), len(asked.joints), 6, asked.v.shape[1]))
    return np.ascontiguousarray(found.transpose(0, 1, 3, 2))


ENERGY = _quantity("energy", motion.energy, _energies)
MOMENTUM = _quantity("momentum", motion.momentum, _momenta)
POSITION = _quantity("position", motion.positions, _positions)
VELOCITY = _quantity("velocity", motion.velocities, _velocities)
JACOBIAN = _quantity("jacobian", motion.jacobians, _jacobians)
