"""Straight-line programs compiled to float64 SIMD batches and to balls.

``Float64Kernel`` runs on heyoka: SIMD machine code over batches of states. ``BallKernel`` runs on Arb:
every result is an interval that certainly holds the exact value at the exact float64 inputs.

Inputs of a system's program are, in this order: q (nq), v (nv), tau (nv), time (1), parameters. Its
outputs are ``mass`` (upper triangle by rows), ``velocity``, ``gravity`` and ``passive`` (nv each), so
that M qdd = tau + passive - velocity - gravity, and ``regularity`` (1) where a chart can be singular.

Sources: Biscani, Izzo, heyoka.py documentation, ``cfunc``; Johansson, Arb:
efficient arbitrary-precision midpoint-radius interval arithmetic, IEEE Trans. Comput. 66 (2017).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from types import CodeType
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.programs.evaluation import Arithmetic
from harness.programs.machine_code import load_heyoka
from harness.programs.program import OUTPUTS, UNARY, StraightLineProgram, earlier_results, position_count, right_hand_side, upper_triangle
from harness.storage import Kept

# Longer programs of expressions are compiled in heyoka's compact mode, in seconds instead of minutes.
MOST_INSTRUCTIONS_UNROLLED = 64
# Degrees of freedom. Compiling the solution of M x = b takes their third power, and minutes beyond.
MOST_UNROLLED = 24
# Straight-line machine code for more instructions takes minutes to compile; with loops it is slower to run.
MOST_STRAIGHT = 20_000


class Float64Kernel:
    """float64 batch evaluators of one system's program, compiled on first use.

    Every method takes ``inputs`` of shape (number of inputs, n), C-contiguous, one column a state.
    """

    def __init__(
        self, program: StraightLineProgram, parameters: Sequence[float] | None = None, other_charts: Sequence[StraightLineProgram] = ()
    ) -> None:
        """With ``parameters`` these are compiled into the machine code, and ``inputs`` ends before them.

        ``other_charts`` are programs of the same equations, each of which stands in for the first where it is more regular.
        """
        self.program = program
        self._programs = (program, *other_charts)
        self.nv = len(program.outputs["velocity"])
        self._parameters = parameters

    def accelerations(self, inputs: Array) -> Array:
        """qdd, (nv, n), by L D L' factorisation without pivoting."""
        if self.nv <= MOST_UNROLLED:
            return evaluated(self._accelerations, inputs)
        return np.stack(self._solved(list(inputs), self._entries(inputs)))

    def terms(self, inputs: Array) -> dict[str, Array]:
        """``mass`` (n, nv, nv), ``velocity``, ``gravity``, ``passive`` (n, nv each)."""
        mass, *vectors = self._entries(inputs).values()
        return dict(zip(OUTPUTS, [full_matrices(mass), *(vector.T for vector in vectors)], strict=True))

    def _entries(self, inputs: Array) -> dict[str, Array]:
        """``OUTPUTS``, (entries, n) each."""
        flat = evaluated(self._terms, inputs)
        return dict(zip(OUTPUTS, np.split(flat, len(flat) - self.nv * np.arange(3, 0, -1)), strict=True))

    def _solved(self, inputs: Sequence[Any], outputs: Mapping[str, Any]) -> list[Any]:
        """qdd, for values or expressions of the inputs and of the program's outputs."""
        first = position_count(self.program) + self.nv
        return solve_symmetric(outputs["mass"], right_hand_side(outputs, inputs[first : first + self.nv]))

    @cached_property
    def _symbols(self) -> tuple[list[Any], dict[str, list[Any]]]:
        heyoka = load_heyoka()

        inputs, chosen = symbols_of(self.program, self._parameters or ())
        for program in self._programs[1:]:
            _, other = symbols_of(program, self._parameters or ())
            better = heyoka.gt(other["regularity"][0], chosen["regularity"][0])
            for name, expressions in chosen.items():
                pairs = zip(expressions, other[name], strict=True)
                chosen[name] = [one if one == another else heyoka.select(better, another, one) for one, another in pairs]
        return inputs, chosen

    @cached_property
    def _terms(self) -> Any:
        inputs, outputs = self._symbols
        return compiled(inputs, outputs, OUTPUTS, len(self.program.instructions) > MOST_STRAIGHT)

    @cached_property
    def _accelerations(self) -> Any:
        return load_heyoka().cfunc(self._solved(*self._symbols), vars=self._symbols[0])


def full_matrices(upper: Array) -> Array:
    """(n, nv, nv) symmetric matrices, given by their upper triangles by rows, (entries, n)."""
    size = int((2 * len(upper)) ** 0.5)
    found = np.empty((upper.shape[1], size, size))
    for entry, (i, j) in zip(upper, upper_triangle(size), strict=True):
        found[:, i, j] = found[:, j, i] = entry
    return found


def compiled(inputs: list[Any], outputs: Mapping[str, Sequence[Any]], names: Iterable[str], is_compact: bool = False) -> Any:
    """heyoka's function of ``inputs`` that evaluates the outputs of these names, one after the other."""
    return load_heyoka().cfunc([expression for name in names for expression in outputs[name]], vars=inputs, compact_mode=is_compact)


def evaluated(function: Any, inputs: Array) -> Array:
    """``function`` of every column, each in a full SIMD vector, so that a state alone is rounded as it is among others.

    heyoka evaluates what is left over one by one, with other sines and cosines.
    """
    states = inputs.shape[1]
    missing = -states % load_heyoka().recommended_simd_size()
    filled = np.pad(inputs, ((0, 0), (0, missing)), mode="edge") if missing and states else inputs
    return np.ascontiguousarray(np.asarray(function(filled))[:, :states])


def symbols_of(program: StraightLineProgram, parameters: Sequence[float] = ()) -> tuple[list[Any], dict[str, list[Any]]]:
    """heyoka's symbols for the inputs before ``parameters``, which are numbers, and the program's outputs of them."""
    heyoka = load_heyoka()

    inputs = [heyoka.expression(f"z{place}") for place in range(len(program.inputs) - len(parameters))]
    # With the digits of long double, as heyoka turns a division by a number into a product.
    values = [heyoka.expression(np.longdouble(value)) for value in parameters]
    return inputs, heyoka_expressions(program, [*inputs, *values])


def heyoka_expressions(program: StraightLineProgram, inputs: Sequence[Any]) -> dict[str, list[Any]]:
    """The program's outputs as heyoka expressions of ``inputs``."""
    heyoka = load_heyoka()

    symbols = Arithmetic(
        # With the digits of long double, for which a kernel may be compiled. A literal of float64 would not do even where it is
        # exact: heyoka turns x / 3 into x times the third of 3.0.
        literal=lambda numerator, denominator: heyoka.expression(np.longdouble(numerator) / np.longdouble(denominator)),
        pi=lambda: heyoka.pi,
        power=lambda value, exponent: value ** float(exponent),
        function=lambda name, *values: getattr(heyoka, name)(*values),
    )
    values = symbols.values(program, inputs)
    return {name: [values[index] for index in indices] for name, indices in program.outputs.items()}


def solve_symmetric(upper: Sequence[Any], right_hand_side: Sequence[Any]) -> list[Any]:
    """Solve M x = b by unrolled L D L', M given by its upper triangle.

    Source: Golub, Van Loan, Matrix Computations, 4th ed., section 4.1.2.
    """
    n = len(right_hand_side)
    mass = {}
    for entry, (i, j) in zip(upper, upper_triangle(n), strict=True):
        mass[i, j] = mass[j, i] = entry
    lower: dict[tuple[int, int], Any] = {}
    pivot: list[Any] = []
    for j in range(n):
        diagonal = mass[j, j]
        for k in range(j):
            diagonal = diagonal - lower[j, k] * lower[j, k] * pivot[k]
        pivot.append(diagonal)
        for i in range(j + 1, n):
            entry = mass[i, j]
            for k in range(j):
                entry = entry - lower[i, k] * lower[j, k] * pivot[k]
            lower[i, j] = entry / diagonal
    x = list(right_hand_side)
    for i in range(n):
        for k in range(i):
            x[i] = x[i] - lower[i, k] * x[k]
    x = [entry / diagonal for entry, diagonal in zip(x, pivot, strict=True)]
    for i in reversed(range(n)):
        for k in range(i + 1, n):
            x[i] = x[i] - lower[k, i] * x[k]
    return x


# Programs of one file with other numbers are the same.
_CODES: Kept[CodeType] = Kept(16)


class BallKernel:
    """Rigorous evaluator of a program in Arb's ball arithmetic.

    Constants and whatever depends on parameters alone are computed once per parameter set and
    precision; ``bind`` returns the function of the remaining inputs.
    """

    def __init__(self, program: StraightLineProgram, parameters: int) -> None:
        """``parameters`` is how many of the last inputs ``bind`` fixes."""
        self.program = program
        self.parameters = parameters

    @cached_property
    def _source(self) -> CodeType:
        def make() -> CodeType:
            return compile(_ball_source(self.program, self.parameters), "<ball kernel>", "exec")

        return _CODES.get((self.program.key, self.parameters), make)

    def bind(self, parameters: Sequence[float]) -> Callable[..., tuple[Any, ...]]:
        """A function from the other inputs (exact float64 each) to all outputs as ``arb``.

        Valid at the working precision (``flint.ctx.prec``) in force when ``bind`` is called. Outputs
        follow the program's outputs, flattened in order. Where the expressions are singular a result
        is not finite; nothing is raised.
        """
        import flint

        namespace: dict[str, Any] = {"arb": flint.arb, "fmpq": flint.fmpq}
        exec(self._source, namespace)
        evaluate: Callable[..., tuple[Any, ...]] = namespace["bind"](*(float(value) for value in parameters))
        return evaluate


# Python's text of each operation, of the names of its operands and of its literals.
_TEXTS = {name: f"{{}}.{name}()" for name in UNARY} | {
    "input": "arb(z{})",
    "rational": "arb(fmpq({}, {}))",
    "pi": "arb.pi()",
    "neg": "-{}",
    "add": "{} + {}",
    "sub": "{} - {}",
    "mul": "{} * {}",
    "div": "{} / {}",
    "pow": "{} ** {}",
    "integer_power": "{} ** {}",
    "atan2": "arb.atan2({}, {})",
}


def _ball_source(program: StraightLineProgram, parameters: int) -> str:
    """Python source of ``bind(parameters...)``, which returns ``evaluate(other inputs)``."""
    free = len(program.inputs) - parameters
    constant: list[bool] = []
    outer: list[str] = []
    inner: list[str] = []
    sines, cosines = ({operands[0] for operation, *operands in program.instructions if operation == name} for name in ("sin", "cos"))
    for position, instruction in enumerate(program.instructions):
        operation, *operands = instruction
        earlier = earlier_results(instruction)
        constant.append(operands[0] >= free if operation == "input" else all(constant[operand] for operand in earlier))
        target = outer if constant[-1] else inner
        if operation in ("sin", "cos") and operands[0] in sines & cosines:
            # One call gives both; the later of the two instructions finds it done.
            both = f"s{operands[0]}, c{operands[0]} = x{operands[0]}.sin_cos()"
            if both not in target:
                target.append(both)
            text = f"{operation[0]}{operands[0]}"
        else:
            text = _TEXTS[operation].format(*(f"x{operand}" for operand in earlier), *operands[len(earlier) :])
        target.append(f"x{position} = {text}")
    results = ", ".join(f"x{index}" for indices in program.outputs.values() for index in indices)
    return "\n".join(
        [
            f"def bind({', '.join(f'z{i}' for i in range(free, len(program.inputs)))}):",
            *(f"    {line}" for line in outer),
            f"    def evaluate({', '.join(f'z{i}' for i in range(free))}):",
            *(f"        {line}" for line in inner),
            f"        return ({results},)",
            "    return evaluate",
            "",
        ]
    )
