"""Directions in which surfaces at rest on one another begin to slide, where a slip has two components.

Friction against the unit direction d adds -mu n d to the force n along the normal, and n solves an equation linear in d:

    n D(d) = n0,    D(d) = 1 + mu (n1 . d),    s'(d) D(d) = s0 D(d) - mu n0 S d

for the acceleration s' of the slip. Sliding is consistent where s' is a multiple of d that is not negative, and n is none either. In the
angle of d both are trigonometric polynomials of second degree; the circle is halved until each part is without such a direction, or holds
one, by the interval Newton test.

Sources: Pfeiffer, Glocker, Multibody Dynamics with Unilateral Contacts, section 5.3 (spatial friction); Moore, Kearfott, Cloud,
Introduction to Interval Analysis, section 8.1 (interval Newton method).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

Direction = tuple[Any, ...]
# More than a turn of angles, whose ends and halves are no angles that mechanisms have; parts of it are not halved further below a width.
_FROM, _TO, _LEAST = -3.7, 3.9, 2.0**-40
# Newton's test of a part takes in its neighbourhood, for a direction may lie where two parts meet; its steps at a direction double digits.
_INFLATED, _STEPS = 1.25, 8


@dataclass(frozen=True)
class BeginningSlide:
    """A contact whose slip is zero, in balls.

    Attributes:
        friction: coefficient mu. free: n0, the normal force without friction; shares: (2,), n1.
        slip: (2,), s0, the acceleration of the slip without friction; yields: (2, 2), S, that of a force against it.
    """

    friction: Any
    free: Any
    shares: Sequence[Any]
    slip: Sequence[Any]
    yields: Sequence[Sequence[Any]]

    def directions(self) -> list[Direction]:
        """All unit directions of a consistent slide, in balls; one may be told twice.

        Raises:
            ValueError: the directions are not isolated.
        """
        import flint

        if all(0 in one for one in (*self.slip, self.friction * self.free)):
            # No force moves it, so that it stays at rest.
            return []
        return [(angle.cos(), angle.sin()) for angle in self._angles(flint.arb(_FROM), flint.arb(_TO))]

    def _angles(self, low: Any, high: Any) -> Iterator[Any]:
        import flint

        middle, radius = (low + high) / 2, (high - low) / 2
        part = flint.arb(middle.mid(), radius)
        if self._is_without(part):
            return
        around = flint.arb(middle.mid(), _INFLATED * radius)
        found = self._newton(around)
        if not found.is_finite() or (found.overlaps(part) and not around.contains_interior(found)):
            if radius < _LEAST:
                raise ValueError("the directions in which a contact begins to slide are not isolated")
            yield from self._angles(low, middle)
            yield from self._angles(middle, high)
        elif found.overlaps(part):
            for _ in range(_STEPS):
                found = self._newton(found)
            if not self._is_without(found):
                yield found

    def _newton(self, angle: Any) -> Any:
        """The angles of ``angle`` at which the slide may be along itself, by Newton's step from its middle."""
        middle = angle.mid()
        return middle - self._across(middle) / self._slope(angle)

    def _is_without(self, angle: Any) -> bool:
        """True where certainly no angle of a ball is consistent."""
        if 0 not in self._across(angle):
            return True
        d, slide = (angle.cos(), angle.sin()), self._slide(angle)
        lessened = self._lessened(d)
        return bool(self.free / lessened < 0 or (d[0] * slide[0] + d[1] * slide[1]) / lessened < 0)

    def _lessened(self, d: Direction) -> Any:
        return 1 + self.friction * (self.shares[0] * d[0] + self.shares[1] * d[1])

    def _slide(self, angle: Any) -> list[Any]:
        """s' D at an angle."""
        d = angle.cos(), angle.sin()
        given = self.friction * self.free
        return [s * self._lessened(d) - given * (row[0] * d[0] + row[1] * d[1]) for s, row in zip(self.slip, self.yields, strict=True)]

    def _across(self, angle: Any) -> Any:
        """The part of s' D across the direction."""
        slide = self._slide(angle)
        return angle.cos() * slide[1] - angle.sin() * slide[0]

    def _slope(self, angle: Any) -> Any:
        """Derivative of the part across by the angle."""
        d, turned, slide = (angle.cos(), angle.sin()), (-angle.sin(), angle.cos()), self._slide(angle)
        given, less = self.friction * self.free, self._lessened(turned) - 1
        slopes = [s * less - given * (row[0] * turned[0] + row[1] * turned[1]) for s, row in zip(self.slip, self.yields, strict=True)]
        return turned[0] * slide[1] - turned[1] * slide[0] + d[0] * slopes[1] - d[1] * slopes[0]
