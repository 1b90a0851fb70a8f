"""Vectors, rotations and frames as instructions of a program.

Sources: Featherstone, Rigid Body Dynamics Algorithms, section 2.2 (frames), and appendix A (rotations); MuJoCo documentation,
Modeling, section Frame orientations.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction

from harness.equations.calculus import ProgramWriter
from harness.equations.program import StraightLineProgram
from harness.robots.tree import Axes, Placement, Pose, Quaternion, Turn

# Places of instructions: a vector, and a matrix by rows.
Three = list[int]
Matrix = list[Three]


class SpatialWriter(ProgramWriter):
    """A program that is written in vectors of three and in matrices; it begins with its inputs alone."""

    def __init__(self, inputs: Sequence[str]) -> None:
        super().__init__(StraightLineProgram(tuple(inputs), (), {}))
        self.zero = self.number(0)
        self.still: Three = [self.zero] * 3
        self.identity: Matrix = [[self.number(int(i == j)) for j in range(3)] for i in range(3)]

    # Vectors and matrices.

    def added(self, first: Three, second: Three) -> Three:
        return [self.sum(a, b) for a, b in zip(first, second, strict=True)]

    def times(self, factor: int, values: Three) -> Three:
        return [self.product(factor, value) for value in values]

    def minus(self, values: Three) -> Three:
        return [self.negative(value) for value in values]

    def turned(self, matrix: Matrix, values: Three) -> Three:
        return [self.dot(row, values) for row in matrix]

    def turned_back(self, matrix: Matrix, values: Three) -> Three:
        return self.turned(transposed(matrix), values)

    def multiplied(self, first: Matrix, second: Matrix) -> Matrix:
        return [[self.dot(row, column) for column in transposed(second)] for row in first]

    def numbers(self, values: Iterable[Fraction]) -> Three:
        return [self.number(value) for value in values]

    def skew(self, values: Three) -> Matrix:
        """The matrix of the vector product with ``values``."""
        x, y, z = values
        return [[self.zero, self.negative(z), y], [z, self.zero, self.negative(x)], [self.negative(y), x, self.zero]]

    def unit(self, values: Three) -> Three:
        """A vector at length 1."""
        length = self.dot(values, values)
        return values if self._value(length) == 1 else [self.quotient(value, self.add("sqrt", length)) for value in values]

    # Rotations.

    def about(self, axis: Three, angle: int) -> Matrix:
        """The rotation about a unit axis, by Rodrigues' formula."""
        sine, cosine = (self.add(name, angle) for name in ("sin", "cos"))
        skew = self.skew(self.times(sine, axis))
        rows = []
        for i in range(3):
            row = []
            for j in range(3):
                along = self.product(axis[i], axis[j])
                across = self.difference(self.identity[i][j], along)
                row.append(self.sum(self.sum(along, self.product(cosine, across)), skew[i][j]))
            rows.append(row)
        return rows

    def of_quaternion(self, quaternion: Sequence[int]) -> Matrix:
        """The rotation by a quaternion of any length."""
        w, *rest = quaternion
        scale = self.quotient(self.number(2), self.dot(quaternion, quaternion))
        skew = self.skew(self.times(self.product(scale, w), rest))
        size = self.dot(rest, rest)
        rows = []
        for i in range(3):
            products = [self.product(rest[i], value) for value in rest]
            products[i] = self.difference(products[i], size)
            rows.append([self.sum(self.identity[i][j], self.sum(self.product(scale, products[j]), skew[i][j])) for j in range(3)])
        return rows

    def angle(self, value: Fraction, in_degrees: bool) -> int:
        """An angle of a file in radians."""
        return self.product(self.number(value / 180), self.add("pi")) if in_degrees and value else self.number(value)

    def rotation(self, placement: Placement) -> Matrix:
        """The orientation of a frame, as its file gives it."""
        found = self.identity
        for part in placement.rotation:
            if isinstance(part, Turn):
                axis = self.unit(self.numbers(part.axis))
                turn = self.about(axis, self.angle(part.angle, part.in_degrees)) if part.angle else self.identity
            elif isinstance(part, Quaternion):
                turn = self.of_quaternion(self.numbers(part.components))
            elif isinstance(part, Axes):
                first, second = self.unit(self.numbers(part.x)), self.numbers(part.y)
                second = self.unit(self.added(second, self.minus(self.times(self.dot(first, second), first))))
                turn = transposed([first, second, self.cross(first, second)])
            else:
                x, y, z = direction = self.numbers(part.z)
                # Twice the angle of this quaternion, and of all directions only the opposite one has none.
                w = self.sum(self.add("sqrt", self.dot(direction, direction)), z)
                turn = self.of_quaternion([w, self.negative(y), x, self.zero])
            found = self.multiplied(found, turn)
        return found

    def placed(self, turn: Matrix, shift: Three, pose: Pose) -> tuple[Matrix, Three]:
        """A pose in a frame, in what that frame stands in."""
        for placement in pose:
            position = self.numbers(placement.position)
            turn, shift = self.multiplied(turn, self.rotation(placement)), self.added(shift, self.turned(turn, position))
        return turn, shift


def transposed(matrix: Matrix) -> Matrix:
    return [list(column) for column in zip(*matrix, strict=True)]
