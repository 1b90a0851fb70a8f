"""Vectors, rotations and frames as instructions of a program.

Sources: Featherstone, Rigid Body Dynamics Algorithms, section 2.2 (frames), and appendix A (rotations); MuJoCo documentation,
Modeling, section Frame orientations.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from fractions import Fraction

from harness.equations.calculus import ProgramWriter
from harness.equations.program import StraightLineProgram
from harness.files.tree import ORIGIN, Axes, Direction, Given, Placement, Pose, Quaternion, Turn, Vector

# Places of instructions: a vector, and a matrix by rows.
Three = list[int]
Matrix = list[Three]
_HALF_TURN = ((1, 0, 0), (0, -1, 0), (0, 0, -1))


class SpatialWriter(ProgramWriter):
    """A program that is written in vectors of three and in matrices; it begins with its inputs alone.

    The numbers of a file become further inputs, in the order in which they are first met. Zeros do not: they are exact, and leave
    the program sparse.
    """

    def __init__(self, inputs: Sequence[str]) -> None:
        super().__init__(StraightLineProgram(tuple(inputs), (), {}))
        self._own_inputs = self.inputs
        # The place of each number of the file among the parameters.
        self._parameters: dict[Hashable, tuple[int, Given]] = {}
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

    def given(self, value: Fraction) -> int:
        """A number of the file as an input, and any other one as a literal."""
        if not isinstance(value, Given) or not value:
            return self.number(value)
        number, _ = self._parameters.setdefault(value.key, (len(self._parameters), value))
        return self.add("input", len(self._own_inputs) + number)

    @property
    def parameters(self) -> tuple[Given, ...]:
        """The numbers of the file that are inputs, in their order."""
        return tuple(value for _, value in self._parameters.values())

    def program(self, outputs: Mapping[str, Sequence[int]]) -> StraightLineProgram:
        """What was written, with the names of its parameters behind those of the inputs that it began with."""
        self.inputs = (*self._own_inputs, *(parameter_name(value) for value in self.parameters))
        return super().program(outputs)

    def numbers(self, values: Iterable[Fraction]) -> Three:
        return [self.given(value) for value in values]

    def direction(self, values: Vector) -> Three:
        """A vector at length 1; exactly a unit vector where it has one component only."""
        if sum(map(bool, values)) == 1:
            return [self.number((value > 0) - (value < 0)) for value in values]
        return self.unit(self.numbers(values))

    def skew(self, values: Three) -> Matrix:
        """The matrix of the vector product with ``values``."""
        x, y, z = values
        return [[self.zero, self.negative(z), y], [z, self.zero, self.negative(x)], [self.negative(y), x, self.zero]]

    def unit(self, values: Three) -> Three:
        """A vector at length 1."""
        length = self.dot(values, values)
        return values if self._values.get(length) == 1 else [self.quotient(value, self.add("sqrt", length)) for value in values]

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
        written = self.given(value)
        if not in_degrees or not value:
            return written
        return self.product(self.number(Fraction(1, 180)), self.product(written, self.add("pi")))

    def rotation(self, placement: Placement) -> Matrix:
        """The orientation of a frame, as its file gives it."""
        found = self.identity
        for part in placement.rotation:
            if isinstance(part, Turn):
                turn = self.about(self.direction(part.axis), self.angle(part.angle, part.in_degrees)) if part.angle else self.identity
            elif isinstance(part, Quaternion):
                turn = self.of_quaternion(self._quaternion(part.components))
            elif isinstance(part, Axes):
                first, second = self.direction(part.x), self.direction(part.y)
                second = self.unit(self.added(second, self.minus(self.times(self.dot(first, second), first))))
                turn = transposed([first, second, self.cross(first, second)])
            else:
                turn = self._of_direction(part)
            found = self.multiplied(found, turn)
        return found

    def _quaternion(self, components: Sequence[Fraction]) -> Three:
        """A quaternion of the file; exactly a unit quaternion where it has one component only."""
        if sum(map(bool, components)) == 1:
            return [self.number((value > 0) - (value < 0)) for value in components]
        return self.numbers(components)

    def _of_direction(self, part: Direction) -> Matrix:
        """The least rotation that turns z into a direction; half a turn about x for the opposite one."""
        if part.start == ORIGIN:
            direction = self.direction(part.end)
        else:
            direction = self.added(self.numbers(part.end), self.minus(self.numbers(part.start)))
        along = [end - start for end, start in zip(part.end, part.start, strict=True)]
        if not any(along[:2]):
            return [[self.number(value) for value in row] for row in _HALF_TURN] if along[2] < 0 else self.identity
        x, y, z = direction
        # Twice the angle of this quaternion, and of all directions only the opposite one has none.
        w = self.sum(self.add("sqrt", self.dot(direction, direction)), z)
        return self.of_quaternion([w, self.negative(y), x, self.zero])

    def origin(self, placement: Placement) -> Three:
        """The origin of a frame."""
        position = self.numbers(placement.position)
        if placement.other_end is None:
            return position
        return self.times(self.number(Fraction(1, 2)), self.added(position, self.numbers(placement.other_end)))

    def placed(self, turn: Matrix, shift: Three, pose: Pose) -> tuple[Matrix, Three]:
        """A pose in a frame, in what that frame stands in."""
        for placement in pose:
            position = self.origin(placement)
            turn, shift = self.multiplied(turn, self.rotation(placement)), self.added(shift, self.turned(turn, position))
        return turn, shift


def parameter_name(value: Given) -> str:
    """File, line, element and attribute of a number, and its place in that, as people find it."""
    place = value.place
    return f"{place.path.name}:{place.line}: {place.tag} {value.attribute}[{value.index}]"


def transposed(matrix: Matrix) -> Matrix:
    return [list(column) for column in zip(*matrix, strict=True)]
