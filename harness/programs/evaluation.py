"""Programs evaluated instruction by instruction in any arithmetic, and their derivatives, without compiling anything.

For quantities that are asked for now and then: the derivatives of every entry of a mass matrix take seconds to compile
and microseconds to run, and these take milliseconds.

Sources: Griewank, Walther, Evaluating Derivatives, 2nd ed., section 3.1 (forward mode); Johansson, Arb: efficient arbitrary-precision
midpoint-radius interval arithmetic, IEEE Trans. Comput. 66 (2017), for balls.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.programs.derivatives import partial_derivatives
from harness.programs.program import StraightLineProgram, earlier_results
from harness.programs.terms import symmetric

_OPERATORS: Mapping[str, Callable[..., Any]] = {
    "neg": operator.neg,
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": operator.truediv,
    "pow": operator.pow,
    # What partial derivatives take besides.
    "inverse": lambda value: 1.0 / value,
    "ratio": operator.truediv,
}
# Functions whose names are others than those of their instructions.
_NUMPY = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2"}


@dataclass(frozen=True)
class Arithmetic:
    """Values that have operators.

    Attributes:
        literal: the quotient of two integers. pi: as a value.
        power: of a value by an integer. function: of one value, or of two, by its name.
    """

    literal: Callable[[int, int], Any]
    pi: Callable[[], Any]
    power: Callable[[Any, int], Any]
    function: Callable[..., Any]

    def apply(self, name: str, *values: Any) -> Any:
        """An operation on values, or a function as ``PARTIAL_DERIVATIVES`` asks for it."""
        operation = _OPERATORS.get(name)
        return self.function(name, *values) if operation is None else operation(*values)

    def values(self, program: StraightLineProgram, inputs: Sequence[Any] | Array) -> list[Any]:
        """The value of every instruction."""
        found: list[Any] = []
        for operation, *operands in program.instructions:
            if operation == "input":
                value = inputs[operands[0]]
            elif operation == "rational":
                value = self.literal(int(operands[0]), int(operands[1]))
            elif operation == "pi":
                value = self.pi()
            elif operation == "integer_power":
                value = self.power(found[operands[0]], operands[1])
            else:
                value = self.apply(operation, *(found[place] for place in operands))
            found.append(value)
        return found

    def partial_derivatives(self, program: StraightLineProgram, place: int, values: Sequence[Any]) -> list[tuple[int, Any]]:
        """The operands of an instruction that are earlier results, each with the derivative by it."""
        return partial_derivatives(self.apply, program.instructions[place], place, values)


def _floats(count: int) -> Arithmetic:
    """Arrays of float64, (count,)."""
    return Arithmetic(
        literal=lambda numerator, denominator: np.full(count, numerator / denominator),
        pi=lambda: np.full(count, np.pi),
        power=lambda value, exponent: value ** float(exponent),
        function=lambda name, *values: getattr(np, _NUMPY.get(name, name))(*values),
    )


@np.errstate(all="ignore")
def values(program: StraightLineProgram, inputs: Array) -> dict[str, Array]:
    """The outputs, (outputs of that name, n), for inputs (number of inputs, n), one column a state; nothing is compiled or raised."""
    n = inputs.shape[1]
    return _gathered(program, _floats(n).values(program, inputs), (n,))


@np.errstate(all="ignore")
def values_and_spread(program: StraightLineProgram, inputs: Array, scales: Array) -> tuple[dict[str, Array], dict[str, Array]]:
    """``values``, and how far each output moves, to first order, when every use of every input moves by up to its scale.

    Ways from an input to an output add their absolute values, so that this is no less than the sum over inputs of
    |derivative times scale|. A length that stands twice in a file is rounded twice, where a derivative sees its two parts cancel.
    """
    n = inputs.shape[1]
    found = _floats(n).values(program, inputs)
    spread = _forward(program, found, scales.__getitem__, lambda known, partial: known * np.abs(partial))
    return _gathered(program, found, (n,)), _gathered(program, spread, (n,))


@np.errstate(all="ignore")
def jacobians(program: StraightLineProgram, inputs: Array) -> dict[str, Array]:
    """d(output)/d(input), (outputs of that name, number of inputs, n), for inputs (number of inputs, n), one column a state.

    Not finite where an output is not differentiable; nothing is raised.
    """
    count, n = inputs.shape
    units = np.eye(count)[:, :, None] * np.ones(n)
    slopes = _forward(program, _floats(n).values(program, inputs), units.__getitem__, operator.mul)
    return _gathered(program, slopes, (count, n))


def _forward(
    program: StraightLineProgram, found: Sequence[Array], seed: Callable[[int], Array], weighed: Callable[[Array, Any], Array]
) -> list[Array | None]:
    """For each output's instruction the sum over its operands of theirs, ``weighed`` by the partial derivatives.

    That of an input is its ``seed``. None for what depends on no input, and for what no later instruction takes.
    """
    carried: list[Array | None] = []
    arithmetic = _floats(0)
    for place, (instruction, done) in enumerate(zip(program.instructions, _last_uses(program), strict=True)):
        if instruction[0] == "input":
            carried.append(seed(instruction[1]))
            continue
        pairs = arithmetic.partial_derivatives(program, place, found)
        parts = [weighed(known, partial) for operand, partial in pairs if (known := carried[operand]) is not None]
        carried.append(sum(parts[1:], parts[0]) if parts else None)
        for operand in done:
            carried[operand] = None
    return carried


def _gathered(program: StraightLineProgram, each: Sequence[Array | None], shape: tuple[int, ...]) -> dict[str, Array]:
    """The outputs of a program, zero for None."""
    zero = np.zeros(shape)
    return {
        name: np.array([zero if each[index] is None else each[index] for index in indices]).reshape(len(indices), *shape)
        for name, indices in program.outputs.items()
    }


def most_at_once(program: StraightLineProgram) -> int:
    """Largest number of instructions whose derivatives ``jacobians`` holds at once."""
    held = most = 0
    for done in _last_uses(program):
        held += 1
        most, held = max(most, held), held - len(done)
    return most


def _last_uses(program: StraightLineProgram) -> list[list[int]]:
    """For each instruction the earlier results that it is the last to take, and that are no outputs."""
    taken = {place for places in program.outputs.values() for place in places}
    found: list[list[int]] = []
    for instruction in reversed(program.instructions):
        last = set(earlier_results(instruction)) - taken
        taken |= last
        found.append(sorted(last))
    return found[::-1]


def _literal(numerator: int, denominator: int) -> Any:
    import flint

    return flint.arb(flint.fmpq(numerator, denominator))


def _pi() -> Any:
    import flint

    return flint.arb.pi()


# At the working precision in force.
BALLS = Arithmetic(_literal, _pi, operator.pow, lambda name, value, *others: getattr(type(value), name)(value, *others))


def mass_matrix(upper: Sequence[Any], nv: int) -> Any:
    """M as ``arb_mat`` of its upper triangle by rows."""
    import flint

    return flint.arb_mat(symmetric(upper, nv).tolist())


def solved(mass: Any, force: Sequence[Any]) -> list[Any]:
    """The solution of M x = force; all indeterminate where M is not certainly regular."""
    import flint

    try:
        solution = mass.solve(flint.arb_mat([[entry] for entry in force]))
    except ZeroDivisionError:
        return [flint.arb.nan()] * len(force)
    return [solution[place, 0] for place in range(len(force))]
