"""Derivatives of straight-line programs, and of terms as further terms of the same program.

One table holds the partial derivatives of every operation, for whatever values have operators: terms, arrays of float64, and balls.
A gradient by reverse accumulation takes a small multiple of the instructions of the function itself, whatever the number of
variables. The derivative expressions of SymPy lose this factoring, as its products are flattened.

Source: Griewank, Walther, Evaluating Derivatives, 2nd ed., sections 3.1 and 3.2 (forward and reverse mode).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import islice
from typing import Any

from harness.programs.program import Instruction, StraightLineProgram, earlier_results, without_unused
from harness.programs.terms import Builder, Term

# A function of one value by its name, as "sin" or "inverse"; and "ratio", the quotient of two.
Apply = Callable[..., Any]
# Partial derivatives of f, given functions, the arguments and f; an integer power has one operand that is a result.
PARTIAL_DERIVATIVES: dict[str, Callable[..., tuple[Any, ...]]] = {
    "neg": lambda apply, x, f: (-1.0,),
    "sqrt": lambda apply, x, f: (0.5 / f,),
    "sin": lambda apply, x, f: (apply("cos", x),),
    "cos": lambda apply, x, f: (-apply("sin", x),),
    "tan": lambda apply, x, f: (1.0 + f * f,),
    "asin": lambda apply, x, f: (1.0 / apply("sqrt", (1.0 - x) * (1.0 + x)),),
    "acos": lambda apply, x, f: (-1.0 / apply("sqrt", (1.0 - x) * (1.0 + x)),),
    "atan": lambda apply, x, f: (1.0 / (1.0 + x * x),),
    "sinh": lambda apply, x, f: (apply("cosh", x),),
    "cosh": lambda apply, x, f: (apply("sinh", x),),
    "tanh": lambda apply, x, f: (1.0 - f * f,),
    "exp": lambda apply, x, f: (f,),
    "log": lambda apply, x, f: (1.0 / x,),
    "integer_power": lambda apply, x, n, f: (n * x ** (n - 1),),
    "add": lambda apply, a, b, f: (1.0, 1.0),
    "sub": lambda apply, a, b, f: (1.0, -1.0),
    "mul": lambda apply, a, b, f: (b, a),
    "div": lambda apply, a, b, f: (apply("inverse", b), -apply("ratio", f, b)),
    "pow": lambda apply, a, b, f: (b * a ** (b - 1.0), f * apply("log", a)),
    "atan2": lambda apply, a, b, f: (b / (a * a + b * b), -(a / (a * a + b * b))),
}


def gradient(of: Term, variables: Sequence[Term]) -> list[Term]:
    """The derivatives of a term by inputs, by reverse accumulation."""
    builder = of.builder
    depends, adjoint = depending_on(builder, variables, of.place + 1), {of.place: builder.number(1)}
    for at in range(of.place, -1, -1):
        if at in adjoint and depends[at]:
            for operand, slope in _partials(builder, at, depends):
                product = adjoint[at] * slope
                adjoint[operand] = adjoint[operand] + product if operand in adjoint else product
    zero = builder.number(0)
    return [adjoint.get(variable.place, zero) for variable in variables]


def along(terms: Iterable[Term], rates: Mapping[Term, Term]) -> list[Term]:
    """The derivatives of terms along a motion, which is given by inputs and their rates."""
    terms = list(terms)
    if not terms:
        return []
    builder = terms[0].builder
    depends = depending_on(builder, rates, max(term.place for term in terms) + 1)
    moved = {term.place: rate for term, rate in rates.items()}
    for at, is_moved in enumerate(depends):
        if is_moved and at not in moved:
            total: Term | None = None
            for operand, slope in _partials(builder, at, depends):
                product = slope * moved[operand]
                total = product if total is None else total + product
            assert total is not None
            moved[at] = total
    zero = builder.number(0)
    return [moved.get(term.place, zero) for term in terms]


def depending_on(builder: Builder, inputs: Iterable[Term], count: int) -> list[bool]:
    """For each of the first ``count`` instructions, whether it rests on one of ``inputs``."""
    chosen, depends = {term.place for term in inputs}, list[bool]()
    for place, instruction in enumerate(islice(builder.instructions, count)):
        depends.append(place in chosen or any(depends[operand] for operand in earlier_results(instruction)))
    return depends


def _partials(builder: Builder, place: int, depends: Sequence[bool]) -> list[tuple[int, Term]]:
    """Operands of an instruction that depend on the variables, each with the derivative by it."""
    operation, *operands = instruction = builder.instructions[place]
    if operation == "mul" and operands[0] == operands[1]:
        return [(operands[0], builder.number(2) * builder.terms[operands[0]])]
    pairs = partial_derivatives(_write, instruction, place, builder.terms)
    terms = [(operand, slope if isinstance(slope, Term) else builder.number(slope)) for operand, slope in pairs]
    return [pair for pair in terms if depends[pair[0]]]


def partial_derivatives(apply: Apply, instruction: Instruction, place: int, values: Sequence[Any]) -> list[tuple[int, Any]]:
    """The operands of the instruction at ``place`` that are earlier results, each with the derivative by it; ``values`` are all results."""
    earlier = earlier_results(instruction)
    arguments = [*(values[operand] for operand in earlier), *instruction[1 + len(earlier) :]]
    return list(zip(earlier, PARTIAL_DERIVATIVES[instruction[0]](apply, *arguments, values[place]), strict=True)) if earlier else []


def _write(name: str, value: Term, divisor: Term | None = None) -> Term:
    """The functions of ``PARTIAL_DERIVATIVES`` as terms; a quotient's derivatives share the inverse of the divisor."""
    if divisor is not None:
        return value * divisor.inverse()
    return value.inverse() if name == "inverse" else value.builder.add(name, value)


# The place of the input that moves at rate 1, or for places of inputs the instructions of the program that are their rates.
Direction = int | Mapping[int, int]
_RATES = "rates of the directions"


def differentiate(program: StraightLineProgram, outputs: Sequence[str], directions: Sequence[Direction]) -> StraightLineProgram:
    """``program`` with an output ``derivative_name(name)`` for each of ``outputs``: its k entries along m directions, k m numbers by rows.

    Each shared part is written once. A rate may be a function of the inputs, as those of a quaternion along an angular velocity are.

    Raises:
        KeyError: the program has no such output.
        ValueError: a direction moves what is no input.
    """
    moved = {place for direction in directions for place in ([direction] if isinstance(direction, int) else direction)}
    if not moved <= set(range(len(program.inputs))):
        raise ValueError(f"the directions move the inputs {sorted(moved)}; the program has {len(program.inputs)}")
    # The builder simplifies, so that its places are others: rates go through it as an output.
    rates = tuple(place for direction in directions if not isinstance(direction, int) for place in direction.values())
    builder = Builder(program.inputs)
    written = builder.append(StraightLineProgram(program.inputs, program.instructions, {**program.outputs, _RATES: rates}))
    following = iter(written.pop(_RATES))
    inputs, one = builder.inputs, builder.number
    motions = [
        {inputs[each]: one(1)} if isinstance(each, int) else {inputs[place]: next(following) for place in each} for each in directions
    ]
    for name in outputs:
        columns = [along(written[name], motion) for motion in motions]
        written[derivative_name(name)] = [column[row] for row in range(len(written[name])) for column in columns]
    return without_unused(builder.program(written))


def derivative_name(output: str) -> str:
    """The name of the output that holds the derivatives of ``output``."""
    return f"d({output})"
