"""Declarations of a URDF beside its links and joints, in existing conventions: springs, reflected inertias, mimics and ball constraints.

``harness.files.model_file`` says which conventions are read. The position of a joint that mimics another is a multiple of its position,
and an offset. Drake gives its ball constraint no name; the element may have one here, which Drake passes over.

Sources: http://wiki.ros.org/urdf/XML/joint, element ``mimic``; Drake, "Parsing model files", and
drake::multibody::MultibodyPlant::AddBallConstraint.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

from lxml import etree

from harness.files.document.source import Elements, Numbers, Source, children, not_negative, positive, unresolved
from harness.files.document.xml import describe, literal_tag, shorten
from harness.files.equalities import Equality, Linkage, Meeting
from harness.files.given import Given, Placement, Pose, vector
from harness.files.joint_kinds import JointKind
from harness.files.tree import WORLD, Joint, Spring
from harness.files.urdf.kinds import BALL_CONSTRAINT, MIMIC, POINT_SPRING, SINGLE_AXIS, needs_axis

ROTOR_INERTIA, _GEAR_RATIO = "drake:rotor_inertia", "drake:gear_ratio"
# What is left out of a robot's file.
FORCES_WITHOUT_AXIS = "springs and rotors of joints of none or several degrees of freedom"
UNREAD_ROTORS = "rotors of transmissions that Drake leaves out"


class Beside:
    """Reads a file whose links and joints are known by name, and the kinds of these.

    Attributes:
        springs: between points. of_joints: fields of ``Joint`` by name, of those that have some.

    Raises:
        InvalidModel: at the line of what is malformed, or speaks of no joint or link of the file.
    """

    def __init__(self, source: Source, links: Elements, joints: Elements, kinds: Mapping[str, JointKind | None]) -> None:
        self._source, self._root, self._links, self._joints, self._kinds = source, source.root, links, joints, kinds
        self._single = {name for name, kind in kinds.items() if kind is not None and kind.is_single}
        self.springs = tuple(self._point_spring(element) for element in children(source.root, POINT_SPRING))
        self.of_joints: dict[str, dict[str, Any]] = dict(self._joint_springs())
        for name, inertia in self._armatures():
            self.of_joints.setdefault(name, {})["armature"] = inertia

    # Springs and reflected inertias.

    def _point_spring(self, element: etree._Element) -> Spring:
        source = self._source
        return Spring(
            ends=(self._end(element, "body_A", "p_AP"), self._end(element, "body_B", "p_BQ")),
            free_length=source.number(self._part(element, "free_length"), "value", None, positive),
            stiffness=source.number(self._part(element, "stiffness"), "value", None, not_negative),
            damping=source.number(self._part(element, "damping"), "value", None, not_negative),
            place=source.place(element),
        )

    def _end(self, element: etree._Element, body: str, point: str) -> tuple[str, Pose]:
        """A link, or the world, and a place in it, as Drake's elements name them."""
        source = self._source
        for part in element.iterchildren("*"):
            source.one(element, literal_tag(part))
        part, place = (self._part(element, suffix) for suffix in (body, point))
        if part.get("name") == WORLD and WORLD not in self._links:
            source.pass_over(part, unresolved(part, "name", self._links))
            name = WORLD
        else:
            name = source.resolve(part, "name", self._links)
        return name, (Placement(vector(source.numbers(place, "value", None, count=3))),)

    def _part(self, element: etree._Element, suffix: str) -> etree._Element:
        """A part of one of Drake's elements, whose tag is that of the element with a suffix."""
        tag = f"{literal_tag(element)}_{suffix}"
        part = self._source.one(element, tag)
        if part is None:
            self._source.refuse(element, f"{describe(element)} has no <{tag}>; add it")
        return part

    def _joint_springs(self) -> Iterator[tuple[str, dict[str, Any]]]:
        source, sprung = self._source, set()
        for gazebo in self._root.iterchildren("gazebo"):
            parts = {
                "stiffness": source.one(gazebo, "springStiffness"),
                "spring_reference": source.one(gazebo, "springReference"),
            }
            if parts["stiffness"] is None:
                continue
            name = source.resolve(gazebo, "reference", self._joints)
            texts = {field: source.read(part, "", part.text or "", Numbers()) for field, part in parts.items() if part is not None}
            if name in sprung:
                source.refuse(gazebo, f"joint {name!r} has a second spring; expected one, with the sum of the stiffnesses")
            sprung.add(name)
            if name not in self._single:
                source.pass_over(gazebo, needs_axis(self._joints[name], "a spring"), FORCES_WITHOUT_AXIS)
            yield name, {field: value for field, (value,) in texts.items()}

    def _armatures(self) -> Iterator[tuple[str, Given]]:
        """Drake's rotors, joint by joint: of a transmission, the float64 gear_ratio^2 rotor_inertia."""
        source, driven = self._source, set()
        for transmission in self._root.iterchildren("transmission"):
            rotor = has_rotor(transmission)
            if problem := self._of_no_joint(transmission, rotor):
                source.pass_over(transmission, f"{describe(transmission)} {problem}", UNREAD_ROTORS if rotor else "")
                continue
            carrier = source.one(transmission, "joint")
            name = source.resolve(carrier, "name", self._joints)
            if name in driven:
                problem = "has a second transmission; expected one, with the sum of the reflected inertias"
                source.refuse(transmission, f"joint {name!r} {problem}")
            driven.add(name)
            joint = self._joints[name]
            limit = source.one(joint, "limit")
            if name not in self._single:
                source.pass_over(carrier, needs_axis(joint, "a transmission"), FORCES_WITHOUT_AXIS)
            elif limit is not None and "effort" in limit.attrib and not source.number(limit, "effort", None):
                problem = "has effort 0, with which Drake leaves out its transmission; write more than zero"
                source.pass_over(limit, f"{describe(joint)} {problem}", UNREAD_ROTORS)
            else:
                yield name, self._reflected(transmission)

    def _of_no_joint(self, transmission: etree._Element, rotor: bool) -> str:
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
        if carrier.get("name") not in self._joints:
            return f"has no <{ROTOR_INERTIA}>, and {unresolved(carrier, 'name', self._joints)}"
        return f"has no <{ROTOR_INERTIA}>; add it, or remove the transmission, which does nothing"

    def _reflected(self, transmission: etree._Element) -> Given:
        """The inertia that the rotor of a transmission adds to its joint."""
        source = self._source
        actuator = source.one(transmission, "actuator")
        assert actuator is not None
        rotor, gear = source.one(actuator, ROTOR_INERTIA), source.one(actuator, _GEAR_RATIO)
        inertia = source.number(rotor, "value", None, not_negative)
        ratio = 1.0 if gear is None else float(source.number(gear, "value", None, not_negative))
        return Given(ratio**2 * float(inertia), inertia.place, inertia.attribute)

    # Mimics and ball constraints.

    def following(self, joint: Joint) -> Joint:
        """The joint; one that mimics another says which one moves it in the end, and how.

        Raises:
            InvalidModel: it mimics none of this file, one of several degrees of freedom or none, or itself by way of others.
        """
        source, name, multiplier, offset = self._source, joint.name, Fraction(1), Fraction(0)
        passed = [name]
        while (mimic := self._mimic(name)) is not None:
            leader = source.resolve(mimic, "joint", self._joints)
            for one in (name, leader):
                if one not in self._single:
                    found = f"{describe(self._joints[one])} is {self._joints[one].get('type')}"
                    source.refuse(mimic, f"{found}; both joints of a mimic must be {SINGLE_AXIS}")
            found = f"{describe(self._joints[name])} mimics {leader!r}, which mimics"
            if leader in passed:
                source.refuse(mimic, f"{found} it; name a joint that moves by itself")
            if self._mimic(leader) is not None:
                source.pass_over(mimic, f"{found} a joint itself; name a joint that moves by itself")
            times, plus = self._multiple(mimic)
            # The numbers of a chain of joints are products, which stand nowhere.
            multiplier, offset = (times, plus) if len(passed) == 1 else (multiplier * times, multiplier * plus + offset)
            name = leader
            passed.append(name)
        return joint if name == joint.name else replace(joint, follows=name, multiplier=multiplier, offset=offset)

    def _mimic(self, name: str) -> etree._Element | None:
        return self._joints[name].find(MIMIC) if name in self._joints else None

    def _multiple(self, mimic: etree._Element) -> tuple[Given, Given]:
        """Multiplier and offset."""
        return self._source.number(mimic, "multiplier", 1.0), self._source.number(mimic, "offset", 0.0)

    def equalities(self) -> tuple[Equality, ...]:
        """Ball constraints in the order of the file, then each ``mimic`` of a joint that moves: a coupling with the one that it names."""
        return (*self._ball_constraints(), *self._couplings())

    def _ball_constraints(self) -> Iterator[Equality]:
        for element in children(self._root, BALL_CONSTRAINT):
            (one, first), (other, second) = self._end(element, "body_A", "p_AP"), self._end(element, "body_B", "p_BQ")
            if one == other:
                self._source.refuse(element, f"{describe(element)} holds two points of link {one!r} together; name another link")
            place, meeting = self._source.place(element), Meeting((one, other), first, second)
            yield Equality(BALL_CONSTRAINT, place, place.line, meeting, name=str(element.get("name") or ""))

    def _couplings(self) -> Iterator[Equality]:
        for name in self._joints:
            mimic = self._mimic(name)
            if mimic is not None and self._kinds[name] is not None:
                multiplier, offset = self._multiple(mimic)
                linkage = Linkage(name, str(mimic.get("joint")), (offset, multiplier, *(Fraction(0),) * 3))
                yield Equality(MIMIC, self._source.place(mimic), self._source.place(mimic).line, linkage, name=name)


def has_rotor(transmission: etree._Element) -> bool:
    """True for a transmission with a rotor in one of its actuators."""
    return any(literal_tag(part) == ROTOR_INERTIA for part in transmission.iterfind("actuator/*"))
