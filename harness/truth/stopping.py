"""The momentum that an engine's solver of a step leaves, beside the one by which it documents that it stops.

Source: ``harness.engines.request.StopRule``.
"""

from __future__ import annotations

import numpy as np

from harness.arrays import Array
from harness.engines.request import StopRule
from harness.programs.evaluation import values
from harness.programs.mechanisms.descent import left_at
from harness.programs.mechanisms.mechanism import RESIDUAL
from harness.programs.states import States
from harness.truth.declared import DeclaredMechanism, alone


def share_of_rule(mechanism: DeclaredMechanism, states: States, numbers: Array | None, answers: Array, rule: StopRule) -> Array:
    """(n,) the momentum that accelerations over a step leave, (n, nv), as a share of what the rule lets them.

    Infinite where no row is in the problem, so that no solver goes, and of what is no step's. ``numbers`` are the parameters of each
    state, (n, parameters), where they are not those of the mechanism. All is in float64.
    """
    length = next((law.of_step.length for _, law in mechanism.laws if law.of_step is not None), None)
    if length is None or mechanism.zones is None or mechanism.problem is None or mechanism.softened is None:
        return np.full(len(states), np.inf)
    found = mechanism.parameters_at(states, numbers)
    inputs, of_rows = mechanism.inputs(states, found), alone(mechanism.softened, RESIDUAL)
    (residuals,) = values(of_rows, inputs[: len(of_rows.inputs)]).values()
    ranges = mechanism.ranges_at(mechanism.zones, states, found, residuals.T)
    metric, derivative, pushed = left_at(mechanism.zones, mechanism.problem, inputs, ranges, found, answers)
    scale = 1 / np.sqrt(np.diagonal(metric, axis1=1, axis2=2))
    after = np.einsum("nij,nj->ni", metric, states.v + length * answers)
    left, whole, impulses = (np.linalg.norm(scale * one, axis=1) for one in (length * derivative, after, length * pushed))
    is_solved = bool(mechanism.zones.cones) | (ranges[1] > 0).any(axis=1)
    return np.asarray(np.where(is_solved, left / (rule.absolute + rule.relative * np.maximum(whole, impulses)), np.inf))
