"""Points in which bodies touch at one state, as whoever looked for them found them: what rows need of a contact.

Source: MuJoCo documentation, Computation, sections Contact and Friction cones.
"""

from __future__ import annotations

import functools
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from fractions import Fraction

from harness.files.given import Given, Vector


class ConeKind(StrEnum):
    """The forces that friction lets a contact have; of a contact without friction both are the same."""

    PYRAMIDAL = "pyramidal"
    ELLIPTIC = "elliptic"


@dataclass(frozen=True)
class PointCompliance:
    """The linear Kelvin-Voigt law of a point in which bodies touch: stiffness [N/m] and relaxation time [s] of both together."""

    stiffness: float
    relaxation_time: float


@dataclass(frozen=True)
class Touch:
    """Two bodies touch in a point; all in the world's frame.

    Its rows are the relative motion of the second body against the first along the axes of its frame and about them, in the order normal,
    first and second tangent, about the normal, about the tangents; of a pyramid the sums and differences of that along the normal and
    each other one times its coefficient of friction.

    Attributes:
        bodies: the first and the second. point: where [m].
        frame: unit vectors: the normal from the first body to the second, and two tangents.
        distance: of the surfaces, negative where they overlap [m]. margin: the distance below which they push [m].
        friction: a coefficient for each motion beside that along the normal, of turns in metres; none, 2, 3 or 5.
        sliding: ``solref`` of the rows that friction acts in, of an elliptic cone; (0, 0) for that of the normal.
        compliance: how it gives, by the law of an engine whose contacts have no ``solref``; None for others.
    """

    bodies: tuple[str, str]
    point: Vector
    frame: tuple[Vector, Vector, Vector]
    distance: Fraction
    margin: Fraction
    friction: tuple[Fraction, ...]
    cone: ConeKind
    sliding: tuple[float, float] = (0.0, 0.0)
    compliance: PointCompliance | None = None

    @property
    def is_elliptic(self) -> bool:
        """True where its force lies in a round cone; without friction it lies on a ray."""
        return bool(self.friction) and self.cone is ConeKind.ELLIPTIC

    @functools.cached_property
    def measured(self) -> tuple[Fraction, ...]:
        """The numbers that whoever looked for the point found at one state alone."""
        return *self.point, *(number for axis in self.frame for number in axis), self.distance, self.margin

    @functools.cached_property
    def numbers(self) -> tuple[float, ...]:
        """Those of ``measured`` that are of the contact itself."""
        return tuple(float(number) for number in self.measured if isinstance(number, Given))

    @functools.cached_property
    def structure(self) -> Hashable:
        """Equal for contacts whose rows differ in the measured numbers alone, each of which is 0 for all or for none."""
        # A number of 0 is none of a program.
        is_there = tuple(number.numerator != 0 for number in self.measured)
        return self.bodies, tuple(map(float, self.friction)), self.cone, self.sliding, self.compliance, is_there

    @property
    def directions(self) -> Sequence[tuple[Vector, bool]]:
        """The axis of each motion that friction resists, and whether it is about the axis."""
        first, *tangents = self.frame
        return [*((axis, False) for axis in tangents), *((axis, True) for axis in (first, *tangents))][: len(self.friction)]
