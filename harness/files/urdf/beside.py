"""The springs and reflected inertias that a URDF declares beside its links and joints, in existing conventions.

``harness.files.model_file`` says which conventions are read.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from lxml import etree

from harness.files.document.source import Elements, Source, children, unresolved
from harness.files.document.values import Numbers, not_negative, positive
from harness.files.document.xml import describe, literal_tag, shorten
from harness.files.joint_kinds import JointKind
from harness.files.tree import WORLD, Given, Placement, Pose, Spring, vector
from harness.files.urdf.kinds import POINT_SPRING, needs_axis

ROTOR_INERTIA, _GEAR_RATIO = "drake:rotor_inertia", "drake:gear_ratio"
# What is left out of a robot's file.
FORCES_WITHOUT_AXIS = "springs and rotors of joints of none or several degrees of freedom"
UNREAD_ROTORS = "rotors of transmissions that Drake leaves out"


@dataclass
class Beside:
    """What stands beside the joints: fields of ``Joint`` by name, and springs between points."""

    of_joints: dict[str, dict[str, Any]] = field(default_factory=dict)
    springs: tuple[Spring, ...] = ()


def read_beside(source: Source, root: etree._Element, links: Elements, joints: Elements, kinds: Mapping[str, JointKind | None]) -> Beside:
    """Everything of that kind; raises InvalidModel at the line of what is malformed, or speaks of no joint or link of the file."""
    found = Beside(springs=tuple(_point_spring(source, element, links) for element in children(root, POINT_SPRING)))
    single = {name for name, kind in kinds.items() if kind is not None and kind.is_single}
    for gazebo in root.iterchildren("gazebo"):
        stiffness, reference = source.one(gazebo, "springStiffness"), source.one(gazebo, "springReference")
        if stiffness is not None:
            name = source.resolve(gazebo, "reference", joints)
            fields = {"stiffness": _text(source, stiffness)}
            if reference is not None:
                fields["spring_reference"] = _text(source, reference)
            if name in found.of_joints:
                source.refuse(gazebo, f"joint {name!r} has a second spring; expected one, with the sum of the stiffnesses")
            found.of_joints[name] = fields
            if name not in single:
                source.pass_over(gazebo, needs_axis(joints[name], "a spring"), FORCES_WITHOUT_AXIS)
    for name, inertia in _armatures(source, root, joints, single):
        found.of_joints.setdefault(name, {})["armature"] = inertia
    return found


def has_rotor(transmission: etree._Element) -> bool:
    """True for a transmission with a rotor in one of its actuators."""
    return any(literal_tag(part) == ROTOR_INERTIA for part in transmission.iterfind("actuator/*"))


def _armatures(source: Source, root: etree._Element, joints: Elements, single: set[str]) -> Iterator[tuple[str, Given]]:
    """Drake's rotors, joint by joint: of a transmission, the float64 gear_ratio^2 rotor_inertia."""
    driven: set[str] = set()
    for transmission in root.iterchildren("transmission"):
        rotor = has_rotor(transmission)
        if problem := _of_no_joint(transmission, rotor, joints):
            source.pass_over(transmission, f"{describe(transmission)} {problem}", UNREAD_ROTORS if rotor else "")
            continue
        carrier = source.one(transmission, "joint")
        name = source.resolve(carrier, "name", joints)
        if name in driven:
            source.refuse(transmission, f"joint {name!r} has a second transmission; expected one, with the sum of the reflected inertias")
        driven.add(name)
        limit = source.one(joints[name], "limit")
        if name not in single:
            source.pass_over(carrier, needs_axis(joints[name], "a transmission"), FORCES_WITHOUT_AXIS)
        elif limit is not None and "effort" in limit.attrib and not source.number(limit, "effort", None):
            problem = "has effort 0, with which Drake leaves out its transmission; write more than zero"
            source.pass_over(limit, f"{describe(joints[name])} {problem}", UNREAD_ROTORS)
        else:
            yield name, _reflected(source, transmission)


def _of_no_joint(transmission: etree._Element, rotor: bool, joints: Elements) -> str:
    """The complaint about a transmission that moves no joint by a rotor; "" for one that does."""
    kind = transmission.findtext("type") or transmission.get("type") or ""
    if "SimpleTransmission" not in kind:
        found = f"is of type {shorten(kind)!r}" if kind else "has no <type>"
        return f"{found}; expected <type>transmission_interface/SimpleTransmission</type>"
    carrier = transmission.find("joint")
    if carrier is None:
        return "has no <joint>; add it"
    if rotor:
        return ""
    if carrier.get("name") not in joints:
        return f"has no <{ROTOR_INERTIA}>, and {unresolved(carrier, 'name', joints)}"
    return f"has no <{ROTOR_INERTIA}>; add it, or remove the transmission, which does nothing"


def _reflected(source: Source, transmission: etree._Element) -> Given:
    """The inertia that the rotor of a transmission adds to its joint."""
    actuator = source.one(transmission, "actuator")
    assert actuator is not None
    rotor, gear = source.one(actuator, ROTOR_INERTIA), source.one(actuator, _GEAR_RATIO)
    inertia = source.number(rotor, "value", None, not_negative)
    ratio = 1.0 if gear is None else float(source.number(gear, "value", None, not_negative))
    return Given(ratio**2 * float(inertia), inertia.place, inertia.attribute)


def _text(source: Source, element: etree._Element) -> Given:
    (value,) = source.read(element, "", element.text or "", Numbers())
    return value


def end_of(source: Source, element: etree._Element, links: Elements, body: str, point: str) -> tuple[str, Pose]:
    """A link, or the world, and a place in it, as Drake's elements name them."""
    for part in element.iterchildren("*"):
        source.one(element, literal_tag(part))
    part, place = (_part(source, element, suffix) for suffix in (body, point))
    if part.get("name") == WORLD and WORLD not in links:
        source.pass_over(part, unresolved(part, "name", links))
        name = WORLD
    else:
        name = source.resolve(part, "name", links)
    return name, (Placement(vector(source.numbers(place, "value", None, None, 3, 3))),)


def _part(source: Source, element: etree._Element, suffix: str) -> etree._Element:
    """A part of one of Drake's elements, whose tag is that of the element with a suffix."""
    tag = f"{literal_tag(element)}_{suffix}"
    part = source.one(element, tag)
    if part is None:
        source.refuse(element, f"{describe(element)} has no <{tag}>; add it")
    return part


def _point_spring(source: Source, element: etree._Element, links: Elements) -> Spring:
    return Spring(
        ends=(end_of(source, element, links, "body_A", "p_AP"), end_of(source, element, links, "body_B", "p_BQ")),
        free_length=source.number(_part(source, element, "free_length"), "value", None, positive),
        stiffness=source.number(_part(source, element, "stiffness"), "value", None, not_negative),
        damping=source.number(_part(source, element, "damping"), "value", None, not_negative),
        place=source.place(element),
    )
