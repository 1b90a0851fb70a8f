"""The constraints of an MJCF: what stands in ``<equality>``, by sites, joints and tendons.

A constraint of bodies instead of sites is refused where it is read (``harness.models.refusals``): MuJoCo takes one of its points from
the zero position of the model, so that it is another mechanism wherever the loop is open there.

Source: MuJoCo documentation, XML reference, equality, option and flag.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from lxml import etree

from harness.files.constraints import (
    POLYNOMIAL,
    SOLIMP,
    SOLREF,
    UNTURNED,
    End,
    FrameConstraint,
    JointConstraint,
    ModelConstraint,
    PointConstraint,
    Softness,
    Tendon,
    TendonConstraint,
)
from harness.files.tree import WORLD
from harness.models.formats import ORIENTATIONS, SOLVER_OPTIONS
from harness.models.mjcf.defaults import resolved, resolved_text, writings
from harness.models.mjcf.options import in_degrees, is_on
from harness.models.values import one_sign
from harness.models.xml import Document, add_named, describe, resolve, shorten

Elements = Mapping[str, etree._Element]


def read_constraints(document: Document, joints: Elements) -> tuple[ModelConstraint, ...]:
    """The constraints of an MJCF in document order; ``joints`` are its moving joints.

    Raises:
        InvalidModel: at the line of one without a name, of one that is switched off, of one that names nothing in the file or what
            cannot be constrained, and of an option for constraints where there are none.
    """
    reader = _Reader(document, joints)
    elements: dict[str, etree._Element] = {}
    for section in document.root.iterfind("equality"):
        if section.find("*") is None:
            document.refuse(section, "<equality> holds no constraint; remove it")
        for element in section.iterchildren("*"):
            add_named(document, element, elements)
            _refuse_switched_off(document, element)
    if not elements:
        _refuse_options(document)
    return tuple(reader.read(name, element) for name, element in elements.items())


def _refuse_switched_off(document: Document, element: etree._Element) -> None:
    active = resolved(element, "active")
    if active is not None and active.text == "false":
        document.refuse(element, f'{describe(element)} is switched off by active="false", so that nothing feels it; remove one of them')
    for stage in ("constraint", "equality"):
        if not is_on(document.root, stage):
            document.refuse(element, f'{describe(element)} is switched off by <flag {stage}="disable">; remove one of them')


def _refuse_options(document: Document) -> None:
    """Refuse what bears on constraints alone."""
    for option in document.root.iterfind("option"):
        for name in (name for name in SOLVER_OPTIONS if name in option.attrib):
            shown = f'<option {name}="{shorten(option.get(name))}">'
            document.refuse(option, f"{shown} is for constraints, of which the file has none; remove it")
    for flag in document.root.iterfind("option/flag[@diagexact]"):
        document.refuse(flag, "<flag diagexact> is for constraints, of which the file has none; remove it")


class _Reader:
    """Constraints of one file, by their tags."""

    def __init__(self, document: Document, joints: Elements) -> None:
        self._document, self._joints = document, joints
        root = document.root
        self._sites = _named(site for world in root.iterfind("worldbody") for site in world.iter("site"))
        self._tendons = _named(root.iterfind("tendon/*"))

    def read(self, name: str, element: etree._Element) -> ModelConstraint:
        readers: Mapping[str, Callable[[str, etree._Element], ModelConstraint]] = {
            "connect": self._connect,
            "weld": self._weld,
            "joint": self._joint,
            "tendon": self._tendon,
        }
        return readers[element.tag](name, element)

    def _connect(self, name: str, element: etree._Element) -> PointConstraint:
        first, second = self._end(element, "site1"), self._end(element, "site2")
        self._refuse_same_body(element, first, second)
        return PointConstraint(name, self._document.lines[element], self._softness(element), (first, second))

    def _weld(self, name: str, element: etree._Element) -> FrameConstraint:
        ends = self._end(element, "site1", turned=True), self._end(element, "site2", turned=True)
        self._refuse_same_body(element, *ends)
        scale = float(element.get("torquescale", "1"))
        return FrameConstraint(name, self._document.lines[element], self._softness(element), ends, scale)

    def _joint(self, name: str, element: etree._Element) -> JointConstraint:
        joint = self._single_axis(element, "joint1")
        leader = self._single_axis(element, "joint2") if "joint2" in element.attrib else None
        if joint == leader:
            self._document.refuse(element, f"{describe(element)} couples joint {joint!r} to itself; name another one")
        return JointConstraint(
            name,
            self._document.lines[element],
            self._softness(element),
            joint,
            leader,
            _polynomial(element),
            (self._reference(joint), 0.0 if leader is None else self._reference(leader)),
        )

    def _tendon(self, name: str, element: etree._Element) -> TendonConstraint:
        tendon = self._path(element, "tendon1")
        leader = self._path(element, "tendon2") if "tendon2" in element.attrib else None
        if leader is not None and tendon.name == leader.name:
            self._document.refuse(element, f"{describe(element)} couples tendon {tendon.name!r} to itself; name another one")
        return TendonConstraint(name, self._document.lines[element], self._softness(element), tendon, leader, _polynomial(element))

    def _softness(self, element: etree._Element) -> Softness:
        first, second = _filled(element, "solref", SOLREF)
        if complaint := one_sign((first, second)):
            self._document.refuse(
                element, f'{describe(element)} has solref="{first:g} {second:g}" with its default class, which {complaint}'
            )
        least, most, width, midpoint, power = _filled(element, "solimp", SOLIMP)
        return Softness((first, second), (least, most, width, midpoint, power))

    def _end(self, element: etree._Element, attribute: str, turned: bool = False) -> End:
        """The site that an attribute names, in the frame of its body."""
        site = self._sites[resolve(self._document, element, attribute, self._sites)]
        holder = site.getparent()
        if holder.tag == "frame":
            self._document.refuse(
                site, f"{describe(site)} of a constraint stands in a <frame>, which is not read; write its pose in its body"
            )
        body = WORLD if holder.tag == "worldbody" else holder.get("name")
        if not body:
            self._document.refuse(holder, f"<body> holds {describe(site)} of a constraint and has no name; add one")
        x, y, z = map(float, resolved_text(site, "pos", "0 0 0").split())
        return End(body, (x, y, z), self._turn(site) if turned else UNTURNED)

    def _turn(self, site: etree._Element) -> tuple[float, float, float, float]:
        for name in ORIENTATIONS:
            if name != "quat" and resolved(site, name) is not None:
                self._document.refuse(site, f"{describe(site)} of a weld is turned by {name!r}, which is not read there; write a quat")
        w, x, y, z = map(float, resolved_text(site, "quat", "1 0 0 0").split())
        return w, x, y, z

    def _refuse_same_body(self, element: etree._Element, first: End, second: End) -> None:
        if first.body == second.body:
            self._document.refuse(element, f"{describe(element)} holds two sites of body {first.body!r} together; name one of another body")

    def _single_axis(self, element: etree._Element, attribute: str) -> str:
        name = resolve(self._document, element, attribute, self._joints)
        joint = self._joints[name]
        kind = "free" if joint.tag == "freejoint" else resolved_text(joint, "type", "hinge")
        if kind not in ("hinge", "slide"):
            self._document.refuse(element, f"{describe(element)} couples joint {name!r}, which is {kind}; expected a hinge or a slide")
        return name

    def _reference(self, name: str) -> float:
        joint = self._joints[name]
        reference = float(resolved_text(joint, "ref", "0"))
        is_angle = resolved_text(joint, "type", "hinge") == "hinge" and in_degrees(self._document.root)
        return math.radians(reference) if is_angle else reference

    def _path(self, element: etree._Element, attribute: str) -> Tendon:
        name = resolve(self._document, element, attribute, self._tendons)
        tendon = self._tendons[name]
        parts = list(tendon.iterchildren("*"))
        if tendon.tag == "fixed":
            return Tendon(name, tuple((str(part.get("joint")), float(part.get("coef"))) for part in parts), ())
        for part in parts:
            if part.tag == "pulley":
                self._document.refuse(part, f"<pulley> divides {describe(tendon)}, which {describe(element)} holds; expected sites alone")
        return Tendon(name, (), tuple(self._end(part, "site") for part in parts))


def _named(elements: object) -> dict[str, etree._Element]:
    return {str(element.get("name")): element for element in elements if element.get("name")}  # type: ignore[attr-defined]


def _filled(element: etree._Element, name: str, defaults: tuple[float, ...]) -> tuple[float, ...]:
    """The numbers of an attribute; of a shorter list each further one is that of the class, and at last the default."""
    found: list[float] = []
    for written in writings(element, name):
        found += map(float, written.text.split()[len(found) :])
    return (*found, *defaults[len(found) :])


def _polynomial(element: etree._Element) -> tuple[float, float, float, float, float]:
    constant, first, second, third, fourth = _filled(element, "polycoef", POLYNOMIAL)
    return constant, first, second, third, fourth
