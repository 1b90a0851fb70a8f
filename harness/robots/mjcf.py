"""From an MJCF to its tree of bodies.

Bodies and joints without names get names from their place, which no author's name can be.

Source: MuJoCo documentation, XML reference, ``body``, ``inertial``, ``joint``, ``frame`` and ``compiler``; Modeling, section
Frame orientations.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction

from lxml import etree

from harness.models.mjcf_defaults import resolved_text
from harness.models.mjcf_forces import GRAVITY, is_on
from harness.models.values import not_negative, not_zero
from harness.models.xml import describe
from harness.robots.mjcf_numbers import Attributes
from harness.robots.mjcf_tendons import springs
from harness.robots.source import Source
from harness.robots.tree import ORIGIN, WORLD, Body, Inertia, Joint, Tree, Vector, vector

KINDS = ("hinge", "slide", "ball", "free")


def read_tree(source: Source, root: etree._Element) -> Tree:
    """The tree of an MJCF.

    Raises:
        InvalidModel: what has no meaning, or one that is that of MuJoCo's program alone.
    """
    reader = _Reader(source, root)
    elements = [body for world in root.iterchildren("worldbody") for body in world.iter("body")]
    bodies = tuple(map(reader.body, elements))
    return Tree(bodies, _gravity(source, root), tuple(springs(source, root, reader.attributes, reader.name)), source.place(root))


def _gravity(source: Source, root: etree._Element) -> Vector:
    options = [*root.iterchildren("option")]
    if not is_on(root, "gravity"):
        return ORIGIN
    given = [option for option in options if "gravity" in option.attrib]
    return vector(
        source.numbers((given or options or [root])[-1], "gravity", GRAVITY) if given else source.default(root, "gravity", GRAVITY)
    )


class _Reader:
    """Bodies of one file."""

    def __init__(self, source: Source, root: etree._Element) -> None:
        self._source, self._root = source, root
        self.attributes = Attributes(source, root)
        self._names: dict[etree._Element, str] = {}
        self._taken: dict[str, etree._Element] = {}

    def body(self, element: etree._Element) -> Body:
        parent = next(element.iterancestors("body", "worldbody"))
        joints = tuple(map(self._joint, joints_of(element)))
        inertial = element.find("inertial")
        # A free joint's position is that of the body in the world.
        pose = () if joints and joints[0].kind == "free" else self.attributes.pose(element)
        inertia = None if inertial is None else self._inertia(inertial)
        return Body(self.name(element), self.name(parent), pose, joints, inertia, self._source.place(element))

    def name(self, element: etree._Element) -> str:
        """The name of a body or joint, or one from its place."""
        if element.tag == "worldbody":
            return WORLD
        if element not in self._names:
            name = str(element.get("name") or "")
            if not name:
                name = self._name_of_place(element)
            kind = "body" if element.tag == "body" else "joint"
            other = self._taken.setdefault(f"{kind} {name}", element)
            if other is not element or (kind == "body" and name == WORLD):
                found = (
                    "has the name of the world itself" if name == WORLD else f"repeats the name of line {self._source.place(other).line}"
                )
                self._source.refuse(element, f"{describe(element)} {found}; give each its own")
            self._names[element] = name
        return self._names[element]

    def _name_of_place(self, element: etree._Element) -> str:
        """Such as "(joint 2 of thigh)" or "(body 1 of world)", which stay the same when lines are added."""
        kind = "body" if element.tag == "body" else "joint"
        owner = next(element.iterancestors("body", "worldbody"))
        fellows = (
            [*joints_of(owner)]
            if kind == "joint"
            else [one for one in owner.iter("body") if next(one.iterancestors("body", "worldbody")) is owner]
        )
        return f"({kind} {fellows.index(element) + 1} of {self.name(owner)})"

    def _inertia(self, element: etree._Element) -> Inertia:
        source, place = self._source, self._source.place(element)
        mass, pose = source.number(element, "mass", None), self.attributes.pose(element)
        given = [name for name in ("fullinertia", "diaginertia") if name in element.attrib]
        if len(given) == 2:
            source.refuse(element, f"{describe(element)} has both diaginertia and fullinertia; expected one of them")
        if given == ["fullinertia"]:
            return Inertia(pose, mass, source.numbers(element, "fullinertia", None, None, 6, 6), place)
        moments = source.numbers(element, "diaginertia", (0, 0, 0))
        return Inertia(pose, mass, (*moments, *ORIGIN), place)

    def _joint(self, element: etree._Element) -> Joint:
        name, place, attributes = self.name(element), self._source.place(element), self.attributes
        kind = "free" if element.tag == "freejoint" else resolved_text(element, "type", "hinge")
        if kind not in KINDS:
            self._source.refuse(element, f"{describe(element)} is of type {kind!r}; expected one of {', '.join(KINDS)}")
        joint = Joint(
            name,
            kind,
            # Those of a free or ball joint belong to all of its velocities.
            armature=attributes.number(element, "armature", 0.0, not_negative),
            damping=attributes.coefficient(element, "damping", "damper"),
            stiffness=attributes.coefficient(element, "stiffness", "spring"),
            friction_loss=attributes.number(element, "frictionloss", 0.0, not_negative),
            place=place,
        )
        if kind == "free":
            return joint
        turned = replace(
            joint,
            axis=ORIGIN if kind == "ball" else vector(attributes.numbers(element, "axis", (0, 0, 1), not_zero)),
            anchor=vector(attributes.numbers(element, "pos", (0, 0, 0))),
            # A joint has no placement of its own.
            pose=attributes.pose(element)[:-1],
        )
        if kind == "ball":
            return turned
        return replace(
            turned,
            reference=attributes.number(element, "ref", 0.0),
            spring_reference=attributes.number(element, "springref", 0.0),
            in_degrees=kind == "hinge" and attributes.in_degrees,
            limits=self._limits(element),
        )

    def _limits(self, element: etree._Element) -> tuple[Fraction, Fraction] | None:
        """The range of a joint that is limited, as ``autolimits`` says where it does not say so itself."""
        lower, upper = self.attributes.numbers(element, "range", (0, 0))
        limited = resolved_text(element, "limited", "auto")
        given = lower.place != self._source.place(element) or "range" in element.attrib
        is_limited = limited == "true" or (limited == "auto" and self.attributes.auto_limits and given)
        return (lower, upper) if is_limited and lower < upper else None


def joints_of(body: etree._Element) -> Iterator[etree._Element]:
    """The joints of a body, those in its frames too."""
    for child in body.iterchildren("joint", "freejoint", "frame"):
        yield from joints_of(child) if child.tag == "frame" else (child,)
