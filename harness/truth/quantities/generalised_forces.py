"""The mass matrix and generalised forces: what controllers take from an engine.

The mass matrix, bias and gravity of a loop are those of the tree that is left without its constraints. Its inverse dynamics are
not one vector: any force that the constraints bear may be added to the applied ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from harness.arrays import Array
from harness.engines import Model, NotOffered, answer_of
from harness.trees.quantities import forces
from harness.trees.quantities.tree_motion import Block, TreeMotion
from harness.truth.quantities import Quantity, Truth, TruthBasis
from harness.truth.quantities._file_truth import AskedMotion, FileTruth


def _quantity(name: str, blocks_of: Callable[[TreeMotion], Iterable[Block]], answer: Callable[[Model, AskedMotion], Array]) -> Quantity:
    return Quantity(name, lambda basis: FileTruth(basis, blocks_of, answer))


def _mass_matrix(model: Model, asked: AskedMotion) -> Array:
    if not hasattr(model, "mass_matrix") and hasattr(model, "terms"):
        still = np.zeros_like(asked.v)
        return np.asarray(model.terms(asked.q, still, still).mass)
    return answer_of(model, "mass_matrix", (asked.q,), (*asked.v.shape, asked.v.shape[1]))


def _gravity(model: Model, asked: AskedMotion) -> Array:
    if not hasattr(model, "gravity") and hasattr(model, "terms"):
        still = np.zeros_like(asked.v)
        return np.asarray(model.terms(asked.q, still, still).gravity)
    return answer_of(model, "gravity", (asked.q,), asked.v.shape)


def _bias(model: Model, asked: AskedMotion) -> Array:
    return answer_of(model, "bias", (asked.q, asked.v), asked.v.shape)


def _inverse_dynamics(model: Model, asked: AskedMotion) -> Array:
    return answer_of(model, "inverse_dynamics", (asked.q, asked.v, asked.qdd), asked.v.shape)


def _power(model: Model, asked: AskedMotion) -> Array:
    """Of the applied forces that the engine's inverse dynamics ask for, beside what springs and dampers do."""
    return np.asarray(np.einsum("nv,nv->n", asked.v, _inverse_dynamics(model, asked)))[:, None]


def _of_trees(
    basis: TruthBasis, blocks_of: Callable[[TreeMotion], Iterable[Block]], answer: Callable[[Model, AskedMotion], Array]
) -> Truth:
    if basis.mechanism.constraints is not None:
        raise NotOffered("the applied forces of a mechanism under constraints are not determined by its accelerations")
    return FileTruth(basis, blocks_of, answer)


MASS_MATRIX = _quantity("mass_matrix", forces.mass_matrix, _mass_matrix)
BIAS = _quantity("bias", forces.bias, _bias)
GRAVITY = _quantity("gravity", forces.gravity, _gravity)
INVERSE_DYNAMICS = Quantity("inverse_dynamics", lambda basis: _of_trees(basis, forces.inverse_dynamics, _inverse_dynamics))
POWER = Quantity("power", lambda basis: _of_trees(basis, forces.power_of_forces, _power))
