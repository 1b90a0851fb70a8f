"""The problem that Drake documents for one discrete step with limits of joints, as laws of their rows.

Velocities v after a step of length h minimise 1/2 |v - v*|_A^2 and the costs of the constraints, A = M + h D and D the dampers of joints.
A limit at the distance g gives the impulse (v^ - J v)_+ / R, v^ = -g / (h + t) and R = max(b^2 / (4 pi^2) w, 1 / (h k (h + t))), with the
stiffness k, the time t of dissipation and b, from which a limit is nearly rigid. w is 1 / A_ii of its joint. The program leaves limits out
of a step, docs/issues/drake-limits-beyond-a-window.md.

Source: Castro, Permenter, Han, An Unconstrained Convex Formulation of Compliant Contact, IEEE Transactions on Robotics 39 (2023), section
V; Drake v1.51.1, documentation of ``SapLimitConstraint``; ``SapDriver::AddLimitConstraints`` (k, t and b),
``SapModel::CalcDelassusDiagonalApproximation`` (w) and ``SapDriver::CalcLinearDynamicsMatrix`` (A).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from harness.files.equalities import Constraint, Limit
from harness.files.rules import ConstraintLaw, Impedance, StepRegularisation

# Of a step [s], near Drake's default of a millisecond; a power of 2, so that no rounding of it is in a law.
STEP = 2.0**-10
# Of a limit: k [N/m, or N m/rad], and b. t is the step.
_STIFFNESS, _NEAR_RIGID = 1e12, 0.1
# The impedance at which R is A.
_HALF = Impedance(0.5, 0.5, 0.0, 0.5, 1.0)


def laws(constraints: Sequence[Constraint]) -> Mapping[str, ConstraintLaw]:
    """By name, of limits of joints."""
    return {one.name: limit() for one in constraints if isinstance(one.says, Limit) and isinstance(one.says.of, str)}


def limit(length: float = STEP) -> ConstraintLaw:
    """The law of a limit in a step of this length [s]."""
    # The impedance is a factor of the stiffness.
    stiffness = 1 / (length * 2 * length) / _HALF.at_zero
    return ConstraintLaw(
        impedance=_HALF,
        stiffness=stiffness,
        damping=1 / length,
        weights=None,
        has_curvature=False,
        least_regularisation=0.0,
        force_range=(0.0, math.inf),
        stiffness_ahead=stiffness,
        of_step=StepRegularisation(length, _NEAR_RIGID * _NEAR_RIGID / (4 * math.pi * math.pi), 1 / (length * _STIFFNESS * 2 * length)),
    )
