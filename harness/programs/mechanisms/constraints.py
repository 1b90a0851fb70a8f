"""The constraints of a derived mechanism, as plain data."""

from __future__ import annotations

import functools
from collections.abc import Hashable
from dataclasses import dataclass, replace

from harness.programs.program import StraightLineProgram, without_unused

# Outputs of the rows' program.
RESIDUAL, JACOBIAN, RATE, BIAS = "residual", "jacobian", "rate", "bias"


@dataclass(frozen=True, kw_only=True)
class Constraints:
    """The rows that tie the coordinates of a mechanism's tree.

    Attributes:
        rows: the name of its constraint for each of the m rows; those that hold positions (holonomic) stand before rolling ones.
        redundant: for each row, whether it follows from the others.
        holonomic: how many rows hold positions.
        positions: places of the coordinates that the holonomic rows determine, one for each that is not redundant.
        rates: places of the coordinates whose rates the rows determine; those of ``positions`` come first.
        assembly: position of each coordinate in one configuration in which all rows hold, to about three digits.
        program: its inputs are the mechanism's; its outputs ``residual``, the holonomic rows, ``jacobian``, (m, nv) by rows, by which
            v changes each row, ``rate``, J v, and ``bias``, J' v, (m,) each.
        tree: the equations of motion without the constraints.
    """

    rows: tuple[str, ...]
    redundant: tuple[bool, ...]
    holonomic: int
    positions: tuple[int, ...]
    rates: tuple[int, ...]
    assembly: tuple[float, ...]
    program: StraightLineProgram
    tree: StraightLineProgram

    @functools.cached_property
    def placing(self) -> StraightLineProgram:
        """The part of ``program`` that has ``residual`` and ``jacobian`` alone, in this order, which is all that closing takes."""
        return without_unused(replace(self.program, outputs={name: self.program.outputs[name] for name in (RESIDUAL, JACOBIAN)}))

    @property
    def independent(self) -> tuple[int, ...]:
        """The numbers of the rows that are not redundant."""
        return tuple(number for number, redundant in enumerate(self.redundant) if not redundant)

    @property
    def determined_by(self) -> dict[int, str]:
        """The place of each coordinate whose position is determined, and the constraint that does."""
        return {place: self.rows[row] for place, row in zip(self.positions, self.independent, strict=False)}

    @property
    def names(self) -> tuple[str, ...]:
        """The constraints, in their order."""
        return tuple(dict.fromkeys(self.rows))

    @property
    def key(self) -> Hashable:
        """Equal for equal constraints."""
        plain = self.rows, self.redundant, self.holonomic, self.positions, self.rates, self.assembly
        return *plain, self.program.key, self.tree.key

    def checked(self, nv: int) -> Constraints:
        """The constraints after a look at their sizes.

        Raises:
            ValueError: a part does not fit the others, or the nv coordinates.
        """
        m, independent = len(self.rows), self.independent
        of_positions = sum(row < self.holonomic for row in independent)
        sizes = {name: len(places) for name, places in self.program.checked().outputs.items()}
        fits = (
            sizes == {RESIDUAL: self.holonomic, JACOBIAN: m * nv, RATE: m, BIAS: m}
            and len(self.redundant) == m
            and (len(self.positions), len(self.rates), len(self.assembly)) == (of_positions, len(independent), nv)
            and all(0 <= place < nv for place in self.rates)
            and self.rates[:of_positions] == self.positions
            and self.tree.checked().inputs == self.program.inputs
        )
        if not fits:
            raise ValueError("the constraints do not fit the coordinates")
        return self
