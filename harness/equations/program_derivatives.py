"""Derivatives of a program's outputs as a program: further outputs beside the old ones, each shared part written once.

What takes derivatives of the equations as inputs of a computation, as an implicit integrator does, is then one program in turn, which
every kernel evaluates and every sweep differentiates once more.

Source: Griewank, Walther, Evaluating Derivatives, 2nd ed., section 3.1 (forward mode).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from harness.equations.calculus import ProgramWriter
from harness.equations.program import StraightLineProgram, without_unused

# The place of the input that moves at rate 1, or for places of inputs the instructions of the program that are their rates.
Direction = int | Mapping[int, int]

_RATES = "rates of the directions"


def differentiate(program: StraightLineProgram, outputs: Sequence[str], directions: Sequence[Direction]) -> StraightLineProgram:
    """``program`` with an output ``derivative_name(name)`` for each of ``outputs``: its k entries along m directions, k m numbers by rows.

    A rate may be a function of the inputs, as those of a quaternion along an angular velocity are.

    Raises:
        KeyError: the program has no such output.
        ValueError: a direction moves what is no input.
    """
    moved = {place for direction in directions for place in ([direction] if isinstance(direction, int) else direction)}
    if not moved <= set(range(len(program.inputs))):
        raise ValueError(f"the directions move the inputs {sorted(moved)}; the program has {len(program.inputs)}")
    # The writer simplifies, so that its places are others: rates go through it as an output.
    rates = tuple(place for direction in directions if not isinstance(direction, int) for place in direction.values())
    writer = ProgramWriter(StraightLineProgram(program.inputs, program.instructions, {**program.outputs, _RATES: rates}))
    written = dict(writer.outputs)
    following = iter(written.pop(_RATES))
    motions = [{one: writer.number(1)} if isinstance(one, int) else {place: next(following) for place in one} for one in directions]
    for name in outputs:
        columns = [writer.along(written[name], motion) for motion in motions]
        written[derivative_name(name)] = [column[row] for row in range(len(written[name])) for column in columns]
    return without_unused(writer.program(written))


def derivative_name(output: str) -> str:
    """The name of the output that holds the derivatives of ``output``."""
    return f"d({output})"
