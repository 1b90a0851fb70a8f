"""The equalities of an MJCF, of which those of points and frames, and couplings of joints and of fixed tendons, are read.

Source: MuJoCo documentation, XML reference, ``equality``, ``option/flag``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping

from lxml import etree

from harness.files.constraints import POLYNOMIAL, SOLIMP, SOLREF, Softness
from harness.files.equalities import Equality, Linkage, Meeting, Rows, Sum, TendonLinkage, Weld
from harness.files.joint_kinds import JointKind
from harness.files.tree import WORLD, Body, Placement, Pose, Quaternion, vector
from harness.models.mjcf.defaults import resolved_text
from harness.models.mjcf.numbers import Attributes
from harness.models.mjcf.options import is_on
from harness.models.mjcf.tendons import tendons
from harness.models.source import Source
from harness.models.values import one_sign

# Of a weld: a quaternion of zero stands for the orientation at the reference.
_AT_REFERENCE = (0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
_UNWRITTEN = "is of a kind whose rows the harness does not write"


class _NotRead(Exception):
    """What an equality speaks of is not there, or not read; the message says what."""


def read_equalities(
    source: Source, root: etree._Element, attributes: Attributes, name: Callable[[etree._Element], str], bodies: Iterable[Body]
) -> tuple[Equality, ...]:
    """The equalities of a file in its order; ``name`` gives the name of a body's element."""
    reader = _Reader(source, root, attributes, name, bodies)
    return tuple(reader.read(element) for section in root.iterchildren("equality") for element in section.iterchildren("*"))


class _Reader:
    def __init__(
        self, source: Source, root: etree._Element, attributes: Attributes, name: Callable[[etree._Element], str], bodies: Iterable[Body]
    ) -> None:
        self._source, self._attributes, self._name = source, attributes, name
        worlds = [*root.iterchildren("worldbody")]
        self._sites = _named(site for world in worlds for site in world.iter("site"))
        self._tendons = _named(tendons(root))
        self._bodies = {WORLD: WORLD} | {key: name(body) for key, body in _named(b for world in worlds for b in world.iter("body")).items()}
        self._single = {joint.name for body in bodies for joint in body.joints if joint.kind.is_single}
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
        rows, why_not, softness = None, _UNWRITTEN, None
        try:
            if element.tag in readers:
                rows, why_not, softness = readers[str(element.tag)](element), "", self._softness(element)
        except _NotRead as problem:
            rows, why_not = None, str(problem)
        (line,) = self._source.lines([element])
        is_active = self._is_on and resolved_text(element, "active", "true") != "false"
        return Equality(str(element.tag), self._source.place(element), line, rows, why_not, softness, is_active)

    def _softness(self, element: etree._Element) -> Softness:
        time, ratio = map(float, self._attributes.numbers(element, "solref", SOLREF))
        if complaint := one_sign((time, ratio)):
            raise _NotRead(f"has a solref that {complaint}")
        least, most, width, midpoint, power = map(float, self._attributes.numbers(element, "solimp", SOLIMP))
        return Softness((time, ratio), (least, most, width, midpoint, power))

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

    def _site(self, element: etree._Element, attribute: str) -> tuple[str, Pose]:
        site = self._sites.get(str(element.get(attribute)))
        if site is None:
            raise _NotRead(f"names no site of this file by {attribute}")
        return self._name(next(site.iterancestors("body", "worldbody"))), self._attributes.pose(site)

    def _body(self, element: etree._Element, attribute: str) -> str:
        named = str(element.get(attribute, WORLD))
        if named not in self._bodies:
            raise _NotRead(f"names no body of this file by {attribute}")
        return self._bodies[named]

    def _joint(self, element: etree._Element) -> Linkage:
        names = [str(element.get(attribute)) for attribute in ("joint1", "joint2") if attribute in element.attrib]
        if not names or not self._single.issuperset(names):
            raise _NotRead("names no hinge or slide of this file")
        coefficients = self._attributes.numbers(element, "polycoef", POLYNOMIAL)
        return Linkage(names[0], names[1] if len(names) > 1 else None, coefficients)

    def _tendon(self, element: etree._Element) -> TendonLinkage:
        tendons = [self._sum(str(element.get(attribute))) for attribute in ("tendon1", "tendon2") if attribute in element.attrib]
        if not tendons:
            raise _NotRead("names no tendon")
        coefficients = self._attributes.numbers(element, "polycoef", POLYNOMIAL)
        return TendonLinkage(tendons[0], tendons[1] if len(tendons) > 1 else None, coefficients)

    def _sum(self, name: str) -> Sum:
        tendon = self._tendons.get(name)
        if tendon is None or tendon.tag != "fixed":
            raise _NotRead("is about a tendon that runs along a path, or about none of this file")
        parts = [*tendon.iterchildren("joint")]
        names = [str(part.get("joint")) for part in parts]
        if not self._single.issuperset(names):
            raise _NotRead("is about a tendon of what is no hinge or slide of this file")
        return Sum(name, tuple((joint, self._source.number(part, "coef", None)) for joint, part in zip(names, parts, strict=True)))


def _named(elements: Iterator[etree._Element]) -> dict[str, etree._Element]:
    return {str(element.get("name")): element for element in elements if element.get("name")}
