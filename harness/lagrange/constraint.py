"""Constraints as a system file declares them: rows that stay zero with the coordinates that they determine, and contacts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import sympy as sp

from harness.lagrange.expressions import SymbolicDerivatives


@dataclass(frozen=True, kw_only=True)
class Constraint:
    """A tie between the joints of a tree: a loop that is closed, or a wheel that rolls.

    Attributes:
        rows: expressions that stay zero. Each is of the coordinates (holonomic), as the components of the difference of two points
            that meet, along the world's axes [m]; or linear in the rates (rolling), as the velocity of the point of contact [m/s].
        determines: the coordinates, or of rolling rows those whose rates, that the rows give when the others are known: one for each
            row that is not redundant.
        redundant: the numbers of rows, from 0, that follow from the others, of this constraint or of earlier ones.

    Raises:
        ValueError: the declaration contradicts itself.

    Source: Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., sections 1.3 and 2.4.
    """

    rows: Sequence[sp.Expr]
    determines: Sequence[sp.Expr]
    redundant: Sequence[int] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "rows", tuple(sp.sympify(row) for row in self.rows))
        object.__setattr__(self, "determines", tuple(self.determines))
        object.__setattr__(self, "redundant", tuple(self.redundant))
        if not self.rows:
            raise ValueError("has no rows; expected at least one expression that stays zero")
        for row in self.redundant:
            if not 0 <= row < len(self.rows):
                raise ValueError(f"row {row} is said to be redundant; its rows are 0 to {len(self.rows) - 1}")
        for number, row in enumerate(self.rows):
            if row == 0:
                raise ValueError(f"row {number} is zero whatever the coordinates are; leave it out")
        independent = len(self.rows) - len(set(self.redundant))
        if len(self.determines) != independent:
            count = f"{len(self.determines)} coordinates"
            raise ValueError(f"determines {count}; expected one for each of its {independent} rows that are not redundant")

    def is_rolling(self, rates: Iterable[sp.Expr]) -> bool:
        """True where the rows are of the rates.

        Raises:
            ValueError: a row is neither of the coordinates alone nor linear in the rates without another term, or rows are of both kinds.
        """
        rates = tuple(rates)
        kinds = set[bool]()
        for number, row in enumerate(self.rows):
            kinds.add(bool(row.has(*rates)))
            if row.has(*rates) and not _is_linear(row, rates):
                raise ValueError(f"row {number} is {row}; expected an expression of the coordinates, or one linear in the rates")
        if len(kinds) > 1:
            raise ValueError("has rows of coordinates and rows of rates; declare a constraint for each kind")
        return kinds.pop()


@dataclass(frozen=True, kw_only=True)
class Contact:
    """A point in which two surfaces may touch: they push one another apart there, and rub by Coulomb's law.

    Attributes:
        gap: the distance of the surfaces, an expression of the coordinates [m].
        slip: the velocity of one surface along the other, linear in the rates [m/s], or their turn about the normal [rad/s]; a pair of
            velocities along perpendicular directions of the common plane where surfaces may slide in both; None of smooth ones, which
            those of systems with ball or free joints are.
        friction: the parameter that is the ratio of the largest force of friction to the normal one: the coefficient of friction, of
            turns a length [m]; None of smooth surfaces.

    Raises:
        ValueError: the declaration contradicts itself.

    Source: Brogliato, Nonsmooth Mechanics, 3rd ed., sections 5.1 (unilateral constraints) and 5.3 (Coulomb friction).
    """

    gap: sp.Expr
    slip: sp.Expr | tuple[sp.Expr, sp.Expr] | None = None
    friction: sp.Symbol | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "gap", sp.sympify(self.gap))
        if (self.slip is None) != (self.friction is None):
            raise ValueError("has a slip or a coefficient of friction alone; expected both, or neither of smooth surfaces")
        if len(self.slips) > 2:
            raise ValueError(f"has {len(self.slips)} slips; expected one, or a pair along perpendicular directions")

    @property
    def slips(self) -> tuple[sp.Expr, ...]:
        """Components of the slip; () of smooth surfaces."""
        given = self.slip if isinstance(self.slip, tuple | list) else () if self.slip is None else (self.slip,)
        return tuple(map(sp.sympify, given))

    @property
    def rows(self) -> tuple[sp.Expr, ...]:
        """Its expressions."""
        return (self.gap, *self.slips)

    def contradictions(self, rates: Iterable[sp.Expr]) -> Iterator[str]:
        """Sentences on what is not of the form that is expected."""
        rates = tuple(rates)
        if self.gap.has(*rates):
            yield f"has the gap {self.gap}; expected an expression of the coordinates"
        for slip in self.slips:
            if not (slip.has(*rates) and _is_linear(slip, rates)):
                yield f"has the slip {slip}; expected an expression linear in the rates"


def _is_linear(row: sp.Expr, rates: Sequence[sp.Expr]) -> bool:
    """True where a row is a sum of multiples of rates, by factors without any."""
    plain = {rate: sp.Dummy(f"rate{place}") for place, rate in enumerate(rates)}
    written, symbols = row.xreplace(plain), set(plain.values())
    # Simplifying takes minutes for a wheel on a leaning frame, and is needed only where a rate is left.
    slopes = [
        sp.simplify(slope) if slope.free_symbols & symbols else slope for slope in SymbolicDerivatives.by(symbols).of(written).values()
    ]
    at_rest = written.xreplace(dict.fromkeys(symbols, sp.S.Zero))
    return not any(slope.free_symbols & symbols for slope in slopes) and (at_rest == 0 or sp.simplify(at_rest) == 0)
