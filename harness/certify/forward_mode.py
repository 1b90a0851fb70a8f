"""Exact first derivatives of a program's outputs by all of its inputs, without compiling anything.

For quantities that are asked for now and then: the derivatives of every entry of a mass matrix take seconds to compile
and microseconds to run, and these take milliseconds.

Source: Griewank, Walther, Evaluating Derivatives, 2nd ed., section 3.1 (forward mode).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.equations.program import StraightLineProgram, earlier_results

# f by its arguments. An integer power has one operand that is a result: its exponent is a literal.
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "neg": np.negative,
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "sinh": np.sinh,
    "cosh": np.cosh,
    "tanh": np.tanh,
    "exp": np.exp,
    "log": np.log,
    "integer_power": lambda x, n: x ** float(n),
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "div": np.divide,
    "pow": np.power,
    "atan2": np.arctan2,
}
# The partial derivatives of f, given a module of functions, the arguments and f: the same for numpy and for balls.
PARTIAL_DERIVATIVES: dict[str, Callable[..., tuple[Any, ...]]] = {
    "neg": lambda m, x, f: (-1.0,),
    "sqrt": lambda m, x, f: (0.5 / f,),
    "sin": lambda m, x, f: (m.cos(x),),
    "cos": lambda m, x, f: (-m.sin(x),),
    "tan": lambda m, x, f: (1.0 + f * f,),
    "asin": lambda m, x, f: (1.0 / m.sqrt((1.0 - x) * (1.0 + x)),),
    "acos": lambda m, x, f: (-1.0 / m.sqrt((1.0 - x) * (1.0 + x)),),
    "atan": lambda m, x, f: (1.0 / (1.0 + x * x),),
    "sinh": lambda m, x, f: (m.cosh(x),),
    "cosh": lambda m, x, f: (m.sinh(x),),
    "tanh": lambda m, x, f: (1.0 - f * f,),
    "exp": lambda m, x, f: (f,),
    "log": lambda m, x, f: (1.0 / x,),
    "integer_power": lambda m, x, n, f: (n * x ** (n - 1),),
    "add": lambda m, a, b, f: (1.0, 1.0),
    "sub": lambda m, a, b, f: (1.0, -1.0),
    "mul": lambda m, a, b, f: (b, a),
    "div": lambda m, a, b, f: (1.0 / b, -f / b),
    "pow": lambda m, a, b, f: (b * a ** (b - 1.0), f * m.log(a)),
    "atan2": lambda m, a, b, f: (b / (a * a + b * b), -a / (a * a + b * b)),
}


def values(program: StraightLineProgram, inputs: Array) -> dict[str, Array]:
    """The outputs, (outputs of that name, n), for inputs (number of inputs, n), one column a state; nothing is compiled or raised."""
    found: list[Array] = []
    with np.errstate(all="ignore"):
        for instruction in program.instructions:
            operation, *operands = instruction
            if operation == "input":
                found.append(inputs[operands[0]])
            elif operation in ("rational", "pi"):
                found.append(np.full(inputs.shape[1], np.pi if operation == "pi" else int(operands[0]) / int(operands[1])))
            else:
                earlier = earlier_results(instruction)
                found.append(FUNCTIONS[operation](*(found[place] for place in earlier), *operands[len(earlier) :]))
    return {
        name: np.array([found[index] for index in indices]).reshape(len(indices), inputs.shape[1])
        for name, indices in program.outputs.items()
    }


def values_and_spread(program: StraightLineProgram, inputs: Array, scales: Array) -> tuple[dict[str, Array], dict[str, Array]]:
    """``values``, and how far each output moves, to first order, when every use of every input moves by up to its scale.

    Ways from an input to an output add their absolute values, so that this is no less than the sum over inputs of
    |derivative times scale|. A length that stands twice in a file is rounded twice, where a derivative sees its two parts cancel.
    """
    found: list[Array] = []
    spread: list[Array | None] = []
    with np.errstate(all="ignore"):
        for instruction in program.instructions:
            operation, *operands = instruction
            if operation == "input":
                found.append(inputs[operands[0]])
                spread.append(scales[operands[0]])
            elif operation in ("rational", "pi"):
                found.append(np.full(inputs.shape[1], np.pi if operation == "pi" else int(operands[0]) / int(operands[1])))
                spread.append(None)
            else:
                earlier = earlier_results(instruction)
                arguments = [*(found[place] for place in earlier), *operands[len(earlier) :]]
                found.append(FUNCTIONS[operation](*arguments))
                pairs = zip(earlier, PARTIAL_DERIVATIVES[operation](np, *arguments, found[-1]), strict=True)
                parts = [known * np.abs(partial) for place, partial in pairs if (known := spread[place]) is not None]
                spread.append(sum(parts[1:], parts[0]) if parts else None)
    zero, n = np.zeros(inputs.shape[1]), inputs.shape[1]

    def gathered(each: Sequence[Array | None]) -> dict[str, Array]:
        return {
            name: np.array([zero if each[index] is None else each[index] for index in indices]).reshape(len(indices), n)
            for name, indices in program.outputs.items()
        }

    return gathered(found), gathered(spread)


def jacobians(program: StraightLineProgram, inputs: Array) -> dict[str, Array]:
    """d(output)/d(input), (outputs of that name, number of inputs, n), for inputs (number of inputs, n), one column a state.

    Not finite where an output is not differentiable; nothing is raised.
    """
    count, n = inputs.shape
    values: list[Array] = []
    # None for what depends on no input, and for what no later instruction takes.
    slopes: list[Array | None] = []
    with np.errstate(all="ignore"):
        for instruction, done in zip(program.instructions, _last_uses(program), strict=True):
            operation, *operands = instruction
            if operation == "input":
                slope = np.zeros((count, n))
                slope[operands[0]] = 1.0
                values.append(inputs[operands[0]])
                slopes.append(slope)
            elif operation in ("rational", "pi"):
                values.append(np.full(n, np.pi if operation == "pi" else int(operands[0]) / int(operands[1])))
                slopes.append(None)
            else:
                earlier = earlier_results(instruction)
                arguments = [*(values[place] for place in earlier), *operands[len(earlier) :]]
                values.append(FUNCTIONS[operation](*arguments))
                pairs = zip(earlier, PARTIAL_DERIVATIVES[operation](np, *arguments, values[-1]), strict=True)
                parts = [known * partial for place, partial in pairs if (known := slopes[place]) is not None]
                slopes.append(sum(parts[1:], parts[0]) if parts else None)
                for place in done:
                    slopes[place] = None
    zero = np.zeros((count, n))
    return {
        name: np.array([zero if slopes[index] is None else slopes[index] for index in indices]).reshape(len(indices), count, n)
        for name, indices in program.outputs.items()
    }


def most_at_once(program: StraightLineProgram) -> int:
    """How many instructions have derivatives that ``jacobians`` holds at once, at most."""
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
