"""The instructions of a program, as loops over them are written for LLVM: forwards, and backwards with adjoints.

``start`` is the place of the first instruction's result among ``values``, (places, 3), whose every number is of four states.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from harness.programs.loops import encoding as operations
from harness.programs.loops.double_double import (
    add,
    arctangent,
    arctangent_in_float64,
    divide,
    multiply,
    number_at,
    root,
    sine_and_cosine,
    sine_and_cosine_in_float64,
    store,
)
from harness.programs.loops.language import Writer
from harness.programs.loops.values import Array, Value, as_number, differs, equals, larger, root_of, select
from harness.programs.numbers import LANES, UNIT_ROUNDOFF

RUN = {"m": "integer", "start": "integer", "instructions": "halves", "values": "vectors"}
SWEEP = {**RUN, "blocks": "integer", "lane": "integer", "adjoints": "vectors", "sizes": "numbers"}


class Program:
    """A program in the function that is being written, with room for its results at four states, ``width`` numbers at each place."""

    def __init__(self, code: Writer, width: int = 3) -> None:
        self.code, self.width = code, width
        self.inputs, self.values = code.argument("inputs"), code.array("values", width)
        # Of the first instruction's result.
        self.start = self.inputs + code.argument("constants")
        constants = code.array("of_constants", 3)
        for k in code.range(code.argument("constants")):
            for part in range(width):
                self.values[self.inputs + k, part] = constants[k, part]

    def blocks(self) -> Iterator[Value]:
        """Every four states."""
        yield from self.code.range((self.code.argument("n") + (LANES - 1)) // LANES)

    def place(self, inputs: Array) -> None:
        """Have ``inputs``, which are exact, for those of the program."""
        for i in self.code.range(self.inputs):
            self.values[i, 0] = inputs[i]
            for part in range(1, self.width):
                self.values[i, part] = 0.0

    def run(self) -> None:
        """Every instruction's result at four states, into ``values``."""
        self.code.perform(f"run_of_{self.width}", self.code.argument("m"), self.start, self.code.array("instructions"), self.values)


@dataclass(frozen=True)
class LoopArithmetic:
    """Storage of numbers at the places of ``values``, and the operations on them; ``add`` is of one and a sign times another."""

    at: Callable[[Array, Value], Any]
    store: Callable[[Array, Value, Any], None]
    add: Callable[[Any, Value, Any], Any]
    multiply: Callable[[Any, Any], Any]
    divide: Callable[[Any, Any], Any]
    root: Callable[[Any], Any]
    sine_and_cosine: Callable[[Writer, Any], tuple[Any, Any]]
    arctangent: Callable[[Writer, Any, Any], Any]


_DOUBLE_DOUBLE = LoopArithmetic(
    number_at, store, lambda a, sign, b: add(a, (sign * b[0], sign * b[1], b[2])), multiply, divide, root, sine_and_cosine, arctangent
)
_FLOAT64 = LoopArithmetic(
    Array.__getitem__,
    Array.__setitem__,
    lambda a, sign, b: a + sign * b,
    operator.mul,
    operator.truediv,
    root_of,
    sine_and_cosine_in_float64,
    arctangent_in_float64,
)


def write_run(code: Writer) -> None:
    """Every instruction's result at four states, into ``values``."""
    write_instructions(code, _DOUBLE_DOUBLE, code.array("values", 3))


def write_approximate_run(code: Writer) -> None:
    """Every instruction's result at four states in float64, into ``values``, (places,)."""
    write_instructions(code, _FLOAT64, code.array("values"))


def write_instructions(code: Writer, numbers: LoopArithmetic, values: Array) -> None:
    """Every instruction's result at four states, into ``values``, in an arithmetic."""
    instructions = code.array("instructions", 6)
    for index in code.range(code.argument("m")):
        operation, *operands = (instructions[index, part] for part in range(3))
        _write_instruction(code, numbers, values, operation, operands, code.argument("start") + index)


def _write_instruction(
    code: Writer, numbers: LoopArithmetic, values: Array, operation: Value, operands: Sequence[Value], place: Value
) -> None:
    a, b = (numbers.at(values, operand) for operand in operands)

    def put(result: Any) -> None:
        numbers.store(values, place, result)

    def sine_with_cosine() -> None:
        sine, cosine = numbers.sine_and_cosine(code, a)
        put(sine)
        numbers.store(values, place + 1, cosine)

    cases: dict[int, Callable[[], None]] = {
        operations.PRODUCT: lambda: put(numbers.multiply(a, b)),
        operations.QUOTIENT: lambda: put(numbers.divide(a, b)),
        operations.ROOT: lambda: put(numbers.root(a)),
        operations.SINE_AND_COSINE: sine_with_cosine,
        operations.COSINE: lambda: None,
        operations.ARCTANGENT: lambda: put(numbers.arctangent(code, a, b)),
    }
    code.choose(operation, cases, lambda: put(numbers.add(a, 1.0 - 2.0 * as_number(operation), b)))


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

        def of_arctangent() -> None:
            # Of lengths over the larger one, whose squares are no numbers too large or too small.
            over = 1.0 / larger(abs(value(a, 0)), abs(value(b, 0)))
            y, x, most_y, most_x = value(a, 0) * over, value(b, 0) * over, most(a) * over, most(b) * over
            square = x * x + y * y
            # Twice, for more roundings than other partial derivatives have.
            size = 2.0 * over * (most_x * most_x + most_y * most_y) / (square * square)
            self._pass_on(row, [(rows[0], x / square * over, most_x * size), (rows[1], -(y / square * over), most_y * size)])

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
            operations.ARCTANGENT: of_arctangent,
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
