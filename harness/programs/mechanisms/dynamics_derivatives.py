"""Derivatives of forward and inverse dynamics by positions, velocities and what is given besides, as straight-line programs.

Proofs and sources: docs/inside/numerics.md, "Derivatives of the dynamics".
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING

from harness.programs.derivatives import along, derivative_name, differentiate
from harness.programs.kernels import solve_symmetric
from harness.programs.program import StraightLineProgram, right_hand_side, without_unused
from harness.programs.terms import Builder, Term, Vector, cross, dot, sqrt, symmetric, vector

if TYPE_CHECKING:
    from harness.programs.mechanisms.mechanism import Mechanism

BY_POSITION, BY_VELOCITY = "by_position", "by_velocity"
# The third argument of inverse and of forward dynamics.
BY_ACCELERATION, BY_FORCE = "by_acceleration", "by_force"
# The parts of tau, as they add up.
TERMS = ("inertial forces", "velocity terms", "gravity terms", "springs and dampers")
_FORCES = "forces"


class _Arguments:
    """A program of q, v, a vector of nv more, time and parameters, which begins with these inputs alone.

    Attributes:
        third: the accelerations, or the applied forces.
    """

    def __init__(self, mechanism: Mechanism, inputs: Sequence[str], is_in_body: bool) -> None:
        self.mechanism, self.builder, self.is_in_body = mechanism, Builder(inputs), is_in_body
        nq, nv = mechanism.nq, mechanism.nv
        self.velocities, self.third = (self.builder.inputs_at(range(first, first + nv)) for first in (nq, nq + nv))

    def appended(self, program: StraightLineProgram, third: Vector) -> dict[str, list[Term]]:
        """Write a program of the same inputs but for the third vector, which is ``third``; its outputs."""
        first, inputs = self.mechanism.nq + self.mechanism.nv, list(self.builder.inputs)
        inputs[first : first + self.mechanism.nv] = third
        return self.builder.append(program, inputs)

    def directions(self) -> Iterator[Mapping[Term, Term]]:
        """For each velocity, the rates of positions at which it is 1 and all others are 0."""
        attitudes, joints, given = self.mechanism.attitudes, self.mechanism.joints, self.builder.inputs
        place = 0
        for coordinate in range(self.mechanism.nv):
            first = next((one for one in attitudes if one <= coordinate < one + 3), None)
            if first is not None:
                # A quaternion has four positions and three velocities.
                yield _turning(vector(given[place : place + 4]), coordinate - first)
                place += 4 * (coordinate == first + 2)
            else:
                of_free = next((one for one in attitudes if joints[one] == joints[coordinate]), None)
                if of_free is not None and self.is_in_body:
                    start = place - (coordinate - of_free + 3)
                    yield _moving(given[start : start + 3], vector(given[start + 3 : start + 7]), coordinate - of_free + 3)
                else:
                    yield {given[place]: self.builder.number(1)}
                place += 1


def _turning(quaternion: Vector, axis: int) -> Mapping[Term, Term]:
    """Half the product of (w, x, y, z) with the unit vector along an axis of the body."""
    w, rest = quaternion[0], quaternion[1:]
    unit = w.builder.vector([int(axis == row) for row in range(3)])
    changes = [-rest[axis], *(w * unit + cross(rest, unit))]
    half = w.builder.number(Fraction(1, 2))
    return {position: half * change for position, change in zip(quaternion, changes, strict=True)}


def _moving(position: Sequence[Term], quaternion: Vector, axis: int) -> Mapping[Term, Term]:
    """The axis of the body, along which the position moves."""
    w, rest = quaternion[0], quaternion[1:]
    unit = w.builder.vector([int(axis == row) for row in range(3)])
    # u + 2 (w (r x u) + r x (r x u)) / |quaternion|^2
    across = cross(rest, unit)
    turned = w * across + cross(rest, across)
    two = w.builder.number(2)
    scale = two / (quaternion @ quaternion)
    return dict(zip(position, unit + scale * turned, strict=True))


def inverse_dynamics_derivatives(
    mechanism: Mechanism, program: StraightLineProgram, linear_velocity_in_body: bool = False
) -> StraightLineProgram:
    """The derivatives of tau that give accelerations a, by q, v and a, from the inputs q, v, a, time and parameters.

    ``program`` is one of the mechanism's charts. Each of the outputs ``by_position``, ``by_velocity`` and ``by_acceleration`` holds nv
    columns of nv entries, one column after the other [N or N m, per unit].
    """
    nv = mechanism.nv
    given = _Arguments(mechanism, _with_accelerations(mechanism, program), linear_velocity_in_body)
    equations = given.appended(program, given.third)
    rows, free = symmetric(equations["mass"], nv), right_hand_side(equations)
    forces = [row @ given.third - rest for row, rest in zip(rows, free, strict=True)]
    outputs: dict[str, Iterable[Term]] = {_FORCES: forces, BY_ACCELERATION: rows.flat}
    found = _differentiated(given, outputs, [_FORCES])
    columns = _by_columns(found.outputs[derivative_name(_FORCES)], 2 * nv)
    derivatives = {BY_POSITION: columns[: nv * nv], BY_VELOCITY: columns[nv * nv :], BY_ACCELERATION: found.outputs[BY_ACCELERATION]}
    return without_unused(replace(found, outputs=derivatives))


def _differentiated(given: _Arguments, outputs: Mapping[str, Iterable[Term]], names: Sequence[str]) -> StraightLineProgram:
    """``differentiate`` by positions along the velocities, and by velocities."""
    nq, nv = given.mechanism.nq, given.mechanism.nv
    directions = [{position.place: rate.place for position, rate in one.items()} for one in given.directions()]
    return differentiate(given.builder.program(outputs), names, [*directions, *range(nq, nq + nv)])


def forward_dynamics_derivatives(
    mechanism: Mechanism, program: StraightLineProgram, linear_velocity_in_body: bool = False
) -> StraightLineProgram:
    """The derivatives of the accelerations by q, v and tau, from the inputs of ``program``, one of the mechanism's charts.

    Each of the outputs ``by_position``, ``by_velocity`` and ``by_force`` holds nv columns of nv entries, one column after the other.
    """
    nv = mechanism.nv
    given = _Arguments(mechanism, program.inputs, linear_velocity_in_body)
    equations = given.appended(program, given.third)
    accelerations = vector(solve_symmetric(equations["mass"], right_hand_side(equations, given.third)))
    of_forces = given.appended(inverse_dynamics_derivatives(mechanism, program, linear_velocity_in_body), accelerations)

    def solved(columns: Sequence[Term]) -> list[Term]:
        return [entry for at in range(0, nv * nv, nv) for entry in solve_symmetric(equations["mass"], columns[at : at + nv])]

    outputs = {name: solved([-entry for entry in of_forces[name]]) for name in (BY_POSITION, BY_VELOCITY)}
    outputs[BY_FORCE] = solved(given.builder.vector([int(row == column) for column in range(nv) for row in range(nv)]))
    return without_unused(given.builder.program(outputs))


def terms_of_forces(mechanism: Mechanism, program: StraightLineProgram, linear_velocity_in_body: bool) -> StraightLineProgram:
    """As ``inverse_dynamics_derivatives``, of each term of the forces by itself: outputs named by ``TERMS``.

    Each holds 2 nv columns of nv entries, by positions and by velocities.
    """
    given = _Arguments(mechanism, _with_accelerations(mechanism, program), linear_velocity_in_body)
    terms = _terms(given, given.appended(program, given.third))
    found = _differentiated(given, terms, list(terms))
    outputs = {name: _by_columns(found.outputs[derivative_name(name)], 2 * mechanism.nv) for name in terms}
    return without_unused(replace(found, outputs=outputs))


def sizes_of_parts(
    mechanism: Mechanism, program: StraightLineProgram, linear_velocity_in_body: bool, *, of_accelerations: bool
) -> StraightLineProgram:
    """Sizes of the parts that an algorithm may form of a column of derivatives and cancel, from the inputs of ``program``.

    ``of_accelerations``: accelerations stand in the place of applied forces. The output "sizes" holds 3 nv numbers in the order of the
    columns of derivatives. Forces on what turns change with its angle by as much as they are large: a column by a rotating coordinate
    has parts as large as the separate forces, and as twice the kinetic energy as a torque on each rotating coordinate, the share of the
    motion that accelerations have; one by a velocity has what becomes of this by a unit of the velocity. Springs and
    dampers may pull at either side of what a coordinate moves: a column has as parts what coordinates that move with the same kinetic
    energy do to their forces. Lengths are kinetic-energy norms of accelerations, which are those of forces in the inverse of M.
    """
    nv = mechanism.nv
    inputs = _with_accelerations(mechanism, program) if of_accelerations else program.inputs
    given = _Arguments(mechanism, inputs, linear_velocity_in_body)
    builder, equations = given.builder, given.appended(program, given.third)
    mass, rows, zero = equations["mass"], symmetric(equations["mass"], nv), builder.number(0)
    units = [sqrt(rows[place, place]) for place in range(nv)]

    def size(forces: Sequence[Term]) -> Term:
        return sqrt(dot(forces, solve_symmetric(mass, forces), zero))

    def of_elements(directions: Sequence[Mapping[Term, Term]]) -> Term:
        columns = [along(equations["passive"], direction) for direction in directions]
        return sum((size(column) / unit for column, unit in zip(columns, units, strict=True)), zero)

    if of_accelerations:
        forces = list(_terms(given, equations).values())
    else:
        free = right_hand_side(equations, given.third)
        forces = [equations["velocity"], equations["gravity"], equations["passive"], given.third, free]
    total = sum((size(one) for one in forces), zero)
    rotating = [place for place, rotates in enumerate(mechanism.rotating) if rotates]
    torques = sum((size(builder.vector([int(row == place) for row in range(nv)])) for place in rotating), zero)
    rates, one = given.velocities, builder.number(1)
    twice_the_energy = rates @ (rows @ rates)
    by_turn = total + twice_the_energy * torques
    speed = builder.number(2) * (sqrt(twice_the_energy) * torques)
    by_position, by_velocity = of_elements(list(given.directions())), speed + of_elements([{rate: one} for rate in rates])
    sizes = [by_position * unit for unit in units]
    for place in rotating:
        sizes[place] = sizes[place] + by_turn
    sizes += [by_velocity * unit for unit in units]
    return without_unused(builder.program({"sizes": [*sizes, *[zero] * nv]}))


def _with_accelerations(mechanism: Mechanism, program: StraightLineProgram) -> list[str]:
    """The names of a program's inputs with accelerations in the place of applied forces."""
    nq, nv = mechanism.nq, mechanism.nv
    return [*program.inputs[: nq + nv], *(f"qdd{place}" for place in range(nv)), *program.inputs[nq + 2 * nv :]]


def _terms(given: _Arguments, equations: Mapping[str, Sequence[Term]]) -> dict[str, Sequence[Term]]:
    """M a, c, g and -p."""
    inertial = symmetric(equations["mass"], given.mechanism.nv) @ given.third
    passive = [-force for force in equations["passive"]]
    return dict(zip(TERMS, (inertial, equations["velocity"], equations["gravity"], passive), strict=True))


def _by_columns(entries: Sequence[int], columns: int) -> tuple[int, ...]:
    """Entries that stand by rows, one column after the other."""
    return tuple(place for column in range(columns) for place in entries[column::columns])
