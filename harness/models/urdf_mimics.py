"""The joints of a URDF that mimic another: their position is a multiple of its position, and an offset.

Source: http://wiki.ros.org/urdf/XML/joint, element ``mimic``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from lxml import etree

from harness.models.checks import numbers
from harness.models.urdf_forces import SINGLE_AXIS, Elements
from harness.models.values import Numbers
from harness.models.xml import Document, describe, resolve


@dataclass(frozen=True)
class Mimic:
    """The position of ``joint`` is multiplier q + offset [m or rad], where q is that of the joint it follows, ``leader``."""

    joint: str
    leader: str
    multiplier: float
    offset: float
    line: int


def mimics(document: Document, joints: Elements) -> Iterator[Mimic]:
    """Joints that mimic another, in document order; raises InvalidModel at the line of a malformed one."""
    followers = {name: joint for name, joint in joints.items() if is_follower(joint)}
    for name, joint in followers.items():
        mimic = joint.find("mimic")
        leader = resolve(document, mimic, "joint", joints)
        for element, one in ((mimic, joint), (mimic, joints[leader])):
            if one.get("type") not in SINGLE_AXIS:
                document.refuse(element, f"{describe(one)} is {one.get('type')}; both joints of a mimic must be {' or '.join(SINGLE_AXIS)}")
        if leader in followers:
            document.refuse(mimic, f"{describe(joint)} mimics {leader!r}, which mimics a joint itself; name a joint that moves by itself")
        multiplier, offset = (_scalar(document, mimic, attribute, default) for attribute, default in (("multiplier", 1.0), ("offset", 0.0)))
        yield Mimic(name, leader, multiplier, offset, document.lines[mimic])
    acting = [(spring, "reference", "spring") for spring in document.root.iterchildren("gazebo")]
    acting += [(joint, "name", "transmission") for joint in document.root.iterfind("transmission/joint")]
    acting += [(joint, "name", "damper") for joint in document.root.iterfind("joint") if joint.find("dynamics[@damping]") is not None]
    for element, attribute, what in acting:
        if element.get(attribute) in followers:
            leader = followers[element.get(attribute)].find("mimic").get("joint")
            document.refuse(
                element, f"{describe(element)} has a {what} in a joint that mimics another, which is not read; give it to {leader!r}"
            )


def is_follower(joint: etree._Element) -> bool:
    """True for a joint that mimics another."""
    return joint.find("mimic") is not None


def _scalar(document: Document, mimic: etree._Element, attribute: str, default: float) -> float:
    return numbers(document, mimic, attribute, Numbers())[0] if attribute in mimic.attrib else default
