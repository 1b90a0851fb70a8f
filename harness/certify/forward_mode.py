"""Exact first derivatives of a program's outputs by all of its inputs, without compiling anything.

For quantities that are asked for now and then: the derivatives of every entry of a mass matrix take seconds to compile
and microseconds to run, and these take milliseconds.

Source: Griewank, Walther, Evaluating Derivatives, 2nd ed., section 3.1 (forward mode).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.equations.program import StraightLineProgram, earlier_results

# f and its slopes by its arguments, given the arguments and f. An integer power has one slope: its exponent is a literal.
_RULES: dict[str, tuple[Callable[..., Array], Callable[..., tuple[Any, ...]]]] = {
    "neg": (np.negative, lambda x, f: (-1.0,)),
    "sqrt": (np.sqrt, lambda x, f: (0.5 / f,)),
    "sin": (np.sin, lambda x, f: (np.cos(x),)),
    "cos": (np.cos, lambda x, f: (-np.sin(x),)),
    "tan": (np.tan, lambda x, f: (1.0 + f * f,)),
    "asin": (np.arcsin, lambda x, f: (1.0 / np.sqrt((1.0 - x) * (1.0 + x)),)),
    "acos": (np.arccos, lambda x, f: (-1.0 / np.sqrt((1.0 - x) * (1.0 + x)),)),
    "atan": (np.arctan, lambda x, f: (1.0 / (1.0 + x * x),)),
    "sinh": (np.sinh, lambda x, f: (np.cosh(x),)),
    "cosh": (np.cosh, lambda x, f: (np.sinh(x),)),
    "tanh": (np.tanh, lambda x, f: (1.0 - f * f,)),
    "exp": (np.exp, lambda x, f: (f,)),
    "log": (np.log, lambda x, f: (1.0 / x,)),
    "integer_power": (lambda x, n: x ** float(n), lambda x, n, f: (n * x ** float(n - 1),)),
    "add": (np.add, lambda a, b, f: (1.0, 1.0)),
    "sub": (np.subtract, lambda a, b, f: (1.0, -1.0)),
    "mul": (np.multiply, lambda a, b, f: (b, a)),
    "div": (np.divide, lambda a, b, f: (1.0 / b, -f / b)),
    "pow": (np.power, lambda a, b, f: (b * a ** (b - 1.0), f * np.log(a))),
    "atan2": (np.arctan2, lambda a, b, f: (b / (a * a + b * b), -a / (a * a + b * b))),
}


def jacobians(program: StraightLineProgram, inputs: Array) -> dict[str, Array]:
    """d(output)/d(input), (outputs of that name, number of inputs, n), for inputs (number of inputs, n), one column a state.

    Not finite where an output is not differentiable; nothing is raised.
    """
    count, n = inputs.shape
    values: list[Array] = []
    # None for what depends on no input.
    slopes: list[Array | None] = []
    with np.errstate(all="ignore"):
        for instruction in program.instructions:
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
                function, partials = _RULES[operation]
                values.append(function(*arguments))
                pairs = zip(earlier, partials(*arguments, values[-1]), strict=True)
                parts = [known * partial for place, partial in pairs if (known := slopes[place]) is not None]
                slopes.append(sum(parts[1:], parts[0]) if parts else None)
    zero = np.zeros((count, n))
    return {
        name: np.array([zero if slopes[index] is None else slopes[index] for index in indices]).reshape(len(indices), count, n)
        for name, indices in program.outputs.items()
    }
