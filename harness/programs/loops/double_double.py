"""Double-double arithmetic in which every number carries a proven bound of its error.

Proofs and sources: docs/inside/numerics.md, "Double-double".
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from fractions import Fraction

import numpy as np

from harness.arrays import Array
from harness.programs.loops.language import Writer
from harness.programs.loops.values import Array as Place
from harness.programs.loops.values import Operand, Value, as_integer, equals, floor, fma, larger, root_of, select, smaller
from harness.programs.numbers import exactly, of_ball

# high, low and bound, as they are written.
Number = tuple[Operand, Operand, Operand]
Known = tuple[Value, Value, Value]
_U2 = 2.0**-106
_ADD, _MULTIPLY, _DIVIDE, _ROOT = 4 * _U2, 6 * _U2, 17 * _U2, 4 * _U2
# Of no bound are more than a dozen roundings taken.
_UPWARDS = 1 + 2.0**-48
UNDERFLOW = 2.0**-1040
# Within it no intermediate result of a quotient or a root falls below the smallest normal number or overflows.
_SMALLEST, _LARGEST = 2.0**-400, 2.0**400

# Sines are known at the multiples of pi / _PARTS, and a series leads on from the nearest one.
_PARTS = 256
# The most that an argument is off the nearest multiple, over its exact half distance for roundings of the quotient.
_REACH = math.pi / (2 * _PARTS) * 1.001
LARGEST_ARGUMENT = 2.0**20
# Of each series, and how many of them, the first, need more digits than a float64 has.
_TERMS, _LONG_TERMS = 6, 4
# Of each series, for float64.
_SHORT = 4
# Of the arctangent of a quotient up to 1, over it and 1 less it: within 0.004.
_BOW = 0.273
# The most that an angle in float64 may be off, so that the arctangent of the rest is a quotient.
_REST_OF_ANGLE = 2.0**-20
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


def number_at(values: Place, place: Value | int) -> Known:
    return values[place, 0], values[place, 1], values[place, 2]


def store(values: Place, place: Value | int, number: Number) -> None:
    values[place, 0], values[place, 1], values[place, 2] = number


def _like(a: Known, number: Number) -> Known:
    """A number of as many lanes as ``a`` has."""
    high, low, bound = (Value(a[0].code, a[0].code.constant(part, a[0].raw.type)) for part in number)
    return high, low, bound


def negative(a: Known) -> Known:
    return -a[0], -a[1], a[2]


def _is_zero(a: Known) -> Value:
    return equals(a[0], 0.0) & equals(a[1], 0.0) & equals(a[2], 0.0)


def _two_sum(a: Value, b: Value) -> tuple[Value, Value]:
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def add(a: Known, b: Number) -> Known:
    """a + b by algorithm 6 (AccurateDWPlusDW)."""
    b = _like(a, b)
    high, rest = _two_sum(a[0], b[0])
    low, last = _two_sum(a[1], b[1])
    rest += low
    middle = high + rest
    rest = last + (rest - (middle - high))
    total = middle + rest
    # Without roundings where one of them is the exact zero: the other one is what all the steps give.
    is_exact = _is_zero(a) | _is_zero(b)
    bound = (a[2] + b[2] + _ADD * abs(total)) * _UPWARDS + select(equals(total, 0.0), 0.0, UNDERFLOW)
    return total, rest - (total - middle), select(is_exact, a[2] + b[2], bound)


def multiply(a: Known, b: Number) -> Known:
    """a b by algorithm 12 (DWTimesDW3)."""
    b = _like(a, b)
    high = a[0] * b[0]
    rest = fma(a[0], b[0], -high) + fma(a[1], b[0], fma(a[0], b[1], a[1] * b[1]))
    product = high + rest
    bound = (abs(a[0]) * b[2] + abs(b[0]) * a[2] + a[2] * b[2] + _MULTIPLY * abs(product)) * _UPWARDS + UNDERFLOW
    return product, rest - (product - high), select(_is_zero(a) | _is_zero(b), abs(product), bound)


def store_total(values: Place, place: Value | int, first: Number, terms: Iterable[Known]) -> None:
    """``first`` and the sum of terms, as a generator expression over a range writes them, at a place."""
    store(values, place, first)
    for term in terms:
        store(values, place, add(number_at(values, place), term))


def divide(a: Known, b: Known) -> Known:
    """a / b by algorithm 17 (DWDivDW2)."""
    size, of_dividend = abs(b[0]), abs(a[0])
    first = a[0] / b[0]
    product = first * b[0]
    lower = fma(first, b[1], fma(first, b[0], -product))
    high = product + lower
    lower -= high - product
    second = ((a[0] - high) + (a[1] - lower)) / b[0]
    quotient = first + second
    bound = (a[2] + abs(quotient) * b[2]) / (size - b[2]) * (1 + 2.0**-40) + _DIVIDE * abs(quotient)
    divides = (size > _SMALLEST) & (size < _LARGEST) & (b[2] < size / 2)
    is_proven = divides & (of_dividend >= _SMALLEST) & (of_dividend < _LARGEST)
    is_zero = divides & _is_zero(a)
    # What cancels in exact arithmetic is a zero with a bound: its quotient is another.
    is_small = divides & (of_dividend < _SMALLEST)
    of_small = (2 * of_dividend + a[2]) / (size - b[2]) * (1 + 2.0**-40)
    bound = select(is_small, of_small, bound) * _UPWARDS + UNDERFLOW
    bound = select(is_zero, 0.0, select(is_proven | is_small, bound, math.inf))
    return select(is_small, 0.0, quotient), select(is_proven, second - (quotient - first), 0.0), bound


def root(a: Known) -> Known:
    """The square root of a by SQRTDWtoDW; of what may be negative the bound is infinite."""
    first = root_of(abs(a[0]))
    second = (a[1] + fma(-first, first, a[0])) / (2 * first)
    total = first + second
    # |sqrt a - sqrt b| = |a - b| / (sqrt a + sqrt b), where sqrt b is at least 0.7 sqrt a, far more than rounding takes from the quotient.
    bound = (a[2] / first + _ROOT * total) * _UPWARDS + UNDERFLOW
    is_proven = (a[0] > _SMALLEST) & (a[0] < _LARGEST) & (a[2] < a[0] / 2)
    high, low = select(is_proven, total, first), select(is_proven, second - (total - first), 0.0)
    return high, low, select(_is_zero(a), 0.0, select(is_proven, bound, math.inf))


def _series(square: Known, coefficients: Place) -> Known:
    """sum of coefficients[k] square^k, by Horner's scheme; its last terms in float64."""
    short = coefficients[_TERMS - 1, 0]
    for k in reversed(range(_LONG_TERMS, _TERMS - 1)):
        short = short * square[0] + coefficients[k, 0]
    # Terms fall by 1,000 and more, and each of them takes part in six roundings at most, those of its number and of the square among them.
    total = _like(square, (short, 0.0, abs(coefficients[_LONG_TERMS, 0]) * (1.01 * 6 * 2.0**-53) + square[2]))
    for k in reversed(range(_LONG_TERMS)):
        total = add(multiply(total, square), number_at(coefficients, k))
    return total


def sine_and_cosine_in_float64(code: Writer, a: Value) -> tuple[Value, Value]:
    """Both to some units in the last place, as ``sine_and_cosine``; nothing is proved of them."""
    step, sines, of_sine, of_cosine = _series_tables(code)
    multiple = select(abs(a) < LARGEST_ARGUMENT, floor(a / step[0] + 0.5), 0.0)
    left = fma(-multiple, step[1], fma(-multiple, step[0], a))
    square = left * left
    sine, cosine = of_sine[_SHORT - 1, 0], of_cosine[_SHORT - 1, 0]
    for k in reversed(range(_SHORT - 1)):
        sine, cosine = sine * square + of_sine[k, 0], cosine * square + of_cosine[k, 0]
    place = as_integer(multiple) % (2 * _PARTS)
    sine_there, cosine_there = sines[place, 0], sines[place + _PARTS // 2, 0]
    sine *= left
    return sine_there * cosine + cosine_there * sine, cosine_there * cosine - sine_there * sine


def _series_tables(code: Writer) -> list[Place]:
    names = ("step", "sines", "series_of_sine", "series_of_cosine")
    return [code.table(name, table) for name, table in zip(names, _tables(), strict=True)]


def sine_and_cosine(code: Writer, a: Known) -> tuple[Known, Known]:
    """The sine and the cosine of a, by the nearest multiple of pi / 64 and the series of both at what is left."""
    step, sines, of_sine, of_cosine = _series_tables(code)
    is_proven = (abs(a[0]) < LARGEST_ARGUMENT) & (a[2] < 1e-9)
    multiple = select(is_proven, floor(a[0] / step[0] + 0.5), 0.0)
    left = a
    for k in range(2):
        # The product of two numbers is the sum of two numbers, exactly.
        product = multiple * step[k]
        left = add(left, (-product, -fma(multiple, step[k], -product), 0.0))
    last = abs(multiple) * (step[3] + abs(step[2]) * (_U2 * 2.0**53)) * _UPWARDS
    left = add(left, (-(multiple * step[2]), 0.0, last))
    square = multiply(left, left)
    sine = multiply(left, _series(square, of_sine))
    cosine = _series(square, of_cosine)
    sine = (sine[0], sine[1], (sine[2] + (abs(left[0]) + left[2]) * _REST_OF_SINE) * _UPWARDS)
    cosine = (cosine[0], cosine[1], (cosine[2] + (square[0] + square[2]) * (_REST_OF_COSINE / _REACH**2)) * _UPWARDS)
    place = as_integer(multiple) % (2 * _PARTS)
    sine_there, cosine_there = number_at(sines, place), number_at(sines, place + _PARTS // 2)
    results = (
        add(multiply(sine_there, cosine), multiply(cosine_there, sine)),
        add(multiply(cosine_there, cosine), negative(multiply(sine_there, sine))),
    )
    first, second = ((high, low, select(is_proven, bound, math.inf)) for high, low, bound in results)
    return first, second


def arctangent_in_float64(code: Writer, y: Value, x: Value) -> Value:
    """The angle of (x, y), in [-pi, pi], to some units in the last place; nothing is proved of it."""
    across, along = abs(y), abs(x)
    ratio = smaller(across, along) / larger(across, along)
    angle = ratio * (math.pi / 4 + _BOW * (1.0 - ratio))
    angle = select(across > along, math.pi / 2 - angle, angle)
    angle = select(x < 0.0, math.pi - angle, angle)
    angle = select(y < 0.0, -angle, angle)
    sine, cosine = sine_and_cosine_in_float64(code, angle)
    rest = (y * cosine - x * sine) / (x * cosine + y * sine)
    square = rest * rest
    return angle + rest * (1.0 - square * (1.0 / 3 - square * (1.0 / 5)))


def arctangent(code: Writer, y: Known, x: Known) -> Known:
    """The angle of (x, y), in (-pi, pi], as ``atan2`` has it; its bound is infinite where the sides of its cut are not told apart."""
    first = arctangent_in_float64(code, y[0], x[0])
    nothing = _like(y, (0.0, 0.0, 0.0))
    sine, cosine = sine_and_cosine(code, (first, *nothing[1:]))
    across = add(multiply(y, cosine), negative(multiply(x, sine)))
    along = add(multiply(x, cosine), multiply(y, sine))
    rest = divide(across, along)
    reach = abs(rest[0]) + abs(rest[1]) + rest[2]
    # atan t is within |t|^3 / 3 of t.
    high, low, bound = add((first, *nothing[1:]), (rest[0], rest[1], (rest[2] + reach * reach * reach / 3) * _UPWARDS))
    is_beside_the_cut = (x[0] > x[2]) | (abs(y[0]) > y[2]) | _is_zero(y)
    is_proven = is_beside_the_cut & (along[0] > along[2]) & (reach < _REST_OF_ANGLE)
    return high, low, select(is_proven, bound, math.inf)
