"""The attributes of MJCF elements once their default classes are applied: as text, as numbers with places, and as placements.

Source: MuJoCo documentation, Modeling, sections Default settings and Frame orientations; XML reference, ``compiler``, ``option`` and
``option/flag``.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import NamedTuple

from lxml import etree

from harness.files.document.source import Check, Numbers, Source, Unread, unresolved
from harness.files.document.xml import describe, shorten
from harness.files.equalities import SOLIMP, SOLREF, SolverParameters
from harness.files.given import Axes, Direction, Given, Placement, Pose, Quaternion, Rotation, Turn, vector
from harness.files.joint_kinds import JointKind

# Kinds of joints by their names in MJCF, in the order of its reference.
KINDS = {kind.value: kind for kind in (JointKind.HINGE, JointKind.SLIDE, JointKind.BALL, JointKind.FREE)}
JOINTS = ("joint", "freejoint")
# The attributes of which one gives a frame its orientation, and how many numbers each holds.
_SIZES = {"quat": 4, "axisangle": 4, "euler": 3, "xyaxes": 6, "zaxis": 3}
ORIENTATIONS = tuple(_SIZES)
# In a frame that a replica has become: how often its placement is repeated.
REPEATED = "repeated"
# Name of the outermost class where its author gave it none.
MAIN = "main"
# Where the defaults of an element stand under another tag than its own; those of actuators of all kinds are one set.
_ACTUATORS = (
    "general",
    "motor",
    "position",
    "velocity",
    "intvelocity",
    "orientation",
    "pid",
    "damper",
    "cylinder",
    "muscle",
    "adhesion",
    "dcmotor",
)
_DEFAULT_TAG = {"spatial": "tendon", "fixed": "tendon", **dict.fromkeys(_ACTUATORS, "actuator")}
_UNITS = {"x": vector((1, 0, 0)), "y": vector((0, 1, 0)), "z": vector((0, 0, 1))}
_LETTERS = 3


class NotRead(Exception):
    """An element speaks of what is not there, or has no meaning here; the message says of what."""


def named(element: etree._Element, attribute: str, known: Collection[str]) -> str:
    """The name in an attribute, of something known; an engine that knows no such thing refuses the file itself.

    Raises:
        NotRead: it is not known.
    """
    if element.get(attribute) not in known:
        raise NotRead(f"is not read: {unresolved(element, attribute, known)}")
    return str(element.get(attribute))


def is_on(root: etree._Element, stage: str) -> bool:
    """False where a stage of MuJoCo's pipeline, like "spring", is switched off."""
    return [flag.get(stage) for flag in root.iterfind("option/flag") if stage in flag.attrib][-1:] != ["disable"]


class Written(NamedTuple):
    """The text of an attribute, and the element in which it is written."""

    text: str
    owner: etree._Element


def resolved(element: etree._Element, name: str) -> Written | None:
    """An attribute as MuJoCo resolves it: the element's own, else that of its class or of a class around that; None where nobody gives it.

    An element without a class of its own has the childclass of the innermost body or frame around it that names one.
    """
    return next(writings(element, name), None)


def resolved_text(element: etree._Element, name: str, default: str = "") -> str:
    """The text of ``resolved``; ``default`` where nobody gives the attribute."""
    written = resolved(element, name)
    return default if written is None else written.text


def writings(element: etree._Element, name: str) -> Iterator[Written]:
    """Wherever an attribute of ``element`` is written: in itself, in its class, in the classes around that.

    Of a list MuJoCo takes each number from the first of them that is long enough to hold it.
    """
    if name in element.attrib:
        yield Written(str(element.get(name)), element)
    # A free joint takes nothing from the defaults of joints, and most files have none.
    if element.tag != "freejoint" and _classes(element.getroottree().getroot()):
        yield from _in_class(element, str(element.get("class") or childclass_of(element) or MAIN), name)


def layers(element: etree._Element) -> list[etree._Element]:
    """The elements of default classes that bear on ``element``, the outermost class first, and itself behind them."""
    classes, found = _classes(element.getroottree().getroot()), [element]
    chain = [str(element.get("class") or childclass_of(element) or MAIN)]
    for one in chain:
        if one in classes:
            found = [part for part in classes[one].elements if _default_tag(part) == _default_tag(element)] + found
            chain += [around for around in classes[one].around if around not in chain]
    return found


def childclass_of(element: etree._Element) -> str | None:
    """The childclass of the innermost ancestor that names one."""
    return next((name for ancestor in element.iterancestors() if (name := ancestor.get("childclass"))), None)


def of_class(element: etree._Element, name_of_class: str, name: str) -> Written | None:
    """An attribute that a default class, or one around it, gives elements like ``element``; None where none does."""
    return next(_in_class(element, name_of_class, name), None)


def _in_class(element: etree._Element, name_of_class: str, name: str) -> Iterator[Written]:
    classes = _classes(element.getroottree().getroot())
    key = _default_tag(element), name
    # A class inside another of its name, which MuJoCo refuses, is around itself.
    chain = [name_of_class]
    for one in chain:
        if one in classes:
            yield from classes[one].given.get(key, ())
            chain += [around for around in classes[one].around if around not in chain]


def _default_tag(element: etree._Element) -> str:
    """The tag under which defaults of ``element`` stand: constraints of all kinds share one."""
    parent = element.getparent()
    return "equality" if parent is not None and parent.tag == "equality" else _DEFAULT_TAG.get(element.tag, str(element.tag))


@dataclass
class _Class:
    """A default class: the name of the one ``around`` it, if any, and its writings by (tag, attribute)."""

    around: tuple[str, ...] = ()
    elements: list[etree._Element] = field(default_factory=list)
    given: dict[tuple[str, str], list[Written]] = field(default_factory=dict)


# Of the last file alone, and once: a file looks as many attributes up as it has elements.
@functools.lru_cache(maxsize=1)
def _classes(root: etree._Element) -> dict[str, _Class]:
    """The default classes of a file by name; a name that stands twice is one class, and what comes later goes first."""
    classes: dict[str, _Class] = {}
    for default in (default for section in root.iterchildren("default") for default in section.iter("default")):
        elements = [part for part in default.iterchildren("*") if part.tag != "default"]
        parts = [(part, *written) for part in default.iterchildren("*") for written in part.attrib.items()]
        for name in _names(default):
            known = classes.setdefault(name, _Class())
            known.around = _names(default.getparent())[-1:]
            known.elements += elements
            for part, attribute, text in parts:
                key = _DEFAULT_TAG.get(part.tag, part.tag), attribute
                longer = [written for written in known.given.get(key, []) if len(written.text.split()) > len(text.split())]
                known.given[key] = [Written(text, part), *longer]
    return classes


def _names(default: etree._Element) -> tuple[str, ...]:
    """The names of a class, none for what is no class: the outermost one is ``MAIN`` besides."""
    own = default.get("class")
    outermost = default.tag == "default" and default.getparent().tag == "mujoco"
    return (*([MAIN] if outermost else []), *([str(own)] if own else []))


class Attributes:
    """Reads by what the ``compiler`` elements say, of which the last word counts."""

    def __init__(self, source: Source) -> None:
        self._source, self._root = source, source.root
        self._acts: dict[str, bool] = {}
        self.in_degrees = self.compiler("angle", "degree", ("degree", "radian")) == "degree"
        self._auto_limits = self.compiler("autolimits", "true", ("true", "false")) == "true"
        self._sequence = self.compiler("eulerseq", "xyz")
        if len(self._sequence) != _LETTERS or set(self._sequence.lower()) - set("xyz"):
            compiler = [*source.root.iterchildren("compiler")][-1]
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

    def compiler_numbers(self, attribute: str, default: tuple[Fraction, ...]) -> tuple[Fraction, ...]:
        """The numbers of the last of the ``compiler`` elements that has an attribute."""
        given = [one for one in self._root.iterchildren("compiler") if attribute in one.attrib]
        return [default, *(self._source.numbers(one, attribute, [*map(float, default)]) for one in given)][-1]

    def numbers(self, element: etree._Element, attribute: str, default: Sequence[float], check: Check | None = None) -> tuple[Given, ...]:
        """The numbers of an attribute, of which MuJoCo takes each from the first writing that is long enough to hold it."""
        found: list[Given] = []
        for written in writings(element, attribute):
            found += self._source.read(written.owner, attribute, written.text, Numbers(0, len(default)))[len(found) :]
        if len(found) < len(default):
            found += self._source.default(element, attribute, default, len(found))
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

    def softness(self, element: etree._Element, of: str = "") -> SolverParameters:
        """The softness of a constraint, or that which a joint or tendon has ``of`` one, "limit" or "friction"."""
        time, ratio = self.numbers(element, f"solref{of}", SOLREF)
        least, most, width, midpoint, power = self.numbers(element, f"solimp{of}", SOLIMP)
        return SolverParameters((time, ratio), (least, most, width, midpoint, power))

    def leave_unread(self, element: etree._Element, attribute: str, number: Fraction, why: str, advice: str) -> None:
        """Note that a number of an attribute, which may stand in a default class, is a force or an inertia that no tree holds."""
        place = number.place if isinstance(number, Given) else self._source.place(element)
        written = next(one for one in writings(element, attribute) if self._source.place(one.owner) == place)
        what = f'{describe(element)} {attribute}="{shorten(written.text)}" {why}'
        self._source.unread.append(Unread(place, what, advice))

    def acts(self, stage: str) -> bool:
        """True where "spring" or "damper" forces are switched on."""
        if stage not in self._acts:
            self._acts[stage] = is_on(self._root, stage) and is_on(self._root, "passive")
        return self._acts[stage]

    def is_limited(self, element: etree._Element) -> bool:
        """True where the range of a joint or tendon holds, as ``autolimits`` says where it does not say so itself."""
        limited = resolved_text(element, "limited", "auto")
        return limited == "true" or (limited == "auto" and self._auto_limits and bool(resolved_text(element, "range")))

    def pose(self, element: etree._Element) -> Pose:
        """The placement of an element, behind those of the frames around it."""
        placements = [self._placement(element)]
        for ancestor in element.iterancestors():
            if ancestor.tag != "frame":
                break
            placements += [self._placement(ancestor)] * int(ancestor.get(REPEATED, "1"))
        return tuple(reversed(placements))

    def _placement(self, element: etree._Element) -> Placement:
        position = self.numbers(element, "offset" if REPEATED in element.attrib else "pos", (0, 0, 0))
        return Placement(vector(position), self._rotation(element))

    def _rotation(self, element: etree._Element) -> Rotation:
        """The orientation of an element, which replaces that of its class in any form; raises InvalidModel where it is given twice."""
        given: list[str] = []
        for layer in reversed(layers(element)):
            given = given or [name for name in ORIENTATIONS if name in layer.attrib]
            if len(given) > 1:
                self._source.refuse(layer, f"{describe(layer)} has {' and '.join(given)}; expected one orientation")
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
    """Elements right inside a body, in its frames too, under one of the tags."""
    for child in body.iterchildren(*tags, "frame"):
        yield from inside(child, *tags) if child.tag == "frame" else (child,)
