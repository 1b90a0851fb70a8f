"""The loops of ``harness.programs.loops.interpreter``, as they are written for LLVM; nothing is allocated in them.

A program's results are numbers of ``harness.programs.loops.double_double``, (places, 3): first the inputs, then the constants, then what
the instructions give. Values are computed at four states at once, each in its lane; adjoints at one state, of four equations at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from harness.programs.loops.double_double import number_at, store
from harness.programs.loops.instructions import RUN, SWEEP, Program, write_run, write_sweep
from harness.programs.loops.language import Function, Writer
from harness.programs.loops.solution import (
    LinearEquations,
    SumOfNorms,
    Workspace,
    condition_numbers,
    factorise,
    in_metric,
    invert,
    norm,
    rows_of_factor,
    rows_of_inverse,
    solve,
)
from harness.programs.loops.values import Array, Value, as_number, equals, lane_numbers, select
from harness.programs.numbers import LANES

_SIZES = {"n": "integer", "m": "integer", "nv": "integer", "inputs": "integer", "constants": "integer"}
_OUTPUTS = {
    **dict.fromkeys(("n", "m", "inputs", "constants", "outputs"), "integer"), "instructions": "halves", "of_constants": "numbers",
    "values": "vectors", "places": "integers", **dict.fromkeys(("found", "given", "bounds"), "vectors"),
}  # fmt: skip
_PROGRAM = {"instructions": "halves", "of_constants": "numbers", "system": "integers", "force": "integers", "rows": "integers"}
_ROOM = {"values": "vectors", "adjoints": "vectors", "sizes": "numbers"}


class _Equations(Program):
    """The equations of a mechanism, with room for the adjoints of their results at one of the four states."""

    def __init__(self, code: Writer) -> None:
        super().__init__(code)
        self.nv, self.rows = code.argument("nv"), code.array("rows")
        self.system, self.force = code.array("system", self.nv), code.array("force")
        self.width_of_rows = (self.nv + (LANES - 1)) // LANES
        self.adjoints, self.sizes = code.array("adjoints", self.width_of_rows), code.array("sizes")

    def states(self, inputs: Array) -> Iterator[tuple[Value, Value]]:
        """Every four states, with their results: their number, and how many there are."""
        for block in self.blocks():
            left = self.code.argument("n") - block * LANES
            self.place(inputs.part(block))
            self.run()
            yield block, select(left < LANES, left, LANES)

    def sweep(self, lane: Value, accelerations: Array, scale: Array) -> Iterator[tuple[Value, Array, Value]]:
        """Each input, the derivatives of f - A a by it, and a sum of absolute values over ``scale`` for their roundings.

        It is done for the state in one lane. ``adjoints``, (rows, nv rounded up to whole vectors), and ``sizes``, (rows,), are zero
        before and after.
        """
        code, adjoints = self.code, self.adjoints.in_numbers(self.width_of_rows * LANES)
        for i in code.range(self.nv):
            row = self.rows[self.force[i]]
            adjoints[row, i] += 1.0
            self.sizes[row] += 1.0 / scale[i, lane]
            for j in code.range(self.nv):
                row = self.rows[self.system[i, j]]
                adjoints[row, i] -= accelerations[j, lane]
                self.sizes[row] += abs(accelerations[j, lane]) / scale[i, lane]
        instructions = code.array("instructions")
        code.perform(
            "sweep", code.argument("m"), self.start, instructions, self.values, self.width_of_rows, lane, self.adjoints, self.sizes
        )
        for i in code.range(self.inputs):
            yield i, adjoints.part(i), self.sizes[i]
        for i in code.range(self.start):
            for block in code.range(self.width_of_rows):
                self.adjoints[i, block] = 0.0
            self.sizes[i] = 0.0


def _evaluate(code: Writer) -> None:
    """Accelerations, sensitivities and what they are made of at n states."""
    program, nv = _Equations(code), code.argument("nv")
    inputs, scales = code.array("given", program.inputs), code.array("scales", program.inputs, LANES)
    solution, radius, scale = code.array("solution", nv, 2), code.array("radius", nv), code.array("scale", nv)
    factor, terms, places = code.array("factor", nv, nv), code.array("terms", 3, nv), code.array("of_terms", nv)
    weights, work = code.array("weights", program.width_of_rows * LANES), Workspace(code.array("work", nv + 3, nv + 3))
    sensitivity, doubt, spread = code.array("sensitivity", LANES), code.array("doubt", LANES), code.array("spread")
    mass, is_metric = code.array("mass", nv), equals(code.argument("has_system"), 0)
    for block, count in program.states(inputs):
        for i in code.range(nv):
            for term in code.range(3):
                terms[block, term, i] = program.values[places[term, i], 0]
            for j in code.range(nv):
                work.matrix[i, j] = program.values[mass[i, j], 0]
        metric, found = (scale.part(block), factor.part(block)), solution.part(block)
        factorise(code, nv, work.matrix, *metric)
        with code.when(is_metric):
            work.take(code, nv, *metric)
        with code.when(~is_metric):
            for i in code.range(nv):
                for j in code.range(nv):
                    work.matrix[i, j] = program.values[program.system[i, j], 0]
            factorise(code, nv, work.matrix, work.scale, work.factor)
        equations = LinearEquations(code, nv, program.values, program.system, program.force, work.scale)
        solve(equations, work, found, radius.part(block))
        spread[block] = 0.0
        with code.when(is_metric):
            rows_of_factor(code, nv, work)
        with code.when(~is_metric):
            spread[block] = rows_of_inverse(code, nv, *metric, work)
            for i in code.range(nv):
                entries = ((j, program.values[program.system[i, j], 0] - program.values[mass[i, j], 0]) for j in code.range(nv))
                terms[block, 2, i] += code.total((-(entry * found[j, 0]) for j, entry in entries), first=code.lanes(0.0))
        for lane in code.range(count):
            own_scale, accelerations = work.scale.in_numbers(LANES), found.in_numbers(2 * LANES)
            norms = SumOfNorms(code, nv, work.rows_of_norm.in_numbers(nv + 3, LANES), own_scale, lane, weights)
            sizes = code.variable(0.0)
            for i, derivatives, size in program.sweep(lane, accelerations, own_scale):
                norms.add(derivatives, scales[block, i, lane])
                sizes.value += size * scales[block, i, lane]
            sensitivity[block, lane] = norms.total.value
            doubt[block, lane] = sizes.value * code.argument("gamma") * norms.of_inverse


def _outputs(code: Writer) -> None:
    """Outputs of a program at n states, numbers (n, outputs, 3) in ``found``, where its inputs are within ``bounds`` of ``given``."""
    program, count, places = Program(code), code.argument("outputs"), code.array("places")
    given, bounds, found = code.array("given", program.inputs), code.array("bounds", program.inputs), code.array("found", count, 3)
    for block in program.blocks():
        program.place(given.part(block))
        for i in code.range(program.inputs):
            program.values[i, 2] = bounds[block, i]
        program.run()
        for i in code.range(count):
            store(found.part(block), i, number_at(program.values, places[i]))


def _derive(code: Writer) -> None:
    """The derivatives of a sweep at n states."""
    program, nv = _Equations(code), code.argument("nv")
    inputs, accelerations, scale = code.array("given", program.inputs), code.array("accelerations", nv), code.array("scale", nv)
    found = code.array("found", LANES, program.inputs, nv + 1)
    for block, count in program.states(inputs):
        for lane in code.range(count):
            here = accelerations.part(block).in_numbers(LANES), scale.part(block).in_numbers(LANES)
            for i, derivatives, size in program.sweep(lane, *here):
                for row in code.range(nv):
                    found[block, lane, i, row] = derivatives[row]
                found[block, lane, i, nv] = size


def _measure(code: Writer) -> None:
    """Norms at n states at which factors of M are known; see ``harness.programs.loops.interpreter.Norms``."""
    n, nv = code.argument("n"), code.argument("nv")
    columns = code.array("columns", (nv + (LANES - 1)) // LANES * LANES)
    condition = code.array("condition").in_vectors()
    for block in code.range((n + (LANES - 1)) // LANES):
        four = block * LANES + lane_numbers(code)
        condition[block] = condition_numbers(code, nv, code.array("factor", nv, nv), select(four < n, four, n - 1), columns)
    for state in code.range(n):
        _measure_one(code, state)


def _measure_one(code: Writer, state: Value) -> None:
    nv = code.argument("nv")
    factor, upper = (code.array(name, nv, nv).part(state) for name in ("factor", "norm_factor"))
    scale, inverse, room = code.array("scale", nv).part(state), code.array("inverse", nv), code.array("room", nv)
    terms, vector = code.array("terms", 4, nv).part(state), room.part(0)

    def in_energy_norm(name: str, magnitude: Callable[[Value], Value] = lambda value: value) -> Value:
        entries = code.array(name, nv).part(state)
        for i in code.range(nv):
            vector[i] = code.total(magnitude(upper[i, j]) * entries[j] for j in code.range(i, nv))
        return norm(code, vector, nv)

    def of_torque(k: Value) -> Value:
        for i in code.range(nv):
            vector[i] = select(i < k, 0.0, inverse[i, k] / scale[k])
        return norm(code, vector, nv)

    def of_term(term: Value) -> Value:
        return in_metric(code, nv, inverse, lambda j: terms[term, j] / scale[j], room)

    for i in code.range(nv):
        for j in code.range(nv):
            upper[i, j] = factor[j, i] * scale[j]
    invert(code, nv, factor, inverse, code.number(0.0))
    speed, of_torques = in_energy_norm("velocities"), code.variable(0.0)
    for k in code.range(nv):
        with code.when(code.array("rotating")[k] > 0.0):
            of_torques.value += of_torque(k)
    of_terms = code.total(of_term(term) for term in code.range(4))
    lost = code.argument("roundings") * as_number(nv) * code.array("condition")[state]
    results = {
        "radius": in_energy_norm("radii", abs),
        "motion": speed * speed * of_torques.value,
        "instability": lost * (in_energy_norm("accelerations") + of_terms),
    }
    for name, result in results.items():
        code.array(name)[state] = result


_VECTORS = dict.fromkeys(("given", "solution", "radius", "scale", "factor", "terms", "work", "spread"), "vectors")
_MEASURED = (
    "scale", "factor", "accelerations", "radii", "velocities", "terms", "rotating", "norm_factor", "condition", "radius", "motion",
    "instability", "inverse", "room",
)  # fmt: skip
# What the loops call, and the loops.
PARTS: dict[str, Function] = {"run_of_3": (write_run, RUN), "sweep": (write_sweep, SWEEP)}
LOOPS: dict[str, Function] = {
    "evaluate": (
        _evaluate,
        {**_SIZES, **_PROGRAM, **_ROOM, "mass": "integers", "has_system": "integer", "of_terms": "integers", "gamma": "number", **_VECTORS}
        | dict.fromkeys(("scales", "sensitivity", "doubt", "weights"), "numbers"),
    ),
    "outputs": (_outputs, _OUTPUTS),
    "derive": (
        _derive,
        {**_SIZES, **_PROGRAM, **_ROOM, **dict.fromkeys(("given", "accelerations", "scale"), "vectors"), "found": "numbers"},
    ),
    "measure": (
        _measure,
        {"n": "integer", "nv": "integer", "roundings": "number", **dict.fromkeys(_MEASURED, "numbers"), "columns": "vectors"},
    ),
}
