"""The problem that Pinocchio documents for one step with dry friction and limits of joints and contacts in points, as laws of their rows.

Impulses x of a step h minimise 1/2 x' G x + g' x, where each lies in the set of its constraint: between the bounds of friction times h, or
above 0 for a limit. G is J M^-1 J' and a compliance, 0 by default; G x + g are the velocities of the rows after the step, for a limit
and its distance over h besides. With x = h f these are the conditions of forces f in their ranges with J qdd = aref where a range is
not used up, aref = -J v / h, and for a limit less its distance over h^2. What follows of a limit that is passed is the Baumgarte
corrector's Kp times its distance, and Kp is 0 by default.

The impulse of a contact in a point lies in Coulomb's cone K. By default, ``solve_ncp``, it solves a problem of complementarity, K > x
against s + Gamma(s) in the dual cone, s = G x + g and Gamma(s) = (0, 0, mu |s_T|): the normal impulse holds what would approach, and
friction is mu of it against what slides. With ``solve_ncp`` False the problem stays convex, and what slides parts; ADMM heeds the setting,
and PGS does not (docs/issues/pinocchio-pgs-at-uneven-contacts.md). The constraint models of a user have a compliance R,
``setCompliance``: with x = h f, forces of the convex problem are nearest to -R^-1 (J qdd - aref) in their sets, in the norm of R, which
is one for all rows. So they are those of rows that give, an elliptic cone with a ratio of impedances of 1; by default one that is not
associated. With R = 0 contacts have no forces of their own; they are asked with R = 2^-10 / kg in all rows wherever bodies touch. Both
points of a contact are one, so that no distance is felt. Linear velocities of free and planar joints are components along the axes of
their bodies.

Source: Pinocchio 4.1, examples/g1-constraint-simulation.py; constraints/joint-friction-constraint.hxx, setTimeStep (the problem in
impulses), joint-limit-constraint.hxx; baumgarte-corrector-parameters.hxx (Kp); algorithm/solvers (settings, solve_ncp),
algorithm/solvers/admm-solver.hxx (the problem with cones), constraint-solver-utils.hxx, DeSaxeCorrectionImpl (Gamma);
constraints/constraint-model-base.hxx, setCompliance.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from harness.files.equalities import Constraint, DryFriction, Limit
from harness.files.rules import ConstraintLaw, FrictionCone, Impedance
from harness.files.touching import ConeKind, Touch

# Of a step [s], near the example's millisecond; a power of 2, so that no rounding of it is in a law.
STEP = 2.0**-10
# R of all rows where bodies touch [1/kg].
COMPLIANCE = 2.0**-10
# The solvers that end where nothing changes any more, with tolerances of 0 and so many iterations: PGS if it is asked again (see
# docs/issues/pinocchio-pgs-stops-after-one-sweep.md), and of rows that give ADMM, if its penalty stays.
EXACT, EXACT_WITH_CONES, ITERATIONS = "PGS", "ADMM", 20_000
# Between a solver's name and that of another one for all rows where bodies touch.
AND = " and "
_RIGID = Impedance(1.0, 1.0, 0.0, 0.5, 1.0)
# The impedance at which R is A.
_HALF = Impedance(0.5, 0.5, 0.0, 0.5, 1.0)


def laws(constraints: Sequence[Constraint], is_convex: bool) -> Mapping[str, ConstraintLaw]:
    """By name, of those that are about joints, and of contacts in points, with which all give; ``is_convex``: of the convex problem."""
    found = {one.name: law for one in constraints if (law := _law(one, is_convex)) is not None}
    touches = any(isinstance(one.says, Touch) for one in constraints)
    return {name: _giving(law) for name, law in found.items()} if touches else found


def contacts(root: Any, model_format: str) -> tuple[ConeKind, str]:
    """See ``harness.engines.Engine``."""
    return ConeKind.ELLIPTIC, ""


def _law(constraint: Constraint, is_convex: bool) -> ConstraintLaw | None:
    says, law = constraint.says, ConstraintLaw(_RIGID, 0.0, damping=1 / STEP, weights=None, has_curvature=False, least_regularisation=0.0)
    if isinstance(says, Touch):
        cone = FrictionCone(tuple(map(float, says.friction)), 1.0, is_elliptic=True, is_associated=is_convex)
        return replace(law, is_contact=True, cone=cone)
    if not isinstance(says, DryFriction | Limit) or not isinstance(says.of, str):
        return None
    if isinstance(says, Limit):
        return replace(law, force_range=(0.0, math.inf), stiffness_ahead=1 / STEP**2)
    return replace(law, force_range=(-float(says.bound), float(says.bound)))


def _giving(law: ConstraintLaw) -> ConstraintLaw:
    """The same with R; the impedance is a factor of the stiffness."""
    ahead = None if law.stiffness_ahead is None else law.stiffness_ahead / _HALF.at_zero
    return replace(law, impedance=_HALF, weights=((),), least_regularisation=COMPLIANCE, stiffness_ahead=ahead, in_body=True)
