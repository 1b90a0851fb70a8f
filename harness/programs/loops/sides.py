"""Loops by which it is found on which sides forces are: programs in float64, how far inputs move them, and certified solutions alone.

Source: Griewank, Walther, Evaluating Derivatives, 2nd ed., section 3.1 (forward mode).
"""

from __future__ import annotations

import math

from harness.programs.loops.double_double import LARGEST_ARGUMENT, arctangent_in_float64, sine_and_cosine_in_float64
from harness.programs.loops.instructions import RUN, LoopArithmetic, Program, write_approximate_run, write_instructions, write_run
from harness.programs.loops.language import Function, Writer
from harness.programs.loops.solution import LinearEquations, Workspace, factorise, solve
from harness.programs.loops.values import Array, Value, larger, root_of, select

Moved = tuple[Value, Value]
_VALUES = {
    **dict.fromkeys(("n", "m", "inputs", "constants", "outputs"), "integer"), "instructions": "halves", "of_constants": "numbers",
    "values": "vectors", "places": "integers", "found": "vectors", "given": "vectors",
}  # fmt: skip
_SPREAD = {**_VALUES, "scales": "vectors"}
_SOLVE = {
    **dict.fromkeys(("n", "m", "inputs", "constants", "nv"), "integer"), "instructions": "halves", "of_constants": "numbers",
    "values": "vectors", "system": "integers", "force": "integers", **dict.fromkeys(("given", "work", "solution", "radius"), "vectors"),
}  # fmt: skip


def _at(values: Array, place: Value) -> Moved:
    return values[place, 0], values[place, 1]


def _store(values: Array, place: Value, moved: Moved) -> None:
    values[place, 0], values[place, 1] = moved


def _divide(a: Moved, b: Moved) -> Moved:
    inverse, quotient = 1.0 / b[0], a[0] / b[0]
    return quotient, abs(inverse) * a[1] + abs(quotient * inverse) * b[1]


def _root(a: Moved) -> Moved:
    found = root_of(a[0])
    return found, a[1] * (0.5 / found)


def _sine_and_cosine(code: Writer, a: Moved) -> tuple[Moved, Moved]:
    sine, cosine = (select(abs(a[0]) < LARGEST_ARGUMENT, one, math.nan) for one in sine_and_cosine_in_float64(code, a[0]))
    return (sine, abs(cosine) * a[1]), (cosine, abs(sine) * a[1])


def _arctangent(code: Writer, a: Moved, b: Moved) -> Moved:
    over = 1.0 / larger(abs(a[0]), abs(b[0]))
    y, x = a[0] * over, b[0] * over
    return arctangent_in_float64(code, a[0], b[0]), (abs(x) * a[1] + abs(y) * b[1]) * (over / (x * x + y * y))


# Values, and sums of the absolute values of all ways from an input.
_MOVED = LoopArithmetic(
    _at,
    _store,
    lambda a, sign, b: (a[0] + sign * b[0], a[1] + b[1]),
    lambda a, b: (a[0] * b[0], abs(b[0]) * a[1] + abs(a[0]) * b[1]),
    _divide,
    _root,
    _sine_and_cosine,
    _arctangent,
)


def _run(code: Writer) -> None:
    write_instructions(code, _MOVED, code.array("values", 2))


def _spread(code: Writer) -> None:
    """Values and spreads of outputs at n states, (n, outputs, 2) in ``found``, for inputs that move by ``scales``.

    NaN for what sines take from arguments that are too large for their tables.
    """
    program, count, places = Program(code, 2), code.argument("outputs"), code.array("places")
    given, scales, found = code.array("given", program.inputs), code.array("scales", program.inputs), code.array("found", count, 2)
    for place in code.range(program.inputs, program.start):
        program.values[place, 1] = 0.0
    for block in program.blocks():
        for i in code.range(program.inputs):
            _store(program.values, i, (given[block, i], scales[block, i]))
        program.run()
        for i in code.range(count):
            _store(found.part(block), i, _at(program.values, places[i]))


def _values(code: Writer) -> None:
    """Values of outputs alone, (n, outputs) in ``found``."""
    program, count, places = Program(code, 1), code.argument("outputs"), code.array("places")
    given, found = code.array("given", program.inputs), code.array("found", count)
    for block in program.blocks():
        program.place(given.part(block))
        program.run()
        for i in code.range(count):
            found[block, i] = program.values[places[i], 0]


def _solve(code: Writer) -> None:
    """The solutions of A a = f at n states, (n, nv, 2), with bounds of their errors, (n, nv), as ``loops`` has them."""
    program, nv, system = Program(code), code.argument("nv"), code.array("system", code.argument("nv"))
    given, solution, radius = code.array("given", program.inputs), code.array("solution", nv, 2), code.array("radius", nv)
    work = Workspace(code.array("work", nv + 3, nv + 3))
    for block in program.blocks():
        program.place(given.part(block))
        program.run()
        for i in code.range(nv):
            for j in code.range(nv):
                work.matrix[i, j] = program.values[system[i, j], 0]
        factorise(code, nv, work.matrix, work.scale, work.factor)
        equations = LinearEquations(code, nv, program.values, system, code.array("force"), work.scale)
        solve(equations, work, solution.part(block), radius.part(block))


# As of ``harness.programs.loops.loops``.
PARTS: dict[str, Function] = {"run_of_1": (write_approximate_run, RUN), "run_of_2": (_run, RUN), "run_of_3": (write_run, RUN)}
LOOPS: dict[str, Function] = {"spread": (_spread, _SPREAD), "values": (_values, _VALUES), "solve": (_solve, _SOLVE)}
