"""The loops of ``harness.certify.interpreter``, as they are written for LLVM; nothing is allocated in them.

A program's results are numbers of ``harness.certify.double_double``, (places, 3): first the inputs, then the constants, then what
the instructions give. Values are computed at four states at once, each in its lane; adjoints at one state, of four equations at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from harness.certify import encoding as operations
from harness.certify.double_double import add, divide, multiply, number_at, root, sine_and_cosine, store
from harness.certify.language import LANES, Array, Value, Writer, select
from harness.certify.numbers import UNIT_ROUNDOFF
from harness.certify.solution import condition_number, factorise, SumOfNorms, in_metric, invert, norm, solve

_SIZES = {"n": "integer", "m": "integer", "nv": "integer", "inputs": "integer", "constants": "integer"}
_PROGRAM = {"instructions": "halves", "of_constants": "numbers", "mass": "integers", "force": "integers"}
_ROOM = {"values": "vectors", "adjoints": "vectors", "sizes": "numbers"}


class _Program:
    """A program in the function that is being written, with room for its results at four states and their adjoints at one of them."""

    def __init__(self, code: Writer) -> None:
        self.code = code
        self.m, self.nv, self.inputs = code.argument("m"), code.argument("nv"), code.argument("inputs")
        # Of the first instruction's result.
        self.start = self.inputs + code.argument("constants")
        self.instructions = code.array("instructions", 3)
        self.mass, self.force = code.array("mass", self.nv), code.array("force")
        self.values = code.array("values", 3)
        self.blocks = (self.nv + (LANES - 1)) // LANES
        self.adjoints, self.sizes = code.array("adjoints", self.blocks), code.array("sizes")
        constants = code.array("of_constants", 3)
        for k in code.range(code.argument("constants")):
            store(self.values, self.inputs + k, number_at(constants, k))

    def states(self) -> Iterator[tuple[Value, Value]]:
        """Every four states: their number, and how many there are."""
        for block in self.code.range((self.code.argument("n") + (LANES - 1)) // LANES):
            left = self.code.argument("n") - block * LANES
            yield block, select(left < LANES, left, LANES)

    def run(self, inputs: Array) -> None:
        """Every instruction's result at four states, into ``values``."""
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

    def sweep(self, lane: Value, accelerations: Array, scale: Array, take: Callable[[Value, Array, Value], None]) -> None:
        """Give ``take`` each input, the derivatives of f - M a by it, and a sum of absolute values over ``scale`` for their roundings.

        It is done for the state in one lane. ``adjoints``, (places, nv rounded up to whole vectors), and ``sizes``, (places,), are zero
        before and after.
        """
        code, adjoints = self.code, self.adjoints.in_numbers(self.blocks * LANES)
        for i in code.range(self.nv):
            adjoints[self.force[i], i] += 1.0
            self.sizes[self.force[i]] += 1.0 / scale[i, lane]
            for j in code.range(self.nv):
                adjoints[self.mass[i, j], i] -= accelerations[j, lane]
                self.sizes[self.mass[i, j]] += abs(accelerations[j, lane]) / scale[i, lane]
        values = self.values.in_numbers(3, LANES)
        for reverse in code.range(self.m):
            self._step_back(self.m - 1 - reverse, lambda place, part: values[place, part, lane])
        for i in code.range(self.inputs):
            take(i, adjoints.part(i), self.sizes[i])
        for i in code.range(self.start):
            for block in code.range(self.blocks):
                self.adjoints[i, block] = 0.0
            self.sizes[i] = 0.0

    def _step_back(self, index: Value, value: Callable[[Value, int], Value]) -> None:
        """Add the adjoint of an instruction's result, times partial derivatives, to those of its operands, and empty it."""
        code, place = self.code, self.start + index
        operation, a, b = (self.instructions[index, part] for part in range(3))

        def most(place: Value) -> Value:
            """An absolute value, so much enlarged that a unit roundoff of it is more than the error of the value."""
            return abs(value(place, 0)) + value(place, 2) / UNIT_ROUNDOFF

        def of_sums_and_products() -> None:
            is_product = operation.equals(operations.PRODUCT)
            by_a = select(is_product, value(b, 0), 1.0)
            by_b = select(is_product, value(a, 0), 1.0 - 2.0 * operation.number())
            self._pass_on(place, [(a, by_a, select(is_product, most(b), 1.0)), (b, by_b, select(is_product, most(a), 1.0))])

        def of_quotient() -> None:
            by_a = 1.0 / value(b, 0)
            most_of_a = abs(by_a) * most(b) * abs(by_a)
            self._pass_on(place, [(a, by_a, most_of_a), (b, -(value(place, 0) * by_a), most(place) * most_of_a)])

        def of_root() -> None:
            by_a = 0.5 / value(place, 0)
            self._pass_on(place, [(a, by_a, 2.0 * by_a * most(place) * by_a)])

        def of_sine_and_cosine() -> None:
            sine, cosine, size = value(place, 0), value(place + 1, 0), self.sizes[place + 1]
            for block in code.range(self.blocks):
                self.adjoints[place, block] = cosine * self.adjoints[place, block] - sine * self.adjoints[place + 1, block]
                self.adjoints[place + 1, block] = 0.0
            self.sizes[place] = most(place + 1) * self.sizes[place] + most(place) * size
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
    program, nv = _Program(code), code.argument("nv")
    inputs, scales = code.array("given", program.inputs), code.array("scales", program.inputs, LANES)
    solution, radius, scale = code.array("solution", nv, 2), code.array("radius", nv), code.array("scale", nv)
    factor, terms, places = code.array("factor", nv, nv), code.array("terms", 3, nv), code.array("of_terms", nv)
    weights, work = code.array("weights", program.blocks * LANES), code.array("work", nv + 3, nv + 3)
    sensitivity, doubt = code.array("sensitivity", LANES), code.array("doubt", LANES)
    matrix, inverse = work.part(5), work.part(6)
    for block, count in program.states():
        program.run(inputs.part(block))
        for i in code.range(nv):
            for term in code.range(3):
                terms[block, term, i] = program.values[places[term, i], 0]
            for j in code.range(nv):
                matrix[i, j] = program.values[program.mass[i, j], 0]
        here, found = scale.part(block), solution.part(block)
        factorise(code, nv, matrix, here, factor.part(block), inverse)
        solve(code, nv, program.values, program.mass, program.force, here, inverse, work, found, radius.part(block))
        for lane in code.range(count):
            own = here.in_numbers(LANES)
            norms, sizes = SumOfNorms(code, nv, inverse.in_numbers(nv + 3, LANES), own, lane, weights), code.variable(0.0)

            def take(i: Value, derivatives: Array, size: Value) -> None:
                norms.add(derivatives, scales[block, i, lane])
                sizes.value += size * scales[block, i, lane]

            # High and low stand side by side.
            program.sweep(lane, found.in_numbers(2 * LANES), own, take)
            sensitivity[block, lane] = norms.total.value
            doubt[block, lane] = sizes.value * code.argument("gamma") * norms.of_inverse


def _derive(code: Writer) -> None:
    """The derivatives of a sweep at n states."""
    program, nv = _Program(code), code.argument("nv")
    inputs, accelerations, scale = code.array("given", program.inputs), code.array("accelerations", nv), code.array("scale", nv)
    found = code.array("found", program.inputs, nv + 1)
    for block, count in program.states():
        program.run(inputs.part(block))
        for lane in code.range(count):

            def take(i: Value, derivatives: Array, size: Value) -> None:
                for row in code.range(nv):
                    found[block * LANES + lane, i, row] = derivatives[row]
                found[block * LANES + lane, i, nv] = size

            program.sweep(lane, accelerations.part(block).in_numbers(LANES), scale.part(block).in_numbers(LANES), take)


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
        invert(code, nv, factor.part(state), inverse, code.number(0.0))
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


_VECTORS = dict.fromkeys(("given", "solution", "radius", "scale", "factor", "terms", "work"), "vectors")
_MEASURED = (
    "scale", "factor", "accelerations", "radii", "velocities", "terms", "rotating", "norm_factor", "condition", "radius", "motion",
    "instability", "inverse", "room", "columns",
)  # fmt: skip
# What writes each loop, and the kinds of its arguments.
LOOPS: dict[str, tuple[Callable[[Writer], None], dict[str, str]]] = {
    "evaluate": (
        _evaluate,
        {**_SIZES, **_PROGRAM, **_ROOM, "of_terms": "integers", "gamma": "number", **_VECTORS}
        | dict.fromkeys(("scales", "sensitivity", "doubt", "weights"), "numbers"),
    ),
    "derive": (
        _derive,
        {**_SIZES, **_PROGRAM, **_ROOM, **dict.fromkeys(("given", "accelerations", "scale"), "vectors"), "found": "numbers"},
    ),
    "measure": (_measure, {"n": "integer", "nv": "integer", "roundings": "number", **dict.fromkeys(_MEASURED, "numbers")}),
}
