"""The problem that Drake documents for one discrete step with limits of joints and contacts in points, as laws of their rows.

Velocities v after a step of length h minimise 1/2 |v - v*|_A^2 and the costs of the constraints, A = M + h D and D the dampers of joints.
A limit at the distance g gives the impulse (v^ - J v)_+ / R, v^ = -g / (h + t) and R = max(b^2 / (4 pi^2) w, 1 / (h k (h + t))), with the
stiffness k, the time t of dissipation and b, from which a limit is nearly rigid. w is 1 / A_ii of its joint. The program leaves limits out
of a step, docs/issues/drake-limits-beyond-a-window.md.

A contact in a point at the depth g of overlap, by ``DiscreteContactApproximation.kSap``, gives the impulse that is nearest to
R^-1 (v^ - J v) in the cone of Coulomb's friction, in the norm of R = diag(R_t, R_t, R_n). Along the normal v^ = g / (h + t) and R_n is R
of a limit, with k = kA kB / (kA + kB) of both shapes, t = tA + tB and b = 1; R_t = s w. w is |J A_d^-1 J'|_F / 3, A_d the diagonal of A.
The friction of two shapes is 2 mA mB / (mA + mB).

Sources: Castro, Permenter, Han, An Unconstrained Convex Formulation of Compliant Contact, IEEE Transactions on Robotics 39 (2023), section
V; Drake v1.51.1, documentation of ``SapLimitConstraint``, of ``SapFrictionConeConstraint`` (the impulse, R, v^ and s), of
``MultibodyPlant``, "Accessing point contact parameters" (k, t and their defaults), of ``MultibodyPlantConfig`` (b of contacts) and of
``CalcContactFrictionFromSurfaceProperties``; ``SapDriver::AddLimitConstraints`` (k, t and b),
``SapModel::CalcDelassusDiagonalApproximation`` (w) ``SapDriver::CalcLinearDynamicsMatrix`` (A), and ``SapSolverParameters`` (where
the solver stops).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from harness.files.equalities import Constraint, Limit
from harness.files.rules import ConstraintLaw, FrictionCone, Impedance, StepRegularisation
from harness.files.touching import ConeKind, PointCompliance, Touch

# Of a step [s], near Drake's default of a millisecond; a power of 2, so that no rounding of it is in a law.
STEP = 2.0**-10
# Of a limit: k [N/m, or N m/rad], and b. t is the step.
_STIFFNESS, _NEAR_RIGID = 1e12, 0.1
# Of a contact: k [N/m] and t [s] of a shape that says none, b, and s.
STIFFNESS, RELAXATION_TIME = 1e6, 0.1
_NEAR_RIGID_CONTACT, _SLIDING = 1.0, 1e-3
# Of the momentum that the solver leaves, in J^1/2 and relative: SapSolverParameters.
ABSOLUTE, RELATIVE = 1e-14, 1e-6
# The impedance at which R is A.
_HALF = Impedance(0.5, 0.5, 0.0, 0.5, 1.0)


def laws(constraints: Sequence[Constraint]) -> Mapping[str, ConstraintLaw]:
    """By name, of limits of joints and of contacts in points."""
    found = {one.name: limit() for one in constraints if isinstance(one.says, Limit) and isinstance(one.says.of, str)}
    return found | {one.name: _touching(one.says, one.says.compliance) for one in constraints if isinstance(one.says, Touch)}


def contacts(root: Any, model_format: str) -> tuple[ConeKind, str]:
    """See ``harness.engines.Engine``."""
    return ConeKind.ELLIPTIC, ""


def combined(stiffness: Sequence[float], times: Sequence[float]) -> PointCompliance:
    """The compliance of a contact of two shapes, from that of each."""
    return PointCompliance(stiffness[0] * stiffness[1] / sum(stiffness), sum(times))


def combined_friction(one: float, other: float) -> float:
    return 2 * one * other / (one + other) if one + other else 0.0


def _touching(touch: Touch, compliance: PointCompliance | None) -> ConstraintLaw:
    assert compliance is not None
    length, way = STEP, STEP + compliance.relaxation_time
    near_rigid = _NEAR_RIGID_CONTACT * _NEAR_RIGID_CONTACT / (4 * math.pi * math.pi)
    return ConstraintLaw(
        impedance=_HALF,
        # The impedance is a factor of the stiffness.
        stiffness=1 / (length * way) / _HALF.at_zero,
        damping=1 / length,
        weights=None,
        has_curvature=False,
        least_regularisation=0.0,
        force_range=(-math.inf, math.inf),
        is_contact=True,
        # The ratio of impedances is that of each state.
        cone=FrictionCone(tuple(map(float, touch.friction)), 1.0, is_elliptic=True),
        of_step=StepRegularisation(length, near_rigid, 1 / (length * compliance.stiffness * way), sliding=_SLIDING),
    )


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
