"""What is written in the language of the loops, against the same in Python, number by number and bit by bit."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from harness.arrays import Array
from harness.programs.loops import closing, loops
from harness.programs.loops.interpreter import compiled
from harness.programs.loops.language import Writer, module_of
from harness.programs.loops.values import (
    Value,
    as_integer,
    as_number,
    differs,
    equals,
    floor,
    fma,
    larger,
    root_of,
    select,
    smaller,
    sum_of_lanes,
)
from harness.programs.numbers import LANES

SPECIAL = [0.0, -0.0, 1.0, -1.0, 0.1, 3.0, 2.0**-1074, 1.7e308, math.inf, -math.inf, math.nan]
FIRST, SECOND = (part.ravel() for part in np.meshgrid(SPECIAL, SPECIAL))

OPERATIONS: dict[str, tuple[Callable[[Value, Value], Value], Callable[[Array, Array], Array]]] = {
    "sum": (lambda a, b: a + b, lambda a, b: a + b),
    "difference": (lambda a, b: a - b, lambda a, b: a - b),
    "of a constant": (lambda a, b: 2.0 - a, lambda a, b: 2.0 - a),
    "product": (lambda a, b: a * b, lambda a, b: a * b),
    "quotient": (lambda a, b: a / b, lambda a, b: a / b),
    "inverse": (lambda a, b: 1.0 / a, lambda a, b: 1.0 / a),
    "negative": (lambda a, b: -a, lambda a, b: -a),
    "magnitude": (lambda a, b: abs(a), lambda a, b: np.abs(a)),
    "root": (lambda a, b: root_of(abs(a)), lambda a, b: np.sqrt(np.abs(a))),
    "floor": (lambda a, b: floor(a), lambda a, b: np.floor(a)),
    "larger": (larger, np.maximum),
    "smaller": (smaller, np.minimum),
    "less": (lambda a, b: select(a < b, 1.0, 0.0), lambda a, b: (a < b) * 1.0),
    "at most": (lambda a, b: select(a <= b, 1.0, 0.0), lambda a, b: (a <= b) * 1.0),
    "more": (lambda a, b: select(a > b, 1.0, 0.0), lambda a, b: (a > b) * 1.0),
    "at least": (lambda a, b: select(a >= b, 1.0, 0.0), lambda a, b: (a >= b) * 1.0),
    "equal": (lambda a, b: select(equals(a, b), 1.0, 0.0), lambda a, b: (a == b) * 1.0),
    "different": (lambda a, b: select(differs(a, b), 1.0, 0.0), lambda a, b: (a != b) * 1.0),
    "both": (lambda a, b: select((a > 0.0) & (b > 0.0), a, b), lambda a, b: np.where((a > 0) & (b > 0), a, b)),
    "one": (lambda a, b: select((a > 0.0) | ~(b > 0.0), a, b), lambda a, b: np.where((a > 0) | ~(b > 0), a, b)),
}


@pytest.mark.parametrize("kind", ["numbers", "vectors"])
def test_operators_are_those_of_python(kind: str) -> None:
    count = -(-len(FIRST) // LANES) * LANES
    first, second = (np.resize(values, count) for values in (FIRST, SECOND))
    found = np.empty((len(OPERATIONS), count))
    steps = count // LANES if kind == "vectors" else count

    def write(code: Writer) -> None:
        a, b, results = code.array("a"), code.array("b"), code.array("found", code.argument("n"))
        for i in code.range(code.argument("n")):
            for place, (operation, _) in enumerate(OPERATIONS.values()):
                results[place, i] = operation(a[i], b[i])

    compiled(write, {"n": "integer", "a": kind, "b": kind, "found": kind})(steps, first, second, found)
    with np.errstate(all="ignore"):
        for (name, (_, expected)), results in zip(OPERATIONS.items(), found, strict=True):
            np.testing.assert_array_equal(results, expected(first, second), err_msg=name)


def test_a_product_and_a_sum_are_rounded_once_where_that_is_asked_for_and_twice_otherwise() -> None:
    found = np.empty(2)
    high = 1 + 2.0**-30

    def write(code: Writer) -> None:
        a, results = code.argument("a"), code.array("found")
        results[0], results[1] = fma(a, a, -1.0), a * a - 1.0

    compiled(write, {"a": "number", "found": "numbers"})(high, found)
    assert found[0] == 2.0**-29 + 2.0**-60
    assert found[1] == high * high - 1.0 != found[0]


@pytest.mark.parametrize("module", [loops, closing], ids=["loops", "closing"])
def test_nothing_that_is_written_may_change_a_rounding(module: Any) -> None:
    text = module_of(module.LOOPS, module.PARTS)
    assert " fadd " in text
    for flag in (" fast ", " contract ", " reassoc ", " nnan ", " ninf ", " nsz ", " arcp ", " afn "):
        assert flag not in text


def test_loops_choices_tables_and_lanes() -> None:
    found, table = np.zeros(4), np.arange(12.0).reshape(6, 2)

    def write(code: Writer) -> None:
        results, rows = code.array("found"), code.table("rows", table)
        total = code.variable(0.0)
        for i in code.range(2, code.argument("n")):
            for j in code.range(i):
                with code.when(equals(i - j, 1)):
                    total.value += as_number(i)
        results[0] = total.value
        for key in code.range(3):
            code.choose(key, {1: lambda: results.__setitem__(1, 7.0)}, lambda: results.__setitem__(2, results[2] + 1.0))
        places = as_integer(code.array("places").in_vectors()[0]) % 4
        results[3] = sum_of_lanes(rows[places, 1])

    compiled(write, {"n": "integer", "found": "numbers", "places": "numbers"})(5, found, np.array([1.0, 3.0, 4.0, 5.0]))
    assert found.tolist() == [2.0 + 3.0 + 4.0, 7.0, 2.0, 3.0 + 7.0 + 1.0 + 3.0]
