"""Equations of motion in ball arithmetic at the exact float64 inputs: accelerations, factors of M, and derivatives.

``BallSolver`` has accelerations and mass matrices at any precision. Mass matrices are factorised in batches, scaled to unit diagonal, in
float64, and in balls where that would lose digits. Derivatives are for states at which those in float64 are in doubt: some milliseconds
each. One sweep backwards through the program gives the derivatives of all nv equations by all inputs.

Sources: Golub, Van Loan, Matrix Computations, 4th ed., section 4.2 (Cholesky); van der Sluis, Condition numbers
and equilibration of matrices, Numer. Math. 14 (1969), for the scaling; Griewank, Walther, Evaluating Derivatives, 2nd ed., section 3.2
(reverse mode).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.programs.evaluation import BALLS, mass_matrix, solved
from harness.programs.kernels import BallKernel
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.numbers import SMALLEST_SCALE
from harness.programs.program import OUTPUTS, StraightLineProgram, earlier_results, position_count, right_hand_side, upper_triangle
from harness.programs.states import States
from harness.storage import Kept


def scaled_cholesky(mass: Array) -> tuple[Array, Array]:
    """Scale (nv, n) and lower factor (nv, nv, n) of M = diag(scale) L L' diag(scale), L L' of unit diagonal.

    NaN where M is not positive definite in float64. Scaling first costs no digits and saves those that
    badly scaled coordinates would lose (van der Sluis).
    """
    scale = np.sqrt(np.diagonal(mass, axis1=1, axis2=2).T)
    return scale, _cholesky(mass.transpose(1, 2, 0) / scale[:, None] / scale[None])


def _cholesky(matrices: Any) -> Any:
    """Lower factors (nv, nv, n) of matrices of that shape, in float64 or of balls."""
    factor = np.zeros(matrices.shape, matrices.dtype)
    for j in range(len(factor)):
        factor[j, j] = np.sqrt(matrices[j, j] - (factor[j, :j] ** 2).sum(axis=0))
        for i in range(j + 1, len(factor)):
            factor[i, j] = (matrices[i, j] - (factor[i, :j] * factor[j, :j]).sum(axis=0)) / factor[j, j]
    return factor


def cholesky_in_balls(upper: Sequence[Any], pairs: list[tuple[int, int]], scale: Sequence[float]) -> Array:
    """The factor (nv, nv) of ``scaled_cholesky`` from M in balls at the working precision, to the last digit.

    NaN where M is not certainly positive definite at this precision.
    """
    import flint

    nothing = np.full((len(scale), len(scale)), np.nan)
    if not all(0 < value < math.inf for value in scale):
        return nothing
    scaled = np.empty((*nothing.shape, 1), dtype=object)
    for (i, j), entry in zip(pairs, upper, strict=True):
        scaled[i, j, 0] = scaled[j, i, 0] = entry / (flint.arb(scale[i]) * flint.arb(scale[j]))
    factor = _cholesky(scaled)[:, :, 0]
    # A pivot that may be zero or negative has no root, or one that nothing can be divided by.
    return factor.astype(np.float64) if all(pivot > 0 for pivot in np.diagonal(factor)) else nothing


def forward_substitute(factor: Array, columns: Array) -> Array:
    """L^-1 columns, for factor (nv, nv, n) and columns (nv, k, n)."""
    solution = np.empty_like(columns)
    for i in range(len(columns)):
        known = (factor[i, :i, None] * solution[:i]).sum(axis=0)
        solution[i] = (columns[i] - known) / factor[i, i]
    return solution


def condition_number(factors: Array) -> Array:
    """2-norm condition numbers, (n,), of L L' for factors L (nv, nv, n); infinite where there is no factor.

    Those of L, squared: its singular values keep their digits up to twice as many orders as the eigenvalues of L L'.
    """
    matrices = factors.transpose(2, 0, 1)
    usable = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    values = np.linalg.svd(np.where(usable[:, None, None], matrices, 0.0), compute_uv=False)
    smallest, largest = values[:, -1], values[:, 0]
    return np.where(usable & (smallest > 0), (largest / np.where(smallest > 0, smallest, 1.0)) ** 2, np.inf)


# Of kappa_s; beyond, rounding M costs its factor too many digits, and it is computed in balls.
MOST_IN_FLOAT64 = 1e8
# Parameter sets whose constants are kept in balls.
_MOST_BOUND = 256


class BallSolver:
    """The equations of one mechanism by one of its programs."""

    def __init__(self, mechanism: Mechanism, program: StraightLineProgram) -> None:
        self._mechanism = mechanism
        self._kernel = BallKernel(program, len(mechanism.parameters))
        self._bound: Kept[Callable[..., tuple[Any, ...]]] = Kept(_MOST_BOUND)

    def solve(self, states: States, parameters: Array, precision: int) -> tuple[Array, Array, Array, Array, Array, Array]:
        """High, low and radius, (n, nv) each, of the accelerations at ``precision`` bits; scale and factor of M, see
        ``scaled_cholesky``; and velocity, gravity and passive forces, (n, 3, nv)."""
        import flint

        nv = self._mechanism.nv
        pairs = upper_triangle(nv)
        results, terms = np.empty((len(states), 3, nv)), np.empty((len(states), 3, nv))
        exact: list[tuple[Any, ...]] = []
        with flint.ctx.workprec(precision):
            for index, (row, values) in enumerate(self.outputs(states, parameters)):
                outputs = {name: values[len(pairs) + k * nv :][:nv] for k, name in enumerate(OUTPUTS[1:])}
                terms[index] = [[float(entry) for entry in outputs[name]] for name in OUTPUTS[1:]]
                force = right_hand_side(outputs, [flint.arb(applied) for applied in row[self._mechanism.nq + nv :][:nv]])
                exact.append(values[: len(pairs)])
                solution = solved(mass_matrix(values[: len(pairs)], nv), force) if nv > 1 else [force[0] / values[0]]
                for i, ball in enumerate(solution):
                    results[index, :, i] = parts_of(ball)
            scale, factor = factorise(exact, nv)
        high, low, radius = (np.ascontiguousarray(results[:, part]) for part in range(3))
        return high, low, radius, scale, factor, terms

    def outputs(self, states: States, parameters: Array) -> Iterator[tuple[list[float], tuple[Any, ...]]]:
        """q, v, tau and time of each state, and the program's outputs there as ``arb`` at the working precision."""
        import flint

        rows = np.hstack([states.q, states.v, states.tau, states.time[:, None]]).tolist()
        for row, values_of_parameters in zip(rows, map(tuple, parameters.tolist()), strict=True):
            bind = functools.partial(self._kernel.bind, values_of_parameters)
            yield row, self._bound.get((flint.ctx.prec, values_of_parameters), bind)(*row)


def parts_of(ball: Any) -> tuple[float, float, float]:
    """(high, low, radius): high + low is the ball's midpoint to twice the digits of float64, and within ``radius`` of all of the ball."""
    high = float(ball)
    rest = ball - high
    low = float(rest)
    radius = float(abs(rest - low).upper())
    # float() rounds to nearest, and what is exact stays so.
    return high, low, math.nextafter(radius, math.inf) if radius else 0.0


def factorise(exact: Sequence[Sequence[Any]], nv: int) -> tuple[Array, Array]:
    """``scaled_cholesky`` of mass matrices given by their upper triangles in balls; in balls where float64 would lose digits."""
    pairs = upper_triangle(nv)
    mass = np.empty((len(exact), nv, nv))
    for index, upper in enumerate(exact):
        for (i, j), entry in zip(pairs, upper, strict=True):
            mass[index, i, j] = mass[index, j, i] = float(entry)
    scale, factor = scaled_cholesky(mass)
    for doubtful in np.flatnonzero(~(condition_number(factor) < MOST_IN_FLOAT64)).tolist():
        factor[:, :, doubtful] = cholesky_in_balls(exact[doubtful], pairs, scale[:, doubtful].tolist())
    return scale, factor


# Radius of a sensitivity relative to itself that is good enough: it is read to three digits.
SOUGHT_ACCURACY = 2.0**-20


def columns_in_balls(
    program: StraightLineProgram, inputs: Sequence[float], scales: Sequence[float], precisions: Sequence[int]
) -> tuple[Array, float]:
    """d(tau + passive - velocity - gravity - M qdd)/dz at fixed qdd times ``scales``, (nv, number of inputs), and
    sum over inputs of |dqdd/dz scale|_M, both at one state.

    Precision rises until the sum is certainly known to ``SOUGHT_ACCURACY``; NaN where the last precision does not give it,
    as where the equations have no derivative or M is not certainly positive definite.
    """
    import flint

    nv, count = len(program.outputs["velocity"]), len(inputs)
    for precision in precisions:
        with flint.ctx.workprec(precision):
            mass, columns = _columns(program, inputs, scales)
            total = _sum_of_norms(mass, columns)
            # Where no input is felt at all, as at rest under dry friction, no precision shows a digit of zero.
            if total < SMALLEST_SCALE or (total > 0 and float(total.rad()) <= SOUGHT_ACCURACY * float(total)):
                found = np.array([[0.0 if entry is None else float(entry) for entry in column] for column in columns]).T
                return np.ascontiguousarray(found), float(total)
    return np.full((nv, count), np.nan), math.nan


def _columns(program: StraightLineProgram, inputs: Sequence[float], scales: Sequence[float]) -> tuple[Any, list[list[Any]]]:
    """M as ``arb_mat``, and for each input the derivatives of the nv equations by it times its scale, None for those that are zero."""
    import flint

    values = BALLS.values(program, [flint.arb(value) for value in inputs])
    outputs = {name: [values[place] for place in places] for name, places in program.outputs.items()}
    nv, first = len(outputs["velocity"]), position_count(program)
    applied = range(first + nv, first + 2 * nv)
    mass = mass_matrix(outputs["mass"], nv)
    solution = solved(mass, right_hand_side(outputs, [flint.arb(inputs[place]) for place in applied]))
    adjoints: list[list[Any] | None] = [None] * len(values)

    def seed(place: int, row: int, value: Any) -> None:
        adjoint = adjoints[place] = adjoints[place] or [None] * nv
        adjoint[row] = value if adjoint[row] is None else adjoint[row] + value

    for place, (i, j) in zip(program.outputs["mass"], upper_triangle(nv), strict=True):
        seed(place, i, -solution[j])
        if i != j:
            seed(place, j, -solution[i])
    for name, sign in zip(OUTPUTS[1:], (-1, -1, 1), strict=True):
        for row, place in enumerate(program.outputs[name]):
            seed(place, row, flint.arb(sign))
    columns: list[list[Any]] = [[None] * nv for _ in inputs]
    for place, adjoint in _swept(program, values, adjoints):
        columns[place] = [None if entry is None else entry * flint.arb(scales[place]) for entry in adjoint]
    for row, place in enumerate(applied):
        # Beside what the program makes of an applied force, as forces of constraints do, its own equation feels it.
        own = columns[place][row]
        columns[place][row] = flint.arb(scales[place]) if own is None else own + flint.arb(scales[place])
    return mass, columns


def _swept(program: StraightLineProgram, values: Sequence[Any], adjoints: list[list[Any] | None]) -> list[tuple[int, list[Any]]]:
    """Inputs with their adjoints, those of the results given in ``adjoints``, which are used up."""
    varies = _VARYING.get(program.key, lambda: _varying(program))
    found = []
    for place in reversed(range(len(values))):
        adjoint, instruction = adjoints[place], program.instructions[place]
        adjoints[place] = None
        if adjoint is None or not varies[place]:
            continue
        if instruction[0] == "input":
            found.append((instruction[1], adjoint))
            continue
        for operand, partial in BALLS.partial_derivatives(program, place, values):
            # The logarithm of a negative base is no number, and nobody asks for it where the exponent is a constant.
            if varies[operand]:
                parts = _times(adjoint, partial)
                adjoints[operand] = parts if (known := adjoints[operand]) is None else list(map(_sum, known, parts))
    return found


def _varying(program: StraightLineProgram) -> list[bool]:
    """For each instruction, whether it varies with any input."""
    varies = list[bool]()
    for instruction in program.instructions:
        varies.append(instruction[0] == "input" or any(varies[place] for place in earlier_results(instruction)))
    return varies


_VARYING: Kept[list[bool]] = Kept(16)


def _times(adjoint: list[Any], partial: Any) -> list[Any]:
    # Sums and differences, a third of all instructions, multiply nothing: theirs alone are floats, 1 and -1.
    if isinstance(partial, float):
        return adjoint if partial > 0 else [None if entry is None else -entry for entry in adjoint]
    return [None if entry is None else entry * partial for entry in adjoint]


def _sum(a: Any, b: Any) -> Any:
    return b if a is None else a if b is None else a + b


def _sum_of_norms(mass: Any, columns: Sequence[Sequence[Any]]) -> Any:
    """sum of |M^-1 column|_M = sqrt(column' M^-1 column), as ``arb``."""
    import flint

    nv, zero = mass.nrows(), flint.arb(0)
    felt = [column for column in columns if any(entry is not None for entry in column)]
    matrix = flint.arb_mat([[zero if column[i] is None else column[i] for column in felt] for i in range(nv)])
    try:
        solution = mass.solve(matrix)
    except ZeroDivisionError:
        return flint.arb.nan()
    total = zero
    for k in range(len(felt)):
        square = sum((matrix[i, k] * solution[i, k] for i in range(nv)), zero)
        total += square.sqrt() if square > 0 else _root_of_nothing(square)
    return total


def _root_of_nothing(square: Any) -> Any:
    """The root of a ball that is certain of no sign: from 0 to that of its upper end; NaN for a negative one."""
    import flint

    upper = square.upper()
    return flint.arb(0).union(upper.sqrt()) if upper >= 0 else flint.arb.nan()
