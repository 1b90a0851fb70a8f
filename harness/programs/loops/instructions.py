"""The instructions of a program, as loops over them are written for LLVM: forwards, and backwards with adjoints.

``start`` is the place of the first instruction's result among ``values``, (places, 3), whose every number is of four states.
"""

from __future__ import annotations

from collections.abc import Callable

from harness.programs.loops import encoding as operations
from harness.programs.loops.double_double import (
    Known,
    add,
    divide,
    multiply,
    number_at,
    root,
    sine_and_cosine,
    sine_and_cosine_in_float64,
    store,
)
from harness.programs.loops.language import Writer
from harness.programs.loops.values import Array, Value, as_number, differs, equals, root_of, select
from harness.programs.numbers import LANES, UNIT_ROUNDOFF

RUN = {"m": "integer", "start": "integer", "instructions": "halves", "values": "vectors"}
SWEEP = {**RUN, "blocks": "integer", "lane": "integer", "adjoints": "vectors", "sizes": "numbers"}


def write_run(code: Writer) -> None:
    """Every instruction's result at four states, into ``values``."""
    instructions, values = code.array("instructions", 6), code.array("values", 3)
    for index in code.range(code.argument("m")):
        a, b = (number_at(values, instructions[index, operand]) for operand in (1, 2))
        _write_instruction(code, instructions[index, 0], values, code.argument("start") + index, a, b)


def _write_instruction(code: Writer, operation: Value, values: Array, place: Value, a: Known, b: Known) -> None:
    def sum_or_difference() -> None:
        sign = 1.0 - 2.0 * as_number(operation)
        store(values, place, add(a, (sign * b[0], sign * b[1], b[2])))

    def sine_with_cosine() -> None:
        sine, cosine = sine_and_cosine(code, a)
        store(values, place, sine)
        store(values, place + 1, cosine)

    cases: dict[int, Callable[[], None]] = {
        operations.PRODUCT: lambda: store(values, place, multiply(a, b)),
        operations.QUOTIENT: lambda: store(values, place, divide(a, b)),
        operations.ROOT: lambda: store(values, place, root(a)),
        operations.SINE_AND_COSINE: sine_with_cosine,
        operations.COSINE: lambda: None,
    }
    code.choose(operation, cases, sum_or_difference)


def write_approximate_run(code: Writer) -> None:
    """Every instruction's result at four states in float64, into ``values``, (places,)."""
    instructions, values = code.array("instructions", 6), code.array("values")
    for index in code.range(code.argument("m")):
        operation, place = instructions[index, 0], code.argument("start") + index
        a, b = values[instructions[index, 1]], values[instructions[index, 2]]
        _write_approximately(code, operation, values, place, a, b)


def _write_approximately(code: Writer, operation: Value, values: Array, place: Value, a: Value, b: Value) -> None:
    def store_at(result: Value) -> None:
        values[place] = result

    def sine_with_cosine() -> None:
        values[place], values[place + 1] = sine_and_cosine_in_float64(code, a)

    cases: dict[int, Callable[[], None]] = {
        operations.PRODUCT: lambda: store_at(a * b),
        operations.QUOTIENT: lambda: store_at(a / b),
        operations.ROOT: lambda: store_at(root_of(a)),
        operations.SINE_AND_COSINE: sine_with_cosine,
        operations.COSINE: lambda: None,
    }
    code.choose(operation, cases, lambda: store_at(a + (1.0 - 2.0 * as_number(operation)) * b))


class _Sweep:
    """Adjoints of the state in one lane, and of ``blocks`` times four equations at once."""

    def __init__(self, code: Writer) -> None:
        self.code, self.blocks = code, code.argument("blocks")
        self.instructions, self.start = code.array("instructions", 6), code.argument("start")
        self.adjoints, self.sizes = code.array("adjoints", self.blocks), code.array("sizes")
        self.values = code.array("values", 3).in_numbers(3, LANES)

    def value(self, place: Value, part: int) -> Value:
        return self.values[place, part, self.code.argument("lane")]

    def most(self, place: Value) -> Value:
        """An absolute value, so much enlarged that a unit roundoff of it is more than the error of the value."""
        return abs(self.value(place, 0)) + self.value(place, 2) / UNIT_ROUNDOFF

    def step(self, index: Value) -> None:
        """Add the adjoint of an instruction's result, times partial derivatives, to those of its operands, and empty it."""
        code, place, value, most = self.code, self.start + index, self.value, self.most
        operation, a, b, row, *rows = (self.instructions[index, part] for part in range(6))

        def of_sums_and_products() -> None:
            is_product = equals(operation, operations.PRODUCT)
            by_a = select(is_product, value(b, 0), 1.0)
            by_b = select(is_product, value(a, 0), 1.0 - 2.0 * as_number(operation))
            self._pass_on(row, [(rows[0], by_a, select(is_product, most(b), 1.0)), (rows[1], by_b, select(is_product, most(a), 1.0))])

        def of_quotient() -> None:
            by_a = 1.0 / value(b, 0)
            most_of_a = abs(by_a) * most(b) * abs(by_a)
            self._pass_on(row, [(rows[0], by_a, most_of_a), (rows[1], -(value(place, 0) * by_a), most(place) * most_of_a)])

        def of_root() -> None:
            by_a = 0.5 / value(place, 0)
            self._pass_on(row, [(rows[0], by_a, 2.0 * by_a * most(place) * by_a)])

        def of_sine_and_cosine() -> None:
            sine, cosine, of_cosine = value(place, 0), value(place + 1, 0), rows[1]
            for block in code.range(self.blocks):
                self.adjoints[row, block] = cosine * self.adjoints[row, block] - sine * self.adjoints[of_cosine, block]
                self.adjoints[of_cosine, block] = 0.0
            self.sizes[row] = most(place + 1) * self.sizes[row] + most(place) * self.sizes[of_cosine]
            self.sizes[of_cosine] = 0.0
            self._pass_on(row, [(rows[0], code.number(1.0), code.number(1.0))])

        cases: dict[int, Callable[[], None]] = {
            operations.QUOTIENT: of_quotient,
            operations.ROOT: of_root,
            operations.SINE_AND_COSINE: of_sine_and_cosine,
            # Its adjoint is passed on with that of the sine before it.
            operations.COSINE: lambda: None,
        }
        code.choose(operation, cases, of_sums_and_products)

    def _pass_on(self, row: Value, to: list[tuple[Value, Value, Value]]) -> None:
        for block in self.code.range(self.blocks):
            adjoint = self.adjoints[row, block]
            # Most equations do not feel what happens on another branch of a tree.
            with self.code.when(differs(adjoint, 0.0).any()):
                self.adjoints[row, block] = 0.0
                for operand, factor, _ in to:
                    self.adjoints[operand, block] += factor * adjoint
        size = self.sizes[row]
        self.sizes[row] = 0.0
        for operand, _, most in to:
            self.sizes[operand] += most * size


def write_sweep(code: Writer) -> None:
    """The adjoints of the inputs and constants, from those of the results; those of the instructions are left empty."""
    sweep, m = _Sweep(code), code.argument("m")
    for reverse in code.range(m):
        sweep.step(m - 1 - reverse)
