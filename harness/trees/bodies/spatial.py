"""Rotations and frames of a model file, as terms of a program.

Sources: Featherstone, Rigid Body Dynamics Algorithms, section 2.2 (frames), and appendix A (rotations); MuJoCo documentation,
Modeling, section Frame orientations.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from harness.files.given import ORIGIN, Axes, Direction, Given, Placement, Pose, Quaternion, Turn
from harness.files.given import Vector as Numbers
from harness.programs.kernels import BallKernel
from harness.programs.program import StraightLineProgram, without_unused
from harness.programs.terms import Builder, Matrix, Number, Term, Vector, cos, cross, length, matrix, sin, sqrt, vector

# Of an angle of a quarter, until its tangent is below 0.0246; and of the series of the arctangent of that, in the square.
_HALVINGS, _TERMS = 5, 20
_HALF_TURN = ((1, 0, 0), (0, -1, 0), (0, 0, -1))


class FileBuilder(Builder):
    """A program about a model file.

    The numbers of the file become further inputs, in the order in which they are first met. Zeros do not: they are exact, and leave
    the program sparse.
    """

    def __init__(self, inputs: Sequence[str]) -> None:
        # The place of each number of the file among the parameters.
        self._parameters: dict[Hashable, tuple[int, Given]] = {}
        self._own = tuple(inputs)
        super().__init__(inputs)
        self.zero, self.one = self.number(0), self.number(1)
        self.still: Vector = self.zeros(3)
        self.identity: Matrix = matrix([[self.number(int(i == j)) for j in range(3)] for i in range(3)])

    def number(self, value: Number) -> Term:
        """A number of the file as an input, and any other one as a literal."""
        if not isinstance(value, Given) or not value:
            return super().number(value)
        place, _ = self._parameters.setdefault(value.key, (len(self._parameters), value))
        return self.add("input", len(self._own) + place)

    @property
    def parameters(self) -> tuple[Given, ...]:
        """The numbers of the file that are inputs, in their order."""
        return tuple(value for _, value in self._parameters.values())

    def program(self, outputs: Mapping[str, Iterable[Term]]) -> StraightLineProgram:
        """The program that was written, with the names of its parameters behind those of the inputs that it began with."""
        self.names = (*self._own, *(parameter_name(value) for value in self.parameters))
        return super().program(outputs)

    def written(self, outputs: Mapping[str, Iterable[Term]]) -> FileProgram:
        """The part of what was written that ``outputs`` take."""
        return FileProgram(without_unused(self.program(outputs)), self.parameters)

    def evaluated(self, outputs: Mapping[str, Iterable[Term]], bits: int, inputs: Sequence[float] = ()) -> dict[str, list[Any]]:
        """``outputs`` at the numbers of the file, and at ``inputs``, as ``arb`` of so many bits."""
        import flint

        with flint.ctx.workprec(bits):
            return self.written(outputs).in_balls()(*inputs)


@dataclass(frozen=True)
class FileProgram:
    """A program about a model file, and the numbers of the file that are its last inputs."""

    program: StraightLineProgram
    parameters: tuple[Given, ...]

    @property
    def numbers(self) -> list[float]:
        """The parameters, each the float64 that it is."""
        return [float(value) for value in self.parameters]

    def in_balls(self) -> Callable[..., dict[str, list[Any]]]:
        """The outputs by their names, as ``arb`` at the working precision in force, as a function of the other inputs.

        Its constants have the precision that is in force here.
        """
        evaluate = BallKernel(self.program, len(self.parameters)).bind(self.numbers)

        def outputs(*inputs: float) -> dict[str, list[Any]]:
            values = iter(evaluate(*inputs))
            return {name: [next(values) for _ in places] for name, places in self.program.outputs.items()}

        return outputs


@dataclass(frozen=True)
class Frame:
    """A frame that stands in another one: its orientation, a rotation matrix, and its origin [m]."""

    turn: Matrix
    shift: Vector

    def at(self, point: Vector) -> Vector:
        """A point of the frame in the other one."""
        return self.shift + self.turn @ point


def parameter_name(value: Given) -> str:
    """File, line, element and attribute of a number, and its name in that, as people find it."""
    place = value.place
    return f"{place.path.name}:{place.line}: {place.tag} {value.attribute} {value.component}".rstrip()


def by_entries(entry: Callable[[int, int], Any]) -> Matrix:
    """(3, 3) of its entries, which are written row by row."""
    return matrix([[entry(i, j) for j in range(3)] for i in range(3)])


def direction(builder: FileBuilder, values: Numbers) -> Vector:
    """A vector at length 1."""
    return unit(_along(builder, values))


def _along(builder: FileBuilder, values: Sequence[Fraction]) -> Vector:
    """A vector of any length, exactly a unit vector where it has one component only."""
    return builder.vector([(value > 0) - (value < 0) for value in values] if sum(map(bool, values)) == 1 else values)


def unit(values: Vector) -> Vector:
    """A vector at length 1."""
    squared = values @ values
    return values if squared.value == 1 else values / sqrt(squared)


def skew(values: Vector) -> Matrix:
    """The matrix of the vector product with ``values``."""
    x, y, z = values
    zero = x.builder.number(0)
    return matrix([[zero, -z, y], [z, zero, -x], [-y, x, zero]])


def about(axis: Vector, angle: Term) -> Matrix:
    """The rotation about a unit axis, by Rodrigues' formula."""
    sine, cosine = sin(angle), cos(angle)
    across = skew(sine * axis)
    return by_entries(lambda i, j: (along := axis[i] * axis[j]) + cosine * (int(i == j) - along) + across[i, j])


def of_quaternion(quaternion: Vector) -> Matrix:
    """The rotation by a quaternion of any length."""
    w, rest = quaternion[0], quaternion[1:]
    two = w.builder.number(2)
    scale = two / (quaternion @ quaternion)
    across = skew((scale * w) * rest)
    size = rest @ rest
    rows = []
    for i in range(3):
        products = rest[i] * rest
        products[i] = products[i] - size
        rows.append([int(i == j) + (scale * products[j] + across[i, j]) for j in range(3)])
    return matrix(rows)


def sign_of(value: Term) -> Term:
    """-1 or 1, and 1 of zero; a constant wherever it is differentiated: two angles add to half a turn forwards or backwards."""
    builder = value.builder
    return (builder.add("atan2", value, builder.number(-1)) + builder.add("atan2", value, builder.number(1))) / builder.add("pi")


def rotation_vector(quaternion: Vector) -> Vector:
    """The vector along the axis of a rotation by a quaternion of any length, as long as its angle [rad], which is in (-pi, pi].

    With t = tan(angle / 4) along the axis it is 4 t atan(|t|) / |t|, which has derivatives at no rotation too: by the series of the
    arctangent, once halving the angle has made its argument small. What that leaves out is below 2^-210 of the vector.
    """
    real, rest = quaternion[0], quaternion[1:]
    builder = real.builder
    one, two = builder.number(1), builder.number(2)
    sign = sign_of(real)
    quarter = (sign / (sign * real + length(quaternion))) * rest
    squared, factor = quarter @ quarter, builder.number(4)
    for _ in range(_HALVINGS):
        root = one + sqrt(one + squared)
        squared, factor = squared / (root * root), factor * (two / root)
    series = builder.number(0)
    for power in reversed(range(_TERMS)):
        series = builder.number(Fraction(1, 2 * power + 1)) - squared * series
    return (factor * series) * quarter


def quaternion_of(turn: Matrix) -> Vector:
    """A quaternion of a rotation by less than half a turn."""
    one = turn[0, 0].builder.number(1)
    return vector([one + turn[0, 0] + turn[1, 1] + turn[2, 2], *(turn[k, j] - turn[j, k] for j, k in ((1, 2), (2, 0), (0, 1)))])


def angle(builder: FileBuilder, value: Fraction, in_degrees: bool) -> Term:
    """An angle of a file in radians."""
    written = builder.number(value)
    return builder.number(Fraction(1, 180)) * (written * builder.add("pi")) if in_degrees and value else written


def rotation(builder: FileBuilder, placement: Placement) -> Matrix:
    """The orientation of a frame, as its file gives it."""
    found = builder.identity
    for part in placement.rotation:
        found = found @ _rotation(builder, part)
    return found


def _rotation(builder: FileBuilder, part: Turn | Quaternion | Axes | Direction) -> Matrix:
    if isinstance(part, Turn):
        if not part.angle:
            return builder.identity
        axis = direction(builder, part.axis)
        return about(axis, angle(builder, part.angle, part.in_degrees))
    if isinstance(part, Quaternion):
        return of_quaternion(_along(builder, part.components))
    if isinstance(part, Axes):
        first, second = direction(builder, part.x), direction(builder, part.y)
        second = unit(second + -((first @ second) * first))
        return matrix([first, second, cross(first, second)]).T
    return _of_direction(builder, part)


def _of_direction(builder: FileBuilder, part: Direction) -> Matrix:
    """The least rotation that turns z into a direction; half a turn about x for the opposite one."""
    is_from_origin = part.start == ORIGIN
    towards = direction(builder, part.end) if is_from_origin else builder.vector(part.end) + -builder.vector(part.start)
    along = [end - start for end, start in zip(part.end, part.start, strict=True)]
    if not any(along[:2]):
        return matrix([[builder.number(value) for value in row] for row in _HALF_TURN]) if along[2] < 0 else builder.identity
    x, y, z = towards
    # Twice the angle of this quaternion, and of all directions only the opposite one has none.
    w = sqrt(towards @ towards) + z
    return of_quaternion(vector((w, -y, x, builder.zero)))


def placed(builder: FileBuilder, pose: Pose, frame: Frame | None = None) -> Frame:
    """A pose in a frame, in what that frame stands in; without one, the pose as a frame."""
    found = frame or Frame(builder.identity, builder.still)
    for placement in pose:
        position = builder.vector(placement.position)
        if placement.other_end is not None:
            position = builder.number(Fraction(1, 2)) * (position + builder.vector(placement.other_end))
        turn = rotation(builder, placement)
        if placement.is_inverse:
            turn, position = turn.T, -(turn.T @ position)
        found = Frame(found.turn @ turn, found.at(position))
    return found
