"""The equations of motion of a tree under rows that hold as rigid as their compliance is small, as far as the ranges of their forces go.

The forces f of the rows are unknowns, since a row of compliance 0 has no force that its acceleration gives. With S, a diagonal of shares,
1 inside a range and 0 beyond, c the bounds of those beyond, G = J M^-1 J' + R and D the diagonal of G, forces are f = S x + c, where

    (S G S + (1 - S) D) x = S (aref - J a0 - G c),

a symmetric system, definite where the rows inside their ranges are independent or give. A force without its own range would be
f - D^-1 (G f + J a0 - aref), which is x of a row inside.

Source: Murty, Linear Complementarity, Linear and Nonlinear Programming, 1988, section 1.3 (quadratic programs between bounds).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction

from harness.programs.mechanisms.constraint_forces import solved, solved_from_tips, tied_equations
from harness.programs.mechanisms.mechanism import JACOBIAN, Constraints
from harness.programs.mechanisms.softened import (
    CONSTANT,
    SHARE,
    STIFFNESS,
    UNBOUNDED,
    SoftenedProgram,
    Softness,
    number_of,
    share_and_constant,
)
from harness.programs.program import without_unused
from harness.programs.terms import matrix, vector

COMPLIANCE, DAMPING = "compliance", "damping"
# Of the diagonal of J M^-1 J', what rows give where a proof of their sides begins.
_GIVING = Fraction(1, 2**30)


def bounded_program(constraints: Constraints, laws: Mapping[str, Softness]) -> SoftenedProgram:
    """The program of the problem between bounds; ``laws`` is that of every constraint, each with a compliance and a range of forces.

    The program has an output more, the ``multipliers``, minus the force of each row. Rows in the order of ``unbounded`` are all.
    """
    rows = list(enumerate(constraints.rows))
    numbers = [number for name in constraints.names for number in _numbers(name, [row for row, owner in rows if owner == name], laws[name])]
    tied = tied_equations(constraints, [name for name, _ in numbers], independent_only=False)
    builder, jacobian = tied.builder, tied.jacobian
    known = {name: builder.inputs[builder.names.index(name)] for name, _ in numbers}
    numbered = [share_and_constant(tied, known, laws[name], number_of(name, "", row)) for row, name in rows]
    shares, constants = vector(share for share, _ in numbered), vector(constant for _, constant in numbered)
    stiffness, damping, compliance = (vector(known[number_of(name, what)] for _, name in rows) for what in (STIFFNESS, DAMPING, COMPLIANCE))
    wanted = vector(-(damping[row] * tied.rate[row] + stiffness[row] * tied.residual[row] + tied.bias[row]) for row, _ in rows)
    *columns, free = solved_from_tips(tied.mass, [*jacobian, tied.force])
    delassus = matrix([jacobian @ column for column in columns]).T
    rigid = vector(delassus[row, row] for row, _ in rows)
    for row, _ in rows:
        delassus[row, row] = rigid[row] + compliance[row]
    missing = wanted - jacobian @ free
    system = matrix([[shares[i] * (delassus[i, j] * shares[j]) for j, _ in rows] for i, _ in rows])
    for row, _ in rows:
        system[row, row] = system[row, row] + (1 - shares[row]) * delassus[row, row]
    [inside] = solved(system, [vector(share * each for share, each in zip(shares, missing - delassus @ constants, strict=True))])
    forces = vector(share * force for share, force in zip(shares, inside, strict=True)) + constants
    left = delassus @ forces - missing
    unbounded = vector(forces[row] - left[row] / delassus[row, row] for row, _ in rows)
    weights = vector(1 / (compliance[row] + _GIVING * rigid[row]) for row, _ in rows)
    asked = {"mass": tied.equations["mass"], "force": tied.force, JACOBIAN: jacobian.ravel(), "wanted": wanted, "weights": weights}
    return SoftenedProgram(
        tied.with_forces(jacobian.T @ forces, -forces),
        numbers,
        without_unused(builder.program({UNBOUNDED: unbounded})),
        [(name, row) for row, name in rows],
        [],
        without_unused(builder.program(asked)),
    )


def _numbers(name: str, rows: Sequence[int], law: Softness) -> Iterator[tuple[str, float]]:
    """Names and values of the numbers of the law of a constraint."""
    assert law.compliance is not None
    of_all = {STIFFNESS: law.stiffness, DAMPING: law.damping, COMPLIANCE: law.compliance}
    yield from ((number_of(name, what), value) for what, value in of_all.items())
    for row in rows:
        yield from ((number_of(name, what, row), value) for what, value in ((SHARE, 1.0), (CONSTANT, 0.0)))
