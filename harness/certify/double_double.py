"""Double-double arithmetic in which every number carries a proven bound of its error.

A number is (high, low, bound): high + low is what was computed, high its rounding to float64, and what it stands for lies within
``bound`` of it. Bounds are absolute. They are computed in float64 and rounded upwards by ``_UPWARDS``, which is more than the
roundings of any one bound add up to. ``_UNDERFLOW`` stands for what products and quotients lose below the smallest numbers. What
may overflow, and what is out of the range that a proof asks for, has the bound infinity or NaN: no comparison accepts it.

The exact zero, (0, 0, 0), stays exact, so that a state at rest has accelerations that are zero and not nearly so.

Sources, u = 2^-53: Joldes, Muller, Popescu, Tight and rigorous error bounds for basic building blocks of double-word arithmetic,
ACM TOMS 44 (2017): algorithms 6, 12 and 17, of relative errors 3 u^2 + 13 u^3, 5 u^2 and 15 u^2 + 56 u^3. Lefevre, Louvet, Muller,
Picot, Rideau, Accurate calculation of Euclidean norms using double-word arithmetic, ACM TOMS 49 (2023), for the root: 25/8 u^2.
Muller et al., Handbook of Floating-Point Arithmetic, 2nd ed., chapter 11 (reduction of arguments).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any, TypeVar

import numba
import numpy as np
from llvmlite import ir
from numba.extending import intrinsic

from harness.arrays import Array
from harness.certify.numbers import Number, exactly, of_ball

F = TypeVar("F", bound=Callable[..., Any])


def inner(function: F) -> F:
    """For what only compiled functions call."""
    # A way for Python to it would take as long again to compile.
    return numba.njit(no_cpython_wrapper=True, error_model="numpy")(function)  # type: ignore[no-any-return]


@intrinsic  # type: ignore[untyped-decorator]
def fma(typing_context: Any, a: Any, b: Any, c: Any) -> Any:
    """a b + c, rounded once: an instruction of the processor, or the C library's function where it has none."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        double = ir.DoubleType()
        function = builder.module.declare_intrinsic("llvm.fma", [double], ir.FunctionType(double, [double] * 3))
        return builder.call(function, arguments)

    return numba.float64(numba.float64, numba.float64, numba.float64), generate


_U2 = 2.0**-106
_ADD, _MULTIPLY, _DIVIDE, _ROOT = 4 * _U2, 6 * _U2, 17 * _U2, 4 * _U2
# Of no bound are more than a dozen roundings taken.
_UPWARDS = 1 + 2.0**-48
_UNDERFLOW = 2.0**-1040
# Within it no intermediate result of a quotient or a root falls below the smallest normal number or overflows.
_SMALLEST, _LARGEST = 2.0**-400, 2.0**400

# Sines are known at the multiples of pi / _PARTS, and a series leads on from the nearest one.
_PARTS = 64
# The most that an argument is off the nearest multiple, over its exact half distance for roundings of the quotient.
_REACH = math.pi / (2 * _PARTS) * 1.001
_LARGEST_ARGUMENT = 2.0**20
_TERMS = 7
# The first terms that are left out, over the argument and over 1.
_REST_OF_SINE = _REACH ** (2 * _TERMS) / math.factorial(2 * _TERMS + 1) * 1.001
_REST_OF_COSINE = _REACH ** (2 * _TERMS) / math.factorial(2 * _TERMS) * 1.001


def _tables() -> tuple[Array, Array, Array, Array]:
    """pi / _PARTS in three numbers, sines of its multiples over two turns and a quarter, and the coefficients of both series."""
    import flint

    with flint.ctx.workprec(400):
        part = flint.arb.pi() / _PARTS
        first, second, rest = of_ball(part)[0], of_ball(part)[1], of_ball(part - of_ball(part)[0] - of_ball(part)[1])
        step = np.array([first, second, rest[0], math.nextafter(abs(rest[1]) + rest[2], math.inf)])
        sines = [(0.0, 0.0, 0.0) if j % _PARTS == 0 else of_ball((part * j).sin()) for j in range(2 * _PARTS + _PARTS // 2)]
        # Where a cosine is zero or one, and a sine one, they are so exactly.
        exact = {_PARTS // 2: 1.0, 3 * _PARTS // 2: -1.0}
        sines = [(exact[j], 0.0, 0.0) if j in exact else sine for j, sine in enumerate(sines)]
    series = [[exactly(Fraction((-1) ** k, math.factorial(2 * k + odd))) for k in range(_TERMS)] for odd in (1, 0)]
    return step, np.array(sines), np.array(series[0]), np.array(series[1])


_STEP, _SINES, _SERIES_OF_SINE, _SERIES_OF_COSINE = _tables()


@inner
def _two_sum(a: float, b: float) -> tuple[float, float]:
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@inner
def add(a: Number, b: Number) -> Number:
    """a + b by algorithm 6 (AccurateDWPlusDW)."""
    if a[0] == 0 and a[1] == 0 and a[2] == 0:
        return b
    if b[0] == 0 and b[1] == 0 and b[2] == 0:
        return a
    high, rest = _two_sum(a[0], b[0])
    low, last = _two_sum(a[1], b[1])
    rest += low
    middle = high + rest
    rest = last + (rest - (middle - high))
    total = middle + rest
    return total, rest - (total - middle), (a[2] + b[2] + _ADD * abs(total)) * _UPWARDS + (_UNDERFLOW if total != 0 else 0.0)


@inner
def multiply(a: Number, b: Number) -> Number:
    """a b by algorithm 12 (DWTimesDW3)."""
    if (a[0] == 0 and a[1] == 0 and a[2] == 0) or (b[0] == 0 and b[1] == 0 and b[2] == 0):
        return 0.0, 0.0, 0.0
    high = a[0] * b[0]
    rest = fma(a[0], b[0], -high) + fma(a[1], b[0], fma(a[0], b[1], a[1] * b[1]))
    product = high + rest
    bound = abs(a[0]) * b[2] + abs(b[0]) * a[2] + a[2] * b[2] + _MULTIPLY * abs(product)
    return product, rest - (product - high), bound * _UPWARDS + _UNDERFLOW


@inner
def divide(a: Number, b: Number) -> Number:
    """a / b by algorithm 17 (DWDivDW2)."""
    size, of_dividend = abs(b[0]), abs(a[0])
    if not (_SMALLEST < size < _LARGEST and b[2] < size / 2 and of_dividend < _LARGEST):
        return a[0] / size if size > 0 else math.nan, 0.0, math.inf
    if of_dividend == 0 and a[1] == 0 and a[2] == 0:
        return 0.0, 0.0, 0.0
    if of_dividend < _SMALLEST:
        return a[0] / b[0], 0.0, math.inf
    first = a[0] / b[0]
    product = first * b[0]
    lower = fma(first, b[0], -product)
    lower = fma(first, b[1], lower)
    high = product + lower
    lower -= high - product
    second = ((a[0] - high) + (a[1] - lower)) / b[0]
    quotient = first + second
    bound = (a[2] + abs(quotient) * b[2]) / (size - b[2]) * (1 + 2.0**-40) + _DIVIDE * abs(quotient)
    return quotient, second - (quotient - first), bound * _UPWARDS + _UNDERFLOW


@inner
def root(a: Number) -> Number:
    """The square root of a by SQRTDWtoDW; of what may be negative the bound is infinite."""
    if a[0] == 0 and a[1] == 0 and a[2] == 0:
        return 0.0, 0.0, 0.0
    if not (_SMALLEST < a[0] < _LARGEST and a[2] < a[0] / 2):
        return math.sqrt(abs(a[0])), 0.0, math.inf
    first = math.sqrt(a[0])
    second = (a[1] + fma(-first, first, a[0])) / (2 * first)
    total = first + second
    # |sqrt a - sqrt b| = |a - b| / (sqrt a + sqrt b).
    return total, second - (total - first), (a[2] / first * (1 + 2.0**-40) + _ROOT * total) * _UPWARDS + _UNDERFLOW


@inner
def _series(square: Number, coefficients: Array) -> Number:
    """sum of coefficients[k] square^k, by Horner's scheme."""
    total = (coefficients[_TERMS - 1, 0], coefficients[_TERMS - 1, 1], coefficients[_TERMS - 1, 2])
    for k in range(_TERMS - 2, -1, -1):
        total = add(multiply(total, square), (coefficients[k, 0], coefficients[k, 1], coefficients[k, 2]))
    return total


@inner
def sine_and_cosine(a: Number) -> tuple[Number, Number]:
    """The sine and the cosine of a, by the nearest multiple of pi / 64 and the series of both at what is left."""
    if not (abs(a[0]) < _LARGEST_ARGUMENT and a[2] < 1e-9):
        return (math.sin(a[0]), 0.0, math.inf), (math.cos(a[0]), 0.0, math.inf)
    multiple = math.floor(a[0] / _STEP[0] + 0.5)
    left = a
    for k in range(2):
        # The product of two numbers is the sum of two numbers, exactly.
        product = multiple * _STEP[k]
        left = add(left, (-product, -fma(multiple, _STEP[k], -product), 0.0))
    if multiple != 0:
        left = add(left, (-multiple * _STEP[2], 0.0, abs(multiple) * (_STEP[3] + _U2 * abs(_STEP[2]) * 2.0**53) * _UPWARDS))
    square = multiply(left, left)
    sine = multiply(left, _series(square, _SERIES_OF_SINE))
    cosine = _series(square, _SERIES_OF_COSINE)
    sine = (sine[0], sine[1], (sine[2] + (abs(left[0]) + left[2]) * _REST_OF_SINE) * _UPWARDS)
    cosine = (cosine[0], cosine[1], (cosine[2] + (square[0] + square[2]) * (_REST_OF_COSINE / _REACH**2)) * _UPWARDS)
    place = int(multiple) % (2 * _PARTS)
    quarter = place + _PARTS // 2
    of_sine = (_SINES[place, 0], _SINES[place, 1], _SINES[place, 2])
    of_cosine = (_SINES[quarter, 0], _SINES[quarter, 1], _SINES[quarter, 2])
    opposite = multiply(of_sine, sine)
    return (
        add(multiply(of_sine, cosine), multiply(of_cosine, sine)),
        add(multiply(of_cosine, cosine), (-opposite[0], -opposite[1], opposite[2])),
    )
