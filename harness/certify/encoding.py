"""A straight-line program as arrays, which one compiled loop interprets for every mechanism.

A sine and the cosine of the same angle are one operation of two results. Tangents become quotients, and whole powers products.
What is left of the functions that a program may hold has no code: such a program is evaluated in balls.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from harness.arrays import Array
from harness.certify.numbers import UNIT_ROUNDOFF, Number, exactly, pi
from harness.equations.mechanism_kernel import Indices
from harness.equations.program import OUTPUTS, StraightLineProgram, position_count, upper_triangle

SUM, DIFFERENCE, PRODUCT, NEGATIVE, QUOTIENT, ROOT, SINE_AND_COSINE, COSINE, INPUT, CONSTANT = range(10)
_CODES = {"neg": NEGATIVE, "add": SUM, "sub": DIFFERENCE, "mul": PRODUCT, "div": QUOTIENT, "sqrt": ROOT}
# Roundings of a partial derivative and of its product with an adjoint, which are fewer.
_ROUNDINGS_OF_AN_EDGE = 8


@dataclass(frozen=True)
class Encoded:
    """A program as the compiled loops read it.

    Attributes:
        codes, first, second: (m,) each operation and its operands: places of earlier results, of an input or of a constant.
        constants: (k, 3) of ``harness.certify.numbers``.
        mass, terms, force: places of M's entries, (nv, nv); of velocity, gravity and passive forces, (3, nv); and of what M qdd
            equals, (nv,).
        roundings: the most that lie on any way from an output back to an input, for a sweep of adjoints.
    """

    codes: Indices
    first: Indices
    second: Indices
    constants: Array
    mass: Indices
    terms: Indices
    force: Indices
    roundings: int

    @property
    def gamma(self) -> float:
        """What the roundings of a sweep, and those of the norms of its results, add up to, relative to absolute values."""
        return (self.roundings + 4 * self.force.size + 16) * UNIT_ROUNDOFF * 1.01


def encode(program: StraightLineProgram) -> Encoded | None:
    """The program for the loops of ``harness.certify.interpreter``; None where it holds a function that they have no code for."""
    encoder = _Encoder()
    places: list[int] = []
    for instruction in program.instructions:
        place = encoder.place_of(instruction, places)
        if place is None:
            return None
        places.append(place)
    outputs = {name: [places[index] for index in program.outputs[name]] for name in OUTPUTS}
    nv, first = len(outputs["velocity"]), position_count(program)
    applied = [encoder.add(INPUT, first + nv + row) for row in range(nv)]
    forces = [encoder.add(SUM, *pair) for pair in zip(applied, outputs["passive"], strict=True)]
    others = [encoder.add(SUM, *pair) for pair in zip(outputs["velocity"], outputs["gravity"], strict=True)]
    force = [encoder.add(DIFFERENCE, *pair) for pair in zip(forces, others, strict=True)]
    mass = np.empty((nv, nv), dtype=np.int64)
    for (i, j), place in zip(upper_triangle(nv), outputs["mass"], strict=True):
        mass[i, j] = mass[j, i] = place
    codes, first_operands, second_operands = np.array(encoder.instructions, dtype=np.int64).T
    return Encoded(
        codes=np.ascontiguousarray(codes),
        first=np.ascontiguousarray(first_operands),
        second=np.ascontiguousarray(second_operands),
        constants=np.array(encoder.constants or [(0.0, 0.0, 0.0)]),
        mass=mass,
        terms=np.array([outputs[name] for name in OUTPUTS[1:]], dtype=np.int64),
        force=np.array(force, dtype=np.int64),
        roundings=_most_roundings(encoder.instructions),
    )


class _Encoder:
    """Instructions in the order in which they were added, each once."""

    def __init__(self) -> None:
        self.instructions: list[tuple[int, int, int]] = []
        self.constants: list[Number] = []
        self._known: dict[tuple[int, int, int], int] = {}

    def add(self, code: int, first: int, second: int = 0) -> int:
        instruction = (code, first, second)
        if instruction not in self._known:
            self._known[instruction] = len(self.instructions)
            self.instructions.append(instruction)
        return self._known[instruction]

    def constant(self, value: Number) -> int:
        self.constants.append(value)
        return self.add(CONSTANT, len(self.constants) - 1)

    def place_of(self, instruction: tuple[object, ...], places: Sequence[int]) -> int | None:
        """Where the result of a program's instruction is, given those of the earlier ones; None for a function without code."""
        match instruction:
            case ("input", int(index)):
                return self.add(INPUT, index)
            case ("rational", str(numerator), str(denominator)):
                return self.constant(exactly(Fraction(int(numerator), int(denominator))))
            case ("pi",):
                return self.constant(pi())
            case ("integer_power", int(base), int(exponent)):
                return self._power(places[base], exponent)
            case ("sin" | "cos" | "tan" as name, int(angle)):
                sine = self.add(SINE_AND_COSINE, places[angle])
                cosine = self.add(COSINE, sine)
                return self.add(QUOTIENT, sine, cosine) if name == "tan" else sine if name == "sin" else cosine
            case (str(name), *operands) if name in _CODES:
                return self.add(_CODES[name], *(places[operand] for operand in operands if isinstance(operand, int)))
            case _:
                return None

    def _power(self, base: int, exponent: int) -> int:
        result = None
        for digit in bin(abs(exponent))[2:]:
            result = result if result is None else self.add(PRODUCT, result, result)
            if digit == "1":
                result = base if result is None else self.add(PRODUCT, result, base)
        if result is None or exponent < 0:
            one = self.constant((1.0, 0.0, 0.0))
            return one if result is None else self.add(QUOTIENT, one, result)
        return result


def _most_roundings(instructions: Sequence[tuple[int, int, int]]) -> int:
    """Roundings on any way from a result back to an input: of each step, and of each sum of the steps that meet."""
    uses = [0] * len(instructions)
    before = [0] * len(instructions)
    for place in reversed(range(len(instructions))):
        code, *operands = instructions[place]
        if code in (INPUT, CONSTANT):
            continue
        binary = code in (SUM, DIFFERENCE, PRODUCT, QUOTIENT)
        for operand in operands if binary else operands[:1]:
            uses[operand] += 1
            before[operand] = max(before[operand], before[place] + uses[place] + _ROUNDINGS_OF_AN_EDGE)
    return max((before[place] + uses[place] for place, (code, *_) in enumerate(instructions) if code == INPUT), default=0)
