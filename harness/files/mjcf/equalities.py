"""The equalities of an MJCF, of which those of points and frames, and couplings of joints and of fixed tendons, are read.

Source: MuJoCo documentation, XML reference, ``equality``, ``option/flag``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping

from lxml import etree

from harness.files.document.source import Elements, Source, unresolved
from harness.files.document.values import one_sign
from harness.files.equalities import (
    POLYNOMIAL,
    SOLIMP,
    SOLREF,
    Equality,
    Linkage,
    Meeting,
    Polygon,
    Rows,
    SolverParameters,
    Sum,
    Tendon,
    TendonLinkage,
    Weld,
)
from harness.files.joint_kinds import JointKind
from harness.files.mjcf.defaults import resolved_text
from harness.files.mjcf.numbers import JOINTS, Attributes
from harness.files.mjcf.options import is_on
from harness.files.mjcf.tendons import tendons
from harness.files.tree import WORLD, Body, Placement, Pose, Quaternion, vector

# Of a weld: a quaternion of zero stands for the orientation at the reference.
_AT_REFERENCE = (0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
_UNWRITTEN = "is of a kind whose rows the harness does not write"
_ALONG_PATH = "is about a tendon that runs along a path, or about none of this file"


class _NotRead(Exception):
    """What an equality speaks of is not there, or not read; the message says what."""


def read_equalities(
    source: Source, root: etree._Element, attributes: Attributes, name: Callable[[etree._Element], str], bodies: Iterable[Body]
) -> tuple[Equality, ...]:
    """The equalities of a file in its order; ``name`` gives the name of a body's element."""
    reader = _EqualityReader(source, root, attributes, name, bodies)
    return tuple(reader.read(element) for section in root.iterchildren("equality") for element in section.iterchildren("*"))


class _EqualityReader:
    def __init__(
        self, source: Source, root: etree._Element, attributes: Attributes, name: Callable[[etree._Element], str], bodies: Iterable[Body]
    ) -> None:
        self._source, self._attributes, self._name = source, attributes, name
        worlds = [*root.iterchildren("worldbody")]
        self._sites = _by_name(site for world in worlds for site in world.iter("site"))
        self._joints = _by_name(joint for world in worlds for joint in world.iter(*JOINTS))
        self._tendons = _by_name(tendons(root))
        self._bodies = _by_name(body for world in worlds for body in world.iter("body"))
        self._singles = {joint.name for body in bodies for joint in body.joints if joint.kind.is_single}
        self._is_on = all(is_on(root, stage) for stage in ("constraint", "equality"))
        floating = {body.name for body in bodies if any(joint.kind is JointKind.FREE for joint in body.joints)}
        elements = {name(body): body for world in worlds for body in world.iter("body")}
        self._floating = tuple((key, attributes.pose(elements[key])) for key in elements if key in floating)

    def read(self, element: etree._Element) -> Equality:
        readers: Mapping[str, Callable[[etree._Element], Rows]] = {
            "connect": self._connect,
            "weld": self._weld,
            "joint": self._joint,
            "tendon": self._tendon,
        }
        says, why_not, softness = None, _UNWRITTEN, None
        try:
            if element.tag in readers:
                says, why_not, softness = readers[str(element.tag)](element), "", self._softness(element)
        except _NotRead as problem:
            says, why_not = None, str(problem)
        if isinstance(says, TendonLinkage) and any(isinstance(tendon, Polygon) for tendon in says.tendons):
            why_not = _ALONG_PATH
        place, (line,) = self._source.place(element), self._source.lines([element])
        is_active = self._is_on and resolved_text(element, "active", "true") != "false"
        return Equality(str(element.tag), place, line, says, why_not, softness, is_active, str(element.get("name") or ""))

    def _softness(self, element: etree._Element) -> SolverParameters:
        time, ratio = map(float, self._attributes.numbers(element, "solref", SOLREF))
        if complaint := one_sign((time, ratio)):
            raise _NotRead(f'has solref="{time:g} {ratio:g}" with its default class, which {complaint}')
        least, most, width, midpoint, power = map(float, self._attributes.numbers(element, "solimp", SOLIMP))
        return SolverParameters((time, ratio), (least, most, width, midpoint, power))

    def _connect(self, element: etree._Element) -> Meeting:
        if "site1" in element.attrib:
            (one, first), (other, second) = self._site(element, "site1"), self._site(element, "site2")
            return Meeting((one, other), first, second)
        bodies = self._body(element, "body1"), self._body(element, "body2")
        anchor = Placement(vector(self._source.numbers(element, "anchor", None, fewest=3, most=3)))
        return Meeting(bodies, (anchor,), None, self._floating)

    def _weld(self, element: etree._Element) -> Weld:
        scale = self._source.number(element, "torquescale", 1.0)
        if "site1" in element.attrib:
            (one, first), (other, second) = self._site(element, "site1"), self._site(element, "site2")
            return Weld((one, other), first, second, torque_scale=scale)
        # The frame of the second body at its anchor is the one that is given; that of the first may be where it is at the reference.
        bodies = self._body(element, "body2"), self._body(element, "body1")
        anchor = Placement(vector(self._source.numbers(element, "anchor", (0.0, 0.0, 0.0))))
        relative = self._source.numbers(element, "relpose", _AT_REFERENCE)
        held = Placement(vector(relative[:3]), (Quaternion(tuple(relative[3:])),)) if any(relative[3:]) else None
        return Weld(bodies, (anchor,), None if held is None else (held,), self._floating, scale)

    def _named(self, element: etree._Element, attribute: str, known: Elements) -> etree._Element:
        if element.get(attribute) not in known:
            raise _NotRead(f"is not read: {unresolved(element, attribute, known)}")
        return known[str(element.get(attribute))]

    def _site(self, element: etree._Element, attribute: str) -> tuple[str, Pose]:
        site = self._named(element, attribute, self._sites)
        return self._name(next(site.iterancestors("body", "worldbody"))), self._attributes.pose(site)

    def _body(self, element: etree._Element, attribute: str) -> str:
        if element.get(attribute, WORLD) == WORLD:
            return WORLD
        return self._name(self._named(element, attribute, self._bodies))

    def _single(self, element: etree._Element, attribute: str) -> str:
        """The hinge or slide that an attribute names."""
        self._named(element, attribute, self._joints)
        joint = str(element.get(attribute))
        if joint not in self._singles:
            raise _NotRead(f"couples joint {joint!r}, which is no hinge or slide")
        return joint

    def _joint(self, element: etree._Element) -> Linkage:
        joint, leader = self._single(element, "joint1"), self._single(element, "joint2") if "joint2" in element.attrib else None
        return Linkage(joint, leader, self._attributes.numbers(element, "polycoef", POLYNOMIAL))

    def _tendon(self, element: etree._Element) -> TendonLinkage:
        tendon = self._length(self._named(element, "tendon1", self._tendons))
        leader = self._length(self._named(element, "tendon2", self._tendons)) if "tendon2" in element.attrib else None
        coefficients = self._attributes.numbers(element, "polycoef", POLYNOMIAL)
        return TendonLinkage(tendon, leader, coefficients)

    def _length(self, tendon: etree._Element) -> Tendon:
        name, parts = str(tendon.get("name")), list(tendon.iterchildren("*"))
        if tendon.tag == "fixed":
            return Sum(name, tuple((self._single(part, "joint"), self._source.number(part, "coef", None)) for part in parts))
        if any(part.tag != "site" for part in parts):
            raise _NotRead(_ALONG_PATH)
        return Polygon(name, tuple(self._site(part, "site") for part in parts))


def _by_name(elements: Iterator[etree._Element]) -> Elements:
    return {str(element.get("name")): element for element in elements if element.get("name")}
