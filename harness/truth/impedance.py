"""The impedance of a law of constraints at the distance of each state, linear around it, to twice the digits of float64.

Source: MuJoCo documentation, Modeling, Solver parameters, Impedance.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from harness.arrays import Array, Rows
from harness.files.rules import Impedance
from harness.programs.kernels import BallKernel
from harness.programs.loops.interpreter import bounded_outputs
from harness.programs.program import StraightLineProgram
from harness.programs.terms import Builder, length, vector
from harness.storage import Kept

_BITS = 192
# Of an impedance, by which the sum of two float64 numbers may miss it, and in squared unit roundoffs; and of a slope, which counts within
# half an ulp of the distance alone.
_TWO_PARTS, ROUNDINGS_OF_TWO_PARTS, _ONE_PART = 2.0**-100, 2.0**6, 2.0**-56
# Of a distance, near which float64 does not say on which side of a bound it is.
_NEAR = 2.0**-40
_BALLS: Kept[BallKernel] = Kept(64)
# Of the last states: rows of constraints have no number of a file that is changed, whose law is asked for a thousand times.
_NEAREST: Kept[Array] = Kept(8)


def nearest(program: StraightLineProgram, inputs: Array) -> Array:
    """The float64 numbers nearest to a program's outputs, (n, outputs), to be read only, for inputs (number of inputs, n)."""
    content = hashlib.blake2b(inputs.tobytes()).digest()
    return _NEAREST.get((program.key, inputs.shape, content), lambda: _nearest(program, inputs))


def _nearest(program: StraightLineProgram, inputs: Array) -> Array:
    by_loops = bounded_outputs(program, inputs)
    if by_loops is None:
        found = _in_balls(program, inputs)[0]
    else:
        found, left = by_loops.high.copy(), np.flatnonzero(~by_loops.is_nearest.all(axis=1))
        found[left] = _in_balls(program, inputs[:, left])[0]
    found.flags.writeable = False
    return found


def in_two_parts(program: StraightLineProgram, inputs: Array, count: int = 1) -> tuple[Array, Array]:
    """The outputs of a program as sums of two numbers, (n, outputs) each; inputs as of ``nearest``.

    All but the first ``count``, as the slopes of an impedance, are so to the digits of float64 alone.
    """
    by_loops = bounded_outputs(program, inputs)
    if by_loops is None:
        return _in_balls(program, inputs)
    high, low = by_loops.high.copy(), by_loops.low.copy()
    allowed = np.where(np.arange(high.shape[1]) < count, _TWO_PARTS, _ONE_PART)
    left = np.flatnonzero(~(by_loops.bound <= allowed * np.abs(high)).all(axis=1))
    high[left], low[left] = _in_balls(program, inputs[:, left])
    return high, low


def _in_balls(program: StraightLineProgram, inputs: Array) -> tuple[Array, Array]:
    import flint

    high, low = np.empty((2, inputs.shape[1], sum(map(len, program.outputs.values()))))
    if inputs.shape[1]:
        with flint.ctx.workprec(_BITS):
            evaluate = _BALLS.get(program.key, lambda: BallKernel(program, 0)).bind([])
            for state, row in enumerate(inputs.T.tolist()):
                balls = evaluate(*row)
                high[state] = [float(ball.mid()) for ball in balls]
                low[state] = [float((ball - whole).mid()) for ball, whole in zip(balls, high[state].tolist(), strict=True)]
    return high, low


@dataclass(frozen=True)
class Linear(Rows):
    """Impedances around n distances: ``value`` + ``rest`` at these, (n,) each, and their derivatives by what each row leaves, (n, rows)."""

    value: Array
    rest: Array
    slopes: Array


def linear(impedances: Sequence[Impedance], counts: Sequence[int], residuals: Array) -> Linear:
    """The impedance of each row of ``residuals``, (n, rows), whose length is the distance.

    The first of ``counts`` are of the first of ``impedances``, and so on, which all have one power. At a kink the larger derivative counts.
    """
    n, count = residuals.shape
    table = np.array([[i.least, i.most, i.width, i.midpoint, i.power, i.is_constant] for i in impedances]).reshape(-1, 6)
    least, most, width, midpoint, power, is_constant = np.repeat(table, counts, axis=0).T
    constant = is_constant == 1.0
    mean = least + most
    error = (least - (mean - most)) + (most - (mean - (mean - most)))
    found = Linear(np.where(constant, mean / 2, most), np.where(constant, error / 2, 0.0), np.zeros((n, count)))
    at_zero = ~constant & ~residuals.any(axis=1)
    found.value[at_zero] = least[at_zero]
    # At distance 0 no direction is another's: the first stands for all.
    found.slopes[at_zero, 0] = np.where(power == 1, (most - least) / np.where(constant, 1.0, width), 0.0)[at_zero]
    left = np.flatnonzero(~constant & ~at_zero)
    is_whole = not power[left].size or float(power[left[0]]).is_integer()
    within = left[_is_within(residuals[left], width[left], np.ones(len(left)), or_at=is_whole)]
    rises = _is_within(residuals[within], width[within], midpoint[within])
    for rising, chosen in ((True, within[rises]), (False, within[~rises])):
        if len(chosen):
            # Of a single row the program takes the distance.
            rows = np.abs(residuals[chosen]) if count == 1 else residuals[chosen]
            program = _program(float(power[chosen[0]]), count, rising)
            given = np.column_stack([least[chosen], most[chosen], width[chosen], midpoint[chosen], rows])
            high, low = in_two_parts(program, np.ascontiguousarray(given.T))
            found.value[chosen], found.rest[chosen] = high[:, 0], low[:, 0]
            found.slopes[chosen] = high[:, 1:] * (np.sign(residuals[chosen]) if count == 1 else 1.0)
    return found


def _is_within(residuals: Array, width: Array, share: Array, or_at: bool = True) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """True for each row, (n, rows), that is no longer than a share of the width, or shorter."""
    lengths, bounds = np.linalg.norm(residuals, axis=1), width * share
    found = np.asarray(lengths < bounds)
    for near in np.flatnonzero(np.abs(lengths - bounds) <= _NEAR * bounds).tolist():
        square = sum(Fraction(one) ** 2 for one in residuals[near].tolist())
        bound = (Fraction(float(width[near])) * Fraction(float(share[near]))) ** 2
        found[near] = square <= bound if or_at else square < bound
    return found


@functools.lru_cache(64)
def _program(power: float, count: int, rising: bool) -> StraightLineProgram:
    """The impedance, and its derivatives by ``count`` rows: below the midpoint, or from there to the width."""
    builder = Builder(("least", "most", "width", "midpoint", *(f"row {row}" for row in range(count))))
    (least, most, width, midpoint), rows = builder.inputs[:4], vector(builder.inputs[4:])
    distance = length(rows) if count > 1 else rows[0]
    x, one, steepness = distance / width, builder.number(1), builder.number(1)
    share, part = (x, midpoint) if rising else (one - x, one - midpoint)
    if power != 1:
        steepness = (share / part) ** (int(power) - 1 if power.is_integer() else builder.number(Fraction(power) - 1))
    y = share * steepness if rising else one - share * steepness
    slope = builder.number(Fraction(power)) * steepness * (most - least) / width
    slopes = [slope * (row / distance) for row in rows] if count > 1 else [slope]
    return builder.program({"impedance": [least + y * (most - least)], "slopes": slopes})
