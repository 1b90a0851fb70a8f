"""Derivatives of straight-line programs, written as further instructions of the same program.

A gradient by reverse accumulation takes a small multiple of the instructions of the function itself, whatever the number of
variables. The derivative expressions of SymPy lose this factoring, as its products are flattened.

Source: Griewank, Walther, Evaluating Derivatives, 2nd ed., sections 3.1 and 3.2 (forward and reverse mode).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Any

from harness.equations.program import Assembler, StraightLineProgram, earlier_results, with_operands

# Instructions of the derivatives of f by its arguments, given those of the arguments and of f; an integer exponent is a literal.
_PARTIALS: dict[str, Callable[..., tuple[int, ...]]] = {
    "neg": lambda w, x, f: (w.number(-1),),
    "sqrt": lambda w, x, f: (w.quotient(w.number(Fraction(1, 2)), f),),
    "sin": lambda w, x, f: (w.add("cos", x),),
    "cos": lambda w, x, f: (w.negative(w.add("sin", x)),),
    "tan": lambda w, x, f: (w.sum(w.number(1), w.product(f, f)),),
    "asin": lambda w, x, f: (w.quotient(w.number(1), w.add("sqrt", w.difference(w.number(1), w.product(x, x)))),),
    "acos": lambda w, x, f: (w.quotient(w.number(-1), w.add("sqrt", w.difference(w.number(1), w.product(x, x)))),),
    "atan": lambda w, x, f: (w.quotient(w.number(1), w.sum(w.number(1), w.product(x, x))),),
    "sinh": lambda w, x, f: (w.add("cosh", x),),
    "cosh": lambda w, x, f: (w.add("sinh", x),),
    "tanh": lambda w, x, f: (w.difference(w.number(1), w.product(f, f)),),
    "exp": lambda w, x, f: (f,),
    "log": lambda w, x, f: (w.quotient(w.number(1), x),),
    "integer_power": lambda w, x, n, f: (w.product(w.number(n), w.add("integer_power", x, n - 1)),),
    "add": lambda w, a, b, f: (w.number(1), w.number(1)),
    "sub": lambda w, a, b, f: (w.number(1), w.number(-1)),
    "mul": lambda w, a, b, f: (b, a),
    "div": lambda w, a, b, f: (w.inverse(b), w.negative(w.product(f, w.inverse(b)))),
    "pow": lambda w, a, b, f: (w.product(b, w.add("pow", a, w.difference(b, w.number(1)))), w.product(f, w.add("log", a))),
    "atan2": lambda w, a, b, f: (w.quotient(b, w.dot((a, b), (a, b))), w.negative(w.quotient(a, w.dot((a, b), (a, b))))),
}


class ProgramWriter(Assembler):
    """A program that grows by derivatives of its instructions; places are indices of instructions.

    Sums and products with 0 and 1, and of numbers, are worked out at once, so that sparse derivatives stay sparse.
    """

    def __init__(self, program: StraightLineProgram) -> None:
        super().__init__(program.inputs)
        # Every sum and product asks for the values of its operands, and most programs hold few numbers.
        self._values: dict[int, Fraction] = {}
        # Most are the zeros and ones of frames that are not turned. A look for their places costs less than comparing fractions.
        self._zero_places: set[int] = set()
        self._one_places: set[int] = set()
        self.outputs = self.append(program)

    def append(self, program: StraightLineProgram) -> dict[str, list[int]]:
        """Write the instructions of a program of the same inputs; the places of its outputs."""
        places: list[int] = []
        for instruction in program.instructions:
            places.append(self.again(*with_operands(instruction, places)))
        return {name: [places[index] for index in indices] for name, indices in program.outputs.items()}

    def add(self, *instruction: Any) -> int:
        place = super().add(*instruction)
        if instruction[0] == "rational" and place not in self._values:
            value = self._values[place] = Fraction(int(instruction[1]), int(instruction[2]))
            if value in (0, 1):
                (self._one_places if value else self._zero_places).add(place)
        return place

    def number(self, value: Fraction | int) -> int:
        """The literal ``value``."""
        return self.add("rational", str(value.numerator), str(value.denominator))

    def sum(self, first: int | None, second: int) -> int:
        """first + second; None stands for 0."""
        if first is None or first in self._zero_places:
            return second
        if second in self._zero_places:
            return first
        known, other = self._values.get(first), self._values.get(second)
        if known is not None and other is not None:
            return self.number(known + other)
        for one, place in ((first, second), (second, first)):
            if self.instructions[place][0] == "neg":
                return self.difference(one, self.instructions[place][1])
        return self.add("add", *sorted((first, second)))

    def difference(self, first: int, second: int) -> int:
        if second in self._zero_places:
            return first
        if first in self._zero_places:
            return self.negative(second)
        if first == second:
            return self.number(0)
        if self.instructions[second][0] == "neg":
            return self.sum(first, self.instructions[second][1])
        return self.add("sub", first, second)

    def negative(self, place: int) -> int:
        value = self._values.get(place)
        if value is not None:
            return self.number(-value)
        operation, *operands = self.instructions[place]
        if operation == "neg":
            return int(operands[0])
        return self.add("sub", operands[1], operands[0]) if operation == "sub" else self.add("neg", place)

    def product(self, first: int, second: int) -> int:
        if first in self._zero_places or second in self._one_places:
            return first
        if second in self._zero_places or first in self._one_places:
            return second
        factor, other = self._values.get(first), self._values.get(second)
        if factor is None and other is not None:
            first, second, factor, other = second, first, other, factor
        if factor is not None:
            if other is not None:
                return self.number(factor * other)
            if factor == -1:
                return self.negative(second)
        for one, place in ((second, first), (first, second)):
            if self.instructions[place][0] == "neg":
                return self.negative(self.product(one, self.instructions[place][1]))
        operation, *operands = self.instructions[second]
        if factor is not None and operation in ("mul", "div"):
            # Twice the half of x is x.
            for known, rest in (operands, operands[::-1]) if operation == "mul" else (operands[::-1],):
                value = self._values.get(known)
                if value is not None:
                    return self.product(self.number(factor * value if operation == "mul" else factor / value), rest)
        return self.add("mul", *((first, second) if factor is not None else sorted((first, second))))

    def quotient(self, first: int, second: int) -> int:
        return first if second in self._one_places or first in self._zero_places else self.add("div", first, second)

    def inverse(self, place: int) -> int:
        value = self._values.get(place)
        return self.number(1 / value) if value else self.quotient(self.number(1), place)

    def dot(self, first: Sequence[int], second: Sequence[int]) -> int:
        total, zeros = self.number(0), self._zero_places
        for one, other in zip(first, second, strict=True):
            if one not in zeros and other not in zeros:
                total = self.sum(total, self.product(one, other))
        return total

    def cross(self, first: Sequence[int], second: Sequence[int]) -> list[int]:
        pairs = [(1, 2), (2, 0), (0, 1)]
        return [self.difference(self.product(first[j], second[k]), self.product(first[k], second[j])) for j, k in pairs]

    def gradient(self, place: int, variables: Sequence[int]) -> list[int]:
        """The derivatives of one instruction by inputs, by reverse accumulation."""
        depends = self.depending_on(variables)
        adjoint = {place: self.number(1)}
        for at in range(place, -1, -1):
            if at in adjoint and depends[at]:
                for operand, slope in self._partials(at, depends):
                    adjoint[operand] = self.sum(adjoint.get(operand), self.product(adjoint[at], slope))
        return [adjoint.get(variable, self.number(0)) for variable in variables]

    def along(self, places: Iterable[int], rates: Mapping[int, int]) -> list[int]:
        """The derivatives of instructions along a motion, which is given by inputs and their rates."""
        places = list(places)
        depends, moved = self.depending_on(rates), dict(rates)
        for at in range(max(places, default=-1) + 1):
            if depends[at] and at not in moved:
                total: int | None = None
                for operand, slope in self._partials(at, depends):
                    total = self.sum(total, self.product(slope, moved[operand]))
                assert total is not None
                moved[at] = total
        return [moved.get(place, self.number(0)) for place in places]

    def depending_on(self, inputs: Iterable[int]) -> list[bool]:
        """For each instruction, whether it rests on one of ``inputs``."""
        chosen, depends = set(inputs), list[bool]()
        for instruction in self.instructions:
            if instruction[0] == "input":
                depends.append(instruction[1] in chosen)
            else:
                depends.append(any(depends[operand] for operand in earlier_results(instruction)))
        return depends

    def _partials(self, place: int, depends: Sequence[bool]) -> list[tuple[int, int]]:
        """Operands of an instruction that depend on the variables, each with the derivative by it."""
        operation, *operands = instruction = self.instructions[place]
        if operation == "input":
            return []
        if operation == "mul" and operands[0] == operands[1]:
            return [(operands[0], self.product(self.number(2), operands[0]))]
        pairs = zip(earlier_results(instruction), _PARTIALS[operation](self, *operands, place), strict=True)
        return [pair for pair in pairs if depends[pair[0]]]

    def again(self, operation: str, *operands: Any) -> int:
        """An instruction of the program itself, with the identities of 0 and 1."""
        if operation == "neg":
            return self.negative(*operands)
        write = {"add": self.sum, "sub": self.difference, "mul": self.product}.get(operation)
        return self.add(operation, *operands) if write is None else write(*operands)
