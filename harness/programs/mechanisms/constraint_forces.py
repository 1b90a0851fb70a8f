"""The equations of motion of a tree under constraints: with the forces that hold them, or with those of a law that lets them give.

Proofs and sources: docs/inside/numerics.md, "Constraint forces".
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from harness.programs.mechanisms.mechanism import BIAS, JACOBIAN, RATE, RESIDUAL, Constraints
from harness.programs.program import OUTPUTS, SYSTEM, StraightLineProgram, position_count, upper_triangle, without_unused
from harness.programs.terms import Builder, Matrix, Term, Vector, dot, length, matrix, symmetric, vector

MULTIPLIERS, ACCELERATIONS = "multipliers", "accelerations"


def constrained_program(constraints: Constraints, solve: Callable[[Tied], tuple[Vector, Vector]]) -> StraightLineProgram:
    """The tree's program whose passive forces hold those of the constraints besides; ``solve`` is one of the two ways.

    It has an output more where the way gives them: the ``multipliers`` of the rows that are not redundant [N or N m].
    """
    tied = tied_equations(constraints)
    return tied.with_forces(*solve(tied))


@dataclass(frozen=True)
class Tied:
    """The program of a tree and its constraints while it is written.

    Attributes:
        equations: the terms of the tree's program.
        mass: M. force: f. jacobian: J. residual: what holonomic rows leave. rate: J v. bias: b.
    """

    builder: Builder
    constraints: Constraints
    equations: Mapping[str, Sequence[Term]]
    mass: Matrix
    force: Vector
    jacobian: Matrix
    residual: Sequence[Term]
    rate: Vector
    bias: Vector

    @property
    def nv(self) -> int:
        return len(self.force)

    def with_system(self, system: Matrix, forces: Vector) -> StraightLineProgram:
        """The tree's program with ``system`` qdd in the place of M qdd, and those of its forces that no acceleration makes."""
        outputs: dict[str, Iterable[Term]] = {name: self.equations[name] for name in OUTPUTS}
        outputs |= {"passive": vector(self.equations["passive"]) + forces, SYSTEM: [system[i, j] for i, j in upper_triangle(self.nv)]}
        return without_unused(self.builder.program(outputs))

    def with_forces(self, forces: Vector, multipliers: Sequence[Term] = ()) -> StraightLineProgram:
        """The tree's program with the forces of constraints among the passive ones."""
        outputs: dict[str, Iterable[Term]] = {name: self.equations[name] for name in OUTPUTS}
        outputs["passive"] = vector(self.equations["passive"]) + forces
        return without_unused(self.builder.program(outputs | ({MULTIPLIERS: multipliers} if len(multipliers) else {})))


def tied_equations(constraints: Constraints, more: Sequence[str] = (), independent_only: bool = True) -> Tied:
    """The equations of a tree and its rows that are not redundant, or all of them; ``more`` are inputs behind those of the tree."""
    builder, nv = Builder((*constraints.tree.inputs, *more)), len(constraints.assembly)
    equations, rows = builder.append(constraints.tree), builder.append(constraints.program)
    chosen = list(constraints.independent if independent_only else range(len(constraints.rows)))
    first = position_count(constraints.tree) + nv
    terms = zip(builder.inputs[first : first + nv], *(equations[name] for name in ("passive", "velocity", "gravity")), strict=True)
    return Tied(
        builder,
        constraints,
        equations,
        mass=symmetric(equations["mass"], nv),
        force=vector([(tau + p) - (c + g) for tau, p, c, g in terms]),
        jacobian=np.array(rows[JACOBIAN], dtype=object).reshape(-1, nv)[chosen],
        residual=[rows[RESIDUAL][row] for row in chosen if row < constraints.holonomic],
        rate=vector(rows[RATE])[chosen],
        bias=vector(rows[BIAS])[chosen],
    )


def solved(rows: Matrix, columns: Sequence[Vector]) -> list[Vector]:
    """The solutions of a symmetric positive definite system, by L D L' (Golub, Van Loan, Matrix Computations, section 4.1.2)."""
    n, zero = len(rows), rows[0, 0].builder.number(0)
    lower: list[list[Term]] = [[] for _ in range(n)]
    pivots: list[Term] = []
    for j in range(n):
        scaled = [entry * pivot for entry, pivot in zip(lower[j], pivots, strict=True)]
        pivots.append(rows[j, j] - dot(lower[j], scaled, zero))
        for i in range(j + 1, n):
            lower[i].append((rows[i, j] - dot(lower[i], scaled, zero)) / pivots[j])
    found = []
    for column in columns:
        x: list[Term] = []
        for i, entry in enumerate(column):
            x.append(entry - dot(lower[i], x, zero))
        x = [entry / pivot for entry, pivot in zip(x, pivots, strict=True)]
        for i in reversed(range(n)):
            x[i] = x[i] - dot([lower[k][i] for k in range(i + 1, n)], x[i + 1 :], zero)
        found.append(vector(x))
    return found


def solved_from_tips(mass: Matrix, columns: Sequence[Vector]) -> list[Vector]:
    """As ``solved``, for the mass matrix of a tree, from its last row to its first: entries that are zero stay so.

    It takes fewer instructions. Of light bodies at the tips of heavy ones it loses digits that ``solved`` keeps.

    Source: Featherstone, Rigid Body Dynamics Algorithms, section 6.5.
    """
    return [column[::-1] for column in solved(mass[::-1, ::-1], [column[::-1] for column in columns])]


def solved_by_rows(rows: Matrix, columns: Sequence[Vector]) -> list[Vector]:
    """As ``solved``, for a regular system that need not be symmetric, by L U from its last row to its first (section 3.2)."""
    n, left = len(rows), rows[::-1, ::-1].copy()
    zero = rows[0, 0].builder.number(0)
    found = [column[::-1].copy() for column in columns]
    for j in range(n):
        for i in range(j + 1, n):
            share = left[i, j] / left[j, j]
            left[i, j + 1 :] = left[i, j + 1 :] - share * left[j, j + 1 :]
            for column in found:
                column[i] = column[i] - share * column[j]
    for column in found:
        for i in reversed(range(n)):
            column[i] = (column[i] - dot(left[i, i + 1 :], column[i + 1 :], zero)) / left[i, i]
    return [vector(column[::-1]) for column in found]


def products_of_elimination(rows: Matrix) -> int:
    """Products of the elimination of a symmetric matrix from its first row to its last, where only zeros of it that stay so cost none."""
    filled, count = np.array([[entry.value != 0 for entry in row] for row in rows]), 0
    for j in range(len(rows)):
        below = j + 1 + np.flatnonzero(filled[j + 1 :, j])
        filled[np.ix_(below, below)] = True
        count += len(below) * (len(below) + 1) // 2
    return count


def _solved_by_orthogonal_columns(left: Sequence[Vector], right: Sequence[Vector]) -> list[Vector]:
    """The solutions of a regular system: its columns ``left`` are made orthogonal to one another, and those of the right with them."""
    m, columns, found = len(left), [*left, *right], list[Vector]()
    upper: dict[tuple[int, int], Term] = {}
    for j in range(m):
        upper[j, j] = length(columns[j])
        unit = columns[j] / upper[j, j]
        for k in range(j + 1, len(columns)):
            upper[j, k] = unit @ columns[k]
            columns[k] = columns[k] - upper[j, k] * unit
    for column in range(m, len(columns)):
        x: list[Term] = []
        for j in reversed(range(m)):
            rest = dot([upper[j, k] for k in range(j + 1, m)], x, upper[j, j].builder.number(0))
            x.insert(0, (upper[j, column] - rest) / upper[j, j])
        found.append(vector(x))
    return found


def by_multipliers(tied: Tied) -> tuple[Vector, Vector]:
    """The forces -J' lambda, (nv,), and lambda, (m,)."""
    *columns, free = solved(tied.mass, [*tied.jacobian, tied.force])
    compliance = matrix([tied.jacobian @ column for column in columns])
    needed = tied.jacobian @ free + tied.bias
    [multipliers] = solved(compliance, [needed])
    return -(tied.jacobian.T @ multipliers), multipliers


def reduced_program(constraints: Constraints) -> StraightLineProgram:
    """A program of the tree's inputs whose one output, ``accelerations`` (nv,), is the solution of the reduced equations."""
    tied = tied_equations(constraints)
    return without_unused(tied.builder.program({ACCELERATIONS: reduced(tied)}))


def reduced(tied: Tied) -> Vector:
    """The accelerations, (nv,), by the reduced equations."""
    builder, determined = tied.builder, list(tied.constraints.rates)
    others = [place for place in range(tied.nv) if place not in determined]
    *ways, drift = _solved_by_orthogonal_columns(tied.jacobian[:, determined].T, [*tied.jacobian[:, others].T, tied.bias])

    def spread(own: Vector, following: Vector) -> Vector:
        found = builder.zeros(tied.nv)
        found[others], found[determined] = own, following
        return found

    basis = [spread(builder.vector([int(place == other) for other in others]), -way) for place, way in zip(others, ways, strict=True)]
    offset = spread(builder.zeros(len(others)), -drift)
    carried = [tied.mass @ way for way in basis]
    compact = matrix([[one @ other for other in carried] for one in basis])
    pulled = tied.force - tied.mass @ offset
    [own] = solved(compact, [vector([one @ pulled for one in basis])])
    return vector([at + matrix(basis)[:, place] @ own for place, at in enumerate(offset)])
