"""The equations of motion of a tree under constraints: with the forces that hold them, or with those of a law that lets them give.

With J the Jacobian of the rows by the rates and b = J' v their bias, accelerations obey J a = -b. The tree's equations get the forces
-J' lambda besides:

    M a = f - J' lambda,    J a = -b,    f = tau + p - c - g.

They are had in two ways that share no step. ``by_multipliers`` solves (J M^-1 J') lambda = J M^-1 f + b. ``by_reduction`` writes
a = B w + n in the accelerations w of the coordinates that no constraint determines, B = (1, -J_d^-1 J_w), n = (0, -J_d^-1 b), solves
B' M B w = B' (f - M n), and has the forces from M a - f.

Only rows that are not redundant take part. Eliminations are written out without pivots: M and J M^-1 J' are positive definite, and
J_d is made orthogonal column by column, which fails only where it is singular.

``softened_program`` is for engines whose constraints are soft. With a weight D_i = d_i / ((1 - d_i) A_i) for each row, A_i its inverse
mass, and the acceleration r_i = -b_i (J v)_i - k_i d_i phi_i that would bring it back, they minimise Gauss' function and a penalty,

    |M^-1 f - a|^2_M + sum D_i ((J a + b)_i - r_i)^2,    (M + J' D J) a = f + J' D (r - b),

so that the forces are J' D (r - b - J a).

Sources: Featherstone, Rigid Body Dynamics Algorithms, sections 3.2 and 8.4; Greenwood, Advanced Dynamics, section 4.3 (Maggi);
Bjorck, Solving linear least squares problems by Gram-Schmidt orthogonalization, BIT 7 (1967); MuJoCo documentation, Computation,
sections "Constraint model" and "Constraint solver", for the last.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from harness.equations.calculus import ProgramWriter
from harness.equations.constraints import BIAS, JACOBIAN, RATE, RESIDUAL, Constraints
from harness.equations.program import OUTPUTS, StraightLineProgram, position_count, upper_triangle, without_unused

Column = list[int]
MULTIPLIERS, ACCELERATIONS = "multipliers", "accelerations"


def constrained_program(constraints: Constraints, solve: Callable[[Tied], tuple[Column, Column]]) -> StraightLineProgram:
    """The tree's program whose passive forces hold those of the constraints besides; ``solve`` is one of the two ways.

    It has an output more where the way gives them: the ``multipliers`` of the rows that are not redundant [N or N m].
    """
    tied = Tied(constraints)
    return tied.with_forces(*solve(tied))


@dataclass(frozen=True)
class Softness:
    """How one row gives: numbers of a model file.

    Attributes:
        impedance: d, above 0 and below 1. stiffness: k [1/s^2]. damping: b [1/s].
        inverse_mass: A, of the row [1/kg, or 1/(kg m^2)]; None for (J M^-1 J')_ii at the state.
        has_bias: whether the law takes account of J' v; without it, it leaves b out.
    """

    impedance: float
    stiffness: float
    damping: float
    inverse_mass: float | None
    has_bias: bool = True


def softened_program(constraints: Constraints, rows: Sequence[Softness]) -> tuple[StraightLineProgram, list[tuple[str, float]]]:
    """The program of the softened problem, and names and values of the parameters that it has behind the others.

    ``rows`` is the law of every row, redundant ones as well. It has an output more, the ``multipliers`` -D (r - b - J a).

    Raises:
        ValueError: there are other rows, or rolling ones.
    """
    if len(rows) != len(constraints.rows) or constraints.holonomic != len(rows):
        raise ValueError(f"{len(rows)} laws for {len(constraints.rows)} rows, of which {constraints.holonomic} hold positions")
    numbers = [
        (f"{name}[{place}] {key.replace('_', ' ')}", value)
        for place, (name, row) in enumerate(zip(constraints.rows, rows, strict=True))
        for key, value in vars(row).items()
        if isinstance(value, float)
    ]
    tied = Tied(constraints, [name for name, _ in numbers], independent_only=False)
    given = {name: tied.add("input", tied.inputs.index(name)) for name, _ in numbers}
    exact = [place for place, row in enumerate(rows) if row.inverse_mass is None]
    columns = dict(zip(exact, tied.solved(tied.mass, [tied.jacobian[place] for place in exact]) if exact else [], strict=True))
    weights, wanted = [], []
    for place, (name, law) in enumerate(zip(constraints.rows, rows, strict=True)):
        impedance, stiffness, damping = (given[f"{name}[{place}] {key}"] for key in ("impedance", "stiffness", "damping"))
        own = given[f"{name}[{place}] inverse mass"] if place not in columns else tied.dot(tied.jacobian[place], columns[place])
        weights.append(tied.quotient(impedance, tied.product(tied.difference(tied.number(1), impedance), own)))
        back = tied.product(tied.product(stiffness, impedance), tied.residual[place])
        bias = tied.bias[place] if law.has_bias else tied.number(0)
        wanted.append(tied.negative(tied.sum(tied.sum(tied.product(damping, tied.rate[place]), back), bias)))
    weighted = [[tied.product(weight, entry) for entry in row] for weight, row in zip(weights, tied.jacobian, strict=True)]
    by_column = list(zip(tied.transposed(tied.jacobian), tied.transposed(weighted), strict=True))
    stiffened = [[tied.sum(tied.mass[i][j], tied.dot(by_column[i][0], by_column[j][1])) for j in range(tied.nv)] for i in range(tied.nv)]
    pulled = [tied.sum(force, tied.dot(column, wanted)) for force, (_, column) in zip(tied.force, by_column, strict=True)]
    [moved] = tied.solved(stiffened, [pulled])
    missing = tied.less(wanted, tied.times(tied.jacobian, moved))
    # Minus, as those of the rigid forces -J' lambda.
    multipliers = [tied.negative(tied.product(weight, force)) for weight, force in zip(weights, missing, strict=True)]
    return tied.with_forces([tied.dot(column, missing) for _, column in by_column], multipliers), numbers


class Tied(ProgramWriter):
    """The program of a tree and its constraints while it is written.

    Attributes:
        mass: M by rows. force: f. jacobian: J by rows. residual: what holonomic rows leave. rate: J v. bias: b.

    Rows are those that are not redundant, or all of them; ``more`` are inputs behind those of the tree.
    """

    def __init__(self, constraints: Constraints, more: Sequence[str] = (), independent_only: bool = True) -> None:
        tree = replace(constraints.tree, inputs=(*constraints.tree.inputs, *more))
        super().__init__(tree)
        self.constraints, self.nv = constraints, len(constraints.assembly)
        rows = self.append(constraints.program)
        chosen = constraints.independent if independent_only else range(len(constraints.rows))
        self.jacobian = [rows[JACOBIAN][row * self.nv :][: self.nv] for row in chosen]
        self.residual = [rows[RESIDUAL][row] for row in chosen if row < constraints.holonomic]
        self.rate, self.bias = ([rows[name][row] for row in chosen] for name in (RATE, BIAS))
        places = dict(zip(upper_triangle(self.nv), self.outputs["mass"], strict=True))
        self.mass = [[places[min(i, j), max(i, j)] for j in range(self.nv)] for i in range(self.nv)]
        first = position_count(constraints.tree) + self.nv
        terms = zip(range(first, first + self.nv), *(self.outputs[name] for name in ("passive", "velocity", "gravity")), strict=True)
        self.force = [self.difference(self.sum(tau, p), self.sum(c, g)) for tau, p, c, g in terms]

    def with_forces(self, forces: Column, multipliers: Sequence[int] = ()) -> StraightLineProgram:
        """The tree's program with the forces of constraints among the passive ones."""
        outputs = {name: self.outputs[name] for name in OUTPUTS}
        outputs["passive"] = [self.sum(*pair) for pair in zip(outputs["passive"], forces, strict=True)]
        return without_unused(self.program(outputs | ({MULTIPLIERS: multipliers} if multipliers else {})))

    def transposed(self, rows: Sequence[Column]) -> list[Column]:
        return [list(column) for column in zip(*rows, strict=True)]

    def times(self, rows: Sequence[Column], column: Column) -> Column:
        return [self.dot(row, column) for row in rows]

    def less(self, first: Column, second: Column) -> Column:
        return [self.difference(*pair) for pair in zip(first, second, strict=True)]

    def solved(self, matrix: Sequence[Column], columns: Sequence[Column]) -> list[Column]:
        """The solutions of a symmetric positive definite system, by L D L' (Golub, Van Loan, Matrix Computations, section 4.1.2)."""
        n = len(matrix)
        lower: list[Column] = [[] for _ in range(n)]
        pivots: Column = []
        for j in range(n):
            scaled = [self.product(entry, pivot) for entry, pivot in zip(lower[j], pivots, strict=True)]
            pivots.append(self.difference(matrix[j][j], self.dot(lower[j], scaled)))
            for i in range(j + 1, n):
                lower[i].append(self.quotient(self.difference(matrix[i][j], self.dot(lower[i], scaled)), pivots[j]))
        found = []
        for column in columns:
            x: Column = []
            for i, entry in enumerate(column):
                x.append(self.difference(entry, self.dot(lower[i], x)))
            x = [self.quotient(entry, pivot) for entry, pivot in zip(x, pivots, strict=True)]
            for i in reversed(range(n)):
                x[i] = self.difference(x[i], self.dot([lower[k][i] for k in range(i + 1, n)], x[i + 1 :]))
            found.append(x)
        return found

    def solved_by_orthogonal_columns(self, matrix: Sequence[Column], columns: Sequence[Column]) -> list[Column]:
        """The solutions of a regular system: its columns are made orthogonal to one another, and those of the right with them."""
        left, right = self.transposed(matrix), [list(column) for column in columns]
        upper: dict[tuple[int, int], int] = {}
        found: list[dict[int, int]] = [{} for _ in right]
        parts: list[Column] = [[] for _ in right]
        for j, vector in enumerate(left):
            upper[j, j] = self.add("sqrt", self.dot(vector, vector))
            unit = [self.quotient(entry, upper[j, j]) for entry in vector]
            for k in range(j + 1, len(left)):
                upper[j, k] = self.dot(unit, left[k])
                left[k] = self.less(left[k], [self.product(upper[j, k], entry) for entry in unit])
            for number, column in enumerate(right):
                parts[number].append(self.dot(unit, column))
                right[number] = self.less(column, [self.product(parts[number][j], entry) for entry in unit])
        for part, x in zip(parts, found, strict=True):
            for j in reversed(range(len(left))):
                known = list(range(j + 1, len(left)))
                rest = self.dot([upper[j, k] for k in known], [x[k] for k in known])
                x[j] = self.quotient(self.difference(part[j], rest), upper[j, j])
        return [[x[j] for j in range(len(left))] for x in found]


def by_multipliers(tied: Tied) -> tuple[Column, Column]:
    """The forces -J' lambda, (nv,), and lambda, (m,)."""
    *columns, free = tied.solved(tied.mass, [*tied.jacobian, tied.force])
    compliance = [tied.times(tied.jacobian, column) for column in columns]
    needed = [tied.sum(*pair) for pair in zip(tied.times(tied.jacobian, free), tied.bias, strict=True)]
    [multipliers] = tied.solved(compliance, [needed])
    return [tied.negative(force) for force in tied.times(tied.transposed(tied.jacobian), multipliers)], multipliers


def by_reduction(tied: Tied) -> tuple[Column, Column]:
    """The forces M a - f, (nv,), with a from the reduced equations; no multipliers."""
    return tied.less(tied.times(tied.mass, reduced(tied)), tied.force), []


def reduced_program(constraints: Constraints) -> StraightLineProgram:
    """A program of the tree's inputs whose one output, ``accelerations`` (nv,), is the solution of the reduced equations."""
    tied = Tied(constraints)
    return without_unused(tied.program({ACCELERATIONS: reduced(tied)}))


def reduced(tied: Tied) -> Column:
    """The accelerations, (nv,), by the reduced equations."""
    determined = tied.constraints.rates
    others = [place for place in range(tied.nv) if place not in determined]
    by_determined = [[row[place] for place in determined] for row in tied.jacobian]
    by_others = tied.transposed([[row[place] for place in others] for row in tied.jacobian])
    *ways, drift = tied.solved_by_orthogonal_columns(by_determined, [*by_others, tied.bias])
    zero = tied.number(0)

    def spread(own: Column, following: Column) -> Column:
        found = [zero] * tied.nv
        for places, values in ((others, own), (determined, following)):
            for place, value in zip(places, values, strict=True):
                found[place] = value
        return found

    basis = [
        spread([tied.number(int(place == other)) for other in others], [tied.negative(entry) for entry in way])
        for place, way in zip(others, ways, strict=True)
    ]
    offset = spread([zero] * len(others), [tied.negative(entry) for entry in drift])
    carried = [tied.times(tied.mass, way) for way in basis]
    reduced = [[tied.dot(one, other) for other in carried] for one in basis]
    [own] = tied.solved(reduced, [tied.times(basis, tied.less(tied.force, tied.times(tied.mass, offset)))])
    return [tied.sum(at, tied.dot(row, own)) for at, row in zip(offset, tied.transposed(basis), strict=True)]
