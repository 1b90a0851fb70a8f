"""On which side of its range each force lies that a range holds, at each state: found in float64, and proved by bounds.

A force in its range is ``share`` times what it would be, and a constant: 1 and 0 inside, 0 and the bound beyond. Where bounds are numbers
of a file, they are parameters too, each of which counts once beyond it in the place of the constant. What it would be may
depend on the other forces in their ranges, and on itself: of a convex optimum there is one way in which all fit, which is found by
exchanging all that do not fit at once, and at last the first of them alone. The force is the same on both sides of a bound that it
reaches, and data roundoff is not: where roundings lead across, the other side counts too.

A contact whose forces lie in a round cone parts, sticks or slides. Where it slides the force is as of weights that depend on the
direction of y = J a - aref alone (``harness.programs.mechanisms.cones``): each exchange is a step of Newton's method.

Source: Portugal, Judice, Vicente, A comparison of block pivoting and interior-point algorithms for linear least squares problems with
nonnegative variables, Math. Comp. 63 (1994); Murty, Note on a Bard-type scheme for solving the complementarity problem, Opsearch 11 (1974).
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from harness.arrays import Array, Rows
from harness.programs.evaluation import values, values_and_spread
from harness.programs.kernels import BallKernel
from harness.programs.loops.interpreter import Bounded, bounded_outputs, encoded, moved_outputs, solutions
from harness.programs.mechanisms.clamps import Clamp, Ranges
from harness.programs.mechanisms.cones import Cone, Flags, Zone
from harness.programs.numbers import length_of_balls
from harness.programs.program import StraightLineProgram
from harness.storage import Kept

_BITS = 192
# Exchanges of all that do not fit, then of the first alone, in float64; and of all with bounds.
_BLOCKS, _SINGLE, _PROVED = 12, 200, 8
# Data roundoffs: evaluating a force in float64 rounds about as often as its inputs are rounded.
_ROUNDINGS = 8
# Of the length of y, by which it may still move where a contact slides, in float64 and in balls: what is then left of the force is the
# square of that.
_SETTLED, _SAME = 1e-6, 2.0**-90
# Of the largest force, by which float64 may miss a bound.
_AT_BOUND = 1e-9
_KERNELS: Kept[BallKernel] = Kept(32)


@dataclass(frozen=True)
class Sides(Rows):
    """On which side of its range each force lies, and what each contact does, at n states.

    Attributes:
        clamps: (n, clamps) -1 below the range, 0 inside and 1 beyond. cones: (n, cones) of ``Zone``.
        towards, rest: (n, rows of cones) y where contacts slide.
    """

    clamps: Array
    cones: Array
    towards: Array
    rest: Array


@dataclass(frozen=True)
class Zones:
    """The ranges of some forces, and the cones of some contacts.

    Attributes:
        clamps: of a force that is part of another the own one first.
        program: its only output is what each force would be, and y of the rows of the cones; inputs are the mechanism's, up to the last
            that it takes.
        cones: of contacts whose forces lie in round ones.
        paired: numbers of two forces along one row, of which the second is 0 wherever the first is inside its range.
        by_solution: the equations of motion, and the output of ``program`` as a function of the accelerations that solve them and of
            the rests of these, which are its last inputs; None where there are none.
    """

    clamps: tuple[Clamp, ...]
    program: StraightLineProgram
    cones: tuple[Cone, ...] = ()
    paired: tuple[tuple[int, int], ...] = ()
    by_solution: tuple[StraightLineProgram, StraightLineProgram] | None = None

    @property
    def key(self) -> Hashable:
        """Equal for what settles equal states alike."""
        return self.clamps, self.cones, self.paired, self.program.key

    @functools.cached_property
    def parts(self) -> list[slice]:
        """The rows of each cone among those of all."""
        ends = list(itertools.accumulate((cone.size for cone in self.cones), initial=0))
        return [slice(*bounds) for bounds in itertools.pairwise(ends)]

    def settle(self, known: Array, found: Array, ranges: Ranges | None = None, start: Sides | None = None) -> Array:
        """Set share and constant of each force in the parameters ``found`` of each state, whose other inputs are ``known``.

        ``ranges`` are the least and the largest forces, (n, clamps) each, where states have other ones; ``start`` is where the search
        begins, by default with all forces inside their ranges. Shares are NaN where no side of some force is proved.
        Returns what each force would be without its range, (n, clamps).
        """
        low, high = self.bounds(found) if ranges is None else ranges
        start = self.sides(np.zeros(low.shape)) if start is None else start[:]
        sides, raw, reach = self._guessed(known, found, low, high, replace(start, clamps=np.where(low == high, -1.0, start.clamps)))
        raw, is_proved = self._are_shown(known, found, (low, high), sides, (raw, reach))
        raw[~is_proved] = np.nan
        self._prove(known, found, (low, high), sides, (raw, is_proved))
        self.put(found, (low, high), sides, is_proved)
        return raw

    def put(self, found: Array, ranges: Ranges, sides: Sides, is_proved: Flags | None = None) -> None:
        """Set what each force and contact does by ``sides``; shares are NaN where these are not proved, (n,)."""
        self._put_clamps(found, *ranges, sides.clamps)
        for zones, cone, part in zip(sides.cones.T, self.cones, self.parts, strict=True):
            cone.put(found, zones, sides.towards[:, part], sides.rest[:, part])
        if is_proved is not None:
            shares = [*(clamp.share for clamp in self.clamps), *(cone.sticking for cone in self.cones)]
            found[:, shares] = np.where(is_proved[:, None], found[:, shares], np.nan)

    def sides(self, clamps: Array, y: Array | None = None, found: Array | None = None, rest: Array | None = None) -> Sides:
        """Sides of n states; y + ``rest``, (n, rows of cones), and the parameters say what contacts do, which part without them."""
        cones = np.zeros((len(clamps), len(self.cones)))
        towards = np.zeros((len(clamps), sum(cone.size for cone in self.cones))) if y is None else y.copy()
        if y is not None and found is not None:
            for number, (cone, part) in enumerate(zip(self.cones, self.parts, strict=True)):
                cones[:, number] = cone.zones(found, y[:, part])
        return Sides(clamps, cones, towards, np.zeros_like(towards) if rest is None else rest.copy())

    def across(self, known: Array, found: Array, unit_roundoff: float, ranges: Ranges | None = None) -> Array:
        """Parameters that ``settle`` has set, with those forces on the other side of a bound that rounding may lead across it."""
        low, high = self.bounds(found) if ranges is None else ranges
        raw, reach = self.reach(known, found, unit_roundoff)
        own, y, count = raw[:, : len(self.clamps)], raw[:, len(self.clamps) :], len(self.clamps)
        sides = np.zeros(low.shape)
        for place, clamp in enumerate(self.clamps):
            sides[:, place] = clamp.side(found, high[:, place])
        for bound, side in ((low, -1.0), (high, 1.0)):
            is_near = np.logical_and(np.abs(own - bound) <= reach[:, :count], low < high)
            sides = np.where(is_near, side - sides, sides)
        other = found.copy()
        self._put_clamps(other, low, high, self._one_of_two(sides, sides))
        for cone, part in zip(self.cones, self.parts, strict=True):
            zones = cone.across(found, y[:, part], reach[:, count:][:, part])
            [crossed] = np.nonzero(zones != cone.zones_at(found))
            moved = other[crossed]
            cone.put(moved, zones[crossed], y[crossed, part], np.zeros((len(crossed), cone.size)))
            other[crossed] = moved
        return np.where(np.isnan(found), found, other)

    def reach(self, known: Array, found: Array, unit_roundoff: float) -> tuple[Array, Array]:
        """Each force as it would be without its range, and y of cones, (n, both), in float64, and how far roundings lead.

        Those are roundings of that and of its inputs.
        """
        inputs = self.inputs(known, found)
        by_loops = moved_outputs(self.program, inputs, np.abs(inputs))
        if by_loops is not None and np.isfinite(by_loops).all():
            return by_loops[0], _ROUNDINGS * unit_roundoff * by_loops[1]
        [raw], [spread] = (list(rows.values()) for rows in values_and_spread(self.program, inputs, np.abs(inputs)))
        return raw.T, _ROUNDINGS * unit_roundoff * spread.T

    def bounds(self, found: Array) -> Ranges:
        """The least and the largest force of each range, (n, clamps) each."""
        low, high = (np.zeros((len(found), len(self.clamps))) for _ in range(2))
        for place, clamp in enumerate(self.clamps):
            low[:, place], high[:, place] = clamp.least(found), clamp.most(found)
        return low, high

    def inputs(self, known: Array, found: Array) -> Array:
        """(inputs, n)."""
        return np.ascontiguousarray(np.hstack([known, found[:, : len(self.program.inputs) - known.shape[1]]]).T)

    def _put_clamps(self, found: Array, low: Array, high: Array, sides: Array) -> None:
        """Share and constant of each force below its range, inside or beyond, as ``sides`` say by -1, 0 and 1."""
        for clamp, *own in zip(self.clamps, sides.T, low.T, high.T, strict=True):
            clamp.put(found, *own)

    def _guessed(self, known: Array, found: Array, low: Array, high: Array, sides: Sides) -> tuple[Sides, Array, Array]:
        """The side of each force by float64, what each would be without its range, (n, clamps), and within what of it, as last computed."""
        left, count = np.arange(len(low)), len(self.clamps)
        last, within = np.full(low.shape, np.nan), np.full(low.shape, np.nan)
        sides = replace(sides, clamps=self._one_of_two(sides.clamps, sides.clamps))
        for exchange in range(_BLOCKS + _SINGLE):
            if not len(left):
                break
            part, before = found[left], sides[left]
            self.put(part, (low[left], high[left]), before)
            found_now = _approximate(self, known[left], part)
            own, cones = found_now.high[:, :count], self.sides(before.clamps, found_now.high[:, count:], part, found_now.low[:, count:])
            last[left], within[left] = own, found_now.reach[:, :count]
            fitting = np.where(low[left] > own, -1.0, np.where(high[left] < own, 1.0, 0.0))
            fitting = np.where(low[left] == high[left], -1.0, fitting)
            if self.paired:
                bounds = np.where(before.clamps < 0, low[left], high[left])
                is_at = np.abs(own - bounds) <= _AT_BOUND * np.abs(own).max(axis=1, keepdims=True)
                fitting = self._one_of_two(fitting, before.clamps, is_at)
            unfit = np.not_equal(fitting, before.clamps)
            if exchange >= _BLOCKS:
                unfit &= np.cumsum(unfit, axis=1) == 1
            exchanged = np.where(unfit, _exchanged(before.clamps, fitting), before.clamps)
            sides.clamps[left] = self._one_of_two(exchanged, exchanged)
            sides.cones[left], sides.towards[left], sides.rest[left] = cones.cones, cones.towards, cones.rest
            moved = np.linalg.norm(cones.towards - before.towards, axis=1) > _SETTLED * np.linalg.norm(cones.towards, axis=1)
            left = left[unfit.any(axis=1) | (cones.cones != before.cones).any(axis=1) | (moved & (cones.cones == Zone.SLIDES).any(axis=1))]
        # Their sides have been exchanged since.
        within[left] = np.inf
        return sides, last, within

    def _are_shown(self, known: Array, found: Array, ranges: Ranges, sides: Sides, last: tuple[Array, Array]) -> tuple[Array, Flags]:
        """Forces without their ranges, (n, clamps), and (n,) whether these and what contacts do are shown to fit ``sides``.

        ``last`` is what forces were last, and within what; contacts that slide have moved since.
        """
        (low, high), (raw, reach), own, count = ranges, last, sides.clamps, len(self.clamps)
        is_shown = np.full(len(low), not self.paired)
        if self.cones:
            self.put(there := found.copy(), ranges, sides)
            now = _approximate(self, known, there)
            raw, reach = now.high[:, :count].copy(), now.reach[:, :count]
            y, moved = now.of(slice(count, None)), now.high[:, count:] - sides.towards + (now.low[:, count:] - sides.rest)
            for zones, cone, part in zip(sides.cones.T, self.cones, self.parts, strict=True):
                is_shown &= cone.are_shown(found, zones, y.of(part), moved[:, part])
        with np.errstate(invalid="ignore"):
            is_above, is_below = raw - low > reach, high - raw > reach
            fits = np.where(own == 0, is_above & is_below, np.where(own < 0, low - raw > reach, raw - high > reach))
        # A range of one force leaves nothing to be found.
        return raw, is_shown & np.asarray((fits | ((low == high) & (own < 0))).all(axis=1))

    def _prove(self, known: Array, found: Array, ranges: Ranges, sides: Sides, proof: tuple[Array, Flags]) -> None:
        """Show by balls that all are on sides that fit, where ``proof``, what each force would be and whether that is shown, does not.

        Sides that do not fit are exchanged in ``sides``, and contacts that slide do so along y to twice float64's digits.
        """
        import flint

        (low, high), (raw, is_proved), count = ranges, proof, len(self.clamps)
        if is_proved.all():
            return
        kernel = _KERNELS.get(self.program.key, lambda: BallKernel(self.program, 0))
        with flint.ctx.workprec(_BITS):
            evaluate = kernel.bind([])
            for state in np.flatnonzero(~is_proved).tolist():
                at, bounds = slice(state, state + 1), list(zip(low[state].tolist(), high[state].tolist(), strict=True))
                for _ in range(_PROVED):
                    self.put(part := found[at].copy(), (low[at], high[at]), sides[at])
                    balls = evaluate(*self.inputs(known[at], part)[:, 0].tolist())
                    own, within = sides.clamps[state], zip(balls, bounds, strict=False)
                    # A range of one force leaves nothing to be found.
                    fits = (-1.0 if least == most or ball < least else 1.0 if ball > most else 0.0 for ball, (least, most) in within)
                    fitting = np.array(list(fits))
                    if self.paired:
                        is_at = [any(ball.overlaps(flint.arb(one)) for one in pair) for ball, pair in zip(balls, bounds, strict=False)]
                        fitting = self._one_of_two(fitting, own, np.array(is_at))
                    contacts_fit = [self._cone_fits(number, part[0], balls[count:], sides, state) for number in range(len(self.cones))]
                    if np.array_equal(fitting, own) and all(contacts_fit):
                        raw[state], is_proved[state] = [float(ball.mid()) for ball in balls[:count]], True
                        break
                    exchanged = np.where(fitting != own, _exchanged(own, fitting), own)
                    sides.clamps[state] = self._one_of_two(exchanged, exchanged)

    def _one_of_two(self, wanted: Array, sides: Array, is_at: Flags | None = None) -> Array:
        """The sides that are ``wanted`` of forces on ``sides``, (..., clamps) both, but for those of pairs.

        The second of a pair is 0 where the first is inside, and the first stays at a bound, where it ``is_at`` one, while the second acts.
        """
        found = wanted.copy()
        for first, second in self.paired:
            found[..., second] = np.where(sides[..., first] == 0.0, -1.0, found[..., second])
            if is_at is not None:
                stays = is_at[..., first] & (sides[..., second] == 0.0)
                found[..., first] = np.where(stays, sides[..., first], found[..., first])
        return found

    def _cone_fits(self, number: int, found: Array, balls: Sequence[Any], sides: Sides, state: int) -> bool:
        """True where balls of y show that a contact does what ``sides`` say, which says what they do afterwards."""
        part = self.parts[number]
        y, before = balls[part], Zone(int(sides.cones[state, number]))
        zone = self.cones[number].zone_in_balls(found, y)
        # On an edge the force is the same on both sides.
        zone = before if zone is None and all(ball.is_finite() for ball in y) else zone
        if zone is None:
            return False
        towards = sides.towards[state, part].tolist(), sides.rest[state, part].tolist()
        sides.cones[state, number] = zone
        if zone != Zone.SLIDES:
            return zone == before
        sides.towards[state, part] = high = [float(ball.mid()) for ball in y]
        sides.rest[state, part] = [float((ball - whole).mid()) for ball, whole in zip(y, high, strict=True)]
        apart = length_of_balls((ball - one) - other for ball, one, other in zip(y, *towards, strict=True))
        return bool(zone == before and apart < _SAME * length_of_balls(y))


def _approximate(zones: Zones, known: Array, found: Array) -> Bounded:
    """Forces without their ranges, and y of cones, with infinite bounds where nothing is known.

    Solutions of the equations have narrower bounds than an elimination instruction by instruction.
    """
    inputs, by_loops = zones.inputs(known, found), None
    equations = None if zones.by_solution is None else encoded(zones.by_solution[0])
    if zones.by_solution is not None and equations is not None:
        moved = solutions(equations, np.ascontiguousarray(np.hstack([known, found])[:, : equations.inputs].T))
        nothing = np.zeros_like(moved.high.T)
        given = np.vstack([inputs, moved.high.T, moved.low.T]), np.vstack([np.zeros_like(inputs), nothing, moved.bound.T])
        by_loops = bounded_outputs(zones.by_solution[1], *given)
    by_loops = by_loops or bounded_outputs(zones.program, inputs)
    if by_loops is not None:
        return by_loops
    (raw,) = values(zones.program, inputs).values()
    return Bounded(raw.T, np.zeros_like(raw.T), np.full(raw.T.shape, np.inf))


def _exchanged(sides: Array, fitting: Array) -> Array:
    """Sides where others fit: inside next, but for forces that were there, which go where they fit."""
    return np.where(sides == 0, fitting, 0.0)
