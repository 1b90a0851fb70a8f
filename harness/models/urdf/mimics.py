"""The joints of a URDF that mimic another: their position is a multiple of its position, and an offset.

Source: http://wiki.ros.org/urdf/XML/joint, element ``mimic``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from fractions import Fraction

from lxml import etree

from harness.files.equalities import Equality, Linkage
from harness.files.joint_kinds import JointKind
from harness.files.tree import Body, Joint, Tree
from harness.models.source import Source
from harness.models.xml import describe, literal_tag

JOINT_TAGS = ("joint", "drake:joint")


def follow(source: Source, elements: Mapping[str, etree._Element], bodies: Iterable[Body]) -> tuple[Body, ...]:
    """The bodies, whose joints that mimic another say which one moves them in the end, and how.

    Raises:
        InvalidModel: a joint mimics none of this file, one of several degrees of freedom or none, or itself by way of others.
    """
    bodies = tuple(bodies)
    kinds = {joint.name: joint.kind for body in bodies for joint in body.joints}
    return tuple(
        replace(body, joints=tuple(_following(source, elements, kinds, joint) for joint in body.joints))
        if any(_mimic(elements, joint.name) is not None for joint in body.joints)
        else body
        for body in bodies
    )


def equalities(source: Source, root: etree._Element, tree: Tree) -> tuple[Equality, ...]:
    """Each ``mimic`` of a joint that moves, as a coupling with the one that it names; ``follow`` has read the joints of the tree."""
    following, found = {joint.name for joint in tree.joints if joint.follows}, []
    for joint in root.iterchildren("*"):
        mimic = joint.find("mimic") if literal_tag(joint) in JOINT_TAGS else None
        if mimic is not None and joint.get("name") in following:
            zero = Fraction(0)
            coefficients = source.number(mimic, "offset", 0.0), source.number(mimic, "multiplier", 1.0), zero, zero, zero
            linkage = Linkage(str(joint.get("name")), str(mimic.get("joint")), coefficients)
            found.append(Equality("mimic", source.place(mimic), source.place(mimic).line, linkage))
    return tuple(found)


def _mimic(elements: Mapping[str, etree._Element], name: str) -> etree._Element | None:
    element = elements.get(name)
    return None if element is None else element.find("mimic")


def _following(source: Source, elements: Mapping[str, etree._Element], kinds: Mapping[str, JointKind], joint: Joint) -> Joint:
    name, multiplier, offset = joint.name, Fraction(1), Fraction(0)
    passed = [name]
    while (mimic := _mimic(elements, name)) is not None:
        leader = str(mimic.get("joint"))
        if leader not in elements:
            source.refuse(mimic, f"{describe(elements[name])} mimics {leader!r}, which is no joint of this file; correct the name")
        for one in (name, leader):
            if one not in kinds or not kinds[one].is_single:
                kind = elements[one].get("type")
                source.refuse(
                    mimic, f"{describe(elements[one])} is {kind}; both joints of a mimic must be revolute, continuous or prismatic"
                )
        if leader in passed:
            source.refuse(mimic, f"{describe(elements[name])} mimics {leader!r}, which mimics it; name a joint that moves by itself")
        times, plus = source.number(mimic, "multiplier", 1.0), source.number(mimic, "offset", 0.0)
        first = len(passed) == 1
        # The numbers of a chain of joints are products, which stand nowhere.
        multiplier, offset = (times, plus) if first else (multiplier * times, multiplier * plus + offset)
        name = leader
        passed.append(name)
    return joint if name == joint.name else replace(joint, follows=name, multiplier=multiplier, offset=offset)
