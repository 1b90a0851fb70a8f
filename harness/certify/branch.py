"""The configurations of a mechanism with constraints in float64, many at a time, on the branch of its assembly.

From the assembly the coordinates that no constraint determines move straight to their values in small steps. Newton's method keeps the
constraints closed, from where the tangent leads.

Source: Allgower, Georg, Introduction to Numerical Continuation Methods, chapter 2.
"""

from __future__ import annotations

import contextlib
import functools
import math

import numpy as np

from harness.arrays import Array
from harness.certify.forward_mode import values
from harness.equations.constraints import JACOBIAN, RESIDUAL
from harness.equations.mechanism import Mechanism
from harness.equations.states import States

# Of the way from the assembly, which is at most half a turn of each angle; more are taken where the first do not arrive.
STEPS = (32, 256)
# Of Newton's method: at the assembly, which is known to a few digits, and after a step along the tangent.
_FIRST_CORRECTIONS, _CORRECTIONS = 6, 2
# Largest change by the last correction, relative to the coordinate or 1, for which it has converged.
_CONVERGED = 1e-6
# Another branch is as far as two roots are from one another: a step that Newton's method corrects by much may have left its own. Of the
# step along the tangent, and the least that is much [m or rad].
_MUCH, _LEAST_MUCH = 0.5, 1e-3


class Branch:
    """The branch of one mechanism at its own parameters."""

    def __init__(self, mechanism: Mechanism) -> None:
        assert mechanism.constraints is not None
        self._mechanism, self._constraints = mechanism, mechanism.constraints
        self._holding = [row for row in self._constraints.independent if row < self._constraints.holonomic]
        self._others = [place for place in range(mechanism.nv) if place not in self._constraints.positions]

    def at(self, wanted: Array) -> Array:
        """The branch of the assembly at the coordinates of ``wanted`` that no row determines; NaN where it is lost."""
        found, left = wanted.copy(), np.arange(len(wanted))
        places = list(self._constraints.positions)
        if not places:
            return found
        for steps in STEPS:
            found[left[:, None], places] = self._continued(wanted[left], steps)
            left = left[~np.isfinite(found[left]).all(axis=1)]
            if not len(left):
                break
        return found

    def _continued(self, wanted: Array, steps: int) -> Array:
        """The determined positions, (n, m), after so many steps from the assembly."""
        places, others = list(self._constraints.positions), self._others
        q = np.tile(np.array(self._constraints.assembly), (len(wanted), 1))
        target = wanted.copy()
        for place in others:
            if self._turns[place]:
                # Whole turns change nothing, and the way would be long.
                away = np.arctan2(np.sin(wanted[:, place]), np.cos(wanted[:, place])) - q[0, place]
                target[:, place] = q[0, place] + away - 2 * math.pi * np.rint(away / (2 * math.pi))
        step = (target[:, others] - q[:, others]) / steps
        begun = q[:, others].copy()
        with np.errstate(all="ignore"):
            change = self._corrected(q, _FIRST_CORRECTIONS)
            for number in range(1, steps + 1):
                _, jacobian = self._rows_at(q)
                tangent = _solved(jacobian[:, :, places], np.einsum("nij,nj->ni", jacobian[:, :, others], step))
                q[:, places] -= tangent
                q[:, others] = begun + number * step if number < steps else target[:, others]
                change = self._corrected(q, _CORRECTIONS)
                q[change > np.maximum(_LEAST_MUCH, _MUCH * np.abs(tangent).max(axis=1))] = np.nan
            size = np.maximum(1.0, np.abs(q[:, places]).max(axis=1))
            final = self._corrected(q, 1)
        q[~(final <= _CONVERGED * size)] = np.nan
        return q[:, places]

    def _corrected(self, q: Array, count: int) -> Array:
        """Take ``count`` steps of Newton's method in place; the largest change of a position by the first of them, (n,)."""
        places, first = list(self._constraints.positions), np.empty(0)
        for number in range(count):
            residual, jacobian = self._rows_at(q)
            change = _solved(jacobian[:, :, places], residual)
            q[:, places] -= change
            first = np.abs(change).max(axis=1) if number == 0 else first
        return first

    def _rows_at(self, q: Array) -> tuple[Array, Array]:
        """What the holonomic rows that are not redundant leave, (n, m), and their Jacobian, (n, m, nv)."""
        still = np.zeros_like(q)
        inputs = self._mechanism.inputs(States(q, still, still, np.zeros(len(q))))
        found = values(self._constraints.placing, inputs)
        jacobian = found[JACOBIAN].reshape(len(self._constraints.rows), self._mechanism.nv, -1).transpose(2, 0, 1)
        return np.ascontiguousarray(found[RESIDUAL][self._holding].T), np.ascontiguousarray(jacobian[:, self._holding])

    @functools.cached_property
    def _turns(self) -> list[bool]:
        turning = set(self._constraints.program.turning)
        return [place in turning for place in range(self._mechanism.nv)]


def _solved(matrices: Array, columns: Array) -> Array:
    """The solutions, (n, m), of n systems; NaN where one has none."""
    finite = np.asarray(np.isfinite(matrices).all(axis=(1, 2)) & np.isfinite(columns).all(axis=1))
    if finite.all():
        # A singular one among them is rare, and looking for it costs as much as to solve all.
        with contextlib.suppress(np.linalg.LinAlgError):
            return np.asarray(np.linalg.solve(matrices, columns[:, :, None])[:, :, 0])
    determinants = np.asarray(np.linalg.det(np.where(finite[:, None, None], matrices, 0.0)))
    regular = np.flatnonzero(finite & (determinants != 0))
    found = np.full_like(columns, np.nan)
    found[regular] = np.linalg.solve(matrices[regular], columns[regular][:, :, None])[:, :, 0]
    return found
