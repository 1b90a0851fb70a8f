"""The mass matrix of a file in Newton, its weight, and its velocity terms: ``eval_mass_matrix`` and ``eval_inverse_dynamics_passive``.

They are of Newton's coordinates, in which a free joint moves by the velocity of its body's centre of mass, and are taken to those of the
harness.

Source: Newton documentation, ``newton.eval_inverse_dynamics_passive``.
"""

from __future__ import annotations

import itertools
from abc import abstractmethod
from collections.abc import Iterator
from typing import Any

import newton
import numpy as np
import warp

from harness.arrays import Array
from harness.engines.loaded_file import LoadedFile

BLOCK = 64


class NewtonQuantities(LoadedFile):
    """A file in ``BLOCK`` equal worlds; q and v are over the joints found, see ``harness.engines.interface``."""

    _model: Any
    _state: Any

    @abstractmethod
    def _own(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array, Array]:
        """Positions (n, nq), velocities and applied forces (n, nv) in Newton's coordinates."""

    @abstractmethod
    def _drift(self, positions: Array, velocities: Array) -> Array:
        """(n, nv) accelerations in Newton's coordinates, where those of the harness are zero."""

    @property
    def quantities(self) -> NewtonQuantities:
        return self

    def mass_matrix(self, q: Array) -> Array:
        """``eval_mass_matrix``, with rotor inertias."""
        moves = self._moves(q)
        found = [self._mass(positions) for positions in self._blocks(q, np.zeros((len(q), moves.shape[2])))]
        return np.asarray(moves.transpose(0, 2, 1) @ np.concatenate(found)[: len(q)] @ moves)

    def gravity(self, q: Array) -> Array:
        """``gravity_force``."""
        return self._forces(q, np.zeros((len(q), len(self.v_columns))), "gravity_force")

    def bias(self, q: Array, v: Array) -> Array:
        """``coriolis_force`` and ``gravity_force``."""
        positions, velocities, _ = self._own(q, v, np.zeros_like(v))
        drift, moves = self._drift(positions, velocities), self._moves(q)
        found = self._forces(q, v, "coriolis_force") + self._forces(q, v, "gravity_force")
        if drift.any():
            mass = np.concatenate([self._mass(one) for one in self._blocks(q, v)])[: len(q)]
            found = found + np.einsum("nkv,nkl,nl->nv", moves, mass, drift)
        return found

    def _moves(self, q: Array) -> Array:
        """(n, nv, velocities of the joints found) that takes the harness's velocities to Newton's at positions q."""
        units = np.eye(len(self.v_columns))
        columns = [self._own(q, np.tile(unit, (len(q), 1)), np.zeros((len(q), len(unit))))[1] for unit in units]
        return np.stack(columns, axis=2)

    def _forces(self, q: Array, v: Array, name: str) -> Array:
        """Forces of ``eval_inverse_dynamics_passive``, by the name of its argument, (n, velocities of the joints found)."""
        found = []
        for _ in self._blocks(q, v):
            force = warp.zeros(self._model.joint_dof_count, dtype=float, device="cpu")
            newton.eval_inverse_dynamics_passive(self._model, self._state, **{name: force})
            found.append(force.numpy().reshape(BLOCK, -1).astype(float))
        return np.asarray(np.einsum("nkv,nk->nv", self._moves(q), np.concatenate(found)[: len(q)]))

    def _blocks(self, q: Array, v: Array) -> Iterator[Array]:
        """The positions of each block of states, at which the worlds stand meanwhile."""
        for start in range(0, len(q), BLOCK):
            positions, velocities, _ = self._own(*(one[start : start + BLOCK] for one in (q, v, v)))
            with warp.ScopedDevice("cpu"):
                self._state.joint_q.assign(filled(positions))
                self._state.joint_qd.assign(filled(velocities))
                newton.eval_fk(self._model, self._state.joint_q, self._state.joint_qd, self._state)
                yield positions

    def _mass(self, positions: Array) -> Array:
        """(worlds, nv, nv) where the worlds stand, of all trees."""
        own = newton.eval_mass_matrix(self._model, self._state).numpy().astype(float)
        starts, velocities = (one.numpy().tolist() for one in (self._model.articulation_start, self._model.joint_qd_start))
        trees, width = self._model.articulation_count // BLOCK, self._model.joint_dof_count // BLOCK
        found = np.zeros((BLOCK, width, width))
        for tree, (first, end) in enumerate(itertools.pairwise(starts[: trees + 1])):
            place = slice(velocities[first], velocities[end])
            count = velocities[end] - velocities[first]
            found[:, place, place] = own[tree::trees, :count, :count]
        return found


def filled(values: Array) -> Any:
    """Numbers of all worlds in a row, in float32; worlds without a state have the first, as zeros are no quaternion."""
    full = np.concatenate([values, np.repeat(values[:1], BLOCK - len(values), axis=0)])
    return np.asarray(full.astype(np.float32).ravel())
