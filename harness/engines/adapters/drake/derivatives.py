"""Drake's derivatives of its algorithms by automatic differentiation: a ``MultibodyPlant_[AutoDiffXd]``, whose numbers carry derivatives.

Positions move along the velocities of the harness: a ball joint turns about the axes of its body, and a free joint besides moves along
the axes of its parent. Drake has angular velocities along the axes of the parent. With R the rotation of the body, moved by a turn d
about its own axes, what Drake is given and what is made of its answer have the derivatives

    d(R x) = R (d x x),    d(R' y) = (R' y) x d,

and Drake's rates of its positions, linear in its velocities, give those of the positions themselves.

Source: Drake documentation, ``System.ToAutoDiffXd``, ``MultibodyPlant.MapVelocityToQDot``, ``MultibodyPlant.CalcInverseDynamics``.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.multibody.tree import MultibodyForces_

from harness.arrays import Array
from harness.engines.coordinates import Columns, cross_matrix

# Of one state, as Drake has it: q, v, and tau or accelerations, and the matrix that takes Drake's accelerations to those of the harness.
Own = tuple[Array, Array, Array, Array]


class DifferentiatedPlant:
    """A finalized plant in continuous time beside its copy of numbers with derivatives; ``columns`` are those of the harness."""

    def __init__(self, plant: Any, columns: Columns) -> None:
        self._plant, self._columns, self._context = plant, columns, plant.CreateDefaultContext()
        self._dual = plant.ToAutoDiffXd()
        self._dual_context = self._dual.CreateDefaultContext()

    def forward(self, states: Iterable[Own]) -> Array:
        """Derivatives of accelerations by q, v and tau, (n, 3, nv, nv)."""
        plant, context = self._dual, self._dual_context
        force, acceleration = plant.get_applied_generalized_force_input_port(), plant.get_generalized_acceleration_output_port()
        found = []
        for state in states:
            force.FixValue(context, self._place(state))
            found.append(self._derivatives(acceleration.Eval(context), state))
        return np.array(found)

    def inverse(self, states: Iterable[Own]) -> Array:
        """Derivatives of applied forces by q, v and the accelerations, (n, 3, nv, nv), with springs and dampers."""
        plant, context, found = self._dual, self._dual_context, []
        for state in states:
            accelerations = self._place(state)
            forces = MultibodyForces_[AutoDiffXd](plant)
            plant.CalcForceElementsContribution(context, forces)
            found.append(self._derivatives(plant.CalcInverseDynamics(context, accelerations, forces), state))
        return np.array(found)

    def _place(self, state: Own) -> Any:
        """The third vector with its derivatives, after positions and velocities are set with theirs."""
        positions, velocities, third, turn = state
        self._plant.SetPositions(self._context, positions)
        # The map as a sparse matrix needs SciPy.
        rates = np.column_stack([self._plant.MapVelocityToQDot(self._context, column) for column in turn])
        none = np.zeros_like(turn.T)
        moved, faster, stronger = (
            InitializeAutoDiff(values, np.hstack(by)).ravel()
            for values, by in (
                (positions, (rates, np.zeros_like(rates), np.zeros_like(rates))),
                (velocities, (-turn.T @ self._crosses(turn @ velocities), turn.T, none)),
                (third, (-turn.T @ self._crosses(turn @ third), none, turn.T)),
            )
        )
        self._dual.SetPositions(self._dual_context, moved)
        self._dual.SetVelocities(self._dual_context, faster)
        return stronger

    def _derivatives(self, answer: Any, state: Own) -> Array:
        """(3, nv, nv) of an answer in Drake's velocities, with its derivatives."""
        turn, nv = state[3], self._columns.nv
        found: Array = (turn @ ExtractGradient(answer)).reshape(nv, 3, nv).transpose(1, 0, 2)
        found[0] += self._crosses(turn @ ExtractValue(answer).ravel())
        return found

    def _crosses(self, components: Array) -> Array:
        """The matrix (nv, nv) that takes the turns of bodies to the product of their angular ``components`` (nv,) with them."""
        found = np.zeros((self._columns.nv, self._columns.nv))
        for name, (nq, nv) in self._columns.sizes.items():
            if nq > nv:
                end = self._columns.spans(name)[1].stop
                found[end - 3 : end, end - 3 : end] = cross_matrix(components[end - 3 : end])
        return found
