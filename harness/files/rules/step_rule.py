"""One step of an integrator as an engine documents it, as plain data.

From positions q and velocities v under forces tau, a step of length h leads to q' and v'. With M a0 = f the equations of motion at the
start, f the sum of all forces, a rule of one stage is

    (M + h D + h^2 K) a = f - h K v,    v' = v + h a,    q' = q + h v',

D and K being derivatives of forces, by the velocities and by the positions with a minus sign, of those parts that the rule names: the
linearly implicit Euler method, and the semi-implicit one where they are empty. A rule with ``stages`` is an explicit Runge-Kutta method.
Positions that are rotations go along the exponential map: q + h v is the rotation q, followed by one about the body's own axes by the
vector h v. A Runge-Kutta method works in this vector, whose rate is v at the start alone.

Sources: Hairer, Wanner, Solving Ordinary Differential Equations II, 2nd ed., section IV.7 (linearly implicit methods); Munthe-Kaas,
High order Runge-Kutta methods on manifolds, Appl. Numer. Math. 29 (1999).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from fractions import Fraction

from harness.errors import InvalidRequest


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
    """

    name: str
    length: float
    implicit: frozenset[ImplicitPart] = frozenset()
    along_branches: bool = False
    with_old_velocities: bool = False
    stages: tuple[tuple[Fraction, ...], ...] = ()
    weights: tuple[Fraction, ...] = ()

    def __post_init__(self) -> None:
        one_stage = self.implicit or self.along_branches or self.with_old_velocities
        if self.stages and (one_stage or len(self.weights) != len(self.stages) + 1):
            raise InvalidRequest(f"the rule {self.name!r} has stages; expected a weight for each and the start, and nothing else")
