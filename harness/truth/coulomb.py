"""Rigid contact with Coulomb's friction: every acceleration that is consistent at one state, in balls.

The surfaces of a closed contact part, or stay together, and then stick or slide. With the manner of each contact given, accelerations and
forces solve linear equations,

    M a - N' n - T' t = f,    N a = -N' v of closed contacts,    T a = -T' v of those that stick,    t = -mu n d of slides along d,

and are consistent where n >= 0, |t| <= mu n of what sticks, surfaces that part do not approach, and what begins to slide does so against
its friction. A slip has one component or two, of which the latter makes |t| the length of a vector, and d of what begins to slide an
unknown (``harness.truth.sliding``). Several manners may be consistent, or none: Painleve's rod has states of either kind. Where rows follow
from one another, as those of a box on four corners, the forces are not unique, and any that are consistent will do; what they do to the
coordinates is unique.

Sources: Pfeiffer, Glocker, Multibody Dynamics with Unilateral Contacts, sections 5.2 and 5.3; Brogliato, Nonsmooth Mechanics, 3rd ed.,
section 5.6 (Painleve's paradox).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.programs.evaluation import BALLS, mass_matrix, solved
from harness.programs.mechanisms.mechanism import BIAS, JACOBIAN, RATE, RESIDUAL, Mechanism
from harness.programs.numbers import length_of_balls
from harness.programs.program import StraightLineProgram, right_hand_side
from harness.truth.sliding import BeginningSlide, Direction

BITS = 256
# Combinations of manners that are tried at one state.
MOST_COMBINATIONS = 4096
# Slips below this part of the velocities that make them are those of surfaces at rest on one another.
_AT_REST = 1e-12
# Accelerations that are one, relative to the largest, and singular values of rows that follow from others.
_SAME, _DEPENDENT = 1e-12, 1e-9


class Manner(StrEnum):
    """The manner in which a closed contact goes on; a slip of one component slides to the one side or back, one of two in any direction."""

    PARTS = "parts"
    STAYS = "stays"
    STICKS = "sticks"
    SLIDES = "slides"
    SLIDES_BACK = "slides back"


@dataclass(frozen=True)
class RigidContact:
    """A contact of a mechanism.

    Attributes:
        rows: its places among the rows of the program: the gap, and the one or two of the slip where it rubs.
        friction: the parameter by which it rubs.
    """

    name: str
    rows: tuple[int, ...]
    friction: str = ""


@dataclass(frozen=True)
class RigidAnswer:
    """One consistent acceleration.

    Attributes:
        manners: of each closed contact, by its name. accelerations: (nv,). forces: (nv,), what the contacts do to the coordinates.
        normal: normal force of each closed contact [N], of those that are not unique one choice.
    """

    manners: Mapping[str, Manner]
    accelerations: Array
    forces: Array
    normal: Mapping[str, float]


@dataclass(frozen=True)
class _Rows:
    """Equations of motion and rows of closed contacts at one state, in balls: M a = force, and rows a = -bias."""

    mass: Any
    force: Sequence[Any]
    rows: Sequence[Sequence[Any]]
    rates: Sequence[Any]
    bias: Sequence[Any]
    velocities: Sequence[float]

    def is_at_rest(self, rows: Sequence[int]) -> bool:
        return all(abs(float(self.rates[row])) <= _AT_REST * self._size(row) for row in rows)

    def _size(self, row: int) -> float:
        return sum(abs(float(entry)) * abs(v) for entry, v in zip(self.rows[row], self.velocities, strict=True))


@dataclass(frozen=True)
class _Branch:
    """A manner of a contact, and where it slides the direction; () where that is to be found."""

    manner: Manner
    along: Direction = ()


class RigidContacts:
    """The contacts of a mechanism, whose equations of motion are those between contacts; ``rows`` is a program as of ``Constraints``."""

    def __init__(self, mechanism: Mechanism, contacts: Sequence[RigidContact], rows: StraightLineProgram) -> None:
        self._mechanism, self._contacts, self._program = mechanism, {one.name: one for one in contacts}, rows

    def gaps(self, q: Sequence[float]) -> dict[str, float]:
        """The distance of the surfaces of each contact at (nq,) [m]."""
        import flint

        with flint.ctx.workprec(BITS):
            values = _values(self._program, self._inputs(q, [0.0] * self._mechanism.nv))
        return {name: float(values[RESIDUAL][one.rows[0]]) for name, one in self._contacts.items()}

    def answers(self, q: Sequence[float], v: Sequence[float], closed: Sequence[str]) -> list[RigidAnswer]:
        """All consistent accelerations at (nq,) and (nv,), where the surfaces of ``closed`` touch and do not approach.

        Raises:
            ValueError: so many contacts are closed that not all manners can be tried, or several at rest may slide in two directions.
        """
        import flint

        with flint.ctx.workprec(BITS):
            at = self._rows_at(self._inputs(q, v), v)
            contacts = [self._contacts[name] for name in closed]
            values = {name: flint.arb(value) for name, value, _ in self._mechanism.parameters}
            choices = [_branches(one, at) for one in contacts]
            if math.prod(map(len, choices)) > MOST_COMBINATIONS:
                raise ValueError(f"{len(contacts)} closed contacts have too many manners to try")
            found, size = list[RigidAnswer](), max((abs(float(one)) for one in solved(at.mass, at.force)), default=0.0)
            for branches in itertools.product(*choices):
                for directed in _directed(at, contacts, branches, values):
                    answer = _Combination(at, contacts, directed, values).answer()
                    if answer is not None and not any(_is_same(answer, other, size) for other in found):
                        found.append(answer)
        return found

    def _inputs(self, q: Sequence[float], v: Sequence[float]) -> list[Any]:
        import flint

        values = (*q, *v, *[0.0] * self._mechanism.nv, 0.0, *self._mechanism.parameter_values)
        return [flint.arb(float(value)) for value in values]

    def _rows_at(self, inputs: Sequence[Any], v: Sequence[float]) -> _Rows:
        nv = self._mechanism.nv
        motion, rows = _values(self._mechanism.program, inputs), _values(self._program, inputs)
        force = right_hand_side(motion, inputs[self._mechanism.nq + nv :][:nv])
        jacobian = [rows[JACOBIAN][start : start + nv] for start in range(0, len(rows[JACOBIAN]), nv)]
        return _Rows(mass_matrix(motion["mass"], nv), force, jacobian, rows[RATE], rows[BIAS], v)


def _values(program: StraightLineProgram, inputs: Sequence[Any]) -> dict[str, list[Any]]:
    values = BALLS.values(program, inputs)
    return {name: [values[place] for place in places] for name, places in program.outputs.items()}


def _branches(contact: RigidContact, at: _Rows) -> tuple[_Branch, ...]:
    parts, slips = _Branch(Manner.PARTS), contact.rows[1:]
    if not slips:
        return parts, _Branch(Manner.STAYS)
    both = _Branch(Manner.SLIDES, (1,)), _Branch(Manner.SLIDES_BACK, (-1,))
    if at.is_at_rest(slips):
        return parts, _Branch(Manner.STICKS), *(both if len(slips) == 1 else (_Branch(Manner.SLIDES),))
    if len(slips) == 1:
        return parts, both[0] if float(at.rates[slips[0]]) > 0 else both[1]
    speed = length_of_balls(at.rates[row] for row in slips)
    return parts, _Branch(Manner.SLIDES, tuple(at.rates[row] / speed for row in slips))


def _directed(
    at: _Rows, contacts: Sequence[RigidContact], branches: Sequence[_Branch], friction: Mapping[str, Any]
) -> Iterator[Sequence[_Branch]]:
    """The same with each direction that a contact may begin to slide along."""
    unknown = [place for place, branch in enumerate(branches) if branch.manner is Manner.SLIDES and not branch.along]
    if not unknown:
        yield branches
        return
    if len(unknown) > 1:
        raise ValueError(f"{len(unknown)} contacts at rest may slide in two directions each; the directions of one alone are found")
    (place,) = unknown
    slide = _Combination(at, contacts, branches, friction).beginning(contacts[place])
    for direction in slide.directions() if slide is not None else ():
        yield [*branches[:place], _Branch(Manner.SLIDES, direction), *branches[place + 1 :]]


def _is_same(one: RigidAnswer, other: RigidAnswer, size: float) -> bool:
    """True for two accelerations that are one but for rounding, beside those without contacts, of ``size``."""
    room = _SAME * max(size, *np.abs(one.accelerations), *np.abs(other.accelerations))
    return bool(np.abs(one.accelerations - other.accelerations).max() <= room)


class _Combination:
    """Closed contacts of which each goes on in a manner of its own."""

    def __init__(self, at: _Rows, contacts: Sequence[RigidContact], branches: Sequence[_Branch], friction: Mapping[str, Any]) -> None:
        self._at, self._friction = at, friction
        self._contacts = list(zip(contacts, branches, strict=True))
        # Rows that are held, and what a multiplier of each does to the coordinates.
        self._held: list[tuple[RigidContact, int, list[Any]]] = []
        for contact, branch in self._contacts:
            if branch.manner is Manner.PARTS:
                continue
            normal = list(at.rows[contact.rows[0]])
            for row, part in zip(contact.rows[1:], branch.along, strict=False):
                rubbing = -part * friction[contact.friction]
                normal = [one + rubbing * other for one, other in zip(normal, at.rows[row], strict=True)]
            self._held.append((contact, contact.rows[0], normal))
            if branch.manner is Manner.STICKS:
                self._held.extend((contact, row, list(at.rows[row])) for row in contact.rows[1:])

    def beginning(self, contact: RigidContact) -> BeginningSlide | None:
        """The slide of a contact, whose direction is unknown; None where forces are not unique without its friction.

        Raises:
            ValueError: rows follow from others.
        """
        chosen, nv = self._independent(), len(self._at.force)
        if len(chosen) < len(self._held):
            raise ValueError(f"contact {contact.name!r} may begin to slide in two directions while rows of others follow from one another")
        rows = [self._at.rows[row] for row in contact.rows[1:]]
        found = self._solution(chosen, [self._at.force, *rows])
        if found is None:
            return None
        place = nv + next(number for number, (one, row, _) in enumerate(self._held) if one is contact and row == contact.rows[0])
        free, *pushed = ([found[line, column] for line in range(nv)] for column in range(3))
        return BeginningSlide(
            self._friction[contact.friction],
            found[place, 0],
            [found[place, 1], found[place, 2]],
            [self._along(row, free) for row in contact.rows[1:]],
            [[sum((one * a for one, a in zip(row, push, strict=True)), 0 * push[0]) for push in pushed] for row in rows],
        )

    def answer(self) -> RigidAnswer | None:
        """The answer that is consistent with the manners; None without one.

        Raises:
            ValueError: forces that are not unique are bounded by a cone.
        """
        chosen = self._independent()
        rest = [number for number in range(len(self._held)) if number not in chosen]
        if rest and any(branch.manner is Manner.STICKS and len(one.rows) > 2 for one, branch in self._contacts):
            raise ValueError("rows of closed contacts follow from one another, and one of the contacts sticks in two directions")
        given = self._shared() if rest else {}
        if given is None:
            return None
        multipliers = {number: given[number] for number in rest}
        accelerations = self._solved(chosen, multipliers)
        if accelerations is None:
            return None
        if not all(self._is_held(number, accelerations) for number in rest) or not self._is_consistent(accelerations, multipliers):
            return None
        forces = [
            sum((multipliers[number] * column[place] for number, (_, _, column) in enumerate(self._held)), 0 * accelerations[place])
            for place in range(len(accelerations))
        ]
        normal = {one.name: float(multipliers[number]) for number, (one, row, _) in enumerate(self._held) if row == one.rows[0]}
        manners = {one.name: branch.manner for one, branch in self._contacts}
        return RigidAnswer(manners, np.array([*map(float, accelerations)]), np.array([*map(float, forces)]), normal)

    def _independent(self) -> list[int]:
        """Numbers of rows that follow from no others, as many as there are."""
        chosen: list[int] = []
        for number in range(len(self._held)):
            rows = np.array([[float(entry) for entry in self._at.rows[self._held[one][1]]] for one in (*chosen, number)])
            sizes = np.linalg.norm(rows, axis=1, keepdims=True)
            if np.linalg.svd(rows / np.where(sizes > 0, sizes, 1.0), compute_uv=False)[-1] > _DEPENDENT and len(rows) <= rows.shape[1]:
                chosen.append(number)
        return chosen

    def _solved(self, chosen: Sequence[int], multipliers: dict[int, Any]) -> list[Any] | None:
        """Accelerations, with the multipliers of the chosen rows beside those that are given; None where they are not unique."""
        import flint

        nv = len(self._at.force)
        force = [
            own + sum((given * self._held[number][2][place] for number, given in multipliers.items()), flint.arb(0))
            for place, own in enumerate(self._at.force)
        ]
        solution = self._solution(chosen, [force])
        if solution is None:
            return None
        for place, number in enumerate(chosen):
            multipliers[number] = solution[nv + place, 0]
        return [solution[place, 0] for place in range(nv)]

    def _solution(self, chosen: Sequence[int], forces: Sequence[Sequence[Any]]) -> Any:
        """Accelerations and then multipliers of the chosen rows, a column for each of ``forces``; the rows' own bias bears on the first.

        None where they are not unique.
        """
        import flint

        at, nv = self._at, len(self._at.force)
        matrix = [[at.mass[i, j] for j in range(nv)] + [-self._held[number][2][i] for number in chosen] for i in range(nv)]
        matrix += [[*at.rows[self._held[number][1]], *[flint.arb(0)] * len(chosen)] for number in chosen]
        right = [[force[i] for force in forces] for i in range(nv)]
        right += [[-at.bias[self._held[number][1]], *[flint.arb(0)] * (len(forces) - 1)] for number in chosen]
        try:
            return flint.arb_mat(matrix).solve(flint.arb_mat(right))
        except ZeroDivisionError:
            return None

    def _along(self, row: int, accelerations: Sequence[Any]) -> Any:
        """The second derivative of what a row leaves."""
        return sum((one * a for one, a in zip(self._at.rows[row], accelerations, strict=True)), self._at.bias[row])

    def _is_held(self, number: int, accelerations: Sequence[Any]) -> bool:
        size = max(abs(float(one)) for one in (*accelerations, self._at.bias[self._held[number][1]]))
        return abs(float(self._along(self._held[number][1], accelerations))) <= _DEPENDENT * size

    def _is_consistent(self, accelerations: Sequence[Any], multipliers: Mapping[int, Any]) -> bool:
        """False where an inequality certainly does not hold."""
        return not any(one < 0 for one in self._margins(accelerations, multipliers))

    def _margins(self, accelerations: Sequence[Any], multipliers: Mapping[int, Any]) -> Iterator[Any]:
        by_row = {row: multipliers[number] for number, (_, row, _) in enumerate(self._held)}
        for contact, branch in self._contacts:
            slips = contact.rows[1:]
            if branch.manner is Manner.PARTS:
                yield self._along(contact.rows[0], accelerations)
                continue
            normal = by_row[contact.rows[0]]
            yield normal
            if branch.manner is Manner.STICKS:
                yield self._friction[contact.friction] * normal - length_of_balls(by_row[row] for row in slips)
            elif branch.along and self._at.is_at_rest(slips):
                yield sum(part * self._along(row, accelerations) for row, part in zip(slips, branch.along, strict=True))

    def _shared(self) -> dict[int, Any] | None:
        """Multipliers of all rows, of which some follow from others, that are as far within their bounds as any; None where none is within.

        Only those of rows that follow from others are kept; the others are solved for.
        """
        import flint
        from scipy.optimize import linprog

        at, nv, count = self._at, len(self._at.force), len(self._held)
        mass = np.array([[float(at.mass[i, j]) for j in range(nv)] for i in range(nv)])
        columns = np.array([[float(entry) for entry in column] for _, _, column in self._held]).T
        rows = np.array([[float(entry) for entry in at.rows[row]] for _, row, _ in self._held])
        bias = np.array([float(at.bias[row]) for _, row, _ in self._held])
        free = np.linalg.solve(mass, np.array([*map(float, at.force)]))
        equal = rows @ np.linalg.solve(mass, columns)
        bounds, size = [], float(np.abs(mass @ free).max()) or 1.0
        normals = {contact.name: number for number, (contact, row, _) in enumerate(self._held) if row == contact.rows[0]}
        for number, (contact, row, _) in enumerate(self._held):
            for sign in (1.0, -1.0) if row != contact.rows[0] else (0.0,):
                bound = np.zeros(count + 1)
                bound[normals[contact.name]] = -float(self._friction[contact.friction]) if sign else -1.0
                bound[number] += sign
                bound[-1] = 1.0
                bounds.append(bound)
        slack = np.zeros((count, 1))
        # The slack is the least margin; more of it than all other forces is of no use.
        found = linprog(
            np.array([*[0.0] * count, -1.0]),
            A_ub=np.array(bounds),
            b_ub=np.zeros(len(bounds)),
            A_eq=np.hstack([equal, slack]),
            b_eq=-bias - rows @ free,
            bounds=[(None, None)] * count + [(None, size)],
        )
        if found.status != 0 or found.x[-1] < -_SAME * size:
            return None
        return {number: flint.arb(float(value)) for number, value in enumerate(found.x[:-1])}
