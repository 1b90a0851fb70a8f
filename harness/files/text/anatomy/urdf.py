"""Anatomy of a URDF model.

Source: http://wiki.ros.org/urdf/XML; ``harness.files.model_file`` for springs and rotors.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from harness.files.joint_kinds import JointKind
from harness.files.text.anatomy.parts import ENTRIES, Anatomy, BodySlots, InertialSlots, JointSlots, Parts, Slot
from harness.files.text.scan import Edit, Element
from harness.files.urdf.kinds import BALL_CONSTRAINT, KINDS, POINT_SPRING

_NAMESPACE = ' xmlns:drake="http://drake.mit.edu"'
_ROTOR = (
    '<transmission name="{name}_transmission"><type>transmission_interface/SimpleTransmission</type>'
    '<joint name="{name}"/><actuator name="{name}_motor"><drake:rotor_inertia value="',
    '"/></actuator></transmission>',
)
_SPRING = ('<gazebo reference="{name}"><springStiffness>', "</springStiffness><springReference>0</springReference></gazebo>")


def anatomy(parts: Parts) -> Anatomy:
    """Take the model apart."""
    carried = {_link(parts, joint, "child"): joint for joint in parts.all("robot", "joint")}
    springs = parts.all("robot", POINT_SPRING)
    points = [
        parts.inside(pair, f"{tag}_{end}")
        for tag in (POINT_SPRING, BALL_CONSTRAINT)
        for pair in parts.all("robot", tag)
        for end in ("p_AP", "p_BQ")
    ]
    return Anatomy(
        model=parts.model,
        bodies=tuple(_body(parts, link, carried.get(link.get("name"))) for link in parts.all("robot", "link")),
        positions=tuple(parts.slot(point, "value") for point in points if point is not None),
        others=tuple(_point_spring(parts, spring) for spring in springs),
    )


def _point_spring(parts: Parts, spring: Element) -> tuple[Slot, Slot, Slot]:
    stiffness, damping, length = (
        parts.slot_inside(spring, f"{POINT_SPRING}_{name}", "value", "0", alone=False) for name in ("stiffness", "damping", "free_length")
    )
    return stiffness, damping, length


def _body(parts: Parts, link: Element, joint: Element | None) -> BodySlots:
    """A link with the joint that carries it."""
    inertial = parts.inside(link, "inertial")
    return BodySlots(
        name=link.get("name") or "",
        parent=None if joint is None else _link(parts, joint, "parent"),
        offset=None if joint is None else parts.slot_inside(joint, "origin", "xyz"),
        rotation=None if joint is None else parts.slot_inside(joint, "origin", "rpy"),
        inertial=None if inertial is None else _inertial(parts, link, inertial),
        joints=_joints(parts, link, joint),
    )


def _link(parts: Parts, joint: Element, tag: str) -> str | None:
    """The link that the parent or child of a joint names."""
    part = parts.inside(joint, tag)
    return None if part is None else part.get("link")


def _inertial(parts: Parts, link: Element, inertial: Element) -> InertialSlots:
    return InertialSlots(
        body=link.get("name") or "",
        mass=parts.slot_inside(inertial, "mass", "value", "0", alone=False),
        centre=parts.slot_inside(inertial, "origin", "xyz"),
        entries=tuple(parts.slot_inside(inertial, "inertia", f"i{name}", "0", alone=False) for name in ENTRIES),
        rotation=parts.slot_inside(inertial, "origin", "rpy"),
    )


def _joints(parts: Parts, link: Element, joint: Element | None) -> tuple[JointSlots, ...]:
    if joint is None:
        own = [ball for ball in parts.all("robot", "drake:joint") if _link(parts, ball, "child") == link.get("name")]
        return tuple(JointSlots(parts.slot(ball, "name", ""), JointKind.BALL, np.zeros(3), None) for ball in own)
    kind = KINDS.get(joint.get("type") or "")
    if kind is None or kind is JointKind.PLANAR:
        return ()
    name = parts.slot(joint, "name", "")
    if kind is JointKind.FREE:
        return (JointSlots(name, kind, np.zeros(3), None),)
    spring = next((gazebo for gazebo in parts.all("robot", "gazebo") if gazebo.get("reference") == joint.get("name")), None)
    return (
        JointSlots(
            name,
            kind,
            np.zeros(3),
            parts.slot_inside(joint, "axis", "xyz", "1 0 0", alone=False),
            damping=parts.slot_inside(joint, "dynamics", "damping", "0"),
            stiffness=_stiffness(parts, joint, spring),
            spring_reference=None if spring is None else _in_spring(parts, spring, "springReference", joint),
            armature=_armature(parts, joint),
            friction=parts.slot_inside(joint, "dynamics", "friction", "0"),
        ),
    )


def _in_spring(parts: Parts, spring: Element, tag: str, joint: Element) -> Slot:
    element = parts.inside(spring, tag)
    assert element is not None
    # Both numbers must be there: a reference that is left out is zero.
    return parts.text_slot(element, spring, joint.line)


def _stiffness(parts: Parts, joint: Element, spring: Element | None) -> Slot:
    if spring is not None:
        return _in_spring(parts, spring, "springStiffness", joint)
    head, tail = _SPRING
    return parts.missing(joint, joint.end, ("springStiffness", ""), (head.format(name=joint.get("name")), tail))


def _armature(parts: Parts, joint: Element) -> Slot:
    """Rotor inertia of the transmission that drives the joint, or the place for one."""
    for transmission in parts.all("robot", "transmission"):
        driven, actuator = parts.inside(transmission, "joint"), parts.inside(transmission, "actuator")
        if driven is None or actuator is None or driven.get("name") != joint.get("name"):
            continue
        slot = parts.slot_inside(actuator, "drake:rotor_inertia", "value", "0", alone=False)
        return replace(slot, removed=(transmission.start, transmission.end), absent_line=joint.line)
    head, tail = _ROTOR
    around = head.format(name=joint.get("name")), tail
    return parts.missing(joint, joint.end, ("drake:rotor_inertia", "value"), around, along=_driven(parts, joint))


def _driven(parts: Parts, joint: Element) -> tuple[Edit, ...]:
    """Edits without which a transmission does nothing: a limit that lets it act, and the namespace of its elements."""
    edits: list[Edit] = []
    limit = parts.inside(joint, "limit")
    if limit is not None and float(limit.get("effort") or 0) == 0:
        edits += parts.slot(limit, "effort", "0").written(["1"])
    root = parts.elements[0]
    if "xmlns:drake" not in parts.text[root.start : root.opened]:
        edits.append((root.opened - 1, root.opened - 1, _NAMESPACE))
    return tuple(edits)
