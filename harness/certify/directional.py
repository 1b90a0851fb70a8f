"""The derivative of a program's outputs along one direction of its inputs, every result moved in its last places, many states at a time.

It is the second opinion on derivatives that were compiled to float64. Where terms cancel, the moved results leave noise of
another size than the digits that float64 has left, also where float64 and any other precision round to one and the same zero.
Another precision would not do better: long double costs four times as much, is float64 itself on some machines, and lets
1 - cos(1e-12) vanish as float64 does.

Instructions that do not depend on each other and do the same are done in one call, so that a single state costs little too.

Sources: Griewank, Walther, Evaluating Derivatives, 2nd ed., section 3.1 (forward mode); Vignes, A stochastic arithmetic for
reliable scientific computation, Math. Comput. Simul. 35 (1993), for results that are moved at random.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.certify.forward_mode import FUNCTIONS, PARTIAL_DERIVATIVES
from harness.equations.program import StraightLineProgram, earlier_results

# In the last place of float64, by which a result is moved at most: enough different ones that two seldom cancel each other.
_MOST_UNITS = 16
# Numbers that are worked on at once, so that they stay in the processor's cache.
_MOST_AT_ONCE = 2**20


@dataclass(frozen=True)
class _Group:
    """Instructions that do the same to results of earlier groups.

    Attributes:
        places: of the results. operands: places of each operand. literals: further arguments.
        varying: numbers of the operands that depend on an input.
        noise: (instructions, 1) factors that differ from one by a few units in the last place.
    """

    operation: str
    places: slice
    operands: tuple[Any, ...]
    literals: tuple[Any, ...]
    varying: tuple[int, ...]
    noise: Array


class DirectionalDerivative:
    """Evaluator of one program; arranged once, asked many times."""

    def __init__(self, program: StraightLineProgram) -> None:
        self._program = program
        self._places, groups = _arranged(program)
        self._outputs = [self._places[index] for indices in program.outputs.values() for index in indices]
        generator = np.random.default_rng(0)
        self._groups = [self._group(key, members, generator) for key, members in groups.items()]

    def __call__(self, inputs: Array, direction: Array) -> dict[str, Array]:
        """Each output's derivative, (outputs of that name, n), for inputs and direction (number of inputs, n), one column a state.

        Not finite where an output is not differentiable; nothing is raised.
        """
        n = inputs.shape[1]
        at_once = max(1, _MOST_AT_ONCE // len(self._program.instructions))
        parts = [self._along(inputs[:, start : start + at_once], direction[:, start : start + at_once]) for start in range(0, n, at_once)]
        slopes = np.hstack(parts) if parts else np.empty((len(self._outputs), 0), dtype=np.float64)
        found, start = {}, 0
        for name, indices in self._program.outputs.items():
            found[name] = slopes[start : start + len(indices)]
            start += len(indices)
        return found

    def _along(self, inputs: Array, direction: Array) -> Array:
        values = np.empty((len(self._program.instructions), inputs.shape[1]))
        slopes = np.zeros_like(values)
        with np.errstate(all="ignore"):
            for group in self._groups:
                here = group.places
                if group.operation == "input":
                    values[here], slopes[here] = inputs[group.operands[0]], direction[group.operands[0]]
                elif group.operation == "rational":
                    values[here] = int(group.literals[0]) / int(group.literals[1])
                elif group.operation == "pi":
                    values[here] = np.pi
                else:
                    arguments = [*(values.take(places, axis=0) for places in group.operands), *group.literals]
                    exact = FUNCTIONS[group.operation](*arguments)
                    np.multiply(exact, group.noise, out=values[here])
                    partials = PARTIAL_DERIVATIVES[group.operation](np, *arguments, exact)
                    parts = [_times(slopes.take(group.operands[number], axis=0), partials[number]) for number in group.varying]
                    if parts:
                        slopes[here] = parts[0] if len(parts) == 1 else parts[0] + parts[1]
        return slopes.take(self._outputs, axis=0)

    def _group(self, key: tuple[Any, ...], members: list[int], generator: np.random.Generator) -> _Group:
        _, operation, literals, varying = key
        instructions = [self._program.instructions[member] for member in members]
        if operation == "input":
            operands: tuple[Any, ...] = (np.array([instruction[1] for instruction in instructions]),)
        else:
            earlier = zip(*(earlier_results(instruction) for instruction in instructions), strict=True)
            operands = tuple(np.array([self._places[place] for place in places]) for places in earlier)
        start = self._places[members[0]]
        units = generator.choice([-1.0, 1.0], (len(members), 1)) * generator.integers(1, _MOST_UNITS, (len(members), 1), endpoint=True)
        noise = 1 + units * np.finfo(np.float64).eps
        return _Group(operation, slice(start, start + len(members)), operands, literals, varying, noise)


def _arranged(program: StraightLineProgram) -> tuple[list[int], dict[tuple[Any, ...], list[int]]]:
    """The place of each instruction's result, and the instructions of each group, in the order in which groups are done."""
    levels: list[int] = []
    varies: list[bool] = []
    groups: dict[tuple[Any, ...], list[int]] = defaultdict(list)
    for number, instruction in enumerate(program.instructions):
        operation, earlier = instruction[0], earlier_results(instruction)
        levels.append(1 + max((levels[place] for place in earlier), default=-1))
        varies.append(operation == "input" or any(varies[place] for place in earlier))
        literals = () if operation == "input" else instruction[1 + len(earlier) :]
        varying = tuple(operand for operand, place in enumerate(earlier) if varies[place])
        groups[levels[-1], operation, literals, varying].append(number)
    ordered = dict(sorted(groups.items(), key=lambda group: (group[0][0], group[1][0])))
    places = [0] * len(program.instructions)
    for place, number in enumerate(number for members in ordered.values() for number in members):
        places[number] = place
    return places, ordered


def _times(slopes: Array, partial: Array | float) -> Array:
    return slopes if isinstance(partial, float) and partial == 1.0 else np.multiply(slopes, partial, out=slopes)
