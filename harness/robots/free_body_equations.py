"""The equations of bodies kept free, see ``harness.robots.free_bodies``, and their solution in balls."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.equations.kernels import BallKernel
from harness.equations.program import StraightLineProgram
from harness.files.tree import Given

# Of the length of the longest row, and of what is left of a row of length 1 beside those before.
_NO_MOTION, _DEPENDENT = 1e-12, 1e-9


@dataclass(frozen=True)
class FreeBodies:
    """The linear equations A x = b of one tree and its constraints.

    Attributes:
        program: its outputs "matrix" and "right" are the entries of A that are not zero, at ``places``, and b; those called
            "<name> coefficients" and "<name>" give what is read from a solution, each a sum of unknowns at ``read[name]``, and a
            constant: "accelerations" are qdd, "moments" and "forces" (three for each of ``joints``) are what the parent does to the
            child through a joint, along the world's axes, about the point of ``world_motion.WorldWriter.points`` [N m, N],
            "constraint forces" are what the file's constraints do along each velocity [N, N m]. "jacobian" are the rows of the
            file's constraints by the velocities.
        parameters: the numbers of the file that are the program's last inputs.
        joints: names of the joints that transmit something: all but free ones. bodies: how many there are; each joint has one, as
            one without mass stands between two joints of one body. rows: of the joints' constraints.
        constraints: the name of the file's constraint for each of its rows, the last equations, whose multipliers are the last
            unknowns.
    """

    program: StraightLineProgram
    parameters: tuple[Given, ...]
    places: tuple[tuple[int, int], ...]
    read: Mapping[str, tuple[tuple[int, ...], ...]]
    joints: tuple[str, ...]
    bodies: int
    rows: int
    constraints: tuple[str, ...] = ()

    @property
    def size(self) -> int:
        """How many equations there are, and unknowns, with all rows of the file's constraints."""
        return 6 * self.bodies + self.rows + len(self.constraints)

    def bind(self, numbers: Sequence[float] | None = None) -> BoundFreeBodies:
        """The equations with the numbers of the file, or others in their place, at the working precision of flint in force."""
        kernel = BallKernel(self.program, len(self.parameters))
        return BoundFreeBodies(self, kernel.bind([float(value) for value in self.parameters] if numbers is None else numbers))


@dataclass(frozen=True)
class BoundFreeBodies:
    """Equations whose parameters have values."""

    equations: FreeBodies
    evaluate: Any

    def solve(self, inputs: Sequence[float]) -> Mapping[str, list[Any]]:
        """What is read from the solution, as ``arb``, at q, v, tau and time; not finite where A is not certainly regular.

        Of the rows of constraints, those that no velocity changes bear nothing, and of the others as many take part as are
        independent. Where some are left over, what each bears is not determined, nor what joints transmit: "moments" and "forces"
        are missing.
        """
        own, values = self.equations, iter(self.evaluate(*inputs))
        outputs = {name: [next(values) for _ in places] for name, places in own.program.outputs.items()}
        jacobian = np.array([float(ball) for ball in outputs["jacobian"]]).reshape(len(own.constraints), len(own.read["accelerations"]))
        moving, chosen = independent_rows(jacobian)
        first = own.size - len(own.constraints)
        numbers = [*range(first), *(first + row for row in chosen)]
        unknowns = dict(zip(numbers, self._solution(outputs, numbers), strict=True))
        found = {}
        for name, sums in own.read.items():
            coefficients = iter(outputs[f"{name} coefficients"])
            found[name] = [
                sum((next(coefficients) * unknowns.get(number, 0) for number in numbers), constant)
                for numbers, constant in zip(sums, outputs[name], strict=True)
            ]
        return found if len(moving) == len(chosen) else {name: found[name] for name in ("accelerations", "constraint forces")}

    def _solution(self, outputs: Mapping[str, list[Any]], numbers: Sequence[int]) -> list[Any]:
        """The unknowns called ``numbers``, from the equations of these numbers."""
        import flint

        own, places = self.equations, {number: place for place, number in enumerate(numbers)}
        matrix = flint.arb_mat(len(numbers), len(numbers))
        for (row, column), entry in zip(own.places, outputs["matrix"], strict=True):
            if row in places and column in places:
                matrix[places[row], places[column]] = entry
        try:
            solution = matrix.solve(flint.arb_mat([[outputs["right"][number]] for number in numbers]))
        except ZeroDivisionError:
            return [flint.arb.nan()] * len(numbers)
        return [solution[place, 0] for place in range(len(numbers))]


def independent_rows(jacobian: Array) -> tuple[list[int], list[int]]:
    """Of rows, (m, nv), those that some velocity changes, and a maximal number of these that are independent, found in float64.

    That the chosen ones are independent is for a solution in balls to prove.
    """
    lengths = np.linalg.norm(jacobian, axis=1)
    if not np.isfinite(lengths).all():
        return list(range(len(jacobian))), list(range(len(jacobian)))
    moving = np.flatnonzero(lengths > _NO_MOTION * lengths.max(initial=0.0))
    left = jacobian[moving] / lengths[moving, None]
    chosen: list[int] = []
    while len(chosen) < len(moving):
        sizes = np.linalg.norm(left, axis=1)
        pivot = int(sizes.argmax())
        if sizes[pivot] <= _DEPENDENT:
            break
        chosen.append(pivot)
        along = left[pivot] / sizes[pivot]
        left = left - np.outer(left @ along, along)
        left[chosen] = 0.0
    return moving.tolist(), sorted(moving[chosen].tolist())
