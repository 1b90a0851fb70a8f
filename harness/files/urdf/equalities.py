"""The joints of a URDF that mimic another, and what else it ties beside its joints: Drake's ball constraints.

The position of a joint that mimics another is a multiple of its position, and an offset. Drake gives its constraint no name; the
element may have one here, which Drake passes over.

Sources: http://wiki.ros.org/urdf/XML/joint, element ``mimic``; Drake, "Parsing model files", tag drake:ball_constraint, and
drake::multibody::MultibodyPlant::AddBallConstraint.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from fractions import Fraction

from lxml import etree

from harness.files.document.source import Elements, Source, children
from harness.files.document.xml import describe
from harness.files.equalities import Equality, Linkage, Meeting
from harness.files.joint_kinds import JointKind
from harness.files.tree import Body, Given, Joint
from harness.files.urdf.beside import end_of
from harness.files.urdf.kinds import BALL_CONSTRAINT, SINGLE_AXIS

MIMIC = "mimic"
Kinds = Mapping[str, JointKind | None]


def follow(source: Source, elements: Elements, kinds: Kinds, bodies: Iterable[Body]) -> tuple[Body, ...]:
    """The bodies, whose joints that mimic another say which one moves them in the end, and how.

    Raises:
        InvalidModel: a joint mimics none of this file, one of several degrees of freedom or none, or itself by way of others.
    """
    return tuple(
        replace(body, joints=tuple(_following(source, elements, kinds, joint) for joint in body.joints))
        if any(_mimic(elements, joint.name) is not None for joint in body.joints)
        else body
        for body in bodies
    )


def read_equalities(source: Source, root: etree._Element, links: Elements, joints: Elements, kinds: Kinds) -> tuple[Equality, ...]:
    """Ball constraints in the order of the file, then each ``mimic`` of a joint that moves, as a coupling with the one that it names."""
    return (*_ball_constraints(source, root, links), *_couplings(source, joints, kinds))


def _ball_constraints(source: Source, root: etree._Element, links: Elements) -> Iterator[Equality]:
    for element in children(root, BALL_CONSTRAINT):
        (one, first), (other, second) = (end_of(source, element, links, *tags) for tags in (("body_A", "p_AP"), ("body_B", "p_BQ")))
        if one == other:
            source.refuse(element, f"{describe(element)} holds two points of link {one!r} together; name another link")
        place, meeting = source.place(element), Meeting((one, other), first, second)
        yield Equality(BALL_CONSTRAINT, place, place.line, meeting, name=str(element.get("name") or ""))


def _couplings(source: Source, joints: Elements, kinds: Kinds) -> Iterator[Equality]:
    for name, joint in joints.items():
        mimic = joint.find("mimic")
        if mimic is not None and kinds[name] is not None:
            linkage = Linkage(name, str(mimic.get("joint")), (*reversed(_numbers(source, mimic)), *(Fraction(0),) * 3))
            yield Equality(MIMIC, source.place(mimic), source.place(mimic).line, linkage, name=name)


def _numbers(source: Source, mimic: etree._Element) -> tuple[Given, Given]:
    """Multiplier and offset."""
    return source.number(mimic, "multiplier", 1.0), source.number(mimic, "offset", 0.0)


def _mimic(elements: Elements, name: str) -> etree._Element | None:
    element = elements.get(name)
    return None if element is None else element.find("mimic")


def _following(source: Source, elements: Elements, kinds: Kinds, joint: Joint) -> Joint:
    name, multiplier, offset = joint.name, Fraction(1), Fraction(0)
    passed = [name]
    while (mimic := _mimic(elements, name)) is not None:
        leader = source.resolve(mimic, "joint", elements)
        for one in (name, leader):
            kind = kinds[one]
            if kind is None or not kind.is_single:
                found = f"{describe(elements[one])} is {elements[one].get('type')}"
                source.refuse(mimic, f"{found}; both joints of a mimic must be {SINGLE_AXIS}")
        found = f"{describe(elements[name])} mimics {leader!r}, which mimics"
        if leader in passed:
            source.refuse(mimic, f"{found} it; name a joint that moves by itself")
        if _mimic(elements, leader) is not None:
            source.pass_over(mimic, f"{found} a joint itself; name a joint that moves by itself")
        times, plus = _numbers(source, mimic)
        # The numbers of a chain of joints are products, which stand nowhere.
        multiplier, offset = (times, plus) if len(passed) == 1 else (multiplier * times, multiplier * plus + offset)
        name = leader
        passed.append(name)
    return joint if name == joint.name else replace(joint, follows=name, multiplier=multiplier, offset=offset)
