"""The loops of ``harness.certify.interpreter``, as they are written for LLVM; nothing is allocated in them.

A program's results are numbers of ``harness.certify.double_double``, (places, 3): first the inputs, then the constants, then what
the instructions give.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from harness.certify import encoding as operations
from harness.certify.double_double import add, divide, multiply, number_at, root, sine_and_cosine, store
from harness.certify.language import LANES, Array, Value, Writer, select
from harness.certify.numbers import UNIT_ROUNDOFF
from harness.certify.solution import condition_number, factorise, SumOfNorms, in_metric, invert, norm, solve

_SIZES = {"n": "integer", "m": "integer", "nv": "integer", "inputs": "integer", "constants": "integer"}
_PROGRAM = {"instructions": "halves", "of_constants": "numbers", "mass": "integers", "force": "integers"}
_ROOM = {"values": "numbers", "adjoints": "vectors", "sizes": "numbers"}


class _Program:
    """A program in the function that is being written, with room for its results and their adjoints at one state."""

    def __init__(self, code: Writer) -> None:
        self.code = code
        self.m, self.nv, self.inputs = code.argument("m"), code.argument("nv"), code.argument("inputs")
        self.blocks = (self.nv + (LANES - 1)) // LANES
        # Of the first instruction's result.
        self.start = self.inputs + code.argument("constants")
        self.instructions = code.array("instructions", 3)
        self.mass, self.force = code.array("mass", self.nv), code.array("force")
        self.values, self.adjoints, self.sizes = code.array("values", 3), code.array("adjoints", self.blocks), code.array("sizes")
        constants = code.array("of_constants", 3)
        for k in code.range(code.argument("constants")):
            store(self.values, self.inputs + k, number_at(constants, k))

    def run(self, inputs: Array) -> None:
        """Every instruction's result, into ``values``."""
        code, values = self.code, self.values
        for i in code.range(self.inputs):
            store(values, i, (inputs[i], 0.0, 0.0))
        for index in code.range(self.m):
            operation, place = self.instructions[index, 0], self.start + index
            a, b = number_at(values, self.instructions[index, 1]), number_at(values, self.instructions[index, 2])

            def sum_or_difference() -> None:
                sign = 1.0 - 2.0 * operation.number()
                store(values, place, add(a, (sign * b[0], sign * b[1], b[2])))

            def pair() -> None:
                sine, cosine = sine_and_cosine(code, a)
                store(values, place, sine)
                store(values, place + 1, cosine)

            cases: dict[int, Callable[[], None]] = {
                operations.PRODUCT: lambda: store(values, place, multiply(a, b)),
                operations.QUOTIENT: lambda: store(values, place, divide(a, b)),
                operations.ROOT: lambda: store(values, place, root(a)),
                operations.SINE_AND_COSINE: pair,
                operations.COSINE: lambda: None,
            }
            code.choose(operation, cases, sum_or_difference)

    def sweep(self, accelerations: Array, scale: Array, take: Callable[[Value, Array, Value], None]) -> None:
        """Give ``take`` each input, the derivatives of f - M a by it, and a sum of absolute values over ``scale`` for their roundings.

        ``adjoints``, (places, nv rounded up to whole vectors), and ``sizes``, (places,), are zero before and after.
        """
        code = self.code
        lanes = code.array_of_numbers(self.adjoints, self.blocks * LANES)
        for i in code.range(self.nv):
            lanes[self.force[i], i] += 1.0
            self.sizes[self.force[i]] += 1.0 / scale[i]
            for j in code.range(self.nv):
                lanes[self.mass[i, j], i] -= accelerations[j]
                self.sizes[self.mass[i, j]] += abs(accelerations[j]) / scale[i]
        for reverse in code.range(self.m):
            self._step_back(self.m - 1 - reverse)
        for i in code.range(self.inputs):
            take(i, lanes.part(i), self.sizes[i])
        for i in code.range(self.start):
            for block in code.range(self.blocks):
                self.adjoints[i, block] = 0.0
            self.sizes[i] = 0.0

    def _step_back(self, index: Value) -> None:
        """Add the adjoint of an instruction's result, times partial derivatives, to those of its operands, and empty it."""
        code, place = self.code, self.start + index
        operation, a, b = (self.instructions[index, part] for part in range(3))

        def of_sums_and_products() -> None:
            is_product = operation.equals(operations.PRODUCT)
            one = code.number(1.0)
            by_a = select(is_product, self.values[b, 0], one)
            by_b = select(is_product, self.values[a, 0], 1.0 - 2.0 * operation.number())
            most_of_a, most_of_b = select(is_product, self._most(b), one), select(is_product, self._most(a), one)
            self._pass_on(place, [(a, by_a, most_of_a), (b, by_b, most_of_b)])

        def of_quotient() -> None:
            by_a = 1.0 / self.values[b, 0]
            most_of_a = abs(by_a) * self._most(b) * abs(by_a)
            self._pass_on(place, [(a, by_a, most_of_a), (b, -(self.values[place, 0] * by_a), self._most(place) * most_of_a)])

        def of_root() -> None:
            by_a = 0.5 / self.values[place, 0]
            self._pass_on(place, [(a, by_a, 2.0 * by_a * self._most(place) * by_a)])

        def of_sine_and_cosine() -> None:
            sine, cosine, size = self.values[place, 0], self.values[place + 1, 0], self.sizes[place + 1]
            for block in code.range(self.blocks):
                self.adjoints[place, block] = cosine * self.adjoints[place, block] - sine * self.adjoints[place + 1, block]
                self.adjoints[place + 1, block] = 0.0
            self.sizes[place] = self._most(place + 1) * self.sizes[place] + self._most(place) * size
            self.sizes[place + 1] = 0.0
            self._pass_on(place, [(a, code.number(1.0), code.number(1.0))])

        cases: dict[int, Callable[[], None]] = {
            operations.QUOTIENT: of_quotient,
            operations.ROOT: of_root,
            operations.SINE_AND_COSINE: of_sine_and_cosine,
            # Its adjoint is passed on with that of the sine before it.
            operations.COSINE: lambda: None,
        }
        code.choose(operation, cases, of_sums_and_products)

    def _most(self, place: Value) -> Value:
        """An absolute value, so much enlarged that a unit roundoff of it is more than the error of the value."""
        return abs(self.values[place, 0]) + self.values[place, 2] / UNIT_ROUNDOFF

    def _pass_on(self, place: Value, to: list[tuple[Value, Value, Value]]) -> None:
        for block in self.code.range(self.blocks):
            adjoint = self.adjoints[place, block]
            self.adjoints[place, block] = 0.0
            for operand, factor, _ in to:
                self.adjoints[operand, block] += factor * adjoint
        size = self.sizes[place]
        self.sizes[place] = 0.0
        for operand, _, most in to:
            self.sizes[operand] += most * size


def _evaluate(code: Writer) -> None:
    """Accelerations, sensitivities and what they are made of at n states."""
    program, n, nv = _Program(code), code.argument("n"), code.argument("nv")
    inputs, scales = code.array("given", program.inputs), code.array("scales", program.inputs)
    high, low, radius, scale = (code.array(name, nv) for name in ("high", "low", "radius", "scale"))
    factor, terms, places = code.array("factor", nv, nv), code.array("terms", 3, nv), code.array("of_terms", nv)
    weights, work = code.array("weights", program.blocks * LANES), code.array("work", nv + 3, nv + 3)
    sensitivity, doubt = code.array("sensitivity"), code.array("doubt")
    matrix, inverse, solution = (work.part(k) for k in range(5, 8))
    for state in code.range(n):
        program.run(inputs.part(state))
        for i in code.range(nv):
            for term in code.range(3):
                terms[state, term, i] = program.values[places[term, i], 0]
            for j in code.range(nv):
                matrix[i, j] = program.values[program.mass[i, j], 0]
        here = scale.part(state)
        factorise(code, nv, matrix, here, factor.part(state), inverse)
        solve(code, nv, program.values, program.mass, program.force, here, inverse, work, solution, radius.part(state))
        for i in code.range(nv):
            high[state, i], low[state, i] = solution[i, 0], solution[i, 1]
        norms, sizes = SumOfNorms(code, nv, inverse, here, weights), code.variable(0.0)

        def take(i: Value, derivatives: Array, size: Value) -> None:
            norms.add(derivatives, scales[state, i])
            sizes.value += size * scales[state, i]

        program.sweep(high.part(state), here, take)
        sensitivity[state], doubt[state] = norms.total.value, sizes.value * code.argument("gamma") * norms.of_inverse


def _derive(code: Writer) -> None:
    """The derivatives of a sweep at n states."""
    program, nv = _Program(code), code.argument("nv")
    inputs, accelerations, scale = code.array("given", program.inputs), code.array("accelerations", nv), code.array("scale", nv)
    found = code.array("found", program.inputs, nv + 1)
    for state in code.range(code.argument("n")):

        def take(i: Value, derivatives: Array, size: Value) -> None:
            for row in code.range(nv):
                found[state, i, row] = derivatives[row]
            found[state, i, nv] = size

        program.run(inputs.part(state))
        program.sweep(accelerations.part(state), scale.part(state), take)


def _measure(code: Writer) -> None:
    """Norms at n states at which factors of M are known; see ``harness.certify.interpreter.Norms``."""
    n, nv = code.argument("n"), code.argument("nv")
    scale, accelerations, radii, velocities = (code.array(name, nv) for name in ("scale", "accelerations", "radii", "velocities"))
    factor, norm_factor, terms, rotating = code.array("factor", nv, nv), code.array("norm_factor", nv, nv), code.array("terms", 4, nv), code.array("rotating")
    condition, radius, motion, instability = (code.array(name) for name in ("condition", "radius", "motion", "instability"))
    inverse, room = code.array("inverse", nv), code.array("room", nv)
    vector = room.part(0)
    columns = code.array("columns", (nv + (LANES - 1)) // LANES * LANES)

    def in_energy_norm(entry: Callable[[Value, Value], Value]) -> Value:
        for i in code.range(nv):
            total = code.variable(0.0)
            for j in code.range(i, nv):
                total.value += entry(i, j)
            vector[i] = total.value
        return norm(code, vector, nv)

    for state in code.range(n):
        upper, here = norm_factor.part(state), scale.part(state)
        for i in code.range(nv):
            for j in code.range(nv):
                upper[i, j] = factor[state, j, i] * here[j]
        condition[state] = condition_number(code, nv, factor.part(state), columns)
        invert(code, nv, factor.part(state), inverse)
        radius[state] = in_energy_norm(lambda i, j: abs(upper[i, j]) * radii[state, j])
        speed = in_energy_norm(lambda i, j: upper[i, j] * velocities[state, j])
        of_torques, of_terms = code.variable(0.0), code.variable(0.0)
        for k in code.range(nv):
            with code.when(rotating[k] > 0.0):
                for i in code.range(nv):
                    vector[i] = select(i < k, code.number(0.0), inverse[i, k] / here[k])
                of_torques.value += norm(code, vector, nv)
        motion[state] = speed * speed * of_torques.value
        for term in code.range(4):
            of_terms.value += in_metric(code, nv, inverse, lambda j: terms[state, term, j] / here[j], room)
        size = in_energy_norm(lambda i, j: upper[i, j] * accelerations[state, j])
        instability[state] = code.argument("roundings") * nv.number() * condition[state] * (size + of_terms.value)


LOOPS: dict[str, tuple[Callable[[Writer], None], dict[str, str]]] = {
    "evaluate": (
        _evaluate,
        {**_SIZES, **_PROGRAM, **_ROOM, "of_terms": "integers", "gamma": "number"}
        | dict.fromkeys(("given", "scales", "high", "low", "radius", "scale", "factor", "terms", "sensitivity", "doubt", "weights", "work"), "numbers"),
    ),
    "derive": (_derive, {**_SIZES, **_PROGRAM, **_ROOM} | dict.fromkeys(("given", "accelerations", "scale", "found"), "numbers")),
    "measure": (
        _measure,
        {"n": "integer", "nv": "integer", "roundings": "number"}
        | dict.fromkeys(
            ("scale", "factor", "accelerations", "radii", "velocities", "terms", "rotating", "norm_factor", "condition", "radius", "motion", "instability", "inverse", "room", "columns"),
            "numbers",
        ),
    ),
}  # fmt: skip
