"""The equations of motion of a tree under constraints: with the forces that hold them, or with those of a law that lets them give.

Proofs and sources: docs/inside/numerics.md, "Constraint forces".
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from harness.programs.mechanisms.mechanism import BIAS, JACOBIAN, RATE, RESIDUAL, Constraints
from harness.programs.program import OUTPUTS, StraightLineProgram, position_count, without_unused
from harness.programs.terms import Builder, Matrix, Term, Vector, dot, length, matrix, symmetric, vector

MULTIPLIERS, ACCELERATIONS = "multipliers", "accelerations"


def constrained_program(constraints: Constraints, solve: Callable[[Tied], tuple[Vector, Vector]]) -> StraightLineProgram:
    """The tree's program whose passive forces hold those of the constraints besides; ``solve`` is one of the two ways.

    It has an output more where the way gives them: the ``multipliers`` of the rows that are not redundant [N or N m].
    """
    tied = tied_equations(constraints)
    return tied.with_forces(*solve(tied))


@dataclass(frozen=True)
class Softness:
    """How one constraint gives: numbers of a model file.

    Attributes:
        impedance: d where the constraint holds, above 0 and below 1. stiffness: k [1/s^2]. damping: b [1/s].
        inverse_masses: A of each row [1/kg, or 1/(kg m^2)]; None for (J M^-1 J')_ii at the state.
        has_bias: whether the law takes account of J' v; without it, it leaves b out.
        force_range: the least and the largest force of each row [N or N m].
    """

    impedance: float
    stiffness: float
    damping: float
    inverse_masses: tuple[float | None, ...]
    has_bias: bool = True
    force_range: tuple[float, float] = (-math.inf, math.inf)

    @property
    def has_range(self) -> bool:
        return self.force_range != Softness.force_range


# Numbers of a law that a state may have of its own, behind the names of constraint and row.
IMPEDANCE, REST, DISTANCE, SLOPE, INVERSE_MASS = "impedance", "rest of impedance", "distance", "slope", "inverse mass"
SHARE, CONSTANT, UNBOUNDED = "share", "constant", "unbounded"


def number_of(name: str, what: str, row: int | None = None) -> str:
    """The name of a number of the law of a constraint, or of one of its rows by its number among all."""
    return f"{name}{'' if row is None else f'[{row}]'} {what}"


@dataclass(frozen=True)
class SoftenedProgram:
    """The program of a softened problem.

    Attributes:
        numbers: names and values of the parameters that it has behind the others.
        unbounded: a program of the same inputs whose output is, of each row that has a range of forces, the force without it.
        ranged: those rows by their constraint and number among all.
    """

    program: StraightLineProgram
    numbers: list[tuple[str, float]]
    unbounded: StraightLineProgram
    ranged: list[tuple[str, int]]


def softened_program(constraints: Constraints, laws: Mapping[str, Softness]) -> SoftenedProgram:
    """The program of the softened problem.

    ``laws`` is that of every constraint, redundant rows included. The program has an output more, the ``multipliers``, minus the force of
    each row: share D (r - b - J a) + constant, where a share of 1 and a constant of 0 are those of rows without a range of forces.
    Around a state the impedance of a constraint is linear in its rows, d = impedance + rest + sum of slope_i (phi_i - distance_i), so
    that its derivative by all inputs is felt; slopes and rests are 0 unless a state has its own.

    Raises:
        ValueError: there are other rows, or rolling ones.
    """
    places = {name: [row for row, owner in enumerate(constraints.rows) if owner == name] for name in constraints.names}
    given = {name: len(law.inverse_masses) for name, law in laws.items()}
    if given != {name: len(rows) for name, rows in places.items()} or constraints.holonomic != len(constraints.rows):
        count = f"{sum(given.values())} laws for {len(constraints.rows)} rows"
        raise ValueError(f"{count}, of which {constraints.holonomic} hold positions")
    numbers = [number for name, rows in places.items() for number in _numbers(name, rows, laws[name])]
    tied = tied_equations(constraints, [name for name, _ in numbers], independent_only=False)
    builder, mass, jacobian, zero = tied.builder, tied.mass, tied.jacobian, tied.builder.number(0)
    known = {name: builder.inputs[builder.names.index(name)] for name, _ in numbers}
    exact = [row for name, rows in places.items() for row, own in zip(rows, laws[name].inverse_masses, strict=True) if own is None]
    columns = dict(zip(exact, _solved(mass, [jacobian[row] for row in exact]) if exact else [], strict=True))
    weights, wanted, constants = (builder.zeros(len(constraints.rows)) for _ in range(3))
    ranged, shares = list[tuple[str, int]](), builder.vector([1] * len(constraints.rows))
    for name, rows in places.items():
        impedance, rest, stiffness, damping = (known[number_of(name, what)] for what in (IMPEDANCE, REST, "stiffness", "damping"))
        for row in rows:
            slope, distance = (known[number_of(name, what, row)] for what in (SLOPE, DISTANCE))
            rest = rest + slope * (tied.residual[row] - distance)
        impedance = impedance + rest
        for row in rows:
            own = jacobian[row] @ columns[row] if row in columns else known[number_of(name, INVERSE_MASS, row)]
            weights[row] = impedance / ((1 - impedance) * own)
            back = (stiffness * impedance) * tied.residual[row]
            bias = tied.bias[row] if laws[name].has_bias else zero
            wanted[row] = -((damping * tied.rate[row] + back) + bias)
            if laws[name].has_range:
                shares[row], constants[row] = (known[number_of(name, what, row)] for what in (SHARE, CONSTANT))
                ranged.append((name, row))
    weighted = matrix([share * weight * row for share, weight, row in zip(shares, weights, jacobian, strict=True)])
    required = vector(wanted)
    stiffened = matrix([[mass[i, j] + jacobian[:, i] @ weighted[:, j] for j in range(tied.nv)] for i in range(tied.nv)])
    pushed = [force + column @ constants for force, column in zip(tied.force, jacobian.T, strict=True)]
    pulled = vector(force + column @ required for force, column in zip(pushed, weighted.T, strict=True))
    [moved] = _solved(stiffened, [pulled])
    missing = required - jacobian @ moved
    unbounded = vector(weight * force for weight, force in zip(weights, missing, strict=True))
    # Minus, as those of the rigid forces -J' lambda.
    multipliers = vector(-(share * force + constant) for share, force, constant in zip(shares, unbounded, constants, strict=True))
    outside = without_unused(builder.program({UNBOUNDED: [unbounded[row] for _, row in ranged]}))
    return SoftenedProgram(tied.with_forces(weighted.T @ missing + jacobian.T @ constants, multipliers), numbers, outside, ranged)


def _numbers(name: str, rows: Sequence[int], law: Softness) -> Iterator[tuple[str, float]]:
    """Names and values of the numbers of the law of a constraint."""
    of_all = {IMPEDANCE: law.impedance, REST: 0.0, "stiffness": law.stiffness, "damping": law.damping}
    yield from ((number_of(name, what), value) for what, value in of_all.items())
    for row, inverse_mass in zip(rows, law.inverse_masses, strict=True):
        own = {DISTANCE: 0.0, SLOPE: 0.0} | ({} if inverse_mass is None else {INVERSE_MASS: inverse_mass})
        own |= {SHARE: 1.0, CONSTANT: 0.0} if law.has_range else {}
        yield from ((number_of(name, what, row), value) for what, value in own.items())


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


def _solved(rows: Matrix, columns: Sequence[Vector]) -> list[Vector]:
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
    *columns, free = _solved(tied.mass, [*tied.jacobian, tied.force])
    compliance = matrix([tied.jacobian @ column for column in columns])
    needed = tied.jacobian @ free + tied.bias
    [multipliers] = _solved(compliance, [needed])
    return -(tied.jacobian.T @ multipliers), multipliers


def by_reduction(tied: Tied) -> tuple[Vector, Vector]:
    """The forces M a - f, (nv,), with a from the reduced equations; no multipliers."""
    return tied.mass @ reduced(tied) - tied.force, ()


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
    [own] = _solved(compact, [vector([one @ pulled for one in basis])])
    return vector([at + matrix(basis)[:, place] @ own for place, at in enumerate(offset)])
