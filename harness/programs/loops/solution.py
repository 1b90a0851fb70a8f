"""The solution of M a = f, as loops are written: the factor of M, the accelerations, their bounds, and norms in the metric of M.

Results of instructions are ``values``, (m, 3), numbers of ``harness.programs.loops.double_double``; ``places`` are those of M's entries
and ``force`` those of f. What is factorised and solved has a state in each lane; no lane's result depends on what the others hold.
See ``harness.programs.loops.interpreter`` for the proofs.

Sources: Golub, Van Loan, Matrix Computations, 4th ed., section 4.2 (Cholesky); Demmel, Veselic, Jacobi's method is more accurate
than QR, SIAM J. Matrix Anal. Appl. 13 (1992), for the singular values of a factor.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from harness.programs.loops.double_double import UNDERFLOW, Known, add, multiply, negative, number_at, store_total
from harness.programs.loops.language import Writer
from harness.programs.loops.values import Array, Value, as_number, differs, equals, larger, root_of, select, smaller, sum_of_lanes
from harness.programs.numbers import LANES, UNIT_ROUNDOFF

_REFINEMENTS = 4
# A step of so little of the largest acceleration is below the last digits of double-double.
_SETTLED = 2.0**-106
# Jacobi's rotations stop where columns are as square as this; what is left changes a condition number relatively by as much.
_SQUARE, _MOST_SWEEPS = 1e-10, 40


def factorise(code: Writer, nv: Value, mass: Array, scale: Array, factor: Array) -> None:
    """Scale and factor as ``harness.truth.balls.scaled_cholesky``; NaN for the scale where M has none."""
    zero = code.lanes(0.0)
    is_regular = code.variable(zero)
    for i in code.range(nv):
        scale[i] = root_of(mass[i, i])
    for j in code.range(nv):
        for k in code.range(j):
            factor[k, j] = 0.0
        known = code.total((factor[j, k] * factor[j, k] for k in code.range(j)), first=zero)
        factor[j, j] = root_of(mass[j, j] / scale[j] / scale[j] - known)
        is_regular.value += select(factor[j, j] > 0.0, zero, math.nan)
        for i in code.range(j + 1, nv):
            known = code.total((factor[i, k] * factor[j, k] for k in code.range(j)), first=zero)
            factor[i, j] = (mass[i, j] / scale[i] / scale[j] - known) / factor[j, j]
    for i in code.range(nv):
        scale[i] += is_regular.value


def invert(code: Writer, nv: Value, factor: Array, inverse: Array, zero: Value) -> None:
    """L^-1 below and on the diagonal; ``zero`` has the lanes of both."""
    for column in code.range(nv):
        inverse[column, column] = 1.0 / factor[column, column]
        for i in code.range(column + 1, nv):
            known = code.total((factor[i, k] * inverse[k, column] for k in code.range(column, i)), first=zero)
            inverse[i, column] = -known / factor[i, i]


@dataclass(frozen=True)
class LinearEquations:
    """A a = f in the function that is being written: ``matrix`` (nv, nv) and ``right`` (nv,) are places among ``values``.

    ``scale``, (nv,), makes the diagonal of the matrix about 1.
    """

    code: Writer
    nv: Value
    values: Array
    matrix: Array
    right: Array
    scale: Array


class Workspace:
    """Seven matrices (nv + 3, nv + 3) by their names; what is needed at different times shares one.

    Attributes:
        matrix: M, and then that of the equations, in float64, (nv, nv).
        scale, factor: of the latter, (nv,) and (nv, nv); the factor until the solution has bounds. inverse: that of the factor, (nv, nv).
        approximate: the approximate inverse of the scaled matrix, (nv, nv).
        residual: f - M a in double-double, (nv, 3). steps: the changes of the scaled solution, (nv,).
        entries, sizes: the entries of the scaled matrix, (nv, nv), and their absolute values with their errors.
        rows: row sums of |I - X A|, (nv,). errors: |X r| with its roundings, (nv,).
        rows_of_norm: columns of W, by rows, with |A^-1 x|_M = |W x|, (nv, nv), once there is a solution.
    """

    def __init__(self, matrices: Array) -> None:
        self.entries, self.steps, self.sizes = matrices.part(0), matrices.part(0, 0), matrices.part(1)
        self.rows, self.errors, self.scale = (matrices.part(2, row) for row in range(3))
        self.approximate, self.residual, self.matrix, self.inverse = (matrices.part(place) for place in range(3, 7))
        self.factor, self.rows_of_norm = self.sizes, self.entries

    def take(self, code: Writer, nv: Value, scale: Array, factor: Array) -> None:
        """Have the scale and the factor of M for those of the equations."""
        for i in code.range(nv):
            self.scale[i] = scale[i]
            for j in code.range(i + 1):
                self.factor[i, j] = factor[i, j]


def defect(code: Writer, n: Value, i: Value, approximate: Array, entries: Array, sizes: Array) -> Value:
    """A bound of the sum of row i of |I - X M|, X an approximate inverse of M, (n, n).

    ``entries`` are those of M, and ``sizes`` their absolute values with their errors over one unit roundoff; both have room for whole
    vectors of columns, of which four are summed at once.
    """
    # The last roundings are those of scaled entries.
    gamma, found = as_number(n + 12) * (UNIT_ROUNDOFF * 1.001), code.variable(code.lanes(0.0))
    for block in code.range((n + (LANES - 1)) // LANES):
        columns = [block * LANES + number for number in range(LANES)]
        diagonals = [code.lanes(select(equals(i, j), 1.0, 0.0)) for j in columns]
        differences, sums = ([code.variable(one) for one in diagonals] for _ in range(2))
        for k in code.range(n):
            own = approximate[i, k]
            for j, difference, size in zip(columns, differences, sums, strict=True):
                difference.value += -own * entries[k, j]
                size.value += abs(own) * sizes[k, j]
        for j, difference, size in zip(columns, differences, sums, strict=True):
            found.value += select(j < n, abs(difference.value) + gamma * size.value, code.lanes(0.0))
    return found.value


def size_of(number: Known) -> Value:
    """A bound of the absolute value of what a number stands for."""
    return abs(number[0]) + abs(number[1]) + number[2]


def _bounds(equations: LinearEquations, work: Workspace, radius: Array) -> None:
    """Bounds of the errors of the solution, for an approximate inverse of M scaled; infinite where it is none."""
    code, nv, scale = equations.code, equations.nv, equations.scale
    entries, sizes, rows, errors, approximate = work.entries, work.sizes, work.rows, work.errors, work.approximate
    zero = code.lanes(0.0)
    rest = code.total((size_of(number_at(work.residual, i)) for i in code.range(nv)), first=zero)
    # What quotients and products of a small residual lose below the smallest numbers; a residual that is zero loses nothing.
    lost = select(rest > 0.0, UNDERFLOW, 0.0)
    for i in code.range(nv):
        for j in code.range(nv):
            high, _, bound = number_at(equations.values, equations.matrix[i, j])
            entries[i, j] = high / scale[i] / scale[j]
            # So much that the entry's own bound is within gamma times it.
            sizes[i, j] = (abs(high) + bound / UNIT_ROUNDOFF) / scale[i] / scale[j]
    for i in code.range(nv):
        rows[i] = defect(code, nv, i, approximate, entries, sizes)
        left = ((k, size_of(number_at(work.residual, k)) / scale[k]) for k in code.range(nv))
        errors[i] = code.total((abs(approximate[i, k]) * (size + lost) + lost for k, size in left), first=lost)
    alpha, most = (code.largest((part[i] for i in code.range(nv)), first=zero) for part in (rows, errors))
    is_inverse = (alpha < 0.5) & (most < math.inf)
    for i in code.range(nv):
        found = select(is_inverse, errors[i] + rows[i] * most / (1.0 - alpha), math.inf)
        radius[i] = found * (1 + 1e-10) / scale[i] + lost


def solve(equations: LinearEquations, work: Workspace, solution: Array, radius: Array) -> None:
    """The accelerations in double-double, (nv, 2), and the bounds of their errors, (nv,), with the factor of ``work``."""
    code, nv, approximate, inverse = equations.code, equations.nv, work.approximate, work.inverse
    invert(code, nv, work.factor, inverse, code.lanes(0.0))
    for i in code.range(nv):
        for j in code.range(i + 1):
            entry = code.total((inverse[k, i] * inverse[k, j] for k in code.range(i, nv)), first=code.lanes(0.0))
            approximate[i, j] = approximate[j, i] = entry
    refine(equations, work, solution, radius)


def refine(equations: LinearEquations, work: Workspace, solution: Array, radius: Array) -> None:
    """As ``solve``, with the approximate inverse of ``work``, which need not be symmetric.

    The refinement of a state ends when it changes nothing that the digits can hold.
    """
    code, nv, values, scale = equations.code, equations.nv, equations.values, equations.scale
    approximate, residual, steps = work.approximate, work.residual, work.steps
    zero = code.lanes(0.0)
    for i in code.range(nv):
        solution[i, 0] = solution[i, 1] = 0.0
    is_moving = code.variable(code.lanes(1.0))
    for refinement in code.range(_REFINEMENTS + 1):
        with code.when((is_moving.value > 0.0).any()):
            for i in code.range(nv):
                entries = ((j, number_at(values, equations.matrix[i, j])) for j in code.range(nv))
                products = (multiply(negative(entry), (solution[j, 0], solution[j, 1], 0.0)) for j, entry in entries)
                store_total(residual, i, number_at(values, equations.right[i]), products)
            for i in code.range(nv):
                steps[i] = code.total((approximate[i, j] * (residual[j, 0] / scale[j]) for j in code.range(nv)), first=zero)
            largest = code.largest((abs(solution[i, 0] * scale[i]) for i in code.range(nv)), first=zero)
            largest_step = code.largest((abs(steps[i]) for i in code.range(nv)), first=zero)
            is_last = largest_step <= _SETTLED * largest
            is_moving.value = select(is_last, 0.0, is_moving.value)
            with code.when(refinement < _REFINEMENTS):
                for i in code.range(nv):
                    # The exact zero, in a lane that has come to rest, changes nothing.
                    step_now = select(is_moving.value > 0.0, steps[i] / scale[i], 0.0)
                    better = add((solution[i, 0], solution[i, 1], zero), (step_now, 0.0, 0.0))
                    solution[i, 0], solution[i, 1] = better[0], better[1]
    _bounds(equations, work, radius)


def norm(code: Writer, entries: Array, count: Value, squares: Value | None = None) -> Value:
    """A Euclidean norm, without overflow or underflow in the squares; ``squares`` is their sum, where it is known."""
    squares = squares or code.total(entries[i] * entries[i] for i in code.range(count))
    found = code.variable(root_of(squares))
    with code.when(~((squares > 1e-280) & (squares < 1e280))):
        largest = code.largest(abs(entries[i]) for i in code.range(count))
        unit = select(equals(largest, 0.0), code.number(1.0), largest)
        parts = (entries[i] / unit for i in code.range(count))
        found.value = largest * root_of(code.total(part * part for part in parts))
    return found.value


def in_metric(code: Writer, nv: Value, inverse: Array, entry: Callable[[Value], Value], work: Array) -> Value:
    """|L^-1 x| for the entries of x, with two rows of ``work``."""
    given, found = work.part(0), work.part(1)
    for i in code.range(nv):
        given[i] = entry(i)
        found[i] = code.total(inverse[i, j] * given[j] for j in code.range(i + 1))
    return norm(code, found, nv)


def rows_of_factor(code: Writer, nv: Value, work: Workspace) -> None:
    """``Workspace.rows_of_norm`` where A is M = D L L' D: W = L^-1 D^-1."""
    for j in code.range(nv):
        for i in code.range(j):
            work.rows_of_norm[j, i] = 0.0
        for i in code.range(j, nv):
            work.rows_of_norm[j, i] = work.inverse[i, j] / work.scale[j]


def rows_of_inverse(code: Writer, nv: Value, scale: Array, factor: Array, work: Workspace) -> Value:
    """The same where A is another matrix and M = D L L' D has this scale and factor: W = L' D S^-1 X S^-1, X for the inverse of A scaled.

    Returns, over the root of the condition number of M scaled, a bound of what X may be wrong by in any norm |W x|, relative to it.
    |X - A^-1| |y| in a norm where A is scaled is |I - X A| |y| at most, and |y| is that norm over the least singular value of L' D S^-1.
    """
    zero, ratios = code.lanes(0.0), work.errors
    for k in code.range(nv):
        ratios[k] = scale[k] / work.scale[k]
    for j in code.range(nv):
        for i in code.range(nv):
            terms = (factor[k, i] * ratios[k] * work.approximate[k, j] for k in code.range(i, nv))
            work.rows_of_norm[j, i] = code.total(terms, first=zero) / work.scale[j]
    wrong = code.largest((work.rows[i] for i in code.range(nv)), first=zero)
    return as_number(nv) * wrong * code.largest((work.scale[i] / scale[i] for i in code.range(nv)), first=zero)


class SumOfNorms:
    """sum over columns of |W column|, for columns in whole vectors.

    ``rows``, W by columns, and ``scale`` have a lane behind their other places.
    ``weights``, (nv + 2, nv rounded up to whole vectors), is room for that of one lane, and for one product with it.
    """

    def __init__(self, code: Writer, nv: Value, rows: Array, scale: Array, lane: Value, weights: Array) -> None:
        self._code, self._nv, self._blocks = code, nv, (nv + (LANES - 1)) // LANES
        self._weights, self._product = weights.in_vectors(self._blocks), weights.part(nv)
        self.total, square = code.variable(0.0), code.variable(0.0)
        for j in code.range(nv):
            for i in code.range(self._blocks * LANES):
                weights[j, i] = 0.0
            for i in code.range(nv):
                weights[j, i] = rows[j, i, lane]
                unscaled = rows[j, i, lane] * scale[j, lane]
                square.value += unscaled * unscaled
        self.of_inverse = root_of(square.value)

    def add(self, column: Array, factor: Value) -> None:
        """Add the norm of a column times a factor, which is that of an input that is zero near the smallest number."""
        code, products = self._code, self._product.in_vectors(self._blocks)
        is_felt = code.variable(0.0)
        for block in code.range(self._blocks):
            products[0, block] = 0.0
        for j in code.range(self._nv):
            # Most inputs are felt by few equations: a number of a joint's limit by one.
            with code.when(differs(column[j], 0.0)):
                is_felt.value = 1.0
                for block in code.range(self._blocks):
                    products[0, block] += self._weights[j, block] * column[j]
        with code.when(is_felt.value > 0.0):
            parts = (products[0, block] * products[0, block] for block in code.range(self._blocks))
            squares = sum_of_lanes(code.total(parts, first=code.lanes(0.0)))
            self.total.value += norm(code, self._product, self._nv, squares) * factor


def condition_numbers(code: Writer, nv: Value, factors: Array, states: Value, columns: Array) -> Value:
    """That of L L' at four states, as ``harness.truth.balls.condition_number``, by Jacobi's rotations of the columns of L.

    ``factors`` are L of all states, (n, nv, nv), and ``states`` the numbers of the four. ``columns``, (nv + 1, nv rounded up to whole
    vectors), is room for their columns and for the squares of these.
    """
    width = (nv + (LANES - 1)) // LANES * LANES
    for i in code.range(nv):
        for j in code.range(width):
            columns[i, j] = 0.0
        for j in code.range(i, nv):
            columns[i, j] = factors[states, j, i]

    def product(first: Value, second: Value) -> Value:
        # Four sums wait for one another no more than four lanes.
        parts = [code.variable(columns[first, part] * columns[second, part]) for part in range(LANES)]
        for block in code.range(1, width // LANES):
            for number, part in enumerate(parts):
                place = block * LANES + number
                part.value += columns[first, place] * columns[second, place]
        return (parts[0].value + parts[1].value) + (parts[2].value + parts[3].value)

    squares, none = columns.part(nv), code.lanes(0.0)
    has_turned = code.variable(code.lanes(1.0))
    for _ in code.range(_MOST_SWEEPS):
        with code.when((has_turned.value > 0.0).any()):
            turning, has_turned.value = has_turned.value > 0.0, none
            for p in code.range(nv):
                squares[p] = product(p, p)
            for p in code.range(nv):
                for q in code.range(p + 1, nv):
                    mixed = product(p, q)
                    turns = turning & (mixed * mixed > _SQUARE * _SQUARE * squares[p] * squares[q])
                    with code.when(turns.any()):
                        has_turned.value = select(turns, 1.0, has_turned.value)
                        tangent = _rotate(code, columns, width, (p, q), select(turns, (squares[q] - squares[p]) / (2.0 * mixed), math.inf))
                        squares[p] -= tangent * mixed
                        squares[q] += tangent * mixed
    smallest, largest = code.variable(code.lanes(math.inf)), code.variable(none)
    for p in code.range(nv):
        smallest.value, largest.value = smaller(smallest.value, squares[p]), larger(largest.value, squares[p])
    return select(smallest.value > 0.0, largest.value / smallest.value, math.inf)


def _rotate(code: Writer, columns: Array, width: Value, pair: tuple[Value, Value], cotangent: Value) -> Value:
    """Make two columns square to one another, by the cotangent of twice the angle, infinite where they stay; the tangent of the angle."""
    size = 1.0 / (abs(cotangent) + root_of(1.0 + cotangent * cotangent))
    tangent = select(cotangent < 0.0, -size, size)
    cosine = 1.0 / root_of(1.0 + tangent * tangent)
    sine, (p, q) = cosine * tangent, pair
    for place in code.range(width):
        first, second = columns[p, place], columns[q, place]
        columns[p, place], columns[q, place] = first * cosine - second * sine, first * sine + second * cosine
    return tangent
