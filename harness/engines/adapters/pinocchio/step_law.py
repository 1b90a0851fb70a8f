"""The problem that Pinocchio documents for one step with dry friction and limits of joints, as laws of their rows.

Impulses x of a step h minimise 1/2 x' G x + g' x, where each lies in the set of its constraint: between the bounds of friction times h, or
above 0 for a limit. G is J M^-1 J' and a compliance, 0 by default; G x + g are the velocities of the rows after the step, for a limit
and its distance over h besides. With x = h f these are the conditions of forces f in their ranges with J qdd = aref where a range is
not used up, aref = -J v / h, and for a limit less its distance over h^2. What follows of a limit that is passed is the Baumgarte
corrector's Kp times its distance, and Kp is 0 by default.

Contacts in points are not asked about. By default their problem is that of complementarity, which has no optimum that certifies it. The
convex one, ``solve_ncp`` being False, is solved by ADMM alone, see docs/issues/pinocchio-pgs-at-uneven-contacts.md.

Source: Pinocchio 4.1, examples/g1-constraint-simulation.py; constraints/joint-friction-constraint.hxx, setTimeStep (the problem in
impulses), joint-limit-constraint.hxx; baumgarte-corrector-parameters.hxx (Kp); algorithm/solvers (settings).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from harness.files.equalities import Constraint, DryFriction, Limit
from harness.files.rules import ConstraintLaw, Impedance

# Of a step [s], near the example's millisecond; a power of 2, so that no rounding of it is in a law.
STEP = 2.0**-10
# The solver that ends where nothing changes any more, with tolerances of 0 and so many iterations, if it is asked again (see
# docs/issues/pinocchio-pgs-stops-after-one-sweep.md). ADMM does not end there with limits.
EXACT, ITERATIONS = "PGS", 20_000
_RIGID = Impedance(1.0, 1.0, 0.0, 0.5, 1.0)


def laws(constraints: Sequence[Constraint]) -> Mapping[str, ConstraintLaw]:
    """By name, of those that are about joints."""
    return {one.name: law for one in constraints if (law := _law(one)) is not None}


def _law(constraint: Constraint) -> ConstraintLaw | None:
    says = constraint.says
    if not isinstance(says, DryFriction | Limit) or not isinstance(says.of, str):
        return None
    is_limit = isinstance(says, Limit)
    return ConstraintLaw(
        impedance=_RIGID,
        stiffness=0.0,
        damping=1 / STEP,
        weights=None,
        has_curvature=False,
        least_regularisation=0.0,
        force_range=(0.0, float("inf")) if is_limit else (-float(says.bound), float(says.bound)),
        stiffness_ahead=1 / STEP**2 if is_limit else None,
    )
