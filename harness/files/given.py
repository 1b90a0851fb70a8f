"""Numbers of a model file, exactly as they stand there, and the placements that are made of them.

Every number of a file is a ``Given``: the float64 that its decimals mean, and the place where they stand. Arithmetic with it gives
plain fractions, which stand nowhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, Self, TypeVar

Vector = tuple[Fraction, Fraction, Fraction]
ORIGIN: Vector = (Fraction(0), Fraction(0), Fraction(0))
SPACE, MOMENTS = ("x", "y", "z"), ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
_Part = TypeVar("_Part")
# Names of the numbers of an attribute that holds several.
_COMPONENTS = {
    **dict.fromkeys(("xyz", "pos", "axis", "gravity"), SPACE),
    "rpy": ("roll", "pitch", "yaw"),
    "quat": ("w", *SPACE),
    **dict.fromkeys(("fullinertia", "diaginertia"), MOMENTS),
}


@dataclass(frozen=True)
class Place:
    """Place of something in a file: the line (1-based) of its element, the number of that element in its file, and its tag."""

    path: Path
    line: int
    element: int = 0
    tag: str = ""

    def __str__(self) -> str:
        return f"{self.path}:{self.line}"

    def within(self, path: Path) -> str:
        """ "line 3" in that file, "inner.xml:3" in another, which it includes."""
        return f"line {self.line}" if self.path == path else f"{self.path.name}:{self.line}"


class Given(Fraction):
    """A number of a file: exactly the float64 that is read, its place, its attribute there and its number in that.

    Two of equal ``key`` are one number of the file, of which elements made from others, or of one class, have a share each.
    """

    __slots__ = ("attribute", "index", "place")

    place: Place
    attribute: str
    index: int

    def __new__(cls, value: float | Fraction, place: Place, attribute: str, index: int = 0) -> Self:
        # A fraction of two integers asks no abstract class what it was given.
        self = super().__new__(cls, *value.as_integer_ratio())
        self.place, self.attribute, self.index = place, attribute, index
        return self

    def __float__(self) -> float:
        # As of all rational numbers, without asking what its parts are.
        numerator, denominator = self.as_integer_ratio()
        return numerator / denominator

    @classmethod
    def from_float(cls, value: float) -> Fraction:  # type: ignore[override]
        """A number that stands nowhere; fractions compare themselves with floats by it."""
        return Fraction(value)

    @property
    def key(self) -> tuple[Place, str, int]:
        return self.place, self.attribute, self.index

    @property
    def component(self) -> str:
        """The name of the number in its attribute, as "y" or "ixz"; "" for the only one."""
        names = _COMPONENTS.get(self.attribute, ())
        return names[self.index] if self.index < len(names) else f"[{self.index}]" if self.index else ""

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (Fraction(self.numerator, self.denominator), self.place, self.attribute, self.index)

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, _memo: object) -> Self:
        return self


class Placed:
    """A part of a tree, which knows the place of its element and of each of its quantities."""

    place: Place | None

    @property
    def places(self) -> Mapping[str, Place]:
        """The place of each quantity, by the name of its field; that of the element where the file does not give the quantity."""
        known = ((one.name, self._place_of(one.name)) for one in fields(self))  # type: ignore[arg-type]
        return {name: place for name, place in known if place is not None}

    def place_of(self, quantity: str) -> Place:
        """One of ``places`` by itself, without those of the other quantities; raises KeyError where there is none."""
        place = self._place_of(quantity)
        if place is None:
            raise KeyError(quantity)
        return place

    def _place_of(self, quantity: str) -> Place | None:
        given = next(numbers_in(getattr(self, quantity)), None)
        return self.place if given is None else given.place


def numbers_in(value: object) -> Iterator[Given]:
    """The numbers of the file in a quantity; none of parts that have places of their own."""
    if isinstance(value, Given):
        yield value
    elif isinstance(value, tuple):
        for part in value:
            yield from numbers_in(part)
    elif isinstance(value, Turn | Quaternion | Axes | Direction | Placement):
        for part in fields(value):
            yield from numbers_in(getattr(value, part.name))


def every_number_in(part: object) -> Iterator[Given]:
    """The numbers of the file in a quantity, and in parts that have places of their own."""
    if isinstance(part, Given):
        yield part
    for own in _parts_of(part):
        yield from every_number_in(own)


def with_numbers(part: _Part, changed: Callable[[Given], Given]) -> _Part:
    """The same with other numbers of the file; itself where ``changed`` gives back every number."""
    found: Any = part
    if isinstance(part, Given):
        found = changed(part)
    elif isinstance(part, tuple):
        values = tuple(with_numbers(own, changed) for own in part)
        found = part if all(one is other for one, other in zip(values, part, strict=True)) else values
    elif is_dataclass(part) and not isinstance(part, type | Place):
        own = {field.name: getattr(part, field.name) for field in fields(part)}
        others = {name: value for name, one in own.items() if (value := with_numbers(one, changed)) is not one}
        found = replace(part, **others) if others else part
    return found  # type: ignore[no-any-return]


def _parts_of(part: object) -> Iterator[object]:
    if isinstance(part, tuple):
        yield from part
    elif is_dataclass(part) and not isinstance(part, type | Place):
        yield from (getattr(part, field.name) for field in fields(part))


@dataclass(frozen=True)
class Turn:
    """A rotation about an axis of any length by an angle [rad, or degrees]."""

    axis: Vector
    angle: Fraction
    in_degrees: bool = False


@dataclass(frozen=True)
class Quaternion:
    """A rotation by a quaternion (w, x, y, z) of any length but 0."""

    components: tuple[Fraction, ...]


@dataclass(frozen=True)
class Axes:
    """A rotation by the new x axis, and the new y axis as far as it is square to that."""

    x: Vector
    y: Vector


@dataclass(frozen=True)
class Direction:
    """The least rotation that turns the z axis into a direction, from the point ``start`` to the point ``end``."""

    end: Vector
    start: Vector = ORIGIN


# Rotations about the axes that those before have turned.
Rotation = tuple[Turn | Quaternion | Axes | Direction, ...]


@dataclass(frozen=True)
class Placement:
    """A frame in another: its origin [m], which is the middle between two points where ``other_end`` is given, and its orientation.

    ``is_inverse`` says that these are of the other frame in it.
    """

    position: Vector = ORIGIN
    rotation: Rotation = ()
    other_end: Vector | None = None
    is_inverse: bool = False


# Frames one in the other, the outermost first.
Pose = tuple[Placement, ...]


def vector(numbers: Sequence[float | Fraction]) -> Vector:
    """Three numbers of a file, exactly."""
    x, y, z = (number if isinstance(number, Fraction) else Fraction(number) for number in numbers)
    return x, y, z
