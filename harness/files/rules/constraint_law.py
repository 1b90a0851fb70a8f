"""The problem that an engine documents for a constraint that it does not hold rigid, as plain data.

The accelerations are then those of (M + J' D J) qdd = f + J' D aref, with the rows r of ``harness.files.equalities``, J = dr/dq and

- D_i = 1 / R_i, R_i = max((1 - d) / d A_i, ``least_regularisation``);
- aref = -b J v - k d r, and minus J' v (the derivative of J, times v) where ``has_curvature``;
- d, the impedance at |r|, the norm over all rows of the constraint.

Source: MuJoCo documentation, Computation, sections Constraint model and Solver parameters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class InverseWeight:
    """The mean of the diagonal of J M^-1 J' in the file's zero position.

    J is that of the "translation" of the centre of mass or of the "rotation" of the body ``of``, of the velocities of the "joint"
    or of the length of the "tendon" of that name.
    """

    kind: Literal["translation", "rotation", "joint", "tendon"]
    of: str


@dataclass(frozen=True)
class Impedance:
    """d from ``least`` at distance 0 to ``most`` at ``width`` [m or rad] and beyond, by two powers that meet at ``midpoint`` of it."""

    least: float
    most: float
    width: float
    midpoint: float
    power: float

    def at(self, distance: float) -> float:
        """The impedance at a distance of 0 or more [m or rad]."""
        if self.is_constant:
            return (self.least + self.most) / 2
        x = min(distance / self.width, 1.0)
        if x <= self.midpoint:
            y = math.pow(x, self.power) / math.pow(self.midpoint, self.power - 1)
        else:
            y = 1 - math.pow(1 - x, self.power) / math.pow(1 - self.midpoint, self.power - 1)
        return self.least + y * (self.most - self.least)

    @property
    def is_constant(self) -> bool:
        """True where the distance does not matter; d is then the mean of ``least`` and ``most``."""
        return self.least == self.most or self.width <= LEAST_WIDTH


@dataclass(frozen=True)
class ConstraintLaw:
    """How soft one constraint is.

    Attributes:
        impedance: d. stiffness: k [1/s^2]. damping: b [1/s].
        weights: for each row the parts whose sum is A_i, an empty sum being 0; None where A_i is the diagonal of J M^-1 J' at the state.
        has_curvature: whether aref takes account of the change of J along the motion.
        least_regularisation: least R_i.
    """

    impedance: Impedance
    stiffness: float
    damping: float
    weights: tuple[tuple[InverseWeight, ...], ...] | None
    has_curvature: bool
    least_regularisation: float


# Of an impedance; the engine's least number.
LEAST_WIDTH = 1e-15
