"""The sensitivity of accelerations to their data: sum over inputs z of |dqdd/dz z|_M, from M dqdd = d(rhs) - dM qdd.

The derivatives are exact ones, compiled to float64. Near a spring of no length, or wherever else the equations cancel, float64
keeps no digit of them. A second evaluation along one direction of the inputs (``harness.certify.directional``) shows where the
two differ; there the derivatives are computed in balls.

Sources: Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., chapter 7; Demmel, Underflow and the reliability of
numerical software, SIAM J. Sci. Stat. Comput. 5 (1984), for inputs near zero.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from harness.arrays import Array
from harness.certify.directional import DirectionalDerivative
from harness.certify.factorisation import forward_substitute, norm_over_first_axis
from harness.certify.reverse_mode import columns_in_balls
from harness.equations.kernels import Float64Kernel
from harness.equations.program import position_count, right_hand_side, upper_triangle

UNIT_ROUNDOFF = 2.0**-53
# Bits that are tried one after the other.
PRECISIONS = (128, 256, 512, 1024, 2048, 4096)
# Half an ulp stops shrinking at the smallest subnormal number, 2^-1074: the roundoff of an input z is
# UNIT_ROUNDOFF * max(|z|, SMALLEST_SCALE).
SMALLEST_SCALE = 2.0**-1021
# Of the sensitivity; where two evaluations differ by more, neither is believed. A sensitivity is read to three digits, and
# the errors of several inputs, of which a direction shows the sum, may cancel to an eighth of their size.
MOST_DIFFERENT = 2.0**-13


class Sensitivity:
    """Evaluator for one program."""

    def __init__(self, kernel: Float64Kernel) -> None:
        self._kernel, self._program = kernel, kernel.program
        # None of the inputs weighs nothing, and no two weigh the same.
        generator = np.random.default_rng(0)
        count = len(self._program.inputs)
        self._weights = generator.choice([-1.0, 1.0], count) * generator.uniform(1.0, 2.0, count)

    def evaluate(self, inputs: Array, accelerations: Array, scale: Array, factor: Array, condition: Array) -> Array:
        """(n,) sensitivities; NaN where balls do not give it either, or M has no factor.

        ``inputs`` (number of inputs, n) and ``accelerations`` (n, nv); ``scale`` and ``factor`` of M as ``scaled_cholesky`` gives,
        and ``condition``, (n,) of the factor.
        """
        columns = self._columns(inputs, accelerations.T)
        found = norm_over_first_axis(forward_substitute(factor, columns / scale[:, None])).sum(axis=0)
        change = self._change(inputs, accelerations.T) - np.einsum("ikn,k->in", columns, self._weights)
        differing = norm_over_first_axis(forward_substitute(factor, (change / scale)[:, None]))[0]
        # Substituting into the factor of M costs the root of its condition number.
        lost = np.sqrt(condition) * UNIT_ROUNDOFF * len(scale)
        doubtful = ~((differing <= MOST_DIFFERENT * found) & (lost <= MOST_DIFFERENT))
        known = np.isfinite(inputs).all(axis=0) & np.isfinite(accelerations).all(axis=1) & np.isfinite(condition)
        for index in np.flatnonzero(doubtful & known).tolist():
            scales = _scales(inputs[:, index])
            found[index] = columns_in_balls(self._program, inputs[:, index].tolist(), scales.tolist(), PRECISIONS)[1]
        return np.asarray(found)

    def _columns(self, inputs: Array, accelerations: Array) -> Array:
        """Derivatives of the equations times the size of each input, (nv, number of inputs, n)."""
        return self._kernel.input_derivatives(inputs, np.ascontiguousarray(accelerations)) * _scales(inputs)[None]

    def _change(self, inputs: Array, accelerations: Array) -> Array:
        """The equations' change, (nv, n), along the direction in which each input changes by its weight, from the second evaluation."""
        direction = self._weights[:, None] * _scales(inputs)
        slopes = {name: list(slope) for name, slope in self._directional(inputs, direction).items()}
        applied = position_count(self._program) + self._kernel.nv
        change = np.array(right_hand_side(slopes, list(direction[applied : applied + self._kernel.nv])))
        for slope, (i, j) in zip(slopes["mass"], upper_triangle(self._kernel.nv), strict=True):
            change[i] -= slope * accelerations[j]
            if i != j:
                change[j] -= slope * accelerations[i]
        return change

    @cached_property
    def _directional(self) -> DirectionalDerivative:
        return DirectionalDerivative(self._program)


def _scales(inputs: Array) -> Array:
    return np.maximum(np.abs(inputs), SMALLEST_SCALE)
