"""The springs, dampers and reflected inertias that a URDF declares beside links and joints, in existing conventions.

``harness.models.model_file`` says which conventions are read.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from lxml import etree

from harness.files.constraints import Point
from harness.models.checks import numbers
from harness.models.formats import POINT_SPRING
from harness.models.values import Numbers, not_negative, positive
from harness.models.xml import Document, describe, literal_tag, resolve, shorten

SINGLE_AXIS = ("revolute", "prismatic", "continuous")
_ROTOR_INERTIA, _GEAR_RATIO = "drake:rotor_inertia", "drake:gear_ratio"

Elements = Mapping[str, etree._Element]


@dataclass(frozen=True)
class JointSpring:
    """Force -stiffness (q - reference) in a joint [N/m and m, or N m/rad and rad]."""

    joint: str
    stiffness: float
    reference: float
    line: int


@dataclass(frozen=True)
class JointDamper:
    """Force -damping v in a joint [N s/m or N m s/rad]."""

    joint: str
    damping: float
    line: int


@dataclass(frozen=True)
class PointSpring:
    """Spring and damper between a point of body A and a point of body B, each in its link's frame [m].

    ``stiffness`` [N/m] acts on the length beyond ``free_length`` [m], ``damping`` [N s/m] on its rate.
    """

    body_a: str
    point_a: Point
    body_b: str
    point_b: Point
    free_length: float
    stiffness: float
    damping: float
    line: int

    @property
    def ends(self) -> tuple[tuple[str, Point], tuple[str, Point]]:
        """Body and point of either end."""
        return (self.body_a, self.point_a), (self.body_b, self.point_b)


@dataclass(frozen=True)
class Armature:
    """Inertia [kg m^2, or kg] that a geared rotor adds to its joint: gear_ratio^2 rotor_inertia.

    The gear ratio is a number for a revolute joint and in 1/m for a prismatic one.
    """

    joint: str
    reflected_inertia: float
    line: int


ForceElement = JointSpring | JointDamper | PointSpring


def force_elements(document: Document, links: Elements, joints: Elements) -> Iterator[ForceElement]:
    """Springs and dampers in document order; raises InvalidModel at the line of a malformed one."""
    sprung: set[str] = set()
    for element in document.root.iterchildren("*"):
        tag = literal_tag(element)
        if tag == "joint":
            yield from _joint_damper(document, element)
        elif tag == "gazebo":
            spring = _joint_spring(document, element, joints)
            if spring.joint in sprung:
                document.refuse(element, f"joint {spring.joint!r} has a second spring; expected one, with the sum of the stiffnesses")
            sprung.add(spring.joint)
            yield spring
        elif tag == POINT_SPRING:
            yield _point_spring(document, element, links)


def armatures(document: Document, joints: Elements) -> Iterator[Armature]:
    """Reflected inertias in document order; raises InvalidModel at the line of a malformed one."""
    driven: set[str] = set()
    for transmission in document.root.iterfind("transmission"):
        kind = transmission.findtext("type") or transmission.get("type") or ""
        if "SimpleTransmission" not in kind:
            found = f"is of type {shorten(kind)!r}" if kind else "has no <type>"
            document.refuse(
                transmission, f"{describe(transmission)} {found}; expected <type>transmission_interface/SimpleTransmission</type>"
            )
        carrier, actuator = transmission.find("joint"), transmission.find("actuator")
        name = resolve(document, carrier, "name", joints)
        _require_single_axis(document, carrier, joints[name], "a transmission")
        if name in driven:
            document.refuse(transmission, f"joint {name!r} has a second transmission; expected one, with the sum of the reflected inertias")
        driven.add(name)
        limit = joints[name].find("limit")
        if limit is not None and numbers(document, limit, "effort", Numbers())[0] == 0:
            document.refuse(
                limit, f"{describe(joints[name])} has effort 0, with which Drake leaves out its transmission; write more than zero"
            )
        values = {literal_tag(part): numbers(document, part, "value", Numbers(check=not_negative))[0] for part in _once(document, actuator)}
        if _ROTOR_INERTIA not in values:
            document.refuse(
                actuator, f"{describe(actuator)} has no <{_ROTOR_INERTIA}>; add it, or remove the transmission, which does nothing"
            )
        yield Armature(name, values.get(_GEAR_RATIO, 1.0) ** 2 * values[_ROTOR_INERTIA], document.lines[transmission])


def _once(document: Document, element: etree._Element) -> list[etree._Element]:
    """The parts of ``element`` that are read by their tag, each of which may stand there once."""
    parts: dict[str, etree._Element] = {}
    for part in element.iterchildren("*"):
        tag = literal_tag(part)
        if tag in parts:
            document.refuse(part, f"second <{tag}> in {describe(element)}; expected one, keep the right one")
        parts[tag] = part
    return [part for tag, part in parts.items() if tag.startswith("drake:")]


def _require_single_axis(document: Document, element: etree._Element, joint: etree._Element, what: str) -> None:
    kind = joint.get("type")
    if kind not in SINGLE_AXIS:
        document.refuse(element, f"{describe(joint)} is {kind}; {what} needs a joint that is {' or '.join(SINGLE_AXIS)}")


def _joint_damper(document: Document, joint: etree._Element) -> Iterator[JointDamper]:
    dynamics = joint.find("dynamics")
    if dynamics is None:
        return
    if not {"damping", "friction"} & set(dynamics.attrib):
        document.refuse(dynamics, f"<dynamics> of {describe(joint)} has no damping; add it, or remove the element")
    if "damping" not in dynamics.attrib:
        return
    (damping,) = numbers(document, dynamics, "damping", Numbers(check=not_negative))
    if damping:
        _require_single_axis(document, dynamics, joint, "a damper")
    if joint.get("type") in SINGLE_AXIS:
        yield JointDamper(joint.get("name"), damping, document.lines[dynamics])


def _joint_spring(document: Document, gazebo: etree._Element, joints: Elements) -> JointSpring:
    stiffness, reference = (numbers(document, gazebo.find(tag), "", Numbers())[0] for tag in ("springStiffness", "springReference"))
    name = resolve(document, gazebo, "reference", joints)
    _require_single_axis(document, gazebo, joints[name], "a spring")
    return JointSpring(name, stiffness, reference, document.lines[gazebo])


def _point_spring(document: Document, element: etree._Element, links: Elements) -> PointSpring:
    parts = {literal_tag(part): part for part in _once(document, element)}

    def part_named(suffix: str) -> etree._Element:
        tag = f"{POINT_SPRING}_{suffix}"
        if tag not in parts:
            document.refuse(element, f"<{POINT_SPRING}> has no <{tag}>; add it")
        return parts[tag]

    def point(suffix: str) -> Point:
        x, y, z = numbers(document, part_named(suffix), "value", Numbers(3))
        return x, y, z

    def scalar(suffix: str, rule: Numbers) -> float:
        return numbers(document, part_named(suffix), "value", rule)[0]

    return PointSpring(
        body_a=resolve(document, part_named("body_A"), "name", links),
        point_a=point("p_AP"),
        body_b=resolve(document, part_named("body_B"), "name", links),
        point_b=point("p_BQ"),
        free_length=scalar("free_length", Numbers(check=positive)),
        stiffness=scalar("stiffness", Numbers(check=not_negative)),
        damping=scalar("damping", Numbers(check=not_negative)),
        line=document.lines[element],
    )
