"""Contacts that give by Coulomb's law: the solutions of their problem of complementarity, proved in balls.

Forces are functions of y = J a - aref, see ``harness.files.rules``, so that accelerations solve

    F(a) = M a - M a0 - J' f(J a - aref) = 0.

With the zone of each contact, and the side of each range, F is smooth. No cost has these forces: there may be several solutions, or none.
They are sought by Newton's method from all combinations of what contacts may do, where these are few, in float64. With the zones of one,
Krawczyk's test proves that there is a solution in a box, and one alone, and the box shows that it lies in these zones. A box that meets
an edge is 2^-160 wide, and there both zones have one force: it is a solution for an aref that is so much another. Equations that are
linear around y have the solution too, but for the square of what rounds y to twice float64's digits.

Sources: Krawczyk, Newton-Algorithmen zur Bestimmung von Nullstellen mit Fehlerschranken, Computing 4 (1969); Moore, Kearfott, Cloud,
Introduction to Interval Analysis, section 8.2; De Saxce, Feng, The bipotential method, Mathl. Comput. Modelling 28 (1998).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.programs.kernels import BallKernel
from harness.programs.mechanisms.clamps import Ranges
from harness.programs.mechanisms.combinations import candidates
from harness.programs.mechanisms.cones import Zone
from harness.programs.mechanisms.descent import problem_of
from harness.programs.mechanisms.mechanism import JACOBIAN, Mechanism
from harness.programs.mechanisms.zones import Sides, Zones
from harness.programs.numbers import length_of_balls
from harness.programs.program import StraightLineProgram, upper_triangle
from harness.programs.states import States
from harness.storage import Kept

_BITS = 256
# Of the largest acceleration: the half width of a box, and what the equations that are linear around y may leave.
_HALF_WIDTH, _LEFT = -160, -128
# Newton's steps in balls.
_SHARPENED = 8
# An acceleration where all are 0, and what rows leave where nobody has begun.
_LEAST, _NOWHERE = 1.0, 1.0
_KERNELS: Kept[BallKernel] = Kept(32)


@dataclass(frozen=True)
class Modes:
    """The doings of rows at one state: the side of each range, -1 below it, 0 inside and 1 beyond, and the zone of each contact."""

    sides: Sequence[float]
    zones: Sequence[Zone]


@dataclass(frozen=True)
class Solution:
    """A proved solution: balls of accelerations, (nv,), and of y of all rows."""

    accelerations: Sequence[Any]
    left: Sequence[Any]
    modes: Modes


@dataclass(frozen=True)
class StateProblem:
    """The problem at one state, in balls: M, M a0, J, aref and D, ranges of the first rows, and cones of those behind them.

    Attributes:
        cones: first row, mu_j, of each; R is one for all rows of a cone.
    """

    mass: Any
    force: Any
    jacobian: Any
    wanted: Any
    weights: Sequence[Any]
    ranges: Sequence[tuple[float, float]]
    cones: Sequence[tuple[int, Sequence[Any]]]

    @classmethod
    def of(
        cls,
        problem: StraightLineProgram,
        values: Iterable[Any],
        ranges: Sequence[tuple[float, float]],
        cones: Iterable[tuple[int, Sequence[Any]]],
    ) -> StateProblem:
        """From the values of the outputs of ``SoftenedProgram.problem``, one after the other."""
        import flint

        rest = iter(values)
        outputs = {name: list(itertools.islice(rest, len(places))) for name, places in problem.outputs.items()}
        nv, mass = len(outputs["force"]), iter(outputs["mass"])
        full = flint.arb_mat(nv, nv)
        for i, j in upper_triangle(nv):
            full[i, j] = full[j, i] = next(mass)
        rows = [outputs[JACOBIAN][start : start + nv] for start in range(0, len(outputs[JACOBIAN]), nv)]
        force, wanted = (flint.arb_mat([[one] for one in outputs[name]]) for name in ("force", "wanted"))
        return cls(full, force, flint.arb_mat(rows), wanted, outputs["weights"], ranges, list(cones))

    def proved(self, start: Array) -> Solution | None:
        """The solution near accelerations ``start``, (nv,); None where none is proved."""
        import flint

        centre = flint.arb_mat([[flint.arb(float(one))] for one in start])
        try:
            for _ in range(_SHARPENED):
                modes = self._modes(self._left(centre))
                centre = (centre - self._step(centre, modes)).mid()
            modes, nv = self._modes(self._left(centre)), centre.nrows()
            half = flint.arb(self._size(centre)) * flint.arb(2) ** _HALF_WIDTH
            box = flint.arb_mat([[flint.arb(centre[place, 0], half)] for place in range(nv)])
            _, weights = self._forces(self._left(box), modes)
            # It encloses the derivative of F all over the box.
            system = self._system(weights)
            inverse = system.mid().inv().mid()
        except ZeroDivisionError:
            return None
        unit = flint.arb_mat(nv, nv, [int(i == j) for i in range(nv) for j in range(nv)])
        image = centre - inverse * self._missing(centre, modes) + (unit - inverse * system) * (box - centre)
        left = self._left(image)
        if not all(box[place, 0].contains_interior(image[place, 0]) for place in range(nv)) or not self._may_be(left, modes):
            return None
        return Solution(_column(image), _column(left), modes)

    def has(self, solution: Solution, towards: Sequence[Any]) -> bool:
        """True where the equations with the derivatives of forces at ``towards``, (rows,), are solved by the solution."""
        import flint

        y = flint.arb_mat([[one] for one in towards])
        values, weights = self._forces(y, solution.modes)
        try:
            found = self._system(weights).solve(self.force + self.jacobian.transpose() * (values + weights * (self.wanted + y)))
        except ZeroDivisionError:
            return False
        room = flint.arb(self._size(found)) * flint.arb(2) ** _LEFT
        return all(abs(one - other) <= room for one, other in zip(_column(found), solution.accelerations, strict=True))

    def _size(self, accelerations: Any) -> float:
        """The largest, of those without forces of rows too."""
        return max(_bound(one) for one in (*_column(accelerations), *_column(self.mass.solve(self.force)))) or _LEAST

    def _left(self, accelerations: Any) -> Any:
        return self.jacobian * accelerations - self.wanted

    def _missing(self, accelerations: Any, modes: Modes) -> Any:
        """F, (nv, 1)."""
        return self.mass * accelerations - self.force - self.jacobian.transpose() * self._forces(self._left(accelerations), modes)[0]

    def _system(self, weights: Any) -> Any:
        return self.mass + self.jacobian.transpose() * (weights * self.jacobian)

    def _step(self, centre: Any, modes: Modes) -> Any:
        return self._system(self._forces(self._left(centre), modes)[1]).solve(self._missing(centre, modes))

    def _modes(self, left: Any) -> Modes:
        """Those of rows that leave ``left``, (rows, 1); on an edge one of both."""
        sides, zones = list[float](), list[Zone]()
        for row, (low, high) in enumerate(self.ranges):
            free = -self.weights[row] * left[row, 0]
            sides.append(-1.0 if low == high or free < low else 1.0 if free > high else 0.0)
        for first, friction in self.cones:
            normal, excess, _ = _edges(friction, left, first)
            zones.append(Zone.PARTS if not normal < 0 else Zone.SLIDES if excess > 0 else Zone.STICKS)
        return Modes(sides, zones)

    def _may_be(self, left: Any, modes: Modes) -> bool:
        """False where rows that leave ``left`` certainly do something else than by ``modes``."""
        for row, ((low, high), side) in enumerate(zip(self.ranges, modes.sides, strict=True)):
            free = -self.weights[row] * left[row, 0]
            if low < high and ((side <= 0 and free > (low if side else high)) or (side >= 0 and free < (high if side else low))):
                return False
        for (first, friction), zone in zip(self.cones, modes.zones, strict=True):
            normal, excess, across = _edges(friction, left, first)
            others = {Zone.PARTS: normal < 0, Zone.STICKS: excess > 0, Zone.SLIDES: normal > 0 or excess < 0 or not across > 0}
            if others[zone]:
                return False
        return True

    def _forces(self, left: Any, modes: Modes) -> tuple[Any, Any]:
        """Forces of rows that leave ``left``, (rows, 1), and minus their derivatives by it, (rows, rows)."""
        import flint

        count = left.nrows()
        values, weights = flint.arb_mat(count, 1), flint.arb_mat(count, count)
        for row, weight in enumerate(self.weights):
            values[row, 0], weights[row, row] = -weight * left[row, 0], weight
        for row, (bounds, side) in enumerate(zip(self.ranges, modes.sides, strict=True)):
            if side:
                values[row, 0], weights[row, row] = flint.arb(bounds[side > 0]), flint.arb(0)
        for (first, friction), zone in zip(self.cones, modes.zones, strict=True):
            rows = range(first, first + 1 + len(friction))
            if zone == Zone.PARTS:
                for row in rows:
                    values[row, 0] = weights[row, row] = flint.arb(0)
            elif zone == Zone.SLIDES:
                self._slide(rows, friction, left, (values, weights))
        return values, weights

    def _slide(self, rows: range, friction: Sequence[Any], left: Any, found: tuple[Any, Any]) -> None:
        """Set the forces and derivatives of a contact that slides, as in ``harness.programs.mechanisms.cones``."""
        values, weights = found
        weight, normal, (_, _, across) = self.weights[rows[0]], left[rows[0], 0], _edges(friction, left, rows[0])
        along = [own * left[row, 0] / across for own, row in zip(friction, rows[1:], strict=True)]
        for row, own, part in zip(rows[1:], friction, along, strict=True):
            values[row, 0], weights[row, rows[0]] = weight * own * normal * part, -weight * own * part
            for column, other, beside in zip(rows[1:], friction, along, strict=True):
                weights[row, column] = -weight * own * other * normal / across * (int(row == column) - part * beside)


def _edges(friction: Sequence[Any], left: Any, first: int) -> tuple[Any, Any, Any]:
    """y_1 of a contact, mu N + T, which is positive where it does not stick, and T."""
    lateral = [own * left[first + 1 + place, 0] for place, own in enumerate(friction)]
    across = length_of_balls(lateral)
    return left[first, 0], friction[0] * friction[0] * left[first, 0] + across, across


def settle(zones: Zones, problem: StraightLineProgram, inputs: Array, found: Array, ranges: Ranges) -> None:
    """Set what forces and contacts do in the parameters ``found`` of each state; arguments as of ``sides_at_least``.

    Of several solutions it is the nearest to where rows are ``begun_at``. Shares are NaN where no solution is proved, and where several
    are that nothing chooses from.
    """
    import flint

    own, sides = problem_of(zones, problem, inputs, found, ranges), zones.sides(np.zeros(ranges[0].shape))
    places, is_proved = [place for cone in zones.cones for place in cone.towards], np.zeros(len(found), dtype=np.bool_)
    # What does not slide has no direction there, which would be that of nothing.
    begun = found[:, places]
    found[:, places] = _NOWHERE
    with flint.ctx.workprec(_BITS):
        evaluate = _KERNELS.get(problem.key, lambda: BallKernel(problem, 0)).bind([])
        for state, row in enumerate(inputs[: len(problem.inputs)].T.tolist()):
            if not np.isfinite(row).all():
                continue
            bounds = list(zip(ranges[0][state].tolist(), ranges[1][state].tolist(), strict=True))
            at = StateProblem.of(problem, evaluate(*row), bounds, _cones(zones, found[state]))
            near = None if (begun[state] == _NOWHERE).all() else begun[state]
            solutions = distinct(map(at.proved, candidates(own[np.array([state])], near)))
            if near is not None:
                solutions = sorted(solutions, key=partial(_distance, begun[state], len(zones.clamps)))[:1]
            is_proved[state] = len(solutions) == 1 and _put(sides, state, at, solutions[0])
    zones.put(found, ranges, sides, is_proved)


def begun_at(mechanism: Mechanism, states: States, values: Array, accelerations: Array) -> Array:
    """Parameters of n states, (n, parameters), with which ``settle`` takes, of several solutions, the nearest to ``accelerations``."""
    zones, problem = getattr(mechanism, "zones", None), getattr(mechanism, "problem", None)
    if zones is None or problem is None or all(cone.flow.is_convex for cone in zones.cones):
        return values
    own = problem_of(zones, problem, mechanism.inputs(states, values), values, None)
    found, first = values.copy(), len(zones.clamps)
    for cone, part in zip(zones.cones, zones.parts, strict=True):
        found[:, list(cone.towards)] = own.left_by(accelerations)[:, first + part.start : first + part.stop]
    return found


def _distance(begun: Array, first: int, solution: Solution) -> float:
    return float(np.linalg.norm([float(one) for one in solution.left[first : first + len(begun)]] - begun))


def _cones(zones: Zones, found: Array) -> Iterator[tuple[int, list[Any]]]:
    """See ``StateProblem``."""
    import flint

    for cone, part in zip(zones.cones, zones.parts, strict=True):
        yield len(zones.clamps) + part.start, [flint.arb(float(found[one])) for one in cone.friction]


def _put(sides: Sides, state: int, at: StateProblem, solution: Solution) -> bool:
    """Set the sides of a state; whether the equations around them have the solution."""
    import flint

    high = [float(one.mid()) for one in solution.left]
    rest = [float((one - whole).mid()) for one, whole in zip(solution.left, high, strict=True)]
    first = sides.clamps.shape[1]
    rows = slice(first, first + sides.towards.shape[1])
    sides.clamps[state], sides.cones[state] = solution.modes.sides, solution.modes.zones
    sides.towards[state], sides.rest[state] = high[rows], rest[rows]
    return at.has(solution, [flint.arb(one) + flint.arb(other) for one, other in zip(high, rest, strict=True)])


def distinct(solutions: Iterable[Solution | None]) -> list[Solution]:
    """Each once: boxes of one solution meet, and those of others certainly do not, or they are not counted as others."""
    found: list[Solution] = []
    for one in solutions:
        if one is not None and not any(_meet(one, other) for other in found):
            found.append(one)
    return found


def _meet(one: Solution, other: Solution) -> bool:
    return all(own.overlaps(beside) for own, beside in zip(one.accelerations, other.accelerations, strict=True))


def _column(matrix: Any) -> list[Any]:
    return [matrix[place, 0] for place in range(matrix.nrows())]


def _bound(ball: Any) -> float:
    return float(abs(ball).upper())
