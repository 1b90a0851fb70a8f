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
from harness.equations.program import StraightLineProgram

# d f(x) / dx, given x and f(x).
_SLOPES: dict[str, Callable[[Array, Array], Any]] = {
    "neg": lambda x, f: -1.0,
    "sqrt": lambda x, f: 0.5 / f,
    "sin": lambda x, f: np.cos(x),
    "cos": lambda x, f: -np.sin(x),
    "tan": lambda x, f: 1.0 + f * f,
    "asin": lambda x, f: 1.0 / np.sqrt((1.0 - x) * (1.0 + x)),
    "acos": lambda x, f: -1.0 / np.sqrt((1.0 - x) * (1.0 + x)),
    "atan": lambda x, f: 1.0 / (1.0 + x * x),
    "sinh": lambda x, f: np.cosh(x),
    "cosh": lambda x, f: np.sinh(x),
    "tanh": lambda x, f: 1.0 - f * f,
    "exp": lambda x, f: f,
    "log": lambda x, f: 1.0 / x,
}
_NAMES_IN_NUMPY: dict[str, str] = {"neg": "negative", "asin": "arcsin", "acos": "arccos", "atan": "arctan"}
# f(a, b), and the slopes of f in a and in b, given a, b and f.
_OF_TWO: dict[str, tuple[Callable[[Array, Array], Array], Callable[[Array, Array, Array], tuple[Any, Any]]]] = {
    "add": (lambda a, b: a + b, lambda a, b, f: (1.0, 1.0)),
    "sub": (lambda a, b: a - b, lambda a, b, f: (1.0, -1.0)),
    "mul": (lambda a, b: a * b, lambda a, b, f: (b, a)),
    "div": (lambda a, b: a / b, lambda a, b, f: (1.0 / b, -f / b)),
    "pow": (lambda a, b: a**b, lambda a, b, f: (b * a ** (b - 1.0), f * np.log(a))),
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
        for operation, *operands in program.instructions:
            if operation == "input":
                slope = np.zeros((count, n))
                slope[operands[0]] = 1.0
                values.append(inputs[operands[0]])
                slopes.append(slope)
            elif operation in ("rational", "pi"):
                values.append(np.full(n, np.pi if operation == "pi" else int(operands[0]) / int(operands[1])))
                slopes.append(None)
            elif operation in _OF_TWO:
                a, b = (values[operand] for operand in operands)
                function, partial = _OF_TWO[operation]
                values.append(function(a, b))
                slopes.append(_chained([slopes[operand] for operand in operands], partial(a, b, values[-1])))
            else:
                x = values[operands[0]]
                if operation == "integer_power":
                    values.append(x ** float(operands[1]))
                    slope_of = operands[1] * x ** float(operands[1] - 1)
                else:
                    values.append(getattr(np, _NAMES_IN_NUMPY.get(operation, str(operation)))(x))
                    slope_of = _SLOPES[operation](x, values[-1])
                slopes.append(_chained([slopes[operands[0]]], (slope_of,)))
    zero = np.zeros((count, n))
    return {
        name: np.array([zero if slopes[index] is None else slopes[index] for index in indices]).reshape(len(indices), count, n)
        for name, indices in program.outputs.items()
    }


def _chained(slopes: list[Array | None], partials: tuple[Any, ...]) -> Array | None:
    parts = [slope * partial for slope, partial in zip(slopes, partials, strict=True) if slope is not None]
    return sum(parts[1:], parts[0]) if parts else None
