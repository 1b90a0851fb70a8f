"""The solution of M a = f as numba compiles it: the factor of M, the accelerations, their bounds, and norms in the metric of M.

Nothing is allocated. Results of instructions are ``values``, (m, 3), numbers of ``harness.certify.double_double``; ``places`` are
those of M's entries and ``force`` those of f. See ``harness.certify.interpreter`` for the proofs.
"""

from __future__ import annotations

import math

from harness.arrays import Array
from harness.certify.double_double import add, inner, multiply
from harness.certify.numbers import UNIT_ROUNDOFF, Number
from harness.equations.mechanism_kernel import Indices

_REFINEMENTS = 4


@inner
def number_at(values: Array, place: int) -> Number:
    return values[place, 0], values[place, 1], values[place, 2]


@inner
def factorise(mass: Array, scale: Array, factor: Array, inverse: Array) -> bool:
    """Scale and factor as ``harness.certify.factorisation.scaled_cholesky``, and L^-1; False where M has none."""
    nv = len(scale)
    for i in range(nv):
        scale[i] = math.sqrt(mass[i, i])
    for j in range(nv):
        pivot = 0.0
        for k in range(j):
            pivot += factor[j, k] ** 2
        factor[j, j] = math.sqrt(mass[j, j] / scale[j] / scale[j] - pivot)
        if not factor[j, j] > 0:
            return False
        for i in range(j + 1, nv):
            known = 0.0
            for k in range(j):
                known += factor[i, k] * factor[j, k]
            factor[i, j] = (mass[i, j] / scale[i] / scale[j] - known) / factor[j, j]
    for column in range(nv):
        inverse[column, column] = 1 / factor[column, column]
        for i in range(column + 1, nv):
            known = 0.0
            for k in range(column, i):
                known += factor[i, k] * inverse[k, column]
            inverse[i, column] = -known / factor[i, i]
    return True


@inner
def _bounds(values: Array, places: Indices, scale: Array, approximate: Array, residual: Array, work: Array, radius: Array) -> None:
    """Bounds of the errors of the solution, for an approximate inverse of M scaled; infinite where it is none."""
    nv = len(scale)
    rows, errors = work[0], work[1]
    # The last roundings are those of M's scaled entries.
    gamma = (nv + 12) * UNIT_ROUNDOFF * 1.001
    for i in range(nv):
        rows[i] = errors[i] = 0.0
        for j in range(nv):
            total, most = 1.0 if i == j else 0.0, 1.0 if i == j else 0.0
            for k in range(nv):
                entry = values[places[k, j], 0] / scale[k] / scale[j]
                total -= approximate[i, k] * entry
                # So much that the entry's own bound is within gamma times it.
                most += abs(approximate[i, k]) * (abs(entry) + values[places[k, j], 2] / scale[k] / scale[j] / UNIT_ROUNDOFF)
            rows[i] += abs(total) + gamma * most
        for k in range(nv):
            errors[i] += abs(approximate[i, k]) * ((abs(residual[k, 0]) + abs(residual[k, 1]) + residual[k, 2]) / scale[k])
    alpha, most = 0.0, 0.0
    for i in range(nv):
        alpha, most = max(alpha, rows[i]), max(most, errors[i])
    for i in range(nv):
        error = errors[i] + rows[i] * most / (1 - alpha) if alpha < 0.5 and most < math.inf else math.inf
        radius[i] = error * (1 + 1e-10) / scale[i] + (2.0**-1000 if most > 0 else 0.0)


@inner
def solve(
    values: Array, places: Indices, force: Indices, scale: Array, inverse: Array, work: Array, approximate: Array, residual: Array,
    solution: Array, radius: Array,
) -> None:  # fmt: skip
    """The accelerations in double-double, (nv, 2), and the bounds of their errors, (nv,), with L^-1 of ``factorise``."""
    nv = len(force)
    for i in range(nv):
        solution[i, 0] = solution[i, 1] = 0.0
        for j in range(nv):
            approximate[i, j] = 0.0
            for k in range(max(i, j), nv):
                approximate[i, j] += inverse[k, i] * inverse[k, j]
    for refinement in range(_REFINEMENTS + 1):
        for i in range(nv):
            total = number_at(values, force[i])
            for j in range(nv):
                product = multiply(number_at(values, places[i, j]), (-solution[j, 0], -solution[j, 1], 0.0))
                total = add(total, product)
            residual[i, 0], residual[i, 1], residual[i, 2] = total
        for i in range(nv if refinement < _REFINEMENTS else 0):
            step = 0.0
            for j in range(nv):
                step += approximate[i, j] * (residual[j, 0] / scale[j])
            better = add((solution[i, 0], solution[i, 1], 0.0), (step / scale[i], 0.0, 0.0))
            solution[i, 0], solution[i, 1] = better[0], better[1]
    _bounds(values, places, scale, approximate, residual, work, radius)


@inner
def sum_of_norms(columns: Array, scales: Array, scale: Array, inverse: Array, entries: Array, gamma: float) -> tuple[float, float]:
    """sum over inputs of |L^-1 D^-1 column| over ``columns`` of a sweep, and a bound of what its roundings do to it."""
    nv = len(scale)
    total, doubt, square = 0.0, 0.0, 0.0
    for i in range(nv):
        for j in range(i + 1):
            square += inverse[i, j] ** 2
    for k in range(len(columns)):
        largest = 0.0
        for i in range(nv):
            entries[i] = 0.0
            for j in range(i + 1):
                entries[i] += inverse[i, j] * (columns[k, j] * (scales[k] / scale[j]))
            largest = max(largest, abs(entries[i]))
        if largest > 0:
            squares = 0.0
            for i in range(nv):
                squares += (entries[i] / largest) ** 2
            total += largest * math.sqrt(squares)
        doubt += columns[k, nv] * scales[k]
    return total, doubt * gamma * math.sqrt(square)
