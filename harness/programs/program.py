"""Straight-line programs: the one form of a system's equations from which every kernel is compiled.

A program is a list of instructions, each an operation on earlier results, in which every common
subexpression is computed once. It is plain data, so that it can be cached as JSON and checked when it
is read back; it keeps coordinates, rates and parameters alike as run-time inputs.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

OUTPUTS = ("mass", "velocity", "gravity", "passive")
# The matrix of equations whose passive forces leave out what the accelerations make of them; M is then the metric alone.
SYSTEM = "system"
ENERGY_OUTPUTS = ("energy", "lagrangian", "kinetic", "power")

UNARY = frozenset({"neg", "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log"})
BINARY = frozenset({"add", "sub", "mul", "div", "pow", "atan2"})
# Literals: "input" holds an index, "rational" numerator and denominator as decimal strings, "pi" nothing.
# "integer_power" holds a result and a literal exponent.
_OPERANDS = {"input": 1, "rational": 2, "pi": 0, "integer_power": 2} | dict.fromkeys(UNARY, 1) | dict.fromkeys(BINARY, 2)

# Operands that are earlier results.
_ARITY = dict.fromkeys(UNARY, 1) | dict.fromkeys(BINARY, 2) | {"integer_power": 1}

Instruction = tuple[Any, ...]


@dataclass(frozen=True)
class StraightLineProgram:
    """Instructions over inputs, with named outputs.

    Attributes:
        inputs: names of the run-time inputs, in order.
        instructions: (operation, operand, ...); an operand is the index of an earlier instruction.
        outputs: output name to instruction indices.
    """

    inputs: tuple[str, ...]
    instructions: tuple[Instruction, ...]
    outputs: Mapping[str, tuple[int, ...]]

    @cached_property
    def key(self) -> str:
        """Equal for programs of equal inputs, instructions and outputs."""
        content = self.inputs, self.instructions, sorted(self.outputs.items())
        return hashlib.sha256(repr(content).encode()).hexdigest()

    @property
    def operations(self) -> int:
        """Number of operations of one evaluation."""
        return sum(instruction[0] not in ("input", "rational", "pi") for instruction in self.instructions)

    @property
    def turning(self) -> list[int]:
        """Inputs that enter nothing but sines, cosines and tangents of their whole multiples and sums: a full turn changes no output."""
        # For each instruction, the inputs it is a sum of whole multiples of; None where it is something else.
        sums: list[frozenset[int] | None] = []
        exposed: set[int] = set()
        whole = {place for place, (operation, *operands) in enumerate(self.instructions) if operation == "rational" and operands[1] == "1"}
        for instruction in self.instructions:
            operation, *operands = instruction
            parts = [sums[place] for place in earlier_results(instruction)]
            known = [part for part in parts if part is not None]
            adds = operation in ("input", "rational", "pi", "add", "sub", "neg") or (operation == "mul" and whole & set(operands))
            is_sum = adds and len(known) == len(parts)
            sums.append(frozenset(operands if operation == "input" else ()).union(*known) if is_sum else None)
            if not is_sum and operation not in ("sin", "cos", "tan"):
                exposed.update(*known)
        exposed.update(*(sums[place] or () for places in self.outputs.values() for place in places))
        return [place for place in range(len(self.inputs)) if place not in exposed]

    def checked(self) -> StraightLineProgram:
        """The program, whose types are right, after a look at its indices.

        Raises:
            ValueError: an unknown operation, or an index out of range.
        """
        for position, instruction in enumerate(self.instructions):
            _check_instruction(position, instruction, len(self.inputs))
        for name, indices in self.outputs.items():
            if not all(_is_index(index, len(self.instructions)) for index in indices):
                raise ValueError(f"output {name!r} points outside the program")
        return self


def right_hand_side(outputs: Mapping[str, Sequence[Any]], applied: Sequence[Any] | None = None) -> list[Any]:
    """tau + p - (c + g), what M qdd equals, of the outputs of a system's program; without ``applied``, p - (c + g)."""
    forces = outputs["passive"] if applied is None else [tau + force for tau, force in zip(applied, outputs["passive"], strict=True)]
    terms = zip(forces, outputs["velocity"], outputs["gravity"], strict=True)
    return [force - (velocity + gravity) for force, velocity, gravity in terms]


def upper_triangle(n: int) -> list[tuple[int, int]]:
    """Index pairs (i, j), i <= j < n, by rows: the order of the ``mass`` output."""
    return [(i, j) for i in range(n) for j in range(i, n)]


def position_count(program: StraightLineProgram) -> int:
    """nq of a system's program: time stands behind q, v and tau."""
    forces = program.outputs["velocity" if "velocity" in program.outputs else "forces"]
    return program.inputs.index("t") - 2 * len(forces)


def _is_index(value: Any, length: int) -> bool:
    return type(value) is int and 0 <= value < length


def _check_instruction(position: int, instruction: Instruction, inputs: int) -> None:
    operation, *operands = instruction or ("",)
    if not isinstance(operation, str) or _OPERANDS.get(operation) != len(operands):
        raise ValueError(f"instruction {position} is {instruction!r}, which is no known operation")
    if operation == "input":
        valid = _is_index(operands[0], inputs)
    elif operation == "rational":
        # Exactly as written by ``str``: the ball kernel puts the text into Python source.
        valid = all(isinstance(text, str) and text == str(int(text)) for text in operands) and int(operands[1]) > 0
    elif operation == "integer_power":
        valid = _is_index(operands[0], position) and type(operands[1]) is int
    else:
        valid = all(_is_index(operand, position) for operand in operands)
    if not valid:
        raise ValueError(f"instruction {position} is {instruction!r}; its operands are out of range")


def earlier_results(instruction: Instruction) -> tuple[int, ...]:
    """Operands of an instruction that are places of earlier ones."""
    return instruction[1 : 1 + _ARITY.get(instruction[0], 0)]


def with_operands(instruction: Instruction, places: Sequence[int] | Mapping[int, int]) -> Instruction:
    """``instruction`` with each operand that is an earlier result moved to ``places[operand]``."""
    operation, *operands = instruction
    count = _ARITY.get(operation, 0)
    return (operation, *(places[operand] for operand in operands[:count]), *operands[count:])


def used_instructions(program: StraightLineProgram) -> set[int]:
    """The places of the instructions on which an output rests."""
    return {place for place, is_used in enumerate(_uses(program)) if is_used}


def _uses(program: StraightLineProgram) -> bytearray:
    """1 for each instruction on which an output rests."""
    instructions = program.instructions
    used = bytearray(len(instructions))
    for indices in program.outputs.values():
        for index in indices:
            used[index] = 1
    for place in reversed(range(len(instructions))):
        if used[place]:
            instruction = instructions[place]
            for operand in instruction[1 : 1 + _ARITY.get(instruction[0], 0)]:
                used[operand] = 1
    return used


def without_unused(program: StraightLineProgram) -> StraightLineProgram:
    """The program without the instructions on which no output rests."""
    used = _uses(program)
    if all(used):
        return StraightLineProgram(program.inputs, program.instructions, {name: tuple(own) for name, own in program.outputs.items()})
    places, instructions = [0] * len(used), list[Instruction]()
    for place in (place for place, is_used in enumerate(used) if is_used):
        instruction = program.instructions[place]
        places[place], count = len(instructions), _ARITY.get(instruction[0], 0)
        # As ``with_operands`` does, which takes four times as long: programs of contacts have ten thousands of instructions.
        if count == 2:
            instruction = (instruction[0], places[instruction[1]], places[instruction[2]])
        elif count:
            instruction = (instruction[0], places[instruction[1]], *instruction[2:])
        instructions.append(instruction)
    outputs = {name: tuple(places[index] for index in indices) for name, indices in program.outputs.items()}
    return StraightLineProgram(program.inputs, tuple(instructions), outputs)
