"""The configurations of a mechanism with constraints in float64, many at a time, on the branch of its assembly.

From the assembly the coordinates that no constraint determines move straight to their values in small steps. One step of Newton's method
closes the constraints from where the tangent leads; the Jacobian that it takes gives the next tangent too.

Source: Allgower, Georg, Introduction to Numerical Continuation Methods, chapter 2.
"""

from __future__ import annotations

import contextlib
import functools
import math

import numpy as np

from harness.arrays import Array
from harness.certify.configurations import Configurations
from harness.equations.constraints import JACOBIAN, RESIDUAL
from harness.equations.evaluation import values
from harness.equations.mechanism import Mechanism
from harness.equations.states import States

# Of the way from the assembly, which is at most half a turn of each angle; more are taken where the first do not arrive.
STEPS = (32, 256)
# Of Newton's method: at the assembly, which is known to a few digits and is closed once, and at the end of the way.
_FIRST_CORRECTIONS, _CORRECTIONS = 16, 2
# Largest change by the last correction, relative to the coordinate or 1, for which it has converged.
_CONVERGED = 1e-6
# Another branch is as far as two roots are from one another: a step that Newton's method corrects by much may have left its own. Of the
# step along the tangent, and the least that is much [m or rad].
_MUCH, _LEAST_MUCH = 0.5, 1e-3


class Branch:
    """The branch of one mechanism at its own parameters; ``loops`` go along it where they have code for its rows."""

    def __init__(self, mechanism: Mechanism, loops: Configurations | None) -> None:
        assert mechanism.constraints is not None
        self._mechanism, self._constraints = mechanism, mechanism.constraints
        self._holding = [row for row in self._constraints.independent if row < self._constraints.holonomic]
        self._others = [place for place in range(mechanism.nv) if place not in self._constraints.positions]
        self._follow = self._followed if loops is None else loops.follow

    def at(self, wanted: Array) -> Array:
        """The branch of the assembly at the coordinates of ``wanted`` that no row determines; NaN where it is lost."""
        found, left = wanted.copy(), np.arange(len(wanted))
        places = list(self._constraints.positions)
        if not places:
            return found
        target = self._nearest_turn(wanted)
        for steps in STEPS:
            found[left[:, None], places] = self._arrived(self._assembly, target[left], steps, _CORRECTIONS)
            left = left[~np.isfinite(found[left]).all(axis=1)]
            if not len(left):
                break
        return found

    @functools.cached_property
    def _assembly(self) -> Array:
        """The assembly, (nv,), with its rows closed; NaN where they cannot be."""
        q = np.array(self._constraints.assembly)
        q[list(self._constraints.positions)] = self._arrived(q, q[None, self._others], 0, _FIRST_CORRECTIONS)[0]
        return q

    def _nearest_turn(self, wanted: Array) -> Array:
        """The coordinates that no row determines, (n, others): whole turns change nothing, and the way would be long."""
        target = wanted[:, self._others]
        turning = set(self._constraints.program.turning)
        for column, place in enumerate(self._others):
            if place in turning:
                start = self._constraints.assembly[place]
                away = np.arctan2(np.sin(target[:, column]), np.cos(target[:, column])) - start
                target[:, column] = start + away - 2 * math.pi * np.rint(away / (2 * math.pi))
        return target

    def _arrived(self, begun: Array, target: Array, steps: int, corrections: int) -> Array:
        """The determined positions, (n, m), at the end of the way; NaN where Newton's method has not converged there."""
        found, last = self._follow(begun, target, steps, corrections, _MUCH, _LEAST_MUCH)
        with np.errstate(all="ignore"):
            found[~(last <= _CONVERGED * np.maximum(1.0, np.abs(found).max(axis=1)))] = np.nan
        return found

    def _followed(self, begun: Array, target: Array, steps: int, corrections: int, much: float, least_much: float) -> tuple[Array, Array]:
        """As ``Configurations.follow``, for any rows."""
        places, others = list(self._constraints.positions), self._others
        q = np.tile(begun, (len(target), 1))
        step = (target - begun[others]) / max(steps, 1)
        tangent = np.zeros((len(q), len(places)))
        with np.errstate(all="ignore"):
            for number in range(steps + 1):
                q[:, places] -= tangent
                q[:, others] = begun[others] + number * step if number < steps else target
                allowed = np.maximum(least_much, much * np.abs(tangent).max(axis=1)) if number else np.inf
                change, tangent = self._step(q, step)
                q[:, places] -= change
                q[~(np.abs(change).max(axis=1) <= allowed)] = np.nan
            for _ in range(corrections):
                change, _ = self._step(q, step)
                q[:, places] -= change
        return q[:, places], np.abs(change).max(axis=1)

    def _step(self, q: Array, step: Array) -> tuple[Array, Array]:
        """Of the determined positions, (n, m): what Newton's method takes from them, and a step of the others along the tangent."""
        still = np.zeros_like(q)
        found = values(self._constraints.placing, self._mechanism.inputs(States(q, still, still, np.zeros(len(q)))))
        rows = found[JACOBIAN].reshape(len(self._constraints.rows), self._mechanism.nv, -1).transpose(2, 0, 1)[:, self._holding]
        columns = found[RESIDUAL][self._holding].T, np.einsum("nij,nj->ni", rows[:, :, self._others], step)
        solution = _solved(rows[:, :, list(self._constraints.positions)], np.stack(columns, axis=2))
        return solution[:, :, 0], solution[:, :, 1]


def _solved(matrices: Array, columns: Array) -> Array:
    """The solutions, (n, m, k), of n systems; NaN where one has none."""
    finite = np.asarray(np.isfinite(matrices).all(axis=(1, 2)) & np.isfinite(columns).all(axis=(1, 2)))
    if finite.all():
        # A singular one among them is rare, and looking for it costs as much as to solve all.
        with contextlib.suppress(np.linalg.LinAlgError):
            return np.asarray(np.linalg.solve(matrices, columns))
    determinants = np.asarray(np.linalg.det(np.where(finite[:, None, None], matrices, 0.0)))
    regular = np.flatnonzero(finite & (determinants != 0))
    found = np.full_like(columns, np.nan)
    found[regular] = np.linalg.solve(matrices[regular], columns[regular])
    return found
