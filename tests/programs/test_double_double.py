"""Bounds of double-double arithmetic against balls of 500 bits, at random operands and at extreme ones."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import flint
import numpy as np
import pytest

from harness.arrays import Array
from harness.programs.loops import double_double, interpreter
from harness.programs.loops.language import Writer

BITS = 500
COUNT = 3_000
# How far of its bound an operand is off. At the ends the bound of a result is all but attained.
SHARES = (-1.0, 0.0, 1.0)


def write_everything(code: Writer) -> None:
    """The seven results of each pair of operands, (7, n, 3)."""
    n = code.argument("n")
    a, b, found = (code.array(name, 3) for name in ("a", "b", "found"))
    for i in code.range(n):
        x, y = double_double.number_at(a, i), double_double.number_at(b, i)
        results = [double_double.add(x, y), double_double.multiply(x, y), double_double.divide(x, y), double_double.root(x)]
        angles = *double_double.sine_and_cosine(code, x), double_double.arctangent(code, x, y)
        for number, result in enumerate([*results, *angles]):
            double_double.store(found, n * number + i, result)


@functools.cache
def compiled() -> Callable[..., None]:
    return interpreter.compiled(write_everything, {"n": "integer", "a": "numbers", "b": "numbers", "found": "numbers"})


EXACT: dict[str, Callable[[Any, Any], Any]] = {
    "add": lambda x, y: x + y,
    "multiply": lambda x, y: x * y,
    "divide": lambda x, y: x / y,
    "root": lambda x, y: x.sqrt(),
    "sine": lambda x, y: x.sin(),
    "cosine": lambda x, y: x.cos(),
    "arctangent": lambda x, y: flint.arb.atan2(x, y),
}


def operands(generator: np.random.Generator, count: int) -> Array:
    """Numbers of all sizes, (count, 3), some exact, some with large bounds, some special."""
    size = np.where(generator.random(count) < 0.7, generator.uniform(-30, 30, count), generator.uniform(-1000, 1000, count))
    high = generator.choice([-1.0, 1.0], count) * generator.uniform(1, 2, count) * 2.0 ** np.rint(size)
    near = generator.random(count) < 0.1
    # Beside multiples of the angles at which the series changes its place.
    high[near] = np.rint(high[near] % 1e4) * math.pi / 128 * (1 + generator.integers(-3, 4, near.sum()) * 2.0**-52)
    low = np.where(generator.random(count) < 0.3, 0.0, high * 2.0**-53 * generator.uniform(-0.99, 0.99, count))
    bound = np.where(generator.random(count) < 0.4, 0.0, np.abs(high) * 2.0 ** generator.uniform(-110, -30, count))
    special = [0.0, 1.0, -1.0, 0.5, 3.0, math.pi, math.pi / 2, 5e-324, 2.0**-1022, 1.7e308, 2.0**20, math.inf, math.nan, -0.0]
    extreme = np.array([(value, 0.0, 0.0) for value in special])
    found = np.column_stack([high, low, bound])
    # What cancelled: nothing is left but the bound.
    cancelled = generator.random(count) < 0.05
    found[cancelled, :2] *= generator.choice([0.0, 2.0**-420], cancelled.sum())[:, None]
    # A float64 of which no second half is left is what it is.
    found[~(np.abs(found[:, 0]) > 2.0**-960), 1] = 0.0
    found[: len(extreme)] = extreme
    return found[generator.permutation(count)]


def as_balls(number: Array) -> list[Any]:
    """What the number may stand for: its middle and both ends of its bound."""
    middle = flint.arb(number[0]) + flint.arb(number[1])
    return [middle + share * flint.arb(number[2]) for share in (SHARES if number[2] else (0.0,))]


def violations(a: Array, b: Array, found: Array, share: float = 1.0) -> dict[str, int]:
    """By operation, how many results are further off than ``share`` of their bounds."""
    counts = dict.fromkeys(EXACT, 0)
    with flint.ctx.workprec(BITS):
        for index in range(len(a)):
            if not (np.isfinite(a[index]).all() and np.isfinite(b[index]).all()):
                continue
            lefts, rights = as_balls(a[index]), as_balls(b[index])
            for name, results in zip(EXACT, found[:, index], strict=True):
                if not math.isfinite(results[2]):
                    continue
                bound, middle = flint.arb(share) * flint.arb(results[2]), flint.arb(results[0]) + flint.arb(results[1])
                others = rights if name in ("add", "multiply", "divide", "arctangent") else rights[:1]
                counts[name] += any(not abs(EXACT[name](x, y) - middle) <= bound for x in lefts for y in others)
    return counts


def results_of(a: Array, b: Array) -> Array:
    found = np.empty((len(EXACT), len(a), 3))
    compiled()(len(a), a, b, found)
    return found


@pytest.mark.parametrize("count", [COUNT, pytest.param(1_000_000, marks=pytest.mark.nightly)])
def test_what_a_result_stands_for_is_within_its_bound(count: int) -> None:
    generator = np.random.default_rng(count)
    a, b = operands(generator, count), operands(generator, count)
    found = results_of(a, b)
    assert violations(a, b, found) == dict.fromkeys(EXACT, 0)
    # A bound of infinity is no answer: most have one.
    moderate = np.logical_and(*(np.abs(np.frexp(part[:, 0])[1] - 0.5) < 30 for part in (a, b))) & (a[:, 0] != 0) & (b[:, 0] != 0)
    positive = a[:, 0] > 0
    for name, results in zip(EXACT, found, strict=True):
        answered = np.isfinite(results[:, 2])
        asked = moderate & (positive if name == "root" else np.abs(a[:, 0]) < 2.0**20) & (a[:, 2] < 1e-9) & (b[:, 2] < 1e-9)
        assert answered[asked].mean() > 0.99, name


def test_a_bound_too_small_by_two_is_seen() -> None:
    generator = np.random.default_rng(1)
    a, b = operands(generator, COUNT), operands(generator, COUNT)
    assert min(violations(a, b, results_of(a, b), share=0.5).values()) > 10


def test_bounds_of_exact_operands_are_a_few_units_of_twice_the_digits() -> None:
    generator = np.random.default_rng(2)
    a, b = (np.column_stack([generator.uniform(0.1, 3.0, 1000), np.zeros((1000, 2))]) for _ in range(2))
    found = results_of(a, b)
    assert (found[:4, :, 2] <= 20 * 2.0**-106 * np.abs(found[:4, :, 0])).all()
    assert (found[4:, :, 2] <= 60 * 2.0**-106).all()


def test_the_exact_zero_stays_exact() -> None:
    zero, other = np.zeros((1, 3)), np.array([[0.7, 1e-18, 1e-30]])
    found = results_of(zero, other)
    assert (found[0, 0] == other[0]).all()
    assert not found[1:5].any() and found[5, 0].tolist() == [1.0, 0.0, found[5, 0, 2]]


def test_a_zero_with_a_bound_has_a_quotient_with_one() -> None:
    """As what cancels in exact arithmetic; an infinite bound would send the whole state to ball arithmetic."""
    cancelled, other = np.array([[0.0, 0.0, 1e-30], [1e-130, 0.0, 1e-30]]), np.array([[0.7, 1e-18, 1e-30]] * 2)
    quotients = results_of(cancelled, other)[2]
    assert (quotients[:, :2] == 0).all()
    assert (quotients[:, 2] > 1e-30 / 0.7).all() and (quotients[:, 2] < 1.001e-30 / 0.7).all()


def test_an_angle_has_a_bound_where_its_cut_is_told_apart() -> None:
    """At the cut it is pi where the ordinate is exactly zero, and any of two angles a turn apart where it may be on either side."""
    y = np.array([[0.0, 0.0, 0.0], [-0.0, 0.0, 0.0], [1e-20, 0.0, 1e-21], [-1e-20, 0.0, 1e-21], [1e-20, 0.0, 1e-19], [1e-20, 0.0, 1e-19]])
    x = np.array([[-2.0, 0.0, 0.0]] * 5 + [[2.0, 0.0, 0.0]])
    high, low, bound = np.moveaxis(results_of(y, x)[-1], -1, 0)
    assert high[:4].tolist() == [math.pi, math.pi, math.pi, -math.pi] and (np.abs(low[:2] - 1.2246467991473532e-16) < 1e-31).all()
    assert np.isfinite(bound).tolist() == [True, True, True, True, False, True]
    assert not results_of(np.zeros((1, 3)), x[-1:])[-1].any(), "the exact zero"
    assert not np.isfinite(results_of(np.zeros((1, 3)), np.zeros((1, 3)))[-1, 0, 2]), "no angle at all"


def write_sines_in_float64(code: Writer) -> None:
    """Sine and cosine of each argument, (n, 2)."""
    a, found = code.array("a"), code.array("found", 2)
    for i in code.range(code.argument("n")):
        for place, result in enumerate(double_double.sine_and_cosine_in_float64(code, a[i])):
            found[i, place] = result


@pytest.mark.parametrize("reach", [0.006, 1e3, 2.0**20])
def test_sines_in_float64_are_right_to_the_last_unit_but_one(reach: float) -> None:
    """Of 1, and of the sine itself beside zero, where the series alone makes it."""
    a, found = np.random.default_rng(4).uniform(-reach, reach, COUNT), np.empty((COUNT, 2))
    interpreter.compiled(write_sines_in_float64, {"n": "integer", "a": "numbers", "found": "numbers"})(COUNT, a, found)
    with flint.ctx.workprec(BITS):
        exact = [(flint.arb(angle).sin(), flint.arb(angle).cos()) for angle in a.tolist()]
        errors = np.array(
            [[float(value - right) for value, right in zip(*pair, strict=True)] for pair in zip(found.tolist(), exact, strict=True)]
        )
    assert np.abs(errors).max() <= 2.0**-52
    assert reach > 1 or (np.abs(errors[:, 0]) <= 2.0**-52 * np.abs(a)).all()
