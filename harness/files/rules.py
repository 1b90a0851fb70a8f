"""Laws that engines document of constraints which they do not hold rigid, and of one step of their integrators, as plain data.

Accelerations under a ``ConstraintLaw`` are those of (M + J' D J) qdd = f + J' D aref, with the rows r of ``harness.files.equalities``,
J = dr/dq and

- D_i = 1 / R_i, R_i = max((1 - d) / d A_i, ``least_regularisation``);
- aref = -b J v - k d r, and minus J' v (the derivative of J, times v) where ``has_curvature``; with ``in_body`` plus J (w x v), see
  ``harness.trees.turning``;
- d, the impedance at |r|, the norm over all rows of the constraint.

A row whose force has a ``force_range`` gives D (aref - J qdd) within it, and its bound beyond: dry friction within its bound on both
sides, a limit above 0 alone. A row that pushes alone is there where r < 0, and nowhere else, but for a law with ``stiffness_ahead``.

A law with d = 1 at all distances has R_i = ``least_regularisation``, which may be 0: J qdd = aref then, as far as the force of the row
goes in its range. All laws of a mechanism are of this kind, or none is.

A law ``of_step`` is one of a step of length h that is linearly implicit: M h a + h^2 D a = h f, D the dampers of joints, beside rows by
J (v + h a). Its metric is A = M + h D in the place of M, and with the diagonal A_d of A and the norm w = |J A_d^-1 J'|_F / n over the
n rows of the constraint, A_i = max(``near_rigid`` w, ``least``) is R_i, d being 1/2. A contact whose friction a step regularises has that
R_1, and R_j = ``sliding`` w across the normal: the ratio of impedances is R_1 / R_2 then, which each state has of its own.

The rows of a contact with friction have one impedance, that of its distance, and one R_1 of the row along the normal, from which those
of the others follow with the coefficients mu of friction and the ratio i of impedances: of a pyramid, whose edges push alone, all are
2 mu_1^2 / i R_1, where A_1 is (1 + mu_1^2) times the sum of its weights. Of an elliptic cone R_2 = R_1 / i and
R_j mu_j-1^2 = R_2 mu_1^2; with mu = mu_1 / sqrt(i), N = mu y_1, U_j = mu_j-1 y_j and T = |U|, y = J qdd - aref, the cost is half the
square of the distance to the dual cone: 0 where N >= mu T, that of rows without a range where mu N + T <= 0, and else
(N - mu T)^2 / (2 R_1 mu^2 (1 + mu^2)).

Of a cone that is not associated the force is that of Coulomb's law, which is no derivative of a cost: the row along the normal pushes by
itself, f_1 = max(-y_1, 0) / R_1, and the others give -y_j / R_j where mu N + T <= 0, and else -mu_j-1 f_1 U_j / T. With the velocities
R f + y of rows that give these are the conditions of complementarity of De Saxce and Feng; what they have for a solution need not be one.

By a ``StepRule``, from positions q and velocities v under forces tau, a step of length h leads to q' and v'. With M a0 = f the equations
of motion at the start, f the sum of all forces, a rule of one stage is

    (M + h D + h^2 K) a = f - h K v,    v' = v + h a,    q' = q + h v',

D and K being derivatives of forces, by the velocities and by the positions with a minus sign, of those parts that the rule names: the
linearly implicit Euler method, and the semi-implicit one where they are empty. A rule with ``stages`` is an explicit Runge-Kutta method.
Positions that are rotations go along the exponential map: q + h v is the rotation q, followed by one about the body's own axes by the
vector h v. A Runge-Kutta method works in this vector, whose rate is v at the start alone.

Sources: MuJoCo documentation, Computation, sections Constraint model, Solver parameters and Friction cones, and MuJoCo 4.0,
engine_core_constraint.c (mj_makeImpedance, mj_constraintUpdate), for R of cones and the three zones; Hairer, Wanner, Solving Ordinary
Differential Equations II, 2nd ed., section IV.7 (linearly implicit methods); De Saxce, Feng, The bipotential method, Mathl. Comput.
Modelling 28 (1998), for cones that are not associated; Munthe-Kaas, High order Runge-Kutta methods on manifolds,
Appl. Numer. Math. 29 (1999).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from fractions import Fraction
from typing import Literal

from harness.errors import InvalidRequest

# Of an impedance; the engine's least number, and between which impedances lie (mjMINIMP, mjMAXIMP).
LEAST_WIDTH, LEAST_IMPEDANCE, MOST_IMPEDANCE = 1e-15, 0.0001, 0.9999


@dataclass(frozen=True)
class InverseWeight:
    """The mean of the diagonal of J M^-1 J' in the file's zero position.

    J is that of the "translation" of the centre of mass or of the "rotation" of the body ``of``, of the velocities of the "joint",
    of a free one the linear ones and by "turn" the angular ones, or of the length of the "tendon" of that name. A body without mass has its
    own origin for its centre. As no documentation has it, it is 1/m of the body, of the kind "mass", and of the kind "position" that of the
    translation of the point which the body's position in its parent is in its own frame.
    """

    kind: Literal["translation", "rotation", "joint", "turn", "tendon", "mass", "position"]
    of: str


@dataclass(frozen=True)
class Impedance:
    """d from ``least`` at distance 0 to ``most`` at ``width`` [m or rad] and beyond, by two powers that meet at ``midpoint`` of it."""

    least: float
    most: float
    width: float
    midpoint: float
    power: float

    @property
    def at_zero(self) -> float:
        """The impedance at distance 0."""
        return (self.least + self.most) / 2 if self.is_constant else self.least

    @property
    def is_constant(self) -> bool:
        """True where the distance does not matter; d is then the mean of ``least`` and ``most``."""
        return self.least == self.most or self.width <= LEAST_WIDTH


@dataclass(frozen=True)
class FrictionCone:
    """The forces of a contact.

    Attributes:
        friction: mu_j. impedance_ratio: i. is_elliptic: whether the cone is round. sliding_damping: b of the rows across the normal of an
            elliptic cone [1/s]; None for that of the normal. is_associated: whether what slides also parts, as at the optimum of a convex
            problem, in place of Coulomb's law; of an elliptic cone of one coefficient and a ratio of 1.
    """

    friction: tuple[float, ...]
    impedance_ratio: float
    is_elliptic: bool
    sliding_damping: float | None = None
    is_associated: bool = True


@dataclass(frozen=True)
class StepRegularisation:
    """R of the rows of one step.

    Attributes:
        length: h [s]. near_rigid: the least share of w in R. least: R of what gives by its own stiffness and dissipation [1/kg, or
            1/(kg m^2)].
        window: of the way that v or v* leads in the step, how far from a limit its row is left out; by default at no distance.
        sliding: share of w that R of the rows across the normal of a contact is; None of constraints without such rows.
    """

    length: float
    near_rigid: float
    least: float
    window: float = math.inf
    sliding: float | None = None


@dataclass(frozen=True)
class ConstraintLaw:
    """Softness of one constraint.

    Attributes:
        impedance: d. stiffness: k [1/s^2]. damping: b [1/s].
        weights: for each row the parts whose sum is A_i, an empty sum being 0; None where A_i is the diagonal of J M^-1 J' at the state.
        has_curvature: whether aref takes account of the change of J along the motion. in_body: whether it is of a step in which linear
            velocities of free and planar joints are components along the axes of their bodies, which turn.
        least_regularisation: least R_i.
        force_range: the least and the largest force of each row [N or N m].
        is_contact: whether it is of a point in which bodies touch, whose impedance is that of its first row.
        cone: of a contact with friction, whose ``weights`` are those of its row along the normal alone.
        stiffness_ahead: k where r >= 0, of a row that pushes alone and is there before its limit is reached; None for one that is not.
        of_step: of a step, see above; None for a law at an instant. All laws of a mechanism are of one step, or none is.
    """

    impedance: Impedance
    stiffness: float
    damping: float
    weights: tuple[tuple[InverseWeight, ...], ...] | None
    has_curvature: bool
    least_regularisation: float
    force_range: tuple[float, float] = (-math.inf, math.inf)
    is_contact: bool = False
    cone: FrictionCone | None = None
    stiffness_ahead: float | None = None
    of_step: StepRegularisation | None = None
    in_body: bool = False

    @property
    def pushes_alone(self) -> bool:
        return self.force_range[0] == 0.0

    @property
    def rubs(self) -> bool:
        """True for a law of dry friction."""
        return -math.inf < self.force_range[0] < 0.0

    @property
    def has_cost(self) -> bool:
        """True where its forces are those of a convex cost, so that one acceleration alone is right."""
        return self.cone is None or self.cone.is_associated

    @property
    def is_rigid(self) -> bool:
        """True for a law whose rows have no softness but ``least_regularisation``."""
        return self.impedance.least == self.impedance.most == 1.0

    @property
    def is_of_an_instant(self) -> bool:
        """True for rigid dry friction and limits that ask nothing of velocities: these decide which forces there may be."""
        return self.is_rigid and self.damping == 0.0 and self.force_range != ConstraintLaw.force_range


def rigid_law(force_range: tuple[float, float]) -> ConstraintLaw:
    """The law of rigid dry friction, or of a rigid stop, whose force lies in this range."""
    return ConstraintLaw(Impedance(1.0, 1.0, 0.0, 0.5, 1.0), 0.0, 0.0, None, True, 0.0, force_range)


class ImplicitPart(StrEnum):
    """A part of the forces that a rule may take implicitly.

    ``JOINT_DAMPERS`` and ``JOINT_SPRINGS`` act in joints. ``LINE_DAMPERS`` and ``LINE_SPRINGS`` act on lengths: those between two points,
    and sums of joint positions; the second derivatives of lengths are in no rule. ``VELOCITY_TERMS`` are centripetal, Coriolis and
    gyroscopic forces; ``VELOCITY_TERMS_OF_FREE_BODIES`` those of bodies that float and carry none.
    """

    JOINT_DAMPERS = "joint dampers"
    LINE_DAMPERS = "line dampers"
    VELOCITY_TERMS = "velocity terms"
    VELOCITY_TERMS_OF_FREE_BODIES = "velocity terms of free bodies"
    JOINT_SPRINGS = "joint springs"
    LINE_SPRINGS = "line springs"


@dataclass(frozen=True)
class StepRule:
    """The rule of one integrator.

    Attributes:
        name: as the engine has it.
        length: of a step [s], which the model file states, or the engine's default.
        implicit: the parts that D and K hold the derivatives of.
        along_branches: whether D leaves out what one velocity does to another that moves none of the same bodies.
        with_old_velocities: whether positions follow with v in the place of v', as in the explicit Euler method.
        stages, weights: of an explicit Runge-Kutta method, of each stage but the first the weights of those before it; () for rules of
            one stage.
        limited: the law of each limit of a joint, one of a step, of an engine whose steps have them on always; None of others.
    """

    name: str
    length: float
    implicit: frozenset[ImplicitPart] = frozenset()
    along_branches: bool = False
    with_old_velocities: bool = False
    stages: tuple[tuple[Fraction, ...], ...] = ()
    weights: tuple[Fraction, ...] = ()
    limited: ConstraintLaw | None = None

    def __post_init__(self) -> None:
        one_stage = self.implicit or self.along_branches or self.with_old_velocities
        if self.stages and (one_stage or len(self.weights) != len(self.stages) + 1):
            raise InvalidRequest(f"the rule {self.name!r} has stages; expected a weight for each and the start, and nothing else")
