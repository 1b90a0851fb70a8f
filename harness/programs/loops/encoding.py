"""A straight-line program as arrays, which one compiled loop interprets for every mechanism.

A sine and the cosine of the same angle are one operation of two results. Tangents become quotients, whole powers products, and a
change of sign the difference from the exact zero.
What is left of the functions that a program may hold has no code: such a program is evaluated in balls.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from harness.arrays import Array, Indices
from harness.programs.numbers import UNIT_ROUNDOFF, Number, exactly, pi
from harness.programs.program import OUTPUTS, StraightLineProgram, position_count, upper_triangle

SUM, DIFFERENCE, PRODUCT, QUOTIENT, ROOT, SINE_AND_COSINE, COSINE = range(7)
_CODES = {"add": SUM, "sub": DIFFERENCE, "mul": PRODUCT, "div": QUOTIENT, "sqrt": ROOT}
_BINARY = (SUM, DIFFERENCE, PRODUCT, QUOTIENT)
# Roundings of a partial derivative and of its product with an adjoint, which are fewer.
_ROUNDINGS_OF_AN_EDGE = 8
_ZERO, _ONE = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)


@dataclass(frozen=True)
class EncodedProgram:
    """A program as the compiled loops run it. Places count the inputs, then the constants, then the instructions' results.

    Attributes:
        inputs: how many there are.
        constants: (k, 3) of ``harness.programs.numbers``.
        instructions: (m, 6) each operation, the places of its operands, and the rows of the adjoints of its result and operands, in 32
            bits; behind a sine, the row of the cosine's stands in place of the second operand's. Only a sweep reads the rows.
    """

    inputs: int
    constants: Array
    instructions: np.ndarray[Any, np.dtype[np.int32]]

    @property
    def places(self) -> int:
        return self.inputs + len(self.constants) + len(self.instructions)


@dataclass(frozen=True)
class Encoded(EncodedProgram):
    """The equations of a mechanism, whose adjoints are swept too.

    Attributes:
        mass, terms, force: places of M's entries, (nv, nv); of velocity, gravity and passive forces, (3, nv); and of what M qdd
            equals, (nv,).
        rows: (places,) where the adjoint of each result stands, from its last use back to where it is computed; some share one.
        roundings: the most that lie on any way from an output back to an input, for a sweep of adjoints.
    """

    mass: Indices
    terms: Indices
    force: Indices
    rows: Indices
    roundings: int

    @property
    def gamma(self) -> float:
        """What the roundings of a sweep, and those of the norms of its results, add up to, relative to absolute values."""
        return (self.roundings + 4 * self.force.size + 16) * UNIT_ROUNDOFF * 1.01


def encode(program: StraightLineProgram) -> Encoded | None:
    """The program for the loops of ``harness.programs.loops.interpreter``; None where it holds a function that they have no code for."""
    encoder = _Encoder(len(program.inputs))
    outputs = encoder.outputs_of(program)
    if outputs is None:
        return None
    nv, applied = len(outputs["velocity"]), position_count(program) + len(outputs["velocity"])
    forces = [encoder.add(SUM, *pair) for pair in zip(range(applied, applied + nv), outputs["passive"], strict=True)]
    others = [encoder.add(SUM, *pair) for pair in zip(outputs["velocity"], outputs["gravity"], strict=True)]
    force = [encoder.add(DIFFERENCE, *pair) for pair in zip(forces, others, strict=True)]
    mass = np.empty((nv, nv), dtype=np.int64)
    for (i, j), result in zip(upper_triangle(nv), outputs["mass"], strict=True):
        mass[i, j] = mass[j, i] = result
    instructions = encoder.placed()
    mass, force_places = encoder.places(mass), encoder.places(np.array(force))
    start = encoder.inputs + len(encoder.constants)
    rows = _rows(instructions, start, {*mass.flat, *force_places})
    operands = instructions[:, 1:].copy()
    [sines] = np.nonzero(instructions[:, 0] == SINE_AND_COSINE)
    operands[sines, 1] = start + sines + 1
    return Encoded(
        inputs=encoder.inputs,
        constants=encoder.numbers(),
        instructions=np.column_stack([instructions, rows[start:], rows[operands]]).astype(np.int32),
        mass=mass,
        terms=encoder.places(np.array([outputs[name] for name in OUTPUTS[1:]])),
        force=force_places,
        rows=rows,
        roundings=_most_roundings(encoder),
    )


def encode_program(program: StraightLineProgram) -> tuple[EncodedProgram, dict[str, Indices]] | None:
    """The program without a sweep, and the places of its outputs by their names; None as of ``encode``."""
    encoder = _Encoder(len(program.inputs))
    outputs = encoder.outputs_of(program)
    if outputs is None:
        return None
    instructions = np.pad(encoder.placed(), ((0, 0), (0, 3))).astype(np.int32)
    places = {name: encoder.places(np.array(results, dtype=np.int64)) for name, results in outputs.items()}
    return EncodedProgram(encoder.inputs, encoder.numbers(), instructions), places


class _Encoder:
    """Instructions in the order in which they were added, each once.

    A result is a number: that of an input, behind those that of an instruction, and below zero that of a constant, since how many
    constants there are is known at the end.
    """

    def __init__(self, inputs: int) -> None:
        self.inputs = inputs
        self.instructions: list[tuple[int, int, int]] = []
        self.constants: dict[Number, int] = {}
        self._known: dict[tuple[int, int, int], int] = {}

    def add(self, code: int, first: int, second: int = 0) -> int:
        instruction = (code, first, second)
        if instruction not in self._known:
            self._known[instruction] = self.inputs + len(self.instructions)
            self.instructions.append(instruction)
        return self._known[instruction]

    def constant(self, value: Number) -> int:
        return -1 - self.constants.setdefault(value, len(self.constants))

    def places(self, results: Indices) -> Indices:
        """Where results stand, when all constants are known."""
        behind = np.where(results < self.inputs, results, results + len(self.constants))
        return np.asarray(np.where(results < 0, self.inputs - 1 - results, behind))

    def placed(self) -> Indices:
        """The instructions, (m, 3), with the places of their operands."""
        instructions = np.array(self.instructions, dtype=np.int64).reshape(-1, 3)
        instructions[:, 1:] = self.places(instructions[:, 1:])
        return instructions

    def numbers(self) -> Array:
        """The constants, (k, 3)."""
        return np.array(list(self.constants), dtype=np.float64).reshape(-1, 3)

    def outputs_of(self, program: StraightLineProgram) -> dict[str, list[int]] | None:
        """The results of a program's outputs, after its instructions; None where one of these is a function without code."""
        found: list[int] = []
        for instruction in program.instructions:
            result = self.result_of(instruction, found)
            if result is None:
                return None
            found.append(result)
        return {name: [found[index] for index in indices] for name, indices in program.outputs.items()}

    def result_of(self, instruction: tuple[object, ...], found: Sequence[int]) -> int | None:
        """The result of a program's instruction, given those of the earlier ones; None for a function without code."""
        match instruction:
            case ("input", int(index)):
                return index
            case ("rational", str(numerator), str(denominator)):
                return self.constant(exactly(Fraction(int(numerator), int(denominator))))
            case ("pi",):
                return self.constant(pi())
            case ("neg", int(operand)):
                return self.add(DIFFERENCE, self.constant(_ZERO), found[operand])
            case ("integer_power", int(base), int(exponent)):
                return self._power(found[base], exponent)
            case ("sin" | "cos" | "tan" as name, int(angle)):
                sine = self.add(SINE_AND_COSINE, found[angle])
                cosine = self.add(COSINE, sine)
                return self.add(QUOTIENT, sine, cosine) if name == "tan" else sine if name == "sin" else cosine
            case (str(name), *operands) if name in _CODES:
                return self.add(_CODES[name], *(found[operand] for operand in operands if isinstance(operand, int)))
            case _:
                return None

    def _power(self, base: int, exponent: int) -> int:
        result = None
        for digit in bin(abs(exponent))[2:]:
            result = result if result is None else self.add(PRODUCT, result, result)
            if digit == "1":
                result = base if result is None else self.add(PRODUCT, result, base)
        if result is None or exponent < 0:
            one = self.constant(_ONE)
            return one if result is None else self.add(QUOTIENT, one, result)
        return result


def _rows(instructions: Indices, start: int, outputs: Collection[int]) -> Indices:
    """``Encoded.rows``: so few that they stay near the processor, where one for each of 30,000 results would not."""
    rows = np.arange(start + len(instructions))
    taken = {place for place in outputs if place >= start}
    for row, place in enumerate(sorted(taken), start):
        rows[place] = row
    free, end = list[int](), start + len(taken)

    def take(place: int) -> None:
        nonlocal end
        if place >= start and place not in taken:
            taken.add(place)
            rows[place] = free.pop() if free else end
            end += rows[place] == end

    for index in reversed(range(len(instructions))):
        (code, *operands), place = instructions[index].tolist(), start + index
        take(place)
        if code == COSINE:
            continue
        for operand in operands if code in _BINARY else operands[:1]:
            take(operand)
        free += [rows[place], rows[place + 1]] if code == SINE_AND_COSINE else [rows[place]]
    return rows


def _most_roundings(encoder: _Encoder) -> int:
    """Roundings on any way from a result back to an input: of each step, and of each sum of the steps that meet."""
    uses: Counter[int] = Counter()
    before: Counter[int] = Counter()
    for index in reversed(range(len(encoder.instructions))):
        (code, *operands), result = encoder.instructions[index], encoder.inputs + index
        for operand in operands if code in _BINARY else operands[:1]:
            uses[operand] += 1
            before[operand] = max(before[operand], before[result] + uses[result] + _ROUNDINGS_OF_AN_EDGE)
    return max((before[place] + uses[place] for place in range(encoder.inputs)), default=0)
