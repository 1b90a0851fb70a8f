"""The springs and reflected inertias that a URDF declares beside its links and joints, in existing conventions.

``harness.models.model_file`` says which conventions are read.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from lxml import etree

from harness.files.tree import WORLD, Given, Placement, Pose, Spring, vector
from harness.models.formats import POINT_SPRING
from harness.models.source import Source
from harness.models.values import Numbers, not_negative, positive
from harness.models.xml import describe, literal_tag

_ROTOR_INERTIA, _GEAR_RATIO = "drake:rotor_inertia", "drake:gear_ratio"
Elements = Mapping[str, etree._Element]


@dataclass
class Beside:
    """What stands beside the joints: fields of ``Joint`` by name, and springs between points."""

    of_joints: dict[str, dict[str, Any]] = field(default_factory=dict)
    springs: tuple[Spring, ...] = ()


def read_beside(source: Source, root: etree._Element, links: Elements, joints: Elements) -> Beside:
    """Everything of that kind; raises InvalidModel at the line of what is malformed, or speaks of no joint or link of the file."""
    found = Beside(
        springs=tuple(_point_spring(source, element, links) for element in root.iterchildren("*") if literal_tag(element) == POINT_SPRING)
    )
    for what, name, element, fields in (*_joint_springs(source, root), *_armatures(source, root)):
        if name not in joints:
            source.refuse(element, f"{describe(element)} is a {what} of {name!r}, which is no joint of this file; correct the name")
        known = found.of_joints.setdefault(name, {})
        if known.keys() & fields.keys():
            source.refuse(element, f"joint {name!r} has a second {what}; expected one, with the sum of both")
        known.update(fields)
    return found


def _joint_springs(source: Source, root: etree._Element) -> Iterator[tuple[str, str, etree._Element, dict[str, Fraction]]]:
    """Gazebo's springs in joints."""
    for gazebo in root.iterchildren("gazebo"):
        stiffness = gazebo.find("springStiffness")
        if stiffness is not None:
            reference = gazebo.find("springReference")
            fields: dict[str, Fraction] = {"stiffness": _text(source, stiffness)}
            if reference is not None:
                fields["spring_reference"] = _text(source, reference)
            yield "spring", str(gazebo.get("reference")), gazebo, fields


def _armatures(source: Source, root: etree._Element) -> Iterator[tuple[str, str, etree._Element, dict[str, Fraction]]]:
    """Drake's rotors: of a transmission, the float64 gear_ratio^2 rotor_inertia."""
    for transmission in root.iterchildren("transmission"):
        for actuator in transmission.iterchildren("actuator"):
            parts = {literal_tag(part): part for part in actuator.iterchildren("*")}
            joint = transmission.find("joint")
            if _ROTOR_INERTIA in parts and joint is not None:
                inertia = source.number(parts[_ROTOR_INERTIA], "value", None, not_negative)
                ratio = source.number(parts[_GEAR_RATIO], "value", None, not_negative) if _GEAR_RATIO in parts else Fraction(1)
                reflected = Given(float(ratio) ** 2 * float(inertia), inertia.place, inertia.attribute)
                yield "transmission", str(joint.get("name")), transmission, {"armature": reflected}


def _text(source: Source, element: etree._Element) -> Given:
    (value,) = source.read(element, "", element.text or "", Numbers())
    return value


def _point_spring(source: Source, element: etree._Element, links: Elements) -> Spring:
    parts = {literal_tag(part): part for part in element.iterchildren("*")}

    def part_named(suffix: str) -> etree._Element:
        tag = f"{POINT_SPRING}_{suffix}"
        if tag not in parts:
            source.refuse(element, f"<{POINT_SPRING}> has no <{tag}>; add it")
        return parts[tag]

    def end(body: str, point: str) -> tuple[str, Pose]:
        part = part_named(body)
        name = str(part.get("name"))
        if name not in links and name != WORLD:
            source.refuse(part, f"{describe(part)} is no link of this file; correct the name")
        return name, (Placement(vector(source.numbers(part_named(point), "value", None, None, 3, 3))),)

    return Spring(
        ends=(end("body_A", "p_AP"), end("body_B", "p_BQ")),
        free_length=source.number(part_named("free_length"), "value", None, positive),
        stiffness=source.number(part_named("stiffness"), "value", None, not_negative),
        damping=source.number(part_named("damping"), "value", None, not_negative),
        place=source.place(element),
    )
