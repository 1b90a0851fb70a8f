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
from harness.certify.numbers import UNIT_ROUNDOFF
from harness.certify.solution import factorise, number_at, solve, sum_of_norms
from harness.equations.mechanism_kernel import Indices

_INPUT, _CONSTANT, _NEGATIVE = code.INPUT, code.CONSTANT, code.NEGATIVE
# Sums and differences stand before.
_PRODUCT, _QUOTIENT, _ROOT, _SINE_AND_COSINE = code.PRODUCT, code.QUOTIENT, code.ROOT, code.SINE_AND_COSINE
_COSINE = code.COSINE


@inner
def _run(codes: Indices, first: Indices, second: Indices, constants: Array, inputs: Array, values: Array) -> None:
    """Every instruction's result, into ``values`` (m, 3)."""
    for place in range(len(codes)):
        operation, a, b = codes[place], first[place], second[place]
        if operation == _PRODUCT:
            result = multiply(number_at(values, a), number_at(values, b))
        elif operation < _PRODUCT:
            sign = 1.0 - 2.0 * operation
            result = add(number_at(values, a), (sign * values[b, 0], sign * values[b, 1], values[b, 2]))
        elif operation == _INPUT:
            result = (inputs[a], 0.0, 0.0)
        elif operation == _CONSTANT:
            result = number_at(constants, a)
        elif operation == _NEGATIVE:
            result = (-values[a, 0], -values[a, 1], values[a, 2])
        elif operation == _QUOTIENT:
            result = divide(number_at(values, a), number_at(values, b))
        elif operation == _ROOT:
            result = root(number_at(values, a))
        elif operation == _SINE_AND_COSINE:
            result, cosine = sine_and_cosine(number_at(values, a))
            values[place + 1, 0], values[place + 1, 1], values[place + 1, 2] = cosine
        else:
            continue
        values[place, 0], values[place, 1], values[place, 2] = result


@inner
def _most(values: Array, place: int) -> float:
    """An absolute value, so much enlarged that a unit roundoff of it is more than the error of the value."""
    most: float = abs(values[place, 0]) + values[place, 2] / UNIT_ROUNDOFF
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
        if not factorise(matrix, scale[state], factor[state], inverse):
            for i in range(nv):
                scale[state, i] = math.nan
            continue
        solve(values, mass, force, scale[state], inverse, sums, approximate, residual, solution, radius[state])
        for i in range(nv):
            high[state, i], low[state, i] = solution[i, 0], solution[i, 1]
        _sweep(codes, first, second, values, mass, force, high[state], scale[state], adjoints, sizes, columns)
        sensitivity[state], doubt[state] = sum_of_norms(columns, scales[state], scale[state], inverse, sums[0], gamma)


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


def intermediate_representation(name: str) -> tuple[str, str]:
    """The name of the machine code of a loop that Python calls, "evaluate" or "derive", and LLVM's text of the module that holds it."""
    number, indices, numbers = numba.int64, numba.types.CPointer(numba.int64), numba.types.CPointer(numba.float64)
    sizes, program = [number] * 5, [indices] * 3 + [numbers] + [indices]
    signatures = {
        "evaluate": (_evaluate, [*sizes, numba.float64, *program, indices, indices, *[numbers] * 15]),
        "derive": (_derive, [*sizes, *program, indices, *[numbers] * 7]),
    }
    function, arguments = signatures[name]
    made = numba.cfunc(numba.void(*arguments), error_model="numpy")(function)
    return made.native_name, made.inspect_llvm()
