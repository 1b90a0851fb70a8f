"""Certified values of any program's outputs in blocks, and their data roundoff.

Proofs and sources: docs/inside/numerics.md, "Blocks".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array, Indices, Rows
from harness.programs.evaluation import jacobians, most_at_once, values
from harness.programs.kernels import BallKernel
from harness.programs.numbers import SMALLEST_SCALE, UNIT_ROUNDOFF
from harness.programs.program import OUTPUTS, StraightLineProgram, without_unused
from harness.programs.states import States
from harness.programs.terms import Builder, symmetric, vector
from harness.truth.balls import parts_of
from harness.truth.compare import CERTIFIED_RADIUS, MOST_DOUBT, SOUGHT_RADIUS, Certified, Flags, in_order
from harness.truth.reference import ReferenceKernel

_PRECISIONS = (128, 256, 512)
# Numbers of the derivatives that are held at once.
_ROOM = 2**24
# Of the derivatives of the outputs, that are held at once where their lengths are taken.
_COPIES = 12
# Roundings that a derivative in float64 takes, at most, of each of the products that it is the sum of.
_ROUNDINGS = 64


@dataclass(frozen=True)
class Between(Rows):
    """Certified values that a program takes as inputs, k of them at n states.

    Attributes:
        high, low: (n, k); the certified midpoint is high + low. radius: (n, k).
        further: (n, m) inputs that the values depend on and the program does not take.
        slopes: (n, k, number of inputs + m) derivatives by the program's inputs, in float64, 0 by the values themselves, and by the
            further ones.
        shares: (n, k, s) changes of the values that are granted where an answer would fail without, as the share of the motion is.
        certified: (n,) whether the values are.
    """

    high: Array
    low: Array
    radius: Array
    further: Array
    slopes: Array
    shares: Array
    certified: Flags

    @classmethod
    def none(cls, n: int, inputs: int) -> Between:
        """No values at n states, for a program of so many inputs."""
        empty = np.zeros((n, 0))
        return cls(empty, empty, empty, empty, np.zeros((n, 0, inputs)), np.zeros((n, 0, 0)), np.ones(n, dtype=np.bool_))


def inputs_of(states: States, third: Array, numbers: Sequence[float]) -> Array:
    """The inputs of a program of a tree, (n, inputs): q, v, a third vector (n, any), the time, and numbers that are those of all states."""
    fixed = np.broadcast_to(numbers, (len(states), len(numbers)))
    return np.concatenate([states.q, states.v, third, states.time[:, None], fixed], axis=1)


class QuantityKernel:
    """Certified values of one program's outputs; compile once, evaluate many batches.

    ``blocks``, (blocks, size), are places among the program's outputs, flattened in order. ``between`` are those of the program's
    inputs that are values between. ``sizes`` is a program of the same inputs with one output a block, see ``Certified``.
    """

    def __init__(
        self,
        program: StraightLineProgram,
        blocks: Sequence[Sequence[int]],
        between: slice = slice(0),
        sizes: StraightLineProgram | None = None,
    ) -> None:
        self.program, self._of_sizes, self._between = program, sizes, between
        self._blocks = np.array(blocks, dtype=np.int64)
        self._kernel = BallKernel(program, 0)
        self._at_once = most_at_once(program) + _COPIES * self._blocks.size
        self._bound: dict[int, Any] = {}

    def evaluate(self, inputs: Array, between: Between | None = None, norm_factor: Array | None = None) -> Certified:
        """The values at ``inputs``, (n, number of inputs), in whose columns ``between`` stand the midpoints of the values between.

        Lengths of blocks are those of ``norm_factor``, see ``Certified``; Euclidean ones for None.
        """
        between = Between.none(*inputs.shape) if between is None else between
        if norm_factor is None:
            size = self._blocks.shape[1]
            norm_factor = np.broadcast_to(np.eye(size), (len(inputs), size, size))
        rows = max(1, _ROOM // (self._at_once * inputs.shape[1]))
        batches = [slice(start, start + rows) for start in range(0, max(len(inputs), 1), rows)]
        with np.errstate(all="ignore"):
            return Certified.concatenate([self._evaluate(inputs[batch], between[batch], norm_factor[batch]) for batch in batches])

    def _evaluate(self, inputs: Array, between: Between, norm_factor: Array) -> Certified:
        sensitivity, doubt, shared = self._sensitivity(inputs, between, norm_factor)
        sizes = self._sizes(inputs, shared)
        # What an answer is held against in the end; where it is 0, the block is 0 whatever the inputs are.
        largest = sensitivity + sizes
        known = np.isfinite(largest) & (doubt <= MOST_DOUBT * largest)
        shape = (len(inputs), *self._blocks.shape)
        high, low, radii = (np.full(shape, np.nan) for _ in range(3))
        bits, radius = np.zeros(len(inputs), dtype=np.int64), np.full(sensitivity.shape, np.nan)
        pending = np.flatnonzero(known.all(axis=1) & between.certified & np.isfinite(inputs).all(axis=1))
        for precision in _PRECISIONS:
            for index in pending.tolist():
                high[index], low[index], radii[index] = self._in_balls(inputs[index], between[[index]], precision)
            bits[pending] = precision
            radius[pending] = np.linalg.norm(radii[pending] @ np.abs(norm_factor[pending]).transpose(0, 2, 1), axis=2)
            pending = pending[~(radius[pending] <= SOUGHT_RADIUS * largest[pending]).all(axis=1)]
            # More bits do not shrink the balls of the values between.
            if not len(pending) or not (between.radius[pending] == 0).all():
                break
        certified = (known & (radius <= CERTIFIED_RADIUS * largest)).all(axis=1) & between.certified
        unsolved = np.zeros(len(inputs)), np.full(len(inputs), np.nan)
        return Certified(high, low, radius, norm_factor, sensitivity, sizes, *unsolved, certified, bits)

    def _in_balls(self, inputs: Array, between: Between, precision: int) -> tuple[Array, Array, Array]:
        """High, low and radius, (blocks, size) each, at one state."""
        import flint

        with flint.ctx.workprec(precision):
            given: list[Any] = inputs.tolist()
            rows = (between.high[0].tolist(), between.low[0].tolist(), between.radius[0].tolist())
            given[self._between] = [flint.arb(flint.arb(high) + flint.arb(low), radius) for high, low, radius in zip(*rows, strict=True)]
            if precision not in self._bound:
                self._bound[precision] = self._kernel.bind(())
            parts = np.array([parts_of(ball) for ball in self._bound[precision](*given)])
        high, low, radius = (parts[:, part][self._blocks] for part in range(3))
        return high, low, radius

    def _sensitivity(self, inputs: Array, between: Between, norm_factor: Array) -> tuple[Array, Array, Array]:
        """(n, blocks) of the blocks, how much of it rounding may be, and what the shares of the values between do to them."""
        slopes = np.concatenate(list(jacobians(self.program, np.ascontiguousarray(inputs.T)).values())).transpose(2, 0, 1)
        through = slopes[:, :, self._between]
        # What the program does not take it does not feel directly.
        direct = np.concatenate([slopes, np.zeros((*slopes.shape[:2], between.further.shape[1]))], axis=2)
        direct[:, :, self._between] = 0.0
        scales = np.maximum(np.abs(np.concatenate([inputs, between.further], axis=1)), SMALLEST_SCALE)[:, None]
        passed_on = (through @ between.slopes) * scales
        changes = [direct * scales + passed_on, passed_on, through * np.abs(between.high)[:, None]]
        doubt = (np.abs(direct) + np.abs(through) @ np.abs(between.slopes)) * scales
        return (
            self._lengths(np.concatenate(changes, axis=2), norm_factor),
            _ROUNDINGS * UNIT_ROUNDOFF * self._lengths(doubt, np.abs(norm_factor)),
            self._lengths(through @ between.shares, norm_factor),
        )

    def _lengths(self, columns: Array, norm_factor: Array) -> Array:
        """(n, blocks), the sum over columns (n, outputs, columns) of their lengths in each block."""
        return np.asarray(np.linalg.norm(norm_factor[:, None] @ columns[:, self._blocks], axis=2).sum(axis=2))

    def _sizes(self, inputs: Array, shared: Array) -> Array:
        if self._of_sizes is None:
            return shared
        sizes: Array = np.concatenate(list(values(self._of_sizes, np.ascontiguousarray(inputs.T)).values())).T
        return shared + sizes


MASS_MATRIX, BIAS, INVERSE_DYNAMICS = "mass_matrix", "bias", "inverse_dynamics"


class EquationValues:
    """The mass matrix, bias and inverse dynamics of a mechanism by its own equations of motion, each entry a block of its own.

    Those of a mechanism under constraints are of the tree that is left without them. A kind of values is compiled once. ``reference``
    chooses the chart of each state, and the frame of the linear velocity of a free joint.
    """

    def __init__(self, reference: ReferenceKernel) -> None:
        self._reference = reference
        self._kernels: dict[tuple[str, str], QuantityKernel] = {}

    def evaluate(self, name: str, states: States) -> Certified:
        """The values ``name`` at ``states``, whose ``tau`` holds the accelerations of inverse dynamics; entries of M by rows."""

        def of_chart(program: StraightLineProgram, chosen: Indices) -> Certified:
            if (name, program.key) not in self._kernels:
                self._kernels[name, program.key] = self._written(name, program)
            return self._kernels[name, program.key].evaluate(np.ascontiguousarray(self._reference.mechanism.inputs(states[chosen]).T))

        return in_order((of_chart(chart.program, chosen), chosen) for chart, chosen in self._reference.by_chart(states))

    def _written(self, name: str, program: StraightLineProgram) -> QuantityKernel:
        mechanism, builder = self._reference.mechanism, Builder(program.inputs)
        equations = builder.append(program)
        mass, first = symmetric(equations["mass"], mechanism.nv), mechanism.nq + mechanism.nv
        velocity, gravity, passive = (vector(equations[term]) for term in OUTPUTS[1:])
        if name == MASS_MATRIX:
            entries = mass.flat
        elif name == BIAS:
            entries = velocity + gravity
        else:
            # M a + c + g - p, with the accelerations a in the place of tau.
            entries = mass @ builder.inputs_at(range(first, first + mechanism.nv)) + (velocity + gravity - passive)
        return QuantityKernel(without_unused(builder.program({name: entries})), [[place] for place in range(len(entries))])
