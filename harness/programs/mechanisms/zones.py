"""On which side of its range each force lies that a range holds, at each state: found in float64, and proved by bounds.

A force in its range is ``share`` times what it would be, and a constant: 1 and 0 inside, 0 and the bound beyond. Where bounds are numbers
of a file, they are parameters too, each of which counts once beyond it in the place of the constant. What it would be may
depend on the other forces in their ranges, and on itself: of a convex optimum there is one way in which all fit, which is found by
exchanging all that do not fit at once, and at last the first of them alone. The force is the same on both sides of a bound that it
reaches, and data roundoff is not: where roundings lead across, the other side counts too.

Source: Portugal, Judice, Vicente, A comparison of block pivoting and interior-point algorithms for linear least squares problems with
nonnegative variables, Math. Comp. 63 (1994); Murty, Note on a Bard-type scheme for solving the complementarity problem, Opsearch 11 (1974).
"""

from __future__ import annotations

import functools
from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np

from harness.arrays import Array
from harness.programs.evaluation import values, values_and_spread
from harness.programs.kernels import BallKernel
from harness.programs.program import StraightLineProgram
from harness.storage import Kept

_BITS = 192
# Exchanges of all that do not fit, then of the first alone, in float64; and of all with bounds.
_BLOCKS, _SINGLE, _PROVED = 12, 200, 8
# Data roundoffs: evaluating a force in float64 rounds about as often as its inputs are rounded.
_ROUNDINGS = 8
_KERNELS: Kept[BallKernel] = Kept(32)


@dataclass(frozen=True)
class Clamp:
    """A range of a force: the parameters ``share`` and ``constant`` by their numbers, and the bounds [N or N m].

    ``bounds``: the parameters that say how often the lower and the upper bound count, and those that the bounds are, -1 for a bound of 0;
    () where the constant is the bound.
    """

    share: int
    constant: int
    low: float
    high: float
    bounds: tuple[int, ...] = ()

    @property
    def own(self) -> tuple[int, ...]:
        """The parameters that each state has of its own."""
        return self.share, self.constant, *(column for column in self.bounds[:2] if column >= 0)

    def least(self, found: Array) -> Array:
        """(n,) lower bounds in parameters of n states."""
        return found[:, self.bounds[2]] if self.bounds and self.bounds[2] >= 0 else np.full(len(found), self.low)

    def most(self, found: Array) -> Array:
        """(n,) upper bounds."""
        return found[:, self.bounds[3]] if self.bounds and self.bounds[3] >= 0 else np.full(len(found), self.high)

    def put(self, found: Array, sides: Array, low: Array | float = 0.0, high: Array | float = 0.0) -> None:
        """Set a state's own parameters where it is below the range, inside or beyond, as ``sides`` (n,) say by -1, 0 and 1."""
        found[:, self.share] = sides == 0
        found[:, self.constant] = 0.0 if self.bounds else np.where(sides == 0, 0.0, np.where(sides < 0, low, high))
        for column, is_beyond in zip(self.bounds[:2], (sides < 0, sides > 0), strict=False):
            if column >= 0:
                found[:, column] = is_beyond

    def side(self, found: Array, high: Array) -> Array:
        """(n,) the sides that ``put`` has set."""
        below, above = self.bounds[:2] or (-1, -1)
        if max(below, above) < 0:
            is_above = found[:, self.constant] == high
        else:
            is_above = found[:, above] == 1.0 if above >= 0 else found[:, below] != 1.0
        return np.where(found[:, self.share] == 1.0, 0.0, np.where(is_above, 1.0, -1.0))


@dataclass(frozen=True)
class Zones:
    """The ranges of some forces.

    Attributes:
        clamps: of a force that is part of another the own one first.
        program: its only output is what each force would be; inputs are the mechanism's, up to the last that it takes.
    """

    clamps: tuple[Clamp, ...]
    program: StraightLineProgram

    @property
    def key(self) -> Hashable:
        """Equal for what settles equal states alike."""
        return self.clamps, self.program.key

    @functools.cached_property
    def _shares(self) -> list[int]:
        return [clamp.share for clamp in self.clamps]

    def settle(self, known: Array, found: Array, high: Array | None = None) -> Array:
        """Set share and constant of each force in the parameters ``found`` of each state, whose other inputs are ``known``.

        ``high``, (n, clamps), are the largest forces where states have other ones. Shares are NaN where no side of some force is proved.
        Returns what each force would be without its range, (n, clamps).
        """
        low, high = self._bounds(found, high)
        sides = self._guessed(known, found, low, high)
        raw = self._proved(known, found, low, high, sides)
        self._put(found, low, high, sides)
        found[:, self._shares] = np.where(np.isnan(raw).any(axis=1, keepdims=True), np.nan, found[:, self._shares])
        return raw

    def across(self, known: Array, found: Array, unit_roundoff: float, high: Array | None = None) -> Array:
        """Parameters that ``settle`` has set, with those forces on the other side of a bound that rounding may lead across it."""
        low, high = self._bounds(found, high)
        raw, reach = self.reach(known, found, unit_roundoff)
        sides = np.column_stack([clamp.side(found, most) for clamp, most in zip(self.clamps, high.T, strict=True)])
        for bound, side in ((low, -1.0), (high, 1.0)):
            is_near = np.logical_and(np.abs(raw - bound) <= reach, low < high)
            sides = np.where(is_near, side - sides, sides)
        other = found.copy()
        self._put(other, low, high, sides)
        return np.where(np.isnan(found), found, other)

    def reach(self, known: Array, found: Array, unit_roundoff: float) -> tuple[Array, Array]:
        """What each force would be without its range, (n, clamps), in float64, and how far roundings of that and of its inputs lead."""
        inputs = self._inputs(known, found)
        [raw], [spread] = (list(rows.values()) for rows in values_and_spread(self.program, inputs, np.abs(inputs)))
        return raw.T, _ROUNDINGS * unit_roundoff * spread.T

    def _bounds(self, found: Array, high: Array | None) -> tuple[Array, Array]:
        low = np.column_stack([clamp.least(found) for clamp in self.clamps])
        return low, np.column_stack([clamp.most(found) for clamp in self.clamps]) if high is None else high

    def _inputs(self, known: Array, found: Array) -> Array:
        """(inputs, n)."""
        return np.ascontiguousarray(np.hstack([known, found[:, : len(self.program.inputs) - known.shape[1]]]).T)

    def _put(self, found: Array, low: Array, high: Array, sides: Array) -> None:
        """Share and constant of each force below its range, inside or beyond, as ``sides`` say by -1, 0 and 1."""
        for clamp, *own in zip(self.clamps, sides.T, low.T, high.T, strict=True):
            clamp.put(found, *own)

    def _guessed(self, known: Array, found: Array, low: Array, high: Array) -> Array:
        """The side of each force by float64, (n, clamps)."""
        sides, left = np.zeros(low.shape), np.arange(len(low))
        for exchange in range(_BLOCKS + _SINGLE):
            if not len(left):
                break
            part = found[left]
            self._put(part, low[left], high[left], sides[left])
            (raw,) = values(self.program, self._inputs(known[left], part)).values()
            fitting = np.where(low[left] > raw.T, -1.0, np.where(high[left] < raw.T, 1.0, 0.0))
            unfit = np.not_equal(fitting, sides[left])
            if exchange >= _BLOCKS:
                unfit &= np.cumsum(unfit, axis=1) == 1
            sides[left] = np.where(unfit, _exchanged(sides[left], fitting), sides[left])
            left = left[unfit.any(axis=1)]
        return sides

    def _proved(self, known: Array, found: Array, low: Array, high: Array, sides: Array) -> Array:
        """What each force would be without its range, where balls show that all are on sides that fit; NaN where they do not.

        Sides that do not fit are exchanged in ``sides``.
        """
        import flint

        raw = np.full(low.shape, np.nan)
        kernel = _KERNELS.get(self.program.key, lambda: BallKernel(self.program, 0))
        with flint.ctx.workprec(_BITS):
            evaluate = kernel.bind([])
            for state in range(len(low)):
                at, bounds = slice(state, state + 1), list(zip(low[state].tolist(), high[state].tolist(), strict=True))
                for _ in range(_PROVED):
                    self._put(part := found[at].copy(), low[at], high[at], sides[at])
                    balls = evaluate(*self._inputs(known[at], part)[:, 0].tolist())
                    fitting = [
                        -1.0 if ball < least else 1.0 if ball > most else 0.0 for ball, (least, most) in zip(balls, bounds, strict=True)
                    ]
                    if fitting == sides[state].tolist():
                        raw[state] = [float(ball.mid()) for ball in balls]
                        break
                    sides[state] = np.where(fitting != sides[state], _exchanged(sides[state], np.array(fitting)), sides[state])
        return raw


def _exchanged(sides: Array, fitting: Array) -> Array:
    """Sides where others fit: inside next, but for forces that were there, which go where they fit."""
    return np.where(sides == 0, fitting, 0.0)
