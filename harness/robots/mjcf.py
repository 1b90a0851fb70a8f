"""From an MJCF to its tree of bodies.

Source: MuJoCo documentation, XML reference, ``body``, ``inertial``, ``joint``, ``frame`` and ``compiler``; Modeling, section
Frame orientations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction

from lxml import etree

from harness.models.formats import ORIENTATIONS
from harness.models.mjcf_defaults import resolved_text
from harness.models.model_file import ROOT_TAGS, ModelFile
from harness.models.xml import parse_document
from harness.robots.tree import (
    ORIGIN,
    WORLD,
    Axes,
    Body,
    Direction,
    Inertia,
    Joint,
    Placement,
    Pose,
    Quaternion,
    Rotation,
    Tree,
    Turn,
    vector,
)

_UNITS = {"x": vector((1, 0, 0)), "y": vector((0, 1, 0)), "z": vector((0, 0, 1))}
Numbers = tuple[Fraction, ...]


def read_tree(model: ModelFile) -> Tree:
    """The tree of a validated MJCF."""
    root = parse_document(model.path, model.text, ROOT_TAGS["mjcf"]).root
    reader = _Reader(in_degrees=_last(root, "angle", "degree") == "degree", sequence=_last(root, "eulerseq", "xyz"))
    assert model.gravity is not None
    return Tree(tuple(map(reader.body, root.iterfind("worldbody//body"))), vector(model.gravity), model.force_elements)


def _last(root: etree._Element, attribute: str, default: str) -> str:
    return [default, *(str(compiler.get(attribute)) for compiler in root.iterfind(f"compiler[@{attribute}]"))][-1]


def _numbers(text: str | None, default: str = "0 0 0") -> Numbers:
    return tuple(Fraction(float(word)) for word in (text or default).split())


class _Reader:
    """Reads bodies by what the ``compiler`` element says of angles."""

    def __init__(self, in_degrees: bool, sequence: str) -> None:
        self._in_degrees, self._sequence = in_degrees, sequence
        self._rotations: Mapping[str, Callable[[Numbers], Rotation]] = {
            "quat": lambda numbers: (Quaternion(numbers),),
            "axisangle": self._turned,
            "euler": self._by_euler_angles,
            "xyaxes": lambda numbers: (Axes(vector(numbers[:3]), vector(numbers[3:])),),
            "zaxis": lambda numbers: (Direction(vector(numbers)),),
        }

    def body(self, element: etree._Element) -> Body:
        inertial = element.find("inertial")
        parent = next(element.iterancestors("body", "worldbody"))
        inertia = None if inertial is None else self._inertia(inertial)
        joints = tuple(map(self._joint, _joints_of(element)))
        # A free joint's position is that of the body in the world.
        pose = () if joints and joints[0].kind == "free" else self._pose(element)
        return Body(_name(element), _name(parent), pose, joints, inertia)

    def _pose(self, element: etree._Element) -> Pose:
        """The placement of an element, behind those of the frames around it."""
        placements = [self._placement(element)]
        for ancestor in element.iterancestors():
            if ancestor.tag != "frame":
                break
            placements.append(self._placement(ancestor))
        return tuple(reversed(placements))

    def _placement(self, element: etree._Element) -> Placement:
        return Placement(vector(_numbers(element.get("pos"))), tuple(self._rotation(element)))

    def _rotation(self, element: etree._Element) -> Rotation:
        given = [(name, _numbers(element.get(name))) for name in ORIENTATIONS if name in element.attrib]
        return tuple(part for name, numbers in given for part in self._rotations[name](numbers))

    def _turned(self, numbers: Numbers) -> Rotation:
        *axis, angle = numbers
        return (Turn(vector(axis), angle, self._in_degrees),)

    def _by_euler_angles(self, numbers: Numbers) -> Rotation:
        turns = [Turn(_UNITS[letter.lower()], angle, self._in_degrees) for letter, angle in zip(self._sequence, numbers, strict=True)]
        # Capital letters turn about axes that stay.
        return tuple(turns if self._sequence.islower() else reversed(turns))

    def _inertia(self, element: etree._Element) -> Inertia:
        full = _numbers(element.get("fullinertia"), "") or (*_numbers(element.get("diaginertia")), *ORIGIN)
        return Inertia(self._pose(element), Fraction(float(element.get("mass", "0"))), full)

    def _joint(self, element: etree._Element) -> Joint:
        name = str(element.get("name"))
        kind = "free" if element.tag == "freejoint" else resolved_text(element, "type", "hinge")
        if kind == "free":
            return Joint(name, kind)
        return Joint(
            name=name,
            kind=kind,
            axis=ORIGIN if kind == "ball" else vector(_numbers(resolved_text(element, "axis", "0 0 1"))),
            anchor=vector(_numbers(resolved_text(element, "pos"))),
            # A joint has no placement of its own.
            pose=self._pose(element)[:-1],
            reference=Fraction(float(resolved_text(element, "ref", "0"))),
            in_degrees=kind == "hinge" and self._in_degrees,
            armature=Fraction(float(resolved_text(element, "armature", "0"))),
        )


def _name(element: etree._Element) -> str:
    """A body without a name gets one from its place, which no author's name can be."""
    if element.tag == "worldbody":
        return WORLD
    return str(element.get("name") or f"\0{element.getroottree().getpath(element)}")


def _joints_of(body: etree._Element) -> Iterator[etree._Element]:
    for child in body.iterchildren("joint", "freejoint", "frame"):
        yield from _joints_of(child) if child.tag == "frame" else (child,)
