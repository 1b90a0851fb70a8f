"""The optimum that MuJoCo documents for equalities, dry friction and limits, by another way than the harness: its dual, by active sets.

Rows are inside, below or above their ranges of forces; with (J M^-1 J' + R) f = aref - J a of those inside, rows that do not fit are
exchanged until all do, which proves the answer. All is computed with 50 digits and more, from the numbers that the test wrote into its
file; stiffness, damping and weights are rounded once, as the harness hands them on.

Source: MuJoCo documentation, Computation, sections Dual problem and Parameters; Modeling, section Solver parameters; Murty, Note on a
Bard-type scheme for solving the complementarity problem, Opsearch 11 (1974).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from flint import arb, arb_mat

DIGITS = 50
STEP = 0.002
# Exchanges of all rows that do not fit, and then of the first alone.
_OF_ALL, _EXCHANGES = 12, 200


@dataclass(frozen=True)
class Row:
    """One row of joints of one velocity, or of one velocity of another.

    Attributes:
        columns: places of v. positions: those of q. multiples: of each position in a sum.
        weight: the diagonal of J M^-1 J' at the reference, or its mean over a joint.
        loss: of dry friction; None otherwise. coefficients: of an equality, that the first position is this polynomial of the second.
        sign, bound, margin: of a limit.
        impedances, distances, stiffnesses, dampings, shares: factors of d, of the distance that it is that of, of k and b and of the
            force within its range, by which a test changes them.
        constraint, owner: names of what the row is one of, and of the joint or tendon.
    """

    columns: tuple[int, ...]
    weight: Any
    positions: tuple[int, ...] = ()
    multiples: tuple[Any, ...] = (1.0,)
    loss: Any = None
    coefficients: tuple[Any, ...] = ()
    sign: int = 1
    bound: Any = 0.0
    margin: Any = 0.0
    solref: tuple[float, float] = (0.02, 1.0)
    solimp: tuple[float, ...] = (0.9, 0.95, 0.001, 0.5, 2.0)
    impedances: Any = 1.0
    distances: Any = 1.0
    stiffnesses: Any = 1.0
    dampings: Any = 1.0
    shares: Any = 1.0
    constraint: str = ""
    owner: str = ""

    @property
    def range(self) -> tuple[Any, Any]:
        """The least and the largest force; None without one."""
        if self.loss is not None:
            return -arb(self.loss), arb(self.loss)
        return (None, None) if self.coefficients else (arb(0), None)

    def residual(self, q: Sequence[Any]) -> Any:
        if self.loss is not None:
            return arb(0)
        if self.coefficients:
            return q[self.positions[0]] - self._polynomial(q, 0)
        total = sum((arb(one) * q[place] for one, place in zip(self.multiples, self.positions, strict=True)), arb(0))
        return self.sign * (total - arb(self.bound)) - arb(self.margin)

    def jacobian(self, q: Sequence[Any]) -> dict[int, Any]:
        own = (arb(1), -self._polynomial(q, 1)) if self.coefficients else [self.sign * arb(one) for one in self.multiples]
        return dict(zip(self.columns, own, strict=True))

    def bias(self, q: Sequence[Any], v: Sequence[Any]) -> Any:
        """J' v."""
        return -self._polynomial(q, 2) * v[self.columns[1]] ** 2 if self.coefficients else arb(0)

    def _polynomial(self, q: Sequence[Any], order: int) -> Any:
        """A derivative at the second position."""
        found = arb(0)
        for power, one in enumerate(self.coefficients):
            factor = 1
            for less in range(order):
                factor *= power - less
            found += factor * arb(one) * q[self.positions[1]] ** max(0, power - order)
        return found

    def impedance(self, residual: Any) -> Any:
        least, most, width, midpoint, power = (arb(value) for value in self.solimp)
        least, most, midpoint = (min(max(value, arb(0.0001)), arb(0.9999)) for value in (least, most, midpoint))
        factor = arb(self.impedances)
        if self.loss is not None:
            return least * factor
        if width <= 0 or least == most:
            return (least + most) / 2 * factor
        x = abs(residual) * arb(self.distances) / width
        if x >= 1:
            return most * factor
        y = x**power / midpoint ** (power - 1) if x <= midpoint else 1 - (1 - x) ** power / (1 - midpoint) ** (power - 1)
        return (least + y * (most - least)) * factor

    def reference(self, residual: Any, rate: Any) -> Any:
        """aref but for J' v."""
        most = min(max(arb(self.solimp[1]), arb(0.0001)), arb(0.9999))
        if self.solref[0] > 0:
            time = max(arb(self.solref[0]), 2 * arb(STEP))
            stiffness, damping = 1 / (most * time * arb(self.solref[1])) ** 2, 2 / (most * time)
        else:
            stiffness, damping = -arb(self.solref[0]) / most**2, -arb(self.solref[1]) / most
        push = arb(float(stiffness)) * arb(self.stiffnesses) * self.impedance(residual) * residual
        return -arb(float(damping)) * arb(self.dampings) * rate - (push if self.loss is None else 0)

    def acts(self, q: Sequence[Any]) -> bool:
        return self.loss is not None or bool(self.coefficients) or bool(self.residual(q) < 0)

    def with_factor(self, name: str, place: int, factor: Any) -> Row:
        """With one of its numbers times ``factor``, if it has it."""
        value = getattr(self, name) if name != "shares" or not self.coefficients else None
        if isinstance(value, tuple):
            own = (*value[:place], arb(value[place]) * factor, *value[place + 1 :]) if place < len(value) > 1 else value
            return replace(self, **{name: own})
        return self if value is None else replace(self, **{name: arb(value) * factor})


# The rows that a number is of: each alone, those of one constraint, or of one joint or tendon.
_NUMBERS = {
    **dict.fromkeys(("weight", "shares", "loss", "bound", "coefficients"), None),
    **dict.fromkeys(("impedances", "distances", "stiffnesses", "dampings"), "constraint"),
    **dict.fromkeys(("margin", "multiples"), "owner"),
}


def changed(rows: Sequence[Row], factor: Any) -> Iterator[list[Row]]:
    """The rows with each of their numbers times ``factor``, one after the other."""
    for name, of in _NUMBERS.items():
        groups: dict[Any, list[int]] = {}
        for number, row in enumerate(rows):
            groups.setdefault(number if of is None else getattr(row, of), []).append(number)
        for group in groups.values():
            values = getattr(rows[group[0]], name)
            for place in range(len(values) if isinstance(values, tuple) else 1):
                found = list(rows)
                for number in group:
                    found[number] = rows[number].with_factor(name, place, factor)
                yield found


def optimum(mass: Any, force: Any, rows: Sequence[Row], q: Sequence[Any], v: Sequence[Any]) -> list[Any]:
    """The accelerations, with M (nv, nv) and f (nv, 1) of the tree."""
    acting, nv = [row for row in rows if row.acts(q)], mass.nrows()
    free = mass.solve(force)
    if not acting:
        return list(free.entries())
    by_row = [row.jacobian(q) for row in acting]
    jacobian = arb_mat([[own.get(column, arb(0)) for column in range(nv)] for own in by_row])
    across = mass.solve(jacobian.transpose())
    soft, wanted, unforced = [], [], (jacobian * free).entries()
    for row, own, pull in zip(acting, by_row, unforced, strict=True):
        residual = row.residual(q)
        impedance = row.impedance(residual)
        soft.append((1 - impedance) / impedance * row.weight / arb(row.shares))
        rate = sum((share * v[column] for column, share in own.items()), arb(0))
        wanted.append(row.reference(residual, rate) - row.bias(q, v) - pull)
    forces = _forces(jacobian * across, soft, wanted, [row.range for row in acting])
    return list((free + across * arb_mat([[one] for one in forces])).entries())


def _forces(delassus: Any, soft: Sequence[Any], wanted: Sequence[Any], ranges: Sequence[tuple[Any, Any]]) -> list[Any]:
    count, sides = len(soft), [0] * len(soft)
    for exchange in range(_EXCHANGES):
        forces = [bounds[side > 0] if side else arb(0) for side, bounds in zip(sides, ranges, strict=True)]
        inside = [i for i, side in enumerate(sides) if not side]
        if inside:
            given = (delassus * arb_mat([[one] for one in forces])).entries()
            system = arb_mat([[delassus[i, k] + (soft[i] if i == k else 0) for k in inside] for i in inside])
            found = system.solve(arb_mat([[wanted[i] - given[i]] for i in inside])).entries()
            for i, one in zip(inside, found, strict=True):
                forces[i] = one
        left = (delassus * arb_mat([[one] for one in forces])).entries()
        # Of a row inside its range this is its force.
        pulls = [(wanted[i] - left[i]) / soft[i] for i in range(count)]
        fitting = [_side(pull, *bounds) for pull, bounds in zip(pulls, ranges, strict=True)]
        unfit = [i for i in range(count) if fitting[i] != sides[i]]
        if not unfit:
            return forces
        for i in unfit if exchange < _OF_ALL else unfit[:1]:
            sides[i] = 0 if sides[i] else fitting[i]
    raise AssertionError("rows were exchanged again and again, and never fit")


def _side(pull: Any, low: Any, high: Any) -> int:
    """The only side on which a row is for certain."""
    if (low is None or pull > low) and (high is None or pull < high):
        return 0
    if low is not None and pull < low:
        return -1
    assert high is not None and pull > high, "a force lies on its bound"
    return 1
