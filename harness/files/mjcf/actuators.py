"""The actuators of an MJCF: what each of its shortcuts means as a general actuator, and what it drives.

A default class gives actuators of all kinds one set of numbers, so that each of its elements acts on what the elements before it left, as
MuJoCo's reader lets them. The armature and damping of one are gear^2 times in the joint or tendon that it drives, where actuators are off
too.

Source: MuJoCo documentation, XML reference, ``actuator``, and ``actuator/general``, damping and armature; Computation, section Actuation
model.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

from lxml import etree

from harness.files.document.source import Elements, Numbers, Source
from harness.files.document.xml import describe
from harness.files.findings import SWITCHED_OFF
from harness.files.given import Given, Pose
from harness.files.joint_kinds import JointKind
from harness.files.mjcf.attributes import Attributes, NotRead, is_on, layers, named, resolved_text
from harness.files.mjcf.between import ElementsBetween
from harness.files.tree import Actuator, Coupling, Joint, Signed

_DYNAMICS = ("none", "integrator", "filter", "filterexact")
_FORCES = ("none", "fixed", "affine")
_GEAR = 6
_ZERO: Signed = (1, Fraction(0))
_RANGES = ("ctrl", "act", "force")


@dataclass
class _General:
    """The general actuator that elements made so far, the last shortcut among them being ``kind``."""

    kind: str = "general"
    gain: list[Signed] = field(default_factory=lambda: [(1, Fraction(1)), _ZERO, _ZERO])
    bias: list[Signed] = field(default_factory=lambda: [_ZERO] * 3)
    gain_type: str = "fixed"
    bias_type: str = "none"
    dynamics: str = "none"
    damping_ratio: Fraction = Fraction(0)
    inherited: Fraction = Fraction(0)
    ranges: dict[str, tuple[Given, Given]] = field(default_factory=dict)
    limited: dict[str, str] = field(default_factory=dict)


class ActuatorReader:
    """Reads the actuators of a file whose joints, tendons and sites are known."""

    def __init__(
        self, source: Source, attributes: Attributes, between: ElementsBetween, joints: Sequence[Joint], tendons: Elements
    ) -> None:
        self._source, self._attributes, self._between = source, attributes, between
        self._joints, self._tendons = {joint.name: joint for joint in joints}, tendons
        self._auto_limits = attributes.compiler("autolimits", "true", ("true", "false")) == "true"
        options = [*source.root.iterchildren("option")]
        self._groups = {word for option in options for word in str(option.get("actuatorgroupdisable", "")).split()}

    def actuators(self) -> tuple[Actuator, ...]:
        """All of them in the order of the file; raises InvalidModel where a number of one that is read is none."""
        return tuple(self._actuator(element, number) for number, element in enumerate(self._source.root.iterfind("actuator/*")))

    def rotors(self) -> Iterator[Coupling]:
        """The armature and damping that each brings to the joint or tendon that it drives; raises as ``actuators``."""
        for element in self._source.root.iterfind("actuator/*"):
            armature, damping = (
                self._attributes.number(element, "armature", 0.0),
                self._attributes.coefficient(element, "damping", "damper"),
            )
            joint = element.get("joint") or element.get("jointinparent")
            if not (armature or damping) or not (joint or "tendon" in element.attrib):
                continue
            try:
                own = self._terms(element) if joint is None else self._single(str(joint))
            except NotRead as problem:
                for attribute, number in (("armature", armature), ("damping", damping)):
                    if number:
                        self._attributes.leave_unread(
                            element, attribute, number, f"is on with actuators off, and the actuator {problem}", "remove it"
                        )
                continue
            gear, nothing = self._attributes.numbers(element, "gear", (1, 0, 0, 0, 0, 0))[0], Fraction(0)
            place = self._source.place(element)
            yield Coupling(own, nothing, damping, nothing, place, armature, gear, of_actuator=True, in_joint=joint is not None)

    def _single(self, joint: str) -> tuple[tuple[str, Fraction], ...]:
        if joint not in self._joints or not self._joints[joint].kind.is_single:
            raise NotRead(f"drives joint {joint!r}, which is no hinge or slide")
        return ((joint, Fraction(1)),)

    def _terms(self, element: etree._Element) -> tuple[tuple[str, Fraction], ...]:
        """The joints of the fixed tendon that one drives, with their multiples."""
        tendon = self._tendons[named(element, "tendon", self._tendons)]
        if tendon.tag != "fixed":
            raise NotRead(f"drives {describe(tendon)}, which is no fixed tendon")
        terms = tuple((str(part.get("joint")), self._source.number(part, "coef", None)) for part in tendon.iterchildren("joint"))
        if any(name not in self._joints or not self._joints[name].kind.is_single for name, _ in terms):
            raise NotRead(f"drives {describe(tendon)}, which is not of hinges and slides")
        return terms

    def force_limits(self, elements: Elements) -> Iterator[tuple[str, tuple[Given, Given]]]:
        """The range of what actuators do together on each joint that has one."""
        for name, element in elements.items():
            low, high = self._attributes.numbers(element, "actuatorfrcrange", (0, 0))
            if self._is_limited(resolved_text(element, "actuatorfrclimited", "auto"), (low, high)):
                yield name, (low, high)

    def _is_limited(self, limited: str, bounds: tuple[Given, Given] | None) -> bool:
        return limited == "true" or (limited == "auto" and self._auto_limits and bounds is not None and any(bounds))

    def _actuator(self, element: etree._Element, number: int) -> Actuator:
        place, (line,) = self._source.place(element), self._source.lines([element])
        known = Actuator(str(element.tag), str(element.get("name") or ""), line, number, place=place)
        try:
            return self._read(element, known)
        except NotRead as problem:
            return replace(known, why_not=str(problem))

    def _read(self, element: etree._Element, known: Actuator) -> Actuator:
        if element.tag not in _MEANINGS:
            raise NotRead(f"is of the kind <{element.tag}>, which is not read")
        if not is_on(self._source.root, "actuation") or resolved_text(element, "group", "0") in self._groups:
            raise NotRead(SWITCHED_OFF)
        for attribute in ("delay", "nsample", "actdim"):
            if resolved_text(element, attribute):
                raise NotRead(f"has {attribute}, which is not read")
        if resolved_text(element, "actearly") == "true":
            raise NotRead("has actearly, by which its force depends on the time step")
        made = _General()
        for layer in layers(element):
            self._apply(layer, made)
        if made.dynamics not in _DYNAMICS:
            raise NotRead(f"has dyntype {made.dynamics!r}, which is not read")
        if {made.gain_type, made.bias_type} - set(_FORCES):
            raise NotRead(f"has gaintype {made.gain_type!r} and biastype {made.bias_type!r}, which are not read")
        gain = (*made.gain[:1], _ZERO, _ZERO) if made.gain_type == "fixed" else tuple(made.gain)
        bias = tuple(made.bias) if made.bias_type == "affine" else (_ZERO,) * 3
        found = replace(self._driving(element, known), gain=gain, bias=bias, dynamics=made.dynamics)
        found = self._damped(element, found, made)
        if found.joints and self._joints[found.joints[0][0]].kind is JointKind.BALL and _feels_length(found):
            raise NotRead("feels the length of a ball joint, which is not read")
        self._inherit(element, found, made)
        clamps = is_on(self._source.root, "clampctrl")
        ranges = {name: self._range(name, made) for name in _RANGES}
        return replace(found, control_range=ranges["ctrl"] if clamps else None, activation_range=ranges["act"], force_range=ranges["force"])

    def _range(self, name: str, made: _General) -> tuple[Given, Given] | None:
        bounds = made.ranges.get(name)
        return bounds if self._is_limited(made.limited.get(name, "auto"), bounds) else None

    def _apply(self, element: etree._Element, made: _General) -> None:
        """Change the general actuator as an element, of a default class or the actuator's own, says."""
        for name in _RANGES:
            if f"{name}range" in element.attrib:
                low, high = self._source.numbers(element, f"{name}range", (0, 0))
                made.ranges[name] = low, high
            made.limited[name] = str(element.get(f"{name}limited", made.limited.get(name, "auto")))
        tag = str(element.tag)
        if tag not in _MEANINGS:
            raise NotRead(f"takes defaults of <{tag}>, which is not read")
        if tag != "general":
            if made.kind not in ("general", tag):
                # The numbers of one shortcut are none of another's; the ranges are.
                for name in ("gain", "bias", "gain_type", "bias_type", "dynamics", "damping_ratio", "inherited"):
                    setattr(made, name, getattr(_General(), name))
            made.kind = tag
        _MEANINGS[tag](self._source, element, made)

    def _damped(self, element: etree._Element, found: Actuator, made: _General) -> Actuator:
        """With the ratio of its damping, which stands in the place of a positive last number of a servo's bias."""
        (sign, stiffness), (opposed, other), (of_damping, damping) = found.gain[0], found.bias[1], found.bias[2]
        is_servo = sign * stiffness == -opposed * other and made.bias_type == "affine"
        ratio = made.damping_ratio or (damping if of_damping * damping > 0 else Fraction(0))
        if not ratio:
            return found
        if not is_servo:
            return found if not made.damping_ratio else replace(found, bias=(*found.bias[:2], (1, ratio)))
        if sign * stiffness < 0:
            raise NotRead("has a damping ratio beside a negative stiffness")
        return replace(found, damping_ratio=ratio if stiffness else Fraction(0), bias=(*found.bias[:2], _ZERO))

    # What it drives.

    def _driving(self, element: etree._Element, known: Actuator) -> Actuator:
        gear = self._attributes.numbers(element, "gear", (1, 0, 0, 0, 0, 0))
        one = Fraction(1)
        for attribute in ("joint", "jointinparent"):
            if attribute in element.attrib:
                name = named(element, attribute, self._joints)
                return replace(known, joints=((name, one),), gear=gear, in_parent=attribute == "jointinparent")
        if "tendon" in element.attrib:
            terms = self._terms(element)
            tendon = self._tendons[str(element.get("tendon"))]
            if resolved_text(tendon, "actuatorfrcrange"):
                raise NotRead(f"drives {describe(tendon)}, whose actuatorfrcrange is not read")
            return replace(known, joints=terms, gear=gear)
        if "site" in element.attrib and "refsite" not in element.attrib:
            return replace(known, site=self._site(element), gear=gear)
        what = next((name for name in ("refsite", "cranksite", "body") if name in element.attrib), "nothing that is known")
        raise NotRead(f"drives by {what}, which is not read")

    def _site(self, element: etree._Element) -> tuple[str, Pose]:
        sites = self._between.sites
        return self._between.at(sites[named(element, "site", sites)])

    def _inherit(self, element: etree._Element, found: Actuator, made: _General) -> None:
        """Give a servo the range of what it drives, as ``inheritrange`` says."""
        if not made.inherited:
            return
        bounds = self._joints[found.joints[0][0]].limits if found.joints and "joint" in element.attrib else None
        if bounds is None:
            raise NotRead("has inheritrange, and drives no joint with a range")
        factor = math.pi / 180 if self._joints[found.joints[0][0]].in_degrees else 1.0
        low, high = (float(bound) * factor for bound in bounds)
        mean, radius = 0.5 * (high + low), 0.5 * (high - low) * float(made.inherited)
        place = self._source.place(element)
        own = tuple(Given(value, place, "range by inheritrange", index) for index, value in enumerate((mean - radius, mean + radius)))
        made.ranges["act" if found.dynamics == "integrator" else "ctrl"] = own[0], own[1]


# What elements say.


def _number(source: Source, element: etree._Element, attribute: str, before: Signed) -> Signed:
    return (1, source.number(element, attribute, None)) if attribute in element.attrib else before


def _general(source: Source, element: etree._Element, made: _General) -> None:
    made.dynamics = str(element.get("dyntype", made.dynamics))
    made.gain_type = str(element.get("gaintype", made.gain_type))
    made.bias_type = str(element.get("biastype", made.bias_type))
    for attribute, numbers in (("gainprm", made.gain), ("biasprm", made.bias)):
        if attribute in element.attrib:
            found = source.read(element, attribute, element.attrib[attribute], Numbers(0, 10))
            numbers[: min(len(found), 3)] = [(1, value) for value in found[:3]]
            if attribute == "biasprm" and len(found) > 2:
                made.damping_ratio = Fraction(0)


def _motor(_source: Source, _element: etree._Element, made: _General) -> None:
    made.gain[0] = 1, Fraction(1)
    made.dynamics, made.gain_type, made.bias_type = "none", "fixed", "none"


def _position(source: Source, element: etree._Element, made: _General) -> None:
    stiffness = _number(source, element, "kp", made.gain[0])
    made.gain[0], made.bias[1] = stiffness, (-stiffness[0], stiffness[1])
    if "kv" in element.attrib:
        made.bias[2], made.damping_ratio = (-1, source.number(element, "kv", None)), Fraction(0)
    if "dampratio" in element.attrib:
        made.bias[2], made.damping_ratio = _ZERO, source.number(element, "dampratio", None)
    if "timeconst" in element.attrib:
        made.dynamics = "filterexact" if source.number(element, "timeconst", None) else "none"
    if "inheritrange" in element.attrib:
        made.inherited = source.number(element, "inheritrange", None)
    made.gain_type, made.bias_type = "fixed", "affine"


def _intvelocity(source: Source, element: etree._Element, made: _General) -> None:
    _position(source, element, made)
    made.dynamics = "integrator"


def _velocity(source: Source, element: etree._Element, made: _General) -> None:
    made.gain[0] = _number(source, element, "kv", made.gain[0])
    made.bias[:], made.damping_ratio = [_ZERO, _ZERO, (-made.gain[0][0], made.gain[0][1])], Fraction(0)
    made.dynamics, made.gain_type, made.bias_type = "none", "fixed", "affine"


def _damper(source: Source, element: etree._Element, made: _General) -> None:
    sign, before = made.gain[2] if made.gain_type == "affine" else _ZERO
    sign, damping = _number(source, element, "kv", (-sign, before))
    made.gain[:] = [_ZERO, _ZERO, (-sign, damping)]
    made.limited["ctrl"] = "true"
    made.dynamics, made.gain_type, made.bias_type = "none", "affine", "none"


def _cylinder(source: Source, element: etree._Element, made: _General) -> None:
    made.gain[0] = _number(source, element, "area", made.gain[0])
    if "bias" in element.attrib:
        made.bias[:] = [(1, value) for value in source.numbers(element, "bias", (0, 0, 0))]
    if "diameter" in element.attrib:
        diameter = float(source.number(element, "diameter", None))
        made.gain[0] = 1, Given(math.pi / 4 * diameter * diameter, source.place(element), "area by diameter")
    made.dynamics, made.gain_type, made.bias_type = "filter", "fixed", "affine"


def _feels_length(actuator: Actuator) -> bool:
    return bool(actuator.gain[1][1] or actuator.bias[1][1])


_MEANINGS = {
    "general": _general,
    "motor": _motor,
    "position": _position,
    "velocity": _velocity,
    "intvelocity": _intvelocity,
    "damper": _damper,
    "cylinder": _cylinder,
}
