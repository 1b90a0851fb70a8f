"""The attributes of MJCF elements once their default classes are applied, as numbers with places, and their placements.

Source: MuJoCo documentation, Modeling, sections Default settings and Frame orientations; XML reference, ``compiler``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction

from lxml import etree

from harness.files.document.source import Source
from harness.files.document.values import Check, Numbers
from harness.files.document.xml import describe, shorten
from harness.files.findings import Unread
from harness.files.mjcf.defaults import writings
from harness.files.mjcf.expansion import REPEATED
from harness.files.mjcf.options import ORIENTATIONS, is_on
from harness.files.tree import Axes, Direction, Given, Placement, Pose, Quaternion, Rotation, Turn, Vector, vector

_UNITS = {"x": vector((1, 0, 0)), "y": vector((0, 1, 0)), "z": vector((0, 0, 1))}
_SIZES = {"quat": 4, "axisangle": 4, "euler": 3, "xyaxes": 6, "zaxis": 3}
_LETTERS = 3
JOINTS = ("joint", "freejoint")


class Attributes:
    """Reads by what the ``compiler`` elements say, of which the last word counts."""

    def __init__(self, source: Source, root: etree._Element) -> None:
        self._source, self._root = source, root
        self.in_degrees = self.compiler("angle", "degree", ("degree", "radian")) == "degree"
        self.auto_limits = self.compiler("autolimits", "true", ("true", "false")) == "true"
        self._sequence = self.compiler("eulerseq", "xyz")
        if len(self._sequence) != _LETTERS or set(self._sequence.lower()) - set("xyz"):
            compiler = [*root.iterchildren("compiler")][-1]
            source.refuse(compiler, f'<compiler eulerseq="{self._sequence}">: expected three of the letters x, y, z, X, Y and Z')
        self._rotations: Mapping[str, Callable[[tuple[Given, ...]], Rotation]] = {
            "quat": lambda numbers: (Quaternion(numbers),),
            "axisangle": lambda numbers: (Turn(vector(numbers[:3]), numbers[3], self.in_degrees),),
            "euler": self._by_euler_angles,
            "xyaxes": lambda numbers: (Axes(vector(numbers[:3]), vector(numbers[3:])),),
            "zaxis": lambda numbers: (Direction(vector(numbers)),),
        }

    def compiler(self, attribute: str, default: str, options: Sequence[str] = ()) -> str:
        """The last word of the ``compiler`` elements on an attribute."""
        found = default
        for compiler in self._root.iterchildren("compiler"):
            found = str(compiler.get(attribute, found))
            if options and found not in options:
                self._source.refuse(compiler, f'<compiler {attribute}="{found}">: expected {" or ".join(options)}')
        return found

    def numbers(self, element: etree._Element, attribute: str, default: Sequence[float], check: Check | None = None) -> tuple[Given, ...]:
        """The numbers of an attribute, of which MuJoCo takes each from the first writing that is long enough to hold it."""
        found: list[Given] = []
        for written in writings(element, attribute):
            found += self._source.read(written.owner, attribute, written.text, Numbers(0, len(default)))[len(found) :]
        if len(found) < len(default):
            found += self._source.default(element, attribute, default)[len(found) :]
        complaint = check(tuple(map(float, found))) if check else None
        if complaint:
            self._source.refuse(element, f"{describe(element)}: {attribute} {complaint}")
        return tuple(found)

    def number(self, element: etree._Element, attribute: str, default: float, check: Check | None = None) -> Given:
        """``numbers`` of one."""
        (value,) = self.numbers(element, attribute, (default,), check)
        return value

    def coefficient(self, element: etree._Element, attribute: str, stage: str) -> Fraction:
        """A stiffness or damping; 0 where that stage is switched off, and where it is left unread."""
        linear, *others = self.numbers(element, attribute, (0, 0, 0))
        if not self.acts(stage):
            return Given(0.0, linear.place, attribute)
        bent = next((one for one in others if one), None)
        if bent is not None:
            self.leave_unread(element, attribute, bent, "is not linear", "write one number")
            return Given(0.0, linear.place, attribute)
        return linear

    def leave_unread(self, element: etree._Element, attribute: str, number: Fraction, why: str, advice: str) -> None:
        """Note that a number of an attribute, which may stand in a default class, is a force or an inertia that no tree holds."""
        place = number.place if isinstance(number, Given) else self._source.place(element)
        written = next(one for one in writings(element, attribute) if self._source.place(one.owner) == place)
        what = f'{describe(element)} {attribute}="{shorten(written.text)}" {why}'
        self._source.unread.append(Unread(place, what, advice))

    def acts(self, stage: str) -> bool:
        """Whether "spring" or "damper" forces are switched on."""
        return is_on(self._root, stage) and is_on(self._root, "passive")

    def pose(self, element: etree._Element) -> Pose:
        """The placement of an element, behind those of the frames around it."""
        placements = [self.placement(element)]
        for ancestor in element.iterancestors():
            if ancestor.tag != "frame":
                break
            placements += [self.placement(ancestor)] * int(ancestor.get(REPEATED, "1"))
        return tuple(reversed(placements))

    def between(self, first: Vector, second: Vector) -> Rotation:
        """The orientation whose z axis points from one point to another."""
        return (Direction(second, first),)

    def placement(self, element: etree._Element) -> Placement:
        return Placement(self._position(element), self.rotation(element))

    def _position(self, element: etree._Element) -> Vector:
        return vector(self.numbers(element, "offset" if REPEATED in element.attrib else "pos", (0, 0, 0)))

    def rotation(self, element: etree._Element) -> Rotation:
        """The orientation of an element; raises InvalidModel where it is given twice."""
        given = [name for name in ORIENTATIONS if next(writings(element, name), None) is not None]
        if len(given) > 1:
            self._source.refuse(element, f"{describe(element)} has {' and '.join(given)}; expected one orientation")
        rotation: Rotation = ()
        for name in given:
            numbers = self.numbers(element, name, (0,) * _SIZES[name])
            # Angles may be zero, and an axis is needed only to turn about it.
            direction = {"quat": numbers, "zaxis": numbers, "axisangle": numbers[:3] if any(numbers[3:]) else ()}.get(name, ())
            if direction and not any(direction):
                self._source.refuse(element, f"{describe(element)}: {name} is zero; expected a direction or rotation")
            if name == "xyaxes" and _are_parallel(numbers[:3], numbers[3:]):
                self._source.refuse(element, f"{describe(element)}: the two directions of xyaxes are parallel, or one is zero")
            rotation = self._rotations[name](numbers)
        return rotation

    def _by_euler_angles(self, numbers: tuple[Given, ...]) -> Rotation:
        """Turns about axes that move along for small letters, and that stay for capital ones."""
        found: list[Turn] = []
        for letter, angle in zip(self._sequence, numbers, strict=True):
            turn = Turn(_UNITS[letter.lower()], angle, self.in_degrees)
            found = [*found, turn] if letter.islower() else [turn, *found]
        return tuple(found)


def _are_parallel(first: Sequence[Fraction], second: Sequence[Fraction]) -> bool:
    return all(first[i] * second[j] == first[j] * second[i] for i, j in ((0, 1), (1, 2), (2, 0)))


def inside(body: etree._Element, *tags: str) -> Iterator[etree._Element]:
    """What is right inside a body, in its frames too, under one of the tags."""
    for child in body.iterchildren(*tags, "frame"):
        yield from inside(child, *tags) if child.tag == "frame" else (child,)
