"""Straight-line programs written with operators.

A ``Term`` is the value of one instruction of a program that a ``Builder`` holds: ``a + b`` adds an instruction, unless there is one like
it. Sums and products with 0 and 1, of numbers, and of values with a changed sign are worked out at once, so that sparse matrices and
their derivatives stay sparse. Vectors and matrices are numpy arrays of terms, whose ``+ - * / @`` are numpy's own.

``a + -b`` is the instruction of ``a - b`` unless b is a difference itself, whose parts then change places: trees are written this way, so
that what is turned and turned back meets its own negative.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from harness.programs.program import Instruction, StraightLineProgram, earlier_results, upper_triangle

NUMBERS = (int, float, Fraction)
Number = int | float | Fraction
# Arrays of terms, of which numpy's types say nothing: (k,) and (k, k).
Vector = Any
Matrix = Any


class Builder:
    """A program that is being written; it begins with its inputs, and holds each distinct instruction once."""

    def __init__(self, inputs: Sequence[Any]) -> None:
        self.names = tuple(str(name) for name in inputs)
        self.instructions: list[Instruction] = []
        self.terms: list[Term] = []
        self._known: dict[Instruction, Term] = {}
        # Literals by their values, of which most are 0 and 1.
        self._literals: dict[Number, Term] = {}
        self.inputs = [self.add("input", place) for place in range(len(self.names))]

    def add(self, operation: str, *operands: Any) -> Term:
        """The value of an instruction as it stands; an operand is a term, or a literal of the operation."""
        return self.write((operation, *[operand.place if operand.__class__ is Term else operand for operand in operands]))

    def write(self, instruction: Instruction) -> Term:
        """The value of an instruction whose operands are literals and places of earlier ones."""
        found = self._known.get(instruction)
        if found is None:
            found = self._known[instruction] = Term(self, len(self.terms), instruction[0])
            self.terms.append(found)
            self.instructions.append(instruction)
        return found

    def forget(self, count: int) -> None:
        """Take back all instructions but the first ``count``."""
        for instruction in self.instructions[count:]:
            del self._known[instruction]
        self._literals = {value: term for value, term in self._literals.items() if term.place < count}
        del self.instructions[count:], self.terms[count:]

    def number(self, value: Number) -> Term:
        """The literal ``value``."""
        if not value:
            value = 0
        # The hash of a fraction takes as long as its literal.
        is_plain = value.__class__ is int or value.__class__ is float
        if is_plain and (known := self._literals.get(value)) is not None:
            return known
        numerator, denominator = value.as_integer_ratio()
        found = self.add("rational", str(numerator), str(denominator))
        found.value = numerator if denominator == 1 else Fraction(numerator, denominator)
        if is_plain:
            self._literals[value] = found
        return found

    def vector(self, values: Iterable[Number]) -> Vector:
        """(k,) numbers."""
        return vector([self.number(value) for value in values])

    def inputs_at(self, places: Iterable[int]) -> Vector:
        """(k,) inputs."""
        return vector([self.inputs[place] for place in places])

    def zeros(self, *shape: int) -> Any:
        """An array of zeros."""
        return np.full(shape, self.number(0), dtype=object)

    def append(self, program: StraightLineProgram, inputs: Sequence[Term] | None = None) -> dict[str, list[Term]]:
        """Write the instructions of a program of the same inputs, or of ``inputs``; its outputs by their names."""
        inputs, terms = self.inputs if inputs is None else inputs, list[Term]()
        for instruction in program.instructions:
            terms.append(inputs[instruction[1]] if instruction[0] == "input" else self.again(instruction, terms))
        return {name: [terms[place] for place in places] for name, places in program.outputs.items()}

    def again(self, instruction: Instruction, terms: Sequence[Term]) -> Term:
        """The value of an instruction of a program whose earlier ones have the values ``terms``, with the identities of 0 and 1."""
        operation, *literals = instruction
        if operation == "rational":
            return self.number(Fraction(int(literals[0]), int(literals[1])))
        operands = [terms[place] for place in earlier_results(instruction)]
        write = _OPERATORS.get(operation)
        return self.add(operation, *operands, *literals[len(operands) :]) if write is None else write(*operands)

    def program(self, outputs: Mapping[str, Iterable[Term]]) -> StraightLineProgram:
        """The program that was written, with ``outputs`` named."""
        places = {name: tuple(term.place for term in terms) for name, terms in outputs.items()}
        return StraightLineProgram(self.names, tuple(self.instructions), places)

    def operand(self, term: Term, number: int) -> Term:
        """An operand of the instruction of a term."""
        return self.terms[self.instructions[term.place][1 + number]]


class Term:
    """The value of one instruction.

    Attributes:
        builder: of its program. place: of its instruction. operation: of the instruction.
        value: of a literal; None for all others.
    """

    __slots__ = ("builder", "operation", "place", "value")

    def __init__(self, builder: Builder, place: int, operation: str) -> None:
        self.builder, self.place, self.operation = builder, place, operation
        self.value: int | Fraction | None = None

    def __add__(self, other: Any) -> Term:
        if other.__class__ is not Term:
            return NotImplemented if not isinstance(other, NUMBERS) else self + self.builder.number(other)
        known, added = self.value, other.value
        if known is not None:
            if not known:
                return other
            if added:
                return self.builder.number(known + added)
        if added is not None and not added:
            return self
        if other.operation == "neg":
            return self - self.builder.operand(other, 0)
        if self.operation == "neg":
            return other - self.builder.operand(self, 0)
        first, second = self.place, other.place
        return self.builder.write(("add", first, second) if first < second else ("add", second, first))

    __radd__ = __add__

    def __sub__(self, other: Any) -> Term:
        if other.__class__ is not Term:
            return NotImplemented if not isinstance(other, NUMBERS) else self - self.builder.number(other)
        if other.value is not None and not other.value:
            return self
        if self.value is not None and not self.value:
            return -other
        if self is other:
            return self.builder.number(0)
        if other.operation == "neg":
            return self + self.builder.operand(other, 0)
        return self.builder.write(("sub", self.place, other.place))

    def __rsub__(self, other: Number) -> Term:
        return self.builder.number(other) - self

    def __neg__(self) -> Term:
        if self.value is not None:
            return self.builder.number(-self.value)
        if self.operation == "neg":
            return self.builder.operand(self, 0)
        if self.operation == "sub":
            _, first, second = self.builder.instructions[self.place]
            return self.builder.write(("sub", second, first))
        return self.builder.write(("neg", self.place))

    def __mul__(self, other: Any) -> Term:
        if other.__class__ is not Term:
            return NotImplemented if not isinstance(other, NUMBERS) else self * self.builder.number(other)
        factor, known = self.value, other.value
        if factor is not None:
            if not factor or known == 1:
                return self
            return other if factor == 1 or known == 0 else self._times(other)
        if known is not None:
            return other if not known else self if known == 1 else other._times(self)
        if self.operation == "neg":
            return -(other * self.builder.operand(self, 0))
        if other.operation == "neg":
            return -(self * self.builder.operand(other, 0))
        first, second = self.place, other.place
        return self.builder.write(("mul", first, second) if first < second else ("mul", second, first))

    __rmul__ = __mul__

    def _times(self, other: Term) -> Term:
        """A literal, which is neither 0 nor 1, times another value."""
        factor, builder = self.value, self.builder
        assert factor is not None
        if other.value is not None:
            return builder.number(factor * other.value)
        if factor == -1:
            return -other
        if other.operation == "neg":
            return -(self * builder.operand(other, 0))
        if other.operation in ("mul", "div"):
            # Twice the half of x is x.
            first, second = builder.operand(other, 0), builder.operand(other, 1)
            for known, rest in ((first, second), (second, first)) if other.operation == "mul" else ((second, first),):
                if known.value is not None:
                    return builder.number(factor * known.value if other.operation == "mul" else Fraction(factor) / known.value) * rest
        return builder.write(("mul", self.place, other.place))

    def __truediv__(self, other: Any) -> Term:
        if other.__class__ is not Term:
            return NotImplemented if not isinstance(other, NUMBERS) else self / self.builder.number(other)
        return self if other.value == 1 or self.value == 0 else self.builder.add("div", self, other)

    def __rtruediv__(self, other: Number) -> Term:
        return self.builder.number(other) / self

    def __pow__(self, exponent: Term | int) -> Term:
        return self.builder.add("pow" if exponent.__class__ is Term else "integer_power", self, exponent)

    def inverse(self) -> Term:
        """1 over the value, worked out for a literal."""
        return self.builder.number(1 / Fraction(self.value)) if self.value else 1 / self


_OPERATORS: dict[str, Callable[..., Term]] = {"neg": Term.__neg__, "add": Term.__add__, "sub": Term.__sub__, "mul": Term.__mul__}


def _function(operation: str) -> Callable[[Term], Term]:
    return lambda value: value.builder.add(operation, value)


sqrt, sin, cos = _function("sqrt"), _function("sin"), _function("cos")


def vector(terms: Iterable[Term]) -> Vector:
    """(k,) terms."""
    return np.fromiter(terms, dtype=object)


def matrix(rows: Iterable[Iterable[Term]]) -> Matrix:
    """(k, l) terms by rows."""
    return np.array([list(row) for row in rows], dtype=object)


def symmetric(upper: Sequence[Any], count: int) -> Matrix:
    """(count, count) of its upper triangle by rows, of terms or any other values."""
    found = np.empty((count, count), dtype=object)
    for (i, j), entry in zip(upper_triangle(count), upper, strict=True):
        found[i, j] = found[j, i] = entry
    return found


def dot(first: Iterable[Term], second: Iterable[Term], zero: Term) -> Term:
    """The sum of products; ``zero`` of none."""
    total = zero
    for one, other in zip(first, second, strict=True):
        total = total + one * other
    return total


def cross(first: Vector, second: Vector) -> Vector:
    """The vector product."""
    (a, b, c), (x, y, z) = first, second
    return vector((b * z - c * y, c * x - a * z, a * y - b * x))


def length(values: Vector) -> Term:
    """The Euclidean norm."""
    return sqrt(values @ values)
