"""Derivatives of forward and inverse dynamics by positions, velocities and what is given besides, as straight-line programs.

With tau = ID(q, v, a) = M a + c + g - p, the derivatives of the accelerations that forces tau cause are those of tau at these
accelerations, solved for:

    d qdd = M^-1 (d tau - dID|a),   a = qdd(q, v, tau) held fixed in dID.

Everything is one program, with the accelerations and L D L' solutions inside, so that whatever evaluates and differentiates programs
gives certified values and data roundoff, which are second derivatives of the equations of motion.

Derivatives by positions are along the velocities of the joints: of a hinge or slide by its position, of a ball or free joint along
q' = N(q) e_i, the change of q at the i-th unit velocity. A rotation is turned about an axis of the body; the position of a free joint
moves along an axis of the frame in which its linear velocity is given. The components of v are kept.

Sources: Carpentier, Mansard, Analytical derivatives of rigid body dynamics algorithms, RSS 2018; Sola, Deray, Atchuthan, A micro Lie
theory for state estimation in robotics, 2018 (right Jacobians).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING

from harness.equations.calculus import ProgramWriter
from harness.equations.kernels import solve_symmetric
from harness.equations.program import StraightLineProgram, right_hand_side, upper_triangle, with_operands, without_unused
from harness.equations.program_derivatives import derivative_name, differentiate

if TYPE_CHECKING:
    from harness.equations.mechanism import Mechanism

BY_POSITION, BY_VELOCITY = "by_position", "by_velocity"
# The third argument of inverse and of forward dynamics.
BY_ACCELERATION, BY_FORCE = "by_acceleration", "by_force"
# The parts of tau, as they add up.
TERMS = ("inertial forces", "velocity terms", "gravity terms", "springs and dampers")
_FORCES = "forces"


@dataclass(frozen=True)
class _Term:
    """The result of an instruction, of which operators write further instructions."""

    writer: ProgramWriter
    place: int

    def __add__(self, other: _Term) -> _Term:
        return _Term(self.writer, self.writer.sum(self.place, other.place))

    def __sub__(self, other: _Term) -> _Term:
        return _Term(self.writer, self.writer.difference(self.place, other.place))

    def __mul__(self, other: _Term) -> _Term:
        return _Term(self.writer, self.writer.product(self.place, other.place))

    def __truediv__(self, other: _Term) -> _Term:
        return _Term(self.writer, self.writer.quotient(self.place, other.place))


class _Writer(ProgramWriter):
    """A program of q, v, a vector of nv more, time and parameters; it begins with these inputs alone."""

    def __init__(self, mechanism: Mechanism, inputs: Sequence[str], linear_velocity_in_body: bool) -> None:
        super().__init__(StraightLineProgram(tuple(inputs), (), {}))
        self.nq, self.nv = mechanism.nq, mechanism.nv
        self._mechanism, self._in_body = mechanism, linear_velocity_in_body
        self.given = [self.add("input", place) for place in range(len(inputs))]

    @property
    def third(self) -> list[int]:
        """The accelerations, or the applied forces."""
        return self.given[self.nq + self.nv : self.nq + 2 * self.nv]

    def appended(self, program: StraightLineProgram, third: Sequence[int]) -> dict[str, list[int]]:
        """Write a program of the same inputs but for the third vector, which is ``third``; the places of its outputs."""
        first, places = self.nq + self.nv, list[int]()
        for instruction in program.instructions:
            if instruction[0] == "input" and first <= instruction[1] < first + self.nv:
                places.append(third[instruction[1] - first])
            else:
                places.append(self.again(*with_operands(instruction, places)))
        return {name: [places[index] for index in indices] for name, indices in program.outputs.items()}

    def terms(self, places: Sequence[int]) -> list[_Term]:
        return [_Term(self, place) for place in places]

    def total(self, places: Iterable[int]) -> int:
        found = self.number(0)
        for place in places:
            found = self.sum(found, place)
        return found

    def solved(self, upper: Sequence[int], right_hand_side: Sequence[int]) -> list[int]:
        """The solution x of M x = b; what depends on M alone is written once."""
        return [term.place for term in solve_symmetric(self.terms(upper), self.terms(right_hand_side))]

    def free(self, equations: Mapping[str, Sequence[int]], applied: Sequence[int] | None = None) -> list[int]:
        """tau + p - (c + g), without tau for None."""
        outputs = {name: self.terms(equations[name]) for name in ("velocity", "gravity", "passive")}
        return [term.place for term in right_hand_side(outputs, None if applied is None else self.terms(applied))]

    def directions(self) -> Iterator[Mapping[int, int]]:
        """For each velocity, the rates of positions at which it is 1 and all others are 0."""
        attitudes, joints = self._mechanism.attitudes, self._mechanism.joints
        place = 0
        for coordinate in range(self.nv):
            first = next((one for one in attitudes if one <= coordinate < one + 3), None)
            if first is not None:
                # A quaternion has four positions and three velocities.
                quaternion = self.given[place : place + 4]
                yield self._turning(quaternion, coordinate - first)
                place += 4 * (coordinate == first + 2)
            else:
                of_free = next((one for one in attitudes if joints[one] == joints[coordinate]), None)
                if of_free is not None and self._in_body:
                    start = place - (coordinate - of_free + 3)
                    yield self._moving(self.given[start : start + 3], self.given[start + 3 : start + 7], coordinate - of_free + 3)
                else:
                    yield {self.given[place]: self.number(1)}
                place += 1

    def _turning(self, quaternion: Sequence[int], axis: int) -> Mapping[int, int]:
        """Half the product of (w, x, y, z) with the unit vector along an axis of the body."""
        w, *rest = quaternion
        unit = [self.number(int(axis == row)) for row in range(3)]
        changes = [self.negative(rest[axis]), *(self.sum(*pair) for pair in zip(self._times(w, unit), self.cross(rest, unit), strict=True))]
        return {place: self.product(self.number(Fraction(1, 2)), change) for place, change in zip(quaternion, changes, strict=True)}

    def _moving(self, position: Sequence[int], quaternion: Sequence[int], axis: int) -> Mapping[int, int]:
        """The axis of the body, along which the position moves."""
        w, *rest = quaternion
        unit = [self.number(int(axis == row)) for row in range(3)]
        # u + 2 (w (r x u) + r x (r x u)) / |quaternion|^2
        across = self.cross(rest, unit)
        turned = [self.sum(*pair) for pair in zip(self._times(w, across), self.cross(rest, across), strict=True)]
        scale = self.quotient(self.number(2), self.dot(quaternion, quaternion))
        return {place: self.sum(*pair) for place, *pair in zip(position, unit, self._times(scale, turned), strict=True)}

    def _times(self, factor: int, values: Sequence[int]) -> list[int]:
        return [self.product(factor, value) for value in values]


def inverse_dynamics_derivatives(
    mechanism: Mechanism, program: StraightLineProgram, linear_velocity_in_body: bool = False
) -> StraightLineProgram:
    """The derivatives of tau that give accelerations a, by q, v and a, from the inputs q, v, a, time and parameters.

    ``program`` is one of the mechanism's charts. Each of the outputs ``by_position``, ``by_velocity`` and ``by_acceleration`` holds nv
    columns of nv entries, one column after the other [N or N m, per unit].
    """
    nq, nv = mechanism.nq, mechanism.nv
    writer = _Writer(mechanism, _with_accelerations(mechanism, program), linear_velocity_in_body)
    equations = writer.appended(program, writer.third)
    rows, free = _rows(equations["mass"], nv), writer.free(equations)
    forces = [writer.difference(writer.dot(row, writer.third), rest) for row, rest in zip(rows, free, strict=True)]
    directions = list(writer.directions())
    forces_alone = writer.program({_FORCES: forces, BY_ACCELERATION: [entry for row in rows for entry in row]})
    found = differentiate(forces_alone, [_FORCES], [*directions, *range(nq, nq + nv)])
    columns = _by_columns(found.outputs[derivative_name(_FORCES)], 2 * nv)
    outputs = {BY_POSITION: columns[: nv * nv], BY_VELOCITY: columns[nv * nv :], BY_ACCELERATION: found.outputs[BY_ACCELERATION]}
    return without_unused(replace(found, outputs=outputs))


def forward_dynamics_derivatives(
    mechanism: Mechanism, program: StraightLineProgram, linear_velocity_in_body: bool = False
) -> StraightLineProgram:
    """The derivatives of the accelerations by q, v and tau, from the inputs of ``program``, one of the mechanism's charts.

    Each of the outputs ``by_position``, ``by_velocity`` and ``by_force`` holds nv columns of nv entries, one column after the other.
    """
    nv = mechanism.nv
    writer = _Writer(mechanism, program.inputs, linear_velocity_in_body)
    equations = writer.appended(program, writer.third)
    accelerations = writer.solved(equations["mass"], writer.free(equations, writer.third))
    of_forces = writer.appended(inverse_dynamics_derivatives(mechanism, program, linear_velocity_in_body), accelerations)

    def solved(columns: Sequence[int]) -> list[int]:
        return [entry for at in range(0, nv * nv, nv) for entry in writer.solved(equations["mass"], columns[at : at + nv])]

    outputs = {name: solved([writer.negative(entry) for entry in of_forces[name]]) for name in (BY_POSITION, BY_VELOCITY)}
    outputs[BY_FORCE] = solved([writer.number(int(row == column)) for column in range(nv) for row in range(nv)])
    return without_unused(writer.program(outputs))


def terms_of_forces(mechanism: Mechanism, program: StraightLineProgram, linear_velocity_in_body: bool = False) -> StraightLineProgram:
    """As ``inverse_dynamics_derivatives``, of each term of the forces by itself: outputs named by ``TERMS``.

    Each holds 2 nv columns of nv entries, by positions and by velocities.
    """
    nq, nv = mechanism.nq, mechanism.nv
    writer = _Writer(mechanism, _with_accelerations(mechanism, program), linear_velocity_in_body)
    terms = _terms(writer, writer.appended(program, writer.third))
    directions = list(writer.directions())
    found = differentiate(writer.program(terms), list(terms), [*directions, *range(nq, nq + nv)])
    outputs = {name: _by_columns(found.outputs[derivative_name(name)], 2 * nv) for name in terms}
    return without_unused(replace(found, outputs=outputs))


def sizes_of_parts(
    mechanism: Mechanism, program: StraightLineProgram, linear_velocity_in_body: bool = False, *, of_accelerations: bool
) -> StraightLineProgram:
    """How large the parts are that an algorithm may form of a column of derivatives and cancel, from the inputs of ``program``.

    ``of_accelerations``: accelerations stand in the place of applied forces. The output "sizes" holds 3 nv numbers in the order of the
    columns of derivatives. Forces on what turns change with its angle by as much as they are large: a column by a rotating coordinate
    has parts as large as the separate forces, and as twice the kinetic energy as a torque on each rotating coordinate, which is
    ``harness.certify.reference.Reference.motion``; one by a velocity has what becomes of this by a unit of the velocity. Springs and
    dampers may pull at either side of what a coordinate moves: a column has as parts what coordinates that move with the same kinetic
    energy do to their forces. Lengths are kinetic-energy norms of accelerations, which are those of forces in the inverse of M.
    """
    nq, nv = mechanism.nq, mechanism.nv
    inputs = _with_accelerations(mechanism, program) if of_accelerations else program.inputs
    writer = _Writer(mechanism, inputs, linear_velocity_in_body)
    equations = writer.appended(program, writer.third)
    mass, rows = equations["mass"], _rows(equations["mass"], nv)
    units = [writer.add("sqrt", rows[place][place]) for place in range(nv)]

    def length(forces: Sequence[int]) -> int:
        return writer.add("sqrt", writer.dot(forces, writer.solved(mass, forces)))

    def of_elements(directions: Sequence[Mapping[int, int]]) -> int:
        columns = [writer.along(equations["passive"], direction) for direction in directions]
        return writer.total(writer.quotient(length(column), unit) for column, unit in zip(columns, units, strict=True))

    if of_accelerations:
        forces = list(_terms(writer, equations).values())
    else:
        forces = [equations["velocity"], equations["gravity"], equations["passive"], writer.third, writer.free(equations, writer.third)]
    total = writer.total(length(one) for one in forces)
    rotating = [place for place, rotates in enumerate(mechanism.rotating) if rotates]
    torques = writer.total(length([writer.number(int(row == place)) for row in range(nv)]) for place in rotating)
    rates, one = writer.given[nq : nq + nv], writer.number(1)
    twice_the_energy = writer.dot(rates, [writer.dot(row, rates) for row in rows])
    by_turn = writer.sum(total, writer.product(twice_the_energy, torques))
    speed = writer.product(writer.number(2), writer.product(writer.add("sqrt", twice_the_energy), torques))
    by_position, by_velocity = of_elements(list(writer.directions())), writer.sum(speed, of_elements([{rate: one} for rate in rates]))
    sizes = [writer.product(by_position, unit) for unit in units]
    for place in rotating:
        sizes[place] = writer.sum(sizes[place], by_turn)
    sizes += [writer.product(by_velocity, unit) for unit in units]
    return without_unused(writer.program({"sizes": [*sizes, *[writer.number(0)] * nv]}))


def _with_accelerations(mechanism: Mechanism, program: StraightLineProgram) -> list[str]:
    """The names of a program's inputs with accelerations in the place of applied forces."""
    nq, nv = mechanism.nq, mechanism.nv
    return [*program.inputs[: nq + nv], *(f"qdd{place}" for place in range(nv)), *program.inputs[nq + 2 * nv :]]


def _terms(writer: _Writer, equations: Mapping[str, Sequence[int]]) -> dict[str, list[int]]:
    """M a, c, g and -p."""
    inertial = [writer.dot(row, writer.third) for row in _rows(equations["mass"], writer.nv)]
    passive = [writer.negative(force) for force in equations["passive"]]
    return dict(zip(TERMS, (inertial, list(equations["velocity"]), list(equations["gravity"]), passive), strict=True))


def _by_columns(entries: Sequence[int], columns: int) -> tuple[int, ...]:
    """Entries that stand by rows, one column after the other."""
    return tuple(place for column in range(columns) for place in entries[column::columns])


def _rows(upper: Sequence[int], nv: int) -> list[list[int]]:
    """A symmetric matrix, given by its upper triangle."""
    entries = dict(zip(upper_triangle(nv), upper, strict=True))
    return [[entries[min(i, j), max(i, j)] for j in range(nv)] for i in range(nv)]
