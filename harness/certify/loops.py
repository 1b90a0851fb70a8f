"""The loops of ``harness.certify.interpreter``, as numba compiles them; nothing is allocated in them.

A program's results are numbers of ``harness.certify.double_double``, (m, 3).
"""

from __future__ import annotations

import math
from typing import Any

import numba
from numba import carray

from harness.arrays import Array
from harness.certify import encoding as code
from harness.certify.double_double import add, divide, inner, multiply, root, sine_and_cosine
from harness.certify.numbers import Number
from harness.equations.mechanism_kernel import Indices

_UNIT_ROUNDOFF = 2.0**-53
_REFINEMENTS = 4
_INPUT, _CONSTANT, _NEGATIVE = code.INPUT, code.CONSTANT, code.NEGATIVE
# Sums and differences stand before.
_PRODUCT, _QUOTIENT, _ROOT, _SINE_AND_COSINE = code.PRODUCT, code.QUOTIENT, code.ROOT, code.SINE_AND_COSINE
_COSINE = code.COSINE


@inner
def _number(values: Array, place: int) -> Number:
    return values[place, 0], values[place, 1], values[place, 2]


@inner
def _run(codes: Indices, first: Indices, second: Indices, constants: Array, inputs: Array, values: Array) -> None:
    """Every instruction's result, into ``values`` (m, 3)."""
    for place in range(len(codes)):
        operation, a, b = codes[place], first[place], second[place]
        if operation == _PRODUCT:
            result = multiply(_number(values, a), _number(values, b))
        elif operation < _PRODUCT:
            sign = 1.0 - 2.0 * operation
            result = add(_number(values, a), (sign * values[b, 0], sign * values[b, 1], values[b, 2]))
        elif operation == _INPUT:
            result = (inputs[a], 0.0, 0.0)
        elif operation == _CONSTANT:
            result = _number(constants, a)
        elif operation == _NEGATIVE:
            result = (-values[a, 0], -values[a, 1], values[a, 2])
        elif operation == _QUOTIENT:
            result = divide(_number(values, a), _number(values, b))
        elif operation == _ROOT:
            result = root(_number(values, a))
        elif operation == _SINE_AND_COSINE:
            result, cosine = sine_and_cosine(_number(values, a))
            values[place + 1, 0], values[place + 1, 1], values[place + 1, 2] = cosine
        else:
            continue
        values[place, 0], values[place, 1], values[place, 2] = result


@inner
def _factorise(mass: Array, scale: Array, factor: Array, inverse: Array) -> bool:
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
    gamma = (nv + 12) * _UNIT_ROUNDOFF * 1.001
    for i in range(nv):
        rows[i] = errors[i] = 0.0
        for j in range(nv):
            total, most = 1.0 if i == j else 0.0, 1.0 if i == j else 0.0
            for k in range(nv):
                entry = values[places[k, j], 0] / scale[k] / scale[j]
                total -= approximate[i, k] * entry
                # So much that the entry's own bound is within gamma times it.
                most += abs(approximate[i, k]) * (abs(entry) + values[places[k, j], 2] / scale[k] / scale[j] / _UNIT_ROUNDOFF)
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
def _solve(
    values: Array, places: Indices, force: Indices, scale: Array, inverse: Array, work: Array, approximate: Array, residual: Array,
    solution: Array, radius: Array,
) -> None:  # fmt: skip
    """The accelerations in double-double, (nv, 2), and the bounds of their errors, (nv,), with L^-1 of ``_factorise``."""
    nv = len(force)
    for i in range(nv):
        solution[i, 0] = solution[i, 1] = 0.0
        for j in range(nv):
            approximate[i, j] = 0.0
            for k in range(max(i, j), nv):
                approximate[i, j] += inverse[k, i] * inverse[k, j]
    for refinement in range(_REFINEMENTS + 1):
        for i in range(nv):
            total = _number(values, force[i])
            for j in range(nv):
                product = multiply(_number(values, places[i, j]), (-solution[j, 0], -solution[j, 1], 0.0))
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
def _most(values: Array, place: int) -> float:
    """An absolute value, so much enlarged that a unit roundoff of it is more than the error of the value."""
    most: float = abs(values[place, 0]) + values[place, 2] / _UNIT_ROUNDOFF
    return most


@inner
def _sweep(
    codes: Indices, first: Indices, second: Indices, values: Array, places: Indices, force: Indices, accelerations: Array, scale: Array,
    adjoints: Array, sizes: Array, found: Array,
) -> None:  # fmt: skip
    """Derivatives of f - M a by the inputs, (number of inputs, nv + 1): behind them sums of absolute values over ``scale``.

    ``adjoints``, (m, nv rounded up to whole vectors of the processor), and ``sizes``, (m,), are zero before and after.
    """
    nv, width = len(force), adjoints.shape[1]
    for i in range(nv):
        adjoints[force[i], i] += 1.0
        sizes[force[i]] += 1 / scale[i]
        for j in range(nv):
            adjoints[places[i, j], i] -= accelerations[j]
            sizes[places[i, j]] += abs(accelerations[j]) / scale[i]
    for place in range(len(codes) - 1, -1, -1):
        operation, a, b = codes[place], first[place], second[place]
        if operation <= _PRODUCT:
            # What is most common is chosen among, which processors do faster than they branch.
            is_product = operation == _PRODUCT
            of_first, of_second = values[a, 0], values[b, 0]
            by_first, by_second = of_second if is_product else 1.0, of_first if is_product else 1.0 - 2.0 * operation
            most_of_first, most_of_second = _most(values, b) if is_product else 1.0, _most(values, a) if is_product else 1.0
        elif operation == _QUOTIENT:
            by_first = 1 / values[b, 0]
            by_second = -values[place, 0] * by_first
            most_of_first = abs(by_first) * _most(values, b) * abs(by_first)
            most_of_second = _most(values, place) * most_of_first
        elif operation == _NEGATIVE:
            by_first, most_of_first, by_second, most_of_second = -1.0, 1.0, 0.0, 0.0
        elif operation == _ROOT:
            by_first, by_second, most_of_second = 0.5 / values[place, 0], 0.0, 0.0
            most_of_first = 2 * by_first * _most(values, place) * by_first
        elif operation == _SINE_AND_COSINE:
            by_first, most_of_first, by_second, most_of_second = 1.0, 1.0, 0.0, 0.0
            for lane in range(width):
                of_cosine = adjoints[place + 1, lane]
                adjoints[place + 1, lane] = 0.0
                adjoints[place, lane] = values[place + 1, 0] * adjoints[place, lane] - values[place, 0] * of_cosine
            sizes[place] = _most(values, place + 1) * sizes[place] + _most(values, place) * sizes[place + 1]
            sizes[place + 1] = 0.0
        elif operation == _COSINE:
            # It ends with its sine, which stands before it.
            continue
        else:
            if operation == _INPUT:
                for lane in range(nv):
                    found[a, lane] = adjoints[place, lane]
                found[a, nv] = sizes[place]
            for lane in range(width):
                adjoints[place, lane] = 0.0
            sizes[place] = 0.0
            continue
        # Four at a time, all read before one is written, which lets the compiler use the processor's vectors.
        for lane in range(0, width, 4):
            r, s, t, u = adjoints[place, lane], adjoints[place, lane + 1], adjoints[place, lane + 2], adjoints[place, lane + 3]
            adjoints[place, lane], adjoints[place, lane + 1], adjoints[place, lane + 2], adjoints[place, lane + 3] = 0.0, 0.0, 0.0, 0.0
            e, f, g, h = adjoints[a, lane], adjoints[a, lane + 1], adjoints[a, lane + 2], adjoints[a, lane + 3]
            adjoints[a, lane], adjoints[a, lane + 1] = e + by_first * r, f + by_first * s
            adjoints[a, lane + 2], adjoints[a, lane + 3] = g + by_first * t, h + by_first * u
            e, f, g, h = adjoints[b, lane], adjoints[b, lane + 1], adjoints[b, lane + 2], adjoints[b, lane + 3]
            adjoints[b, lane], adjoints[b, lane + 1] = e + by_second * r, f + by_second * s
            adjoints[b, lane + 2], adjoints[b, lane + 3] = g + by_second * t, h + by_second * u
        size = sizes[place]
        sizes[place] = 0.0
        sizes[a] += most_of_first * size
        sizes[b] += most_of_second * size


@inner
def _sum_of_norms(columns: Array, scales: Array, scale: Array, inverse: Array, entries: Array, gamma: float) -> tuple[float, float]:
    """sum over inputs of |L^-1 D^-1 column| over ``columns`` of ``_sweep``, and a bound of what its roundings do to it."""
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


def _evaluate(
    n: int, m: int, nv: int, count: int, of_constants: int, gamma: float,
    at_codes: Any, at_first: Any, at_second: Any, at_constants: Any, at_mass: Any, at_terms: Any, at_force: Any, at_inputs: Any,
    at_scales: Any, at_high: Any, at_low: Any, at_radius: Any, at_scale: Any, at_factor: Any, at_found: Any, at_sensitivity: Any,
    at_doubt: Any, at_values: Any, at_adjoints: Any, at_sizes: Any, at_columns: Any, at_work: Any,
) -> None:  # fmt: skip
    codes, first, second, constants = (
        carray(at_codes, m),
        carray(at_first, m),
        carray(at_second, m),
        carray(at_constants, (of_constants, 3)),
    )
    mass, terms, force = carray(at_mass, (nv, nv)), carray(at_terms, (3, nv)), carray(at_force, nv)
    inputs, scales = carray(at_inputs, (n, count)), carray(at_scales, (n, count))
    high, low, radius, scale = carray(at_high, (n, nv)), carray(at_low, (n, nv)), carray(at_radius, (n, nv)), carray(at_scale, (n, nv))
    factor, found = carray(at_factor, (n, nv, nv)), carray(at_found, (n, 3, nv))
    sensitivity, doubt = carray(at_sensitivity, n), carray(at_doubt, n)
    values, adjoints, sizes = carray(at_values, (m, 3)), carray(at_adjoints, (m, (nv + 3) // 4 * 4)), carray(at_sizes, m)
    columns, work = carray(at_columns, (count, nv + 1)), carray(at_work, (6, nv + 3, nv + 3))
    matrix, inverse, approximate, solution, residual, sums = work[0], work[1], work[2], work[3], work[4], work[5]
    for state in range(n):
        _run(codes, first, second, constants, inputs[state], values)
        for i in range(nv):
            for term in range(3):
                found[state, term, i] = values[terms[term, i], 0]
            for j in range(nv):
                matrix[i, j] = values[mass[i, j], 0]
        if not _factorise(matrix, scale[state], factor[state], inverse):
            for i in range(nv):
                scale[state, i] = math.nan
            continue
        _solve(values, mass, force, scale[state], inverse, sums, approximate, residual, solution, radius[state])
        for i in range(nv):
            high[state, i], low[state, i] = solution[i, 0], solution[i, 1]
        _sweep(codes, first, second, values, mass, force, high[state], scale[state], adjoints, sizes, columns)
        sensitivity[state], doubt[state] = _sum_of_norms(columns, scales[state], scale[state], inverse, sums[0], gamma)


def _derive(
    n: int, m: int, nv: int, count: int, of_constants: int,
    at_codes: Any, at_first: Any, at_second: Any, at_constants: Any, at_mass: Any, at_force: Any, at_inputs: Any, at_accelerations: Any,
    at_scale: Any, at_found: Any, at_values: Any, at_adjoints: Any, at_sizes: Any,
) -> None:  # fmt: skip
    codes, first, second, constants = (
        carray(at_codes, m),
        carray(at_first, m),
        carray(at_second, m),
        carray(at_constants, (of_constants, 3)),
    )
    mass, force, scale = carray(at_mass, (nv, nv)), carray(at_force, nv), carray(at_scale, (n, nv))
    inputs, accelerations, found = carray(at_inputs, (n, count)), carray(at_accelerations, (n, nv)), carray(at_found, (n, count, nv + 1))
    values, adjoints, sizes = carray(at_values, (m, 3)), carray(at_adjoints, (m, (nv + 3) // 4 * 4)), carray(at_sizes, m)
    for state in range(n):
        _run(codes, first, second, constants, inputs[state], values)
        _sweep(codes, first, second, values, mass, force, accelerations[state], scale[state], adjoints, sizes, found[state])


def intermediate_representations() -> dict[str, tuple[str, str]]:
    """By name of each loop that Python calls, the name of its machine code and LLVM's text of the module that holds it."""
    number, indices, numbers = numba.int64, numba.types.CPointer(numba.int64), numba.types.CPointer(numba.float64)
    sizes, program = [number] * 5, [indices] * 3 + [numbers] + [indices]
    signatures = {
        "evaluate": (_evaluate, [*sizes, numba.float64, *program, indices, indices, *[numbers] * 15]),
        "derive": (_derive, [*sizes, *program, indices, *[numbers] * 7]),
    }
    found = {}
    for name, (function, arguments) in signatures.items():
        made = numba.cfunc(numba.void(*arguments), error_model="numpy")(function)
        found[name] = made.native_name, made.inspect_llvm()
    return found
