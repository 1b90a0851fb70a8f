"""From coordinates that are measured from the world to joints that measure each body from the one before.

A text that uses the absolute angles of a chain has a kinetic energy of few terms; in the angles of the joints every
term depends on all joints before it, and the equations of n bars hold n^4 of them. So the equations are derived in the
text's coordinates q, and the program is then put into the joints' positions u:

    q = S u,    M_u = S' M S,    f_u = S' f,

where S adds to each joint's position those of the joints that it is measured from. S' sums over whatever is measured from a
joint, so that the program grows by about 2 n^2 additions.

Source: Greenwood, Principles of Dynamics, 2nd ed., section 6-4 (generalised forces under a change of coordinates).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from harness.equations.program import StraightLineProgram, with_operands, without_unused

Parents = Sequence[int | None]
_OF_FORCE = ("velocity", "gravity", "passive", "forces")


def in_joint_positions(program: StraightLineProgram, measured_from: Parents) -> StraightLineProgram:
    """The program of the same equations with joint positions and velocities for inputs, and their forces for outputs.

    ``measured_from`` has, for each of the n coordinates, the place of an earlier one, or None for the world. The first n
    inputs are positions, the next n rates. Outputs are those of ``harness.equations.kernels`` or of ``harness.equations.energies``.
    """
    n = len(measured_from)
    instructions: list[tuple[Any, ...]] = [("input", place) for place in range(len(program.inputs))]

    def add(first: int, second: int) -> int:
        instructions.append(("add", first, second))
        return len(instructions) - 1

    coordinate = list(range(len(program.inputs)))
    for block in (0, n):
        for place, parent in enumerate(measured_from):
            if parent is not None:
                coordinate[block + place] = add(block + place, coordinate[block + parent])
    results: list[int] = []
    for instruction in program.instructions:
        if instruction[0] == "input":
            results.append(coordinate[instruction[1]])
        else:
            instructions.append(with_operands(instruction, results))
            results.append(len(instructions) - 1)
    outputs = {name: [results[index] for index in indices] for name, indices in program.outputs.items()}
    for name in filter(outputs.get, _OF_FORCE):
        for place, parent in _from_the_tips(measured_from):
            outputs[name][parent] = add(outputs[name][parent], outputs[name][place])
    if "mass" in outputs:
        upper = [(i, j) for i in range(n) for j in range(i, n)]
        mass = {pair: index for index, (i, j) in zip(outputs["mass"], upper, strict=True) for pair in ((i, j), (j, i))}
        for place, parent in _from_the_tips(measured_from):
            mass |= {(row, parent): add(mass[row, parent], mass[row, place]) for row in range(n)}
        for place, parent in _from_the_tips(measured_from):
            mass |= {(parent, column): add(mass[parent, column], mass[place, column]) for column in range(n)}
        outputs["mass"] = [mass[pair] for pair in upper]
    joint = StraightLineProgram(program.inputs, tuple(instructions), {name: tuple(indices) for name, indices in outputs.items()})
    return without_unused(joint)


def _from_the_tips(measured_from: Parents) -> list[tuple[int, int]]:
    return [(place, parent) for place, parent in reversed(list(enumerate(measured_from))) if parent is not None]
