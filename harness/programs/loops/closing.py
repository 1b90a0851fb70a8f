"""The closing of constraints, as loops are written: the way along a branch in float64, and the proof in double-double.

A state stands in each lane. The program has the rows' residual and Jacobian for its outputs. Which way is gone, and what is
proved, say ``manifold`` and ``enclosure`` of ``harness.truth``.
"""

from __future__ import annotations

import math

from harness.programs.loops.double_double import add, multiply, negative, number_at, store, store_total
from harness.programs.loops.instructions import RUN, Program, write_approximate_run, write_run
from harness.programs.loops.language import Function, Writer
from harness.programs.loops.solution import LinearEquations, Workspace, defect, refine, size_of
from harness.programs.loops.values import Array, Value, as_number, equals, larger, select
from harness.programs.numbers import UNIT_ROUNDOFF

_SIZES = {"n": "integer", "m": "integer", "inputs": "integer", "constants": "integer", "unheld": "integer"}
_PROGRAM = {"instructions": "halves", "of_constants": "numbers", "values": "vectors"}
_HELD = {"held": "integer", **dict.fromkeys(("positions", "residual", "by_positions"), "integers")}
_FOLLOW = {
    **_SIZES, **_PROGRAM, **_HELD, "steps": "integer", "corrections": "integer", "much": "number", "least_much": "number",
    "others": "integers", "by_others": "integers", "begun": "numbers",
    **dict.fromkeys(("given", "target", "work", "found", "change"), "vectors"),
}  # fmt: skip
_ENCLOSE = {
    **_SIZES, **_PROGRAM, **_HELD, "redundant": "integer", "tied": "integer",
    **dict.fromkeys(("residual_of_redundant", "by_rates", "by_others", "of_moved"), "integers"),
    **dict.fromkeys(("given", "velocities", "ones", "matrix", "work", "rates", "found", "radius", "is_proved"), "vectors"),
}  # fmt: skip
# A configuration is sought within so many times the step that Newton's method would take, and so much more of it or of 1.
_REACH, _LEAST_REACH = 4.0, 2.0**-90
# Over the roundings of a sum of a few products.
_UPWARDS = 1 + 1e-10


class _ClosingRows(Program):
    """The program of the rows."""

    def __init__(self, code: Writer, width: int) -> None:
        super().__init__(code, width)
        self.held, self.free = code.argument("held"), code.argument("unheld")
        self.positions, self.residual = code.array("positions"), code.array("residual")
        self.by_positions = code.array("by_positions", self.held)


def eliminate(code: Writer, m: Value, width: Value, matrix: Array) -> None:
    """Make the first m columns of a matrix, (m, width), the unit matrix, by rows; what is not finite comes of one that is singular.

    Source: Golub, Van Loan, Matrix Computations, 4th ed., section 3.4 (partial pivoting, by the exchange of rows lane by lane).
    """
    for k in code.range(m):
        for i in code.range(k + 1, m):
            is_larger = abs(matrix[i, k]) > abs(matrix[k, k])
            with code.when(is_larger.any()):
                for j in code.range(k, width):
                    upper, lower = matrix[k, j], matrix[i, j]
                    matrix[k, j], matrix[i, j] = select(is_larger, lower, upper), select(is_larger, upper, lower)
        pivot = 1.0 / matrix[k, k]
        for j in code.range(k, width):
            matrix[k, j] = matrix[k, j] * pivot
        for i in code.range(m):
            factor = select(equals(i, k), code.lanes(0.0), matrix[i, k])
            for j in code.range(k, width):
                matrix[i, j] -= factor * matrix[k, j]


def _follow(code: Writer) -> None:
    """The way in ``steps`` from ``begun``, (nv,), where the rows hold, to where the other coordinates are ``target``, (n, free).

    ``found``, (n, held), are the positions there, NaN where a step was corrected by more than ``much`` of its tangent and
    ``least_much``, and ``change``, (n,), the last of ``corrections`` steps of Newton's method there. ``work`` is (held, held + 2).
    """
    rows, held, steps = _ClosingRows(code, 1), code.argument("held"), code.argument("steps")
    others, by_others, begun = code.array("others"), code.array("by_others", rows.free), code.array("begun")
    given, target, found = code.array("given", rows.inputs), code.array("target", rows.free), code.array("found", held)
    values, matrix, change = rows.values, code.array("work", held + 2), code.array("change")
    zero = code.lanes(0.0)
    # Of whole steps, that of the assembly itself.
    share = 1.0 / select(equals(steps, 0), code.number(1.0), as_number(steps))

    def correct(here: Array) -> tuple[Value, Value]:
        """The largest change of a position, and of it along the tangent over one step, which stand behind the matrix."""
        rows.run()
        for i in code.range(held):
            for j in code.range(held):
                matrix[i, j] = values[rows.by_positions[i, j], 0]
            moved = (values[by_others[i, j], 0] * ((here[j] - begun[others[j]]) * share) for j in code.range(rows.free))
            matrix[i, held], matrix[i, held + 1] = values[rows.residual[i], 0], code.total(moved, first=zero)
        eliminate(code, held, held + 2, matrix)
        for i in code.range(held):
            values[rows.positions[i], 0] -= matrix[i, held]
        largest, along = (code.largest((abs(matrix[i, held + k]) for i in code.range(held)), first=zero) for k in range(2))
        return largest, along

    for block in rows.blocks():
        rows.place(given.part(block))
        here = target.part(block)
        for i in code.range(held):
            values[rows.positions[i], 0] = begun[rows.positions[i]]
            matrix[i, held + 1] = 0.0
        tangent, is_lost = code.variable(zero), code.variable(zero)
        for number in code.range(steps + 1):
            way = as_number(number) * share
            for j in code.range(rows.free):
                start = begun[others[j]]
                values[others[j], 0] = select(equals(number, steps), here[j], start + way * (here[j] - start))
            for i in code.range(held):
                values[rows.positions[i], 0] -= matrix[i, held + 1]
            size, along = correct(here)
            # The assembly is known to a few digits: what its first step corrects says nothing.
            much = select(
                equals(number, 0), code.lanes(math.inf), larger(tangent.value * code.argument("much"), code.argument("least_much"))
            )
            is_lost.value += select(size <= much, zero, math.nan)
            tangent.value = along
        change[block] = zero
        for _ in code.range(code.argument("corrections")):
            size, _along = correct(here)
            change[block] = size
        for i in code.range(held):
            found[block, i] = values[rows.positions[i], 0] + is_lost.value


def _enclose(code: Writer) -> None:
    """The positions and rates near ``given``, (n, inputs), with bounds, (n, held + tied, 3), in ``found``; 1 in ``is_proved``, (n,).

    ``velocities``, (n, free), are the rates that no row determines; the positions are those before the rates in ``found``.
    """
    rows, held, tied = _ClosingRows(code, 3), code.argument("held"), code.argument("tied")
    by_rates, by_others = code.array("by_rates", tied), code.array("by_others", rows.free)
    redundant, of_moved = code.array("residual_of_redundant"), code.array("of_moved")
    given, velocities = code.array("given", rows.inputs), code.array("velocities", rows.free)
    found, rates, radius = code.array("found", held + tied, 3), code.array("rates", 2), code.array("radius")
    matrix, work, ones = code.array("matrix"), Workspace(code.array("work", tied + 3, tied + 3)), code.array("ones")
    is_proved, values = code.array("is_proved"), rows.values
    for block in rows.blocks():
        rows.place(given.part(block))
        here = found.part(block)
        is_proved[block] = _enclosed_positions(rows, given.part(block), code, work, here)
        for i in code.range(held):
            store(values, rows.positions[i], number_at(here, i))
        rows.run()
        for i in code.range(code.argument("redundant")):
            high, low, bound = number_at(values, redundant[i])
            is_proved[block] = select(abs(high) + abs(low) <= bound, is_proved[block], 0.0)
        work.approximate = _inverted(code, tied, matrix, values, by_rates)
        for i in code.range(tied):
            entries = ((j, number_at(values, by_others[i, j])) for j in code.range(rows.free))
            moved = (multiply(negative(entry), (velocities[block, j], 0.0, 0.0)) for j, entry in entries)
            store_total(values, of_moved[i], (0.0, 0.0, 0.0), moved)
        refine(LinearEquations(code, tied, values, by_rates, of_moved, ones), work, rates, radius)
        for i in code.range(tied):
            store(here, held + i, (rates[i, 0], rates[i, 1], radius[i]))


def _inverted(code: Writer, m: Value, room: Array, values: Array, places: Array) -> Array:
    """The approximate inverse, (m, m), of the matrix of the entries at ``places``, with ``room``, (m, 2 m)."""
    matrix = Array(code, room.pointer, (2 * m,))
    for i in code.range(m):
        for j in code.range(m):
            matrix[i, j] = values[places[i, j], 0]
            matrix[i, m + j] = select(equals(i, j), 1.0, 0.0)
    eliminate(code, m, 2 * m, matrix)
    return Array(code, matrix.part(0, m).pointer, (2 * m,))


def _enclosed_positions(rows: _ClosingRows, inputs: Array, code: Writer, work: Workspace, found: Array) -> Value:
    """The image of a ball around the positions under the Krawczyk operator, in ``found``; 1 in the lanes where it lies within the ball.

    With Y an approximate inverse of the Jacobian at x it is x - Y f(x) + (1 - Y F(X)) (X - x), F(X) being the Jacobian over the ball X.
    """
    held, values, zero, entries, sizes = rows.held, rows.values, code.lanes(0.0), work.entries, work.sizes
    rows.run()
    inverse = _inverted(code, held, code.array("matrix"), values, rows.by_positions)
    for i in code.range(held):
        steps = (multiply(number_at(values, rows.residual[j]), (inverse[i, j], 0.0, 0.0)) for j in code.range(held))
        store_total(found, i, (0.0, 0.0, 0.0), steps)
    largest = code.largest((size_of(number_at(found, i)) for i in code.range(held)), first=zero)
    size = code.largest((abs(inputs[rows.positions[i]]) for i in code.range(held)), first=code.lanes(1.0))
    reach = _REACH * largest + _LEAST_REACH * size
    for i in code.range(held):
        values[rows.positions[i], 2] = reach
    rows.run()
    for i in code.range(held):
        for j in code.range(held):
            high, _, bound = number_at(values, rows.by_positions[i, j])
            # The entries' low parts and bounds count as roundings.
            entries[i, j], sizes[i, j] = high, abs(high) + bound / UNIT_ROUNDOFF
    is_proved = code.variable(code.lanes(1.0))
    for i in code.range(held):
        radius = defect(code, held, i, inverse, entries, sizes) * reach * _UPWARDS
        is_inside = (size_of(number_at(found, i)) + radius) * _UPWARDS < reach
        is_proved.value = select(is_inside, is_proved.value, 0.0)
        high, low, bound = add((inputs[rows.positions[i]], zero, zero), negative(number_at(found, i)))
        store(found, i, (high, low, (bound + radius) * _UPWARDS))
    return is_proved.value


# As of ``harness.programs.loops.loops``.
PARTS: dict[str, Function] = {"run_of_3": (write_run, RUN), "run_of_1": (write_approximate_run, RUN)}
LOOPS: dict[str, Function] = {"follow": (_follow, _FOLLOW), "enclose": (_enclose, _ENCLOSE)}
