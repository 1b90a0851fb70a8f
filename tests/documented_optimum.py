"""The optimum that MuJoCo documents for dry friction and limits, found by another way than the harness: its dual, side by side.

Each combination of rows that are below, inside and above their ranges of forces is tried until one fits, with
(J M^-1 J' + R) f = aref - J a of those inside. All is computed with 50 digits and more, from the numbers that the test wrote into its
file; stiffness, damping and weights are rounded once, as the harness hands them on.

Source: MuJoCo documentation, Computation, sections Dual problem and Parameters; Modeling, section Solver parameters.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from flint import arb, arb_mat

DIGITS = 50
STEP = 0.002


@dataclass(frozen=True)
class Row:
    """One row: J is ``sign`` at the place ``column`` of v and 0 elsewhere; of a limit ``bound`` and ``margin``, of friction ``loss``.

    Attributes:
        position: place in q. loss: None for a limit. weight: the diagonal of M^-1 at the reference, or its mean over the joint.
    """

    column: int
    weight: Any
    sign: int = 1
    position: int = -1
    bound: float = 0.0
    margin: float = 0.0
    loss: float | None = None
    solref: tuple[float, float] = (0.02, 1.0)
    solimp: tuple[float, ...] = (0.9, 0.95, 0.001, 0.5, 2.0)

    def residual(self, q: Sequence[Any]) -> Any:
        """Distance less margin; its gradient is ``sign``."""
        return arb(0) if self.loss is not None else self.sign * (q[self.position] - arb(self.bound)) - arb(self.margin)

    def impedance(self, residual: Any) -> Any:
        least, most, width, midpoint, power = (arb(value) for value in self.solimp)
        least, most, midpoint = (min(max(value, arb(0.0001)), arb(0.9999)) for value in (least, most, midpoint))
        if self.loss is not None:
            return least
        if width <= 0 or least == most:
            return (least + most) / 2
        x = abs(residual) / width
        if x >= 1:
            return most
        y = x**power / midpoint ** (power - 1) if x <= midpoint else 1 - (1 - x) ** power / (1 - midpoint) ** (power - 1)
        return least + y * (most - least)

    def reference(self, residual: Any, rate: Any) -> Any:
        """aref."""
        most = min(max(arb(self.solimp[1]), arb(0.0001)), arb(0.9999))
        if self.solref[0] > 0:
            time = max(arb(self.solref[0]), 2 * arb(STEP))
            stiffness, damping = 1 / (most * time * arb(self.solref[1])) ** 2, 2 / (most * time)
        else:
            stiffness, damping = -arb(self.solref[0]) / most**2, -arb(self.solref[1]) / most
        push = arb(0) if self.loss is not None else arb(float(stiffness)) * self.impedance(residual) * residual
        return -arb(float(damping)) * rate - push

    def acts(self, q: Sequence[Any]) -> bool:
        return self.loss is not None or bool(self.residual(q) < 0)


def optimum(mass: Any, force: Any, rows: Sequence[Row], q: Sequence[Any], v: Sequence[Any]) -> list[Any]:
    """The accelerations, with M (nv, nv) and f (nv, 1) of the tree."""
    acting, nv = [row for row in rows if row.acts(q)], mass.nrows()
    jacobian = arb_mat(len(acting), nv, [row.sign * (row.column == column) for row in acting for column in range(nv)])
    across = mass.solve(jacobian.transpose()) if acting else arb_mat(nv, 0)
    free = mass.solve(force)
    delassus, unforced = jacobian * across, jacobian * free
    soft, wanted = [], []
    for row in acting:
        residual = row.residual(q)
        impedance = row.impedance(residual)
        soft.append((1 - impedance) / impedance * arb(float(row.weight)))
        wanted.append(row.reference(residual, row.sign * v[row.column]))
    limits = [(-arb(row.loss), arb(row.loss)) if row.loss is not None else (arb(0), None) for row in acting]
    sides = [(0, -1, 1) if row.loss is not None else (0, -1) for row in acting]
    for chosen in itertools.product(*sides):
        forces = [limits[i][side > 0] if side else arb(0) for i, side in enumerate(chosen)]
        inside = [i for i, side in enumerate(chosen) if not side]
        missing = [
            wanted[i] - unforced[i, 0] - sum((delassus[i, k] * forces[k] for k in range(len(acting))), arb(0)) for i in range(len(acting))
        ]
        if inside:
            system = arb_mat([[delassus[i, k] + (soft[i] if i == k else 0) for k in inside] for i in inside])
            for i, found in zip(inside, system.solve(arb_mat([[missing[i]] for i in inside])).entries(), strict=True):
                forces[i] = found
        pulls = [
            (wanted[i] - unforced[i, 0] - sum((delassus[i, k] * forces[k] for k in range(len(acting))), arb(0))) / soft[i]
            for i in range(len(acting))
        ]
        if all(_fits(pull, side, *own) for pull, side, own in zip(pulls, chosen, limits, strict=True)):
            return (free + across * arb_mat([[one] for one in forces])).entries() if acting else free.entries()
    raise AssertionError("no combination of sides fits")


def _fits(pull: Any, side: int, low: Any, high: Any) -> bool:
    if side < 0:
        return bool(pull < low)
    return bool(pull > high) if side > 0 else bool(pull > low) and (high is None or bool(pull < high))
