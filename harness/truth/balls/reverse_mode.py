"""Derivatives of the equations of motion in balls, at the exact float64 inputs.

For states at which derivatives in float64 are in doubt: some milliseconds each. One sweep backwards through the program gives
the derivatives of all nv equations by all inputs.

Source: Griewank, Walther, Evaluating Derivatives, 2nd ed., section 3.2 (reverse mode).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.programs.evaluation import BALLS, mass_matrix, solved
from harness.programs.program import OUTPUTS, StraightLineProgram, earlier_results, position_count, right_hand_side, upper_triangle
from harness.storage import Kept

# Radius of a sensitivity relative to itself that is good enough: it is read to three digits.
SOUGHT_ACCURACY = 2.0**-20


def columns_in_balls(
    program: StraightLineProgram, inputs: Sequence[float], scales: Sequence[float], precisions: Sequence[int]
) -> tuple[Array, float]:
    """d(tau + passive - velocity - gravity - M qdd)/dz at fixed qdd times ``scales``, (nv, number of inputs), and
    sum over inputs of |dqdd/dz scale|_M, both at one state.

    Precision rises until the sum is certainly known to ``SOUGHT_ACCURACY``; NaN where the last precision does not give it,
    as where the equations have no derivative or M is not certainly positive definite.
    """
    import flint

    nv, count = len(program.outputs["velocity"]), len(inputs)
    for precision in precisions:
        with flint.ctx.workprec(precision):
            mass, columns = _columns(program, inputs, scales)
            total = _sum_of_norms(mass, columns)
            if total > 0 and float(total.rad()) <= SOUGHT_ACCURACY * float(total):
                found = np.array([[0.0 if entry is None else float(entry) for entry in column] for column in columns]).T
                return np.ascontiguousarray(found), float(total)
    return np.full((nv, count), np.nan), math.nan


def _columns(program: StraightLineProgram, inputs: Sequence[float], scales: Sequence[float]) -> tuple[Any, list[list[Any]]]:
    """M as ``arb_mat``, and for each input the derivatives of the nv equations by it times its scale, None for those that are zero."""
    import flint

    values = BALLS.values(program, [flint.arb(value) for value in inputs])
    outputs = {name: [values[place] for place in places] for name, places in program.outputs.items()}
    nv, first = len(outputs["velocity"]), position_count(program)
    applied = range(first + nv, first + 2 * nv)
    mass = mass_matrix(outputs["mass"], nv)
    solution = solved(mass, right_hand_side(outputs, [flint.arb(inputs[place]) for place in applied]))
    adjoints: list[list[Any] | None] = [None] * len(values)

    def seed(place: int, row: int, value: Any) -> None:
        adjoint = adjoints[place] = adjoints[place] or [None] * nv
        adjoint[row] = value if adjoint[row] is None else adjoint[row] + value

    for place, (i, j) in zip(program.outputs["mass"], upper_triangle(nv), strict=True):
        seed(place, i, -solution[j])
        if i != j:
            seed(place, j, -solution[i])
    for name, sign in zip(OUTPUTS[1:], (-1, -1, 1), strict=True):
        for row, place in enumerate(program.outputs[name]):
            seed(place, row, flint.arb(sign))
    columns: list[list[Any]] = [[None] * nv for _ in inputs]
    for place, adjoint in _swept(program, values, adjoints):
        columns[place] = [None if entry is None else entry * flint.arb(scales[place]) for entry in adjoint]
    for row, place in enumerate(applied):
        # Beside what the program makes of an applied force, as forces of constraints do, its own equation feels it.
        own = columns[place][row]
        columns[place][row] = flint.arb(scales[place]) if own is None else own + flint.arb(scales[place])
    return mass, columns


def _swept(program: StraightLineProgram, values: Sequence[Any], adjoints: list[list[Any] | None]) -> list[tuple[int, list[Any]]]:
    """Inputs with their adjoints, those of the results given in ``adjoints``, which are used up."""
    varies = _VARYING.get(program.key, lambda: _varying(program))
    found = []
    for place in reversed(range(len(values))):
        adjoint, instruction = adjoints[place], program.instructions[place]
        adjoints[place] = None
        if adjoint is None or not varies[place]:
            continue
        if instruction[0] == "input":
            found.append((instruction[1], adjoint))
            continue
        for operand, partial in BALLS.partial_derivatives(program, place, values):
            # The logarithm of a negative base is no number, and nobody asks for it where the exponent is a constant.
            if varies[operand]:
                parts = _times(adjoint, partial)
                adjoints[operand] = parts if (known := adjoints[operand]) is None else list(map(_sum, known, parts))
    return found


def _varying(program: StraightLineProgram) -> list[bool]:
    """For each instruction, whether it varies with any input."""
    varies = list[bool]()
    for instruction in program.instructions:
        varies.append(instruction[0] == "input" or any(varies[place] for place in earlier_results(instruction)))
    return varies


_VARYING: Kept[list[bool]] = Kept(16)


def _times(adjoint: list[Any], partial: Any) -> list[Any]:
    # Sums and differences, a third of all instructions, multiply nothing.
    if isinstance(partial, float) and abs(partial) == 1.0:
        return adjoint if partial > 0 else [None if entry is None else -entry for entry in adjoint]
    return [None if entry is None else entry * partial for entry in adjoint]


def _sum(a: Any, b: Any) -> Any:
    return b if a is None else a if b is None else a + b


def _sum_of_norms(mass: Any, columns: Sequence[Sequence[Any]]) -> Any:
    """sum of |M^-1 column|_M = sqrt(column' M^-1 column), as ``arb``."""
    import flint

    nv, zero = mass.nrows(), flint.arb(0)
    felt = [column for column in columns if any(entry is not None for entry in column)]
    matrix = flint.arb_mat([[zero if column[i] is None else column[i] for column in felt] for i in range(nv)])
    try:
        solution = mass.solve(matrix)
    except ZeroDivisionError:
        return flint.arb.nan()
    total = zero
    for k in range(len(felt)):
        square = sum((matrix[i, k] * solution[i, k] for i in range(nv)), zero)
        total += square.sqrt() if square > 0 else _root_of_nothing(square)
    return total


def _root_of_nothing(square: Any) -> Any:
    """The root of a ball that is certain of no sign: from 0 to that of its upper end; NaN for a negative one."""
    import flint

    upper = square.upper()
    return flint.arb(0).union(upper.sqrt()) if upper >= 0 else flint.arb.nan()
