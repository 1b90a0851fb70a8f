"""A straight-line program as arrays, which one compiled loop interprets for every mechanism.

A sine and the cosine of the same angle are one operation of two results. Tangents become quotients, whole powers products, arctangents
angles of points, and a change of sign the difference from the exact zero.
What is left of the functions that a program may hold has no code: such a program is evaluated in balls.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from harness.arrays import Array, Indices
from harness.programs.numbers import UNIT_ROUNDOFF, Number, exactly, pi
from harness.programs.program import OUTPUTS, SYSTEM, Instruction, StraightLineProgram, position_count
from harness.programs.terms import symmetric

SUM, DIFFERENCE, PRODUCT, QUOTIENT, ROOT, SINE_AND_COSINE, COSINE, ARCTANGENT = range(8)
_CODES = dict(zip(("add", "sub", "mul", "div", "sqrt", "sine_and_cosine", "cosine", "atan2"), range(8), strict=True))
# Operations that a program and the loops have alike, of two results.
_ALIKE = frozenset({"add", "sub", "mul", "div", "atan2"})
_BINARY = (SUM, DIFFERENCE, PRODUCT, QUOTIENT, ARCTANGENT)
# Roundings of a partial derivative and of its product with an adjoint, which are fewer.
_ROUNDINGS_OF_AN_EDGE = 8


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
        mass, terms, force: places of M's entries, (nv, nv); of velocity, gravity and passive forces, (3, nv); and of what the matrix
            of the equations times qdd equals, (nv,).
        system: places of the entries of that matrix, (nv, nv), which is M unless the program has another.
        rows: (places,) where the adjoint of each result stands, from its last use back to where it is computed; some share one.
        roundings: the most that lie on any way from an output back to an input, for a sweep of adjoints.
    """

    mass: Indices
    terms: Indices
    force: Indices
    system: Indices
    rows: Indices
    roundings: int

    @property
    def has_system(self) -> bool:
        """True where the matrix of the equations is another than M."""
        return not np.array_equal(self.system, self.mass)

    @property
    def gamma(self) -> float:
        """Sum of the roundings of a sweep, and of those of the norms of its results, relative to absolute values."""
        return (self.roundings + 4 * self.force.size + 16) * UNIT_ROUNDOFF * 1.01


def encode(program: StraightLineProgram) -> Encoded | None:
    """The program for the loops of ``harness.programs.loops.interpreter``; None where it holds a function that they have no code for."""
    written = _written(program)
    if written is None:
        return None
    writer, outputs = written
    nv, first = len(outputs["velocity"]), position_count(program) + len(outputs["velocity"])
    forces = [writer.add("add", *pair) for pair in zip(range(first, first + nv), outputs["passive"], strict=True)]
    others = [writer.add("add", *pair) for pair in zip(outputs["velocity"], outputs["gravity"], strict=True)]
    force = [writer.add("sub", *pair) for pair in zip(forces, others, strict=True)]
    matrices = {name: list(symmetric(outputs.get(name, outputs["mass"]), nv).flat) for name in ("mass", SYSTEM)}
    encoded, places = _placed(writer, {**outputs, **matrices, "force": force})
    (mass, system), start = (places[name].reshape(nv, nv) for name in matrices), encoded.inputs + len(encoded.constants)
    instructions = encoded.instructions[:, :3].astype(np.int64)
    rows = _rows(instructions, start, {*system.flat, *places["force"]})
    operands = instructions[:, 1:].copy()
    [sines] = np.nonzero(instructions[:, 0] == SINE_AND_COSINE)
    operands[sines, 1] = start + sines + 1
    return Encoded(
        inputs=encoded.inputs,
        constants=encoded.constants,
        instructions=np.column_stack([instructions, rows[start:], rows[operands]]).astype(np.int32),
        mass=mass,
        terms=np.array([places[name] for name in OUTPUTS[1:]]),
        force=places["force"],
        system=system,
        rows=rows,
        roundings=_most_roundings(instructions, start, encoded.inputs),
    )


def encode_program(program: StraightLineProgram) -> tuple[EncodedProgram, dict[str, Indices]] | None:
    """The program without a sweep, and the places of its outputs by their names; None as of ``encode``."""
    written = _written(program)
    return None if written is None else _placed(*written)


# Places of results by the names of outputs.
Outputs = dict[str, list[int]]


class _LoopProgram:
    """A program in the operations of the loops: each distinct instruction once, to its place among them, inputs first."""

    def __init__(self, inputs: int) -> None:
        self.places: dict[Instruction, int] = {("input", place): place for place in range(inputs)}

    def add(self, *instruction: Any) -> int:
        """The place of an instruction, whose operands are literals and places."""
        return self.places.setdefault(instruction, len(self.places))

    def number(self, value: int) -> int:
        """The place of a literal."""
        return self.add("rational", str(value), "1")


def _written(program: StraightLineProgram) -> tuple[_LoopProgram, Outputs] | None:
    """The program in the operations of the loops, and the results of its outputs; None where a function has no code."""
    writer, found = _LoopProgram(len(program.inputs)), list[int]()
    places = writer.places
    for instruction in program.instructions:
        if instruction[0] in _ALIKE:
            operation, first, second = instruction
            found.append(places.setdefault((operation, found[first], found[second]), len(places)))
            continue
        result = _result_of(writer, instruction, found)
        if result is None:
            return None
        found.append(result)
    return writer, {name: [found[index] for index in indices] for name, indices in program.outputs.items()}


def _result_of(writer: _LoopProgram, instruction: Instruction, found: Sequence[int]) -> int | None:
    """The result of a program's instruction, given those of the earlier ones; None for a function without code."""
    add = writer.add
    match instruction:
        case ("input" | "rational" | "pi", *_):
            return add(*instruction)
        case ("neg", int(operand)):
            return add("sub", writer.number(0), found[operand])
        case ("integer_power", int(base), int(exponent)):
            return _power(writer, found[base], exponent)
        case ("sin" | "cos" | "tan" as name, int(angle)):
            sine = add("sine_and_cosine", found[angle])
            cosine = add("cosine", sine)
            return {"sin": sine, "cos": cosine}[name] if name != "tan" else add("div", sine, cosine)
        case ("atan", int(operand)):
            return add("atan2", found[operand], writer.number(1))
        case ("sqrt", int(operand)):
            return add("sqrt", found[operand])
        case _:
            return None


def _power(writer: _LoopProgram, base: int, exponent: int) -> int:
    result = None
    for digit in bin(abs(exponent))[2:]:
        result = result if result is None else writer.add("mul", result, result)
        if digit == "1":
            result = base if result is None else writer.add("mul", result, base)
    if result is None or exponent < 0:
        one = writer.number(1)
        return one if result is None else writer.add("div", one, result)
    return result


def _placed(writer: _LoopProgram, outputs: Outputs) -> tuple[EncodedProgram, dict[str, Indices]]:
    """The program without a sweep: first the inputs, then the constants, then the instructions, each kind in its order."""
    kinds = [0 if operation == "input" else 1 if operation in ("rational", "pi") else 2 for operation, *_ in writer.places]
    places = np.empty(len(kinds), dtype=np.int64)
    places[np.argsort(kinds, kind="stable")] = np.arange(len(kinds))
    constants, rows, placed = list[Number](), list[tuple[int, int, int]](), places.tolist()
    for kind, instruction in zip(kinds, writer.places, strict=True):
        if kind == 2:
            rows.append((_CODES[instruction[0]], placed[instruction[1]], placed[instruction[2]] if len(instruction) > 2 else 0))
        elif kind == 1:
            constants.append(pi() if instruction[0] == "pi" else exactly(Fraction(*map(int, instruction[1:]))))
    instructions = np.zeros((len(rows), 6), dtype=np.int32)
    instructions[:, :3] = np.array(rows, dtype=np.int32).reshape(-1, 3)
    encoded = EncodedProgram(kinds.count(0), np.array(constants, dtype=np.float64).reshape(-1, 3), instructions)
    return encoded, {name: places[np.array(own, dtype=np.int64)] for name, own in outputs.items()}


def _rows(instructions: Indices, start: int, outputs: Collection[int]) -> Indices:
    """``Encoded.rows``: so few that they stay near the processor, where one for each of 30,000 results would not."""
    rows = list(range(start + len(instructions)))
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

    for index, (code, *operands) in reversed(list(enumerate(instructions.tolist()))):
        place = start + index
        take(place)
        if code == COSINE:
            continue
        for operand in operands if code in _BINARY else operands[:1]:
            take(operand)
        free += [rows[place], rows[place + 1]] if code == SINE_AND_COSINE else [rows[place]]
    return np.array(rows, dtype=np.int64)


def _most_roundings(instructions: Indices, start: int, inputs: int) -> int:
    """Roundings on any way from a result back to an input: of each step, and of each sum of the steps that meet."""
    uses, before = ([0] * (start + len(instructions)) for _ in range(2))
    for index, (code, *operands) in reversed(list(enumerate(instructions.tolist()))):
        result = start + index
        for operand in operands if code in _BINARY else operands[:1]:
            uses[operand] += 1
            before[operand] = max(before[operand], before[result] + uses[result] + _ROUNDINGS_OF_AN_EDGE)
    return max((before[place] + uses[place] for place in range(inputs)), default=0)
