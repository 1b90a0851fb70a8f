"""Relations that an MJCF states between its bodies and joints: springs, dampers and inertias of its tendons, and its equalities.

Those springs are read that run straight from one site to another, or act on a sum of joint positions, and may be slack between two lengths;
those equalities that are of points and frames, or couple joints, fixed tendons and tendons through sites. What acts on bodies while
constraints, actuators and contacts are off is left unread: MuJoCo computes deformable bodies and plugins among the passive forces.

Source: MuJoCo documentation, XML reference, ``tendon/spatial``, ``tendon/fixed``, ``equality``, ``option/flag``, ``deformable/flex``,
``extension/plugin``; MuJoCo 4.0.0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import TypeVar

from lxml import etree

from harness.files.document.source import Elements, Source, Unread, not_negative, one_sign
from harness.files.document.xml import describe
from harness.files.equalities import (
    POLYNOMIAL,
    BoundTendon,
    Equality,
    Linkage,
    Meeting,
    Polygon,
    Rows,
    SolverParameters,
    Sum,
    Tendon,
    TendonLinkage,
    Weld,
)
from harness.files.given import Given, Place, Placement, Pose, Quaternion, vector
from harness.files.joint_kinds import JointKind
from harness.files.mjcf.attributes import JOINTS, Attributes, NotRead, is_on, named, resolved, resolved_text
from harness.files.tree import WORLD, Body, Coupling, Spring

# Of a weld: a quaternion of zero stands for the orientation at the reference.
_AT_REFERENCE = (0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
# Of a springlength: that follows from where the springs of joints are at rest.
_AUTOMATIC = -1
_UNWRITTEN = "is of a kind whose rows the harness does not write"
_ALONG_PATH = "is about a tendon that runs along a path, or about none of this file"

# Plugins of MuJoCo that act as actuators, sensors and shapes of contacts alone.
_OFF_WITH_STAGES = ("mujoco.pid", "mujoco.sensor.", "mujoco.sdf.")
_WITHOUT_IT = "compare a copy without it"

_Coupled = TypeVar("_Coupled", str, Tendon)


class ElementsBetween:
    """Reads a file whose ``bodies`` have been read; ``name`` gives the name of a body's element."""

    def __init__(self, source: Source, attributes: Attributes, name: Callable[[etree._Element], str], bodies: Sequence[Body]) -> None:
        self._source, self._root, self._attributes, self._name = source, source.root, attributes, name
        sites, joints, holders = (
            [element for world in source.root.iterchildren("worldbody") for element in world.iter(*tags)]
            for tags in (("site",), JOINTS, ("body",))
        )
        self.sites, self._joints, self._bodies = map(_by_name, (sites, joints, holders))
        self._tendons = _by_name(source.root.iterfind("tendon/*"))
        self.singles = {joint.name for body in bodies for joint in body.joints if joint.kind.is_single}
        self._floating = tuple((body.name, body.start) for body in bodies if any(joint.kind is JointKind.FREE for joint in body.joints))

    def at(self, site: etree._Element) -> tuple[str, Pose]:
        """The body of a site, and its place there."""
        return self._name(next(site.iterancestors("body", "worldbody"))), self._attributes.pose(site)

    # Springs and dampers.

    def springs(self) -> tuple[tuple[Spring, ...], tuple[Coupling, ...]]:
        """Those between points, and those on sums of joint positions.

        Raises:
            InvalidModel: one speaks of nothing in the file. A spring or damper on another path, or between two lengths, and what is always
                on, is left unread.
        """
        self._source.unread.extend(_of_flexes(self._source, self._attributes))
        self._source.unread.extend(_of_plugins(self._source))
        found = [spring for tendon in self._root.iterfind("tendon/*") if (spring := self._spring(tendon)) is not None]
        return tuple(one for one in found if isinstance(one, Spring)), tuple(one for one in found if isinstance(one, Coupling))

    def _spring(self, tendon: etree._Element) -> Spring | Coupling | None:
        attributes, place, path = self._attributes, self._source.place(tendon), list(tendon.iterchildren("*"))
        armature = attributes.number(tendon, "armature", 0.0)
        stiffness, damping = attributes.coefficient(tendon, "stiffness", "spring"), attributes.coefficient(tendon, "damping", "damper")
        if not stiffness and not damping and not armature:
            return None
        lower, upper = _rest(attributes, tendon) if stiffness else (Fraction(0), Fraction(0))
        is_automatic, slack_to = lower == upper == _AUTOMATIC, None if lower == upper else upper
        if lower > upper:
            self._source.refuse(
                tendon, f"{describe(tendon)} has springlength {float(lower):g} {float(upper):g}; expected the shorter one first"
            )
        if tendon.tag == "fixed":
            terms = tuple(self._term(part) for part in tendon.iterchildren("joint"))
            return Coupling(terms, stiffness, damping, None if is_automatic else lower, place, armature, slack_to=slack_to)
        if [part.tag for part in path] != ["site", "site"]:
            what, advice = "does not run straight from one site to another", "lead it through two sites"
        elif is_automatic:
            what, advice = "leaves its springlength to the reader", "write it"
        else:
            first, second = (self.at(self.sites[self._source.resolve(part, "site", self.sites)]) for part in path)
            return Spring((first, second), lower, stiffness, damping, place, slack_to, armature)
        self._source.unread.append(Unread(place, f"{describe(tendon)} {what}", advice))
        return None

    def _term(self, part: etree._Element) -> tuple[str, Given]:
        name = str(part.get("joint"))
        if name not in self.singles:
            self._source.refuse(part, f'<joint joint="{name}"> names no hinge or slide of this file; correct the name')
        return name, self._source.number(part, "coef", None)

    # Dry friction and limits.

    def bound_tendons(self) -> tuple[BoundTendon, ...]:
        """The tendons that have some; one without a name has one of its place."""
        found = []
        for number, element in enumerate(self._root.iterfind("tendon/*"), start=1):
            name, why_not = str(element.get("name") or f"(tendon {number})"), ""
            try:
                tendon: Tendon = replace(self._tendon(element), name=name)
            except NotRead as problem:
                tendon, why_not = Sum(name, ()), str(problem)
            found.append(_bound(self._attributes, element, tendon, self._source.place(element), why_not))
        return tuple(one for one in found if one.friction_loss or one.limits is not None)

    # Equalities.

    def equalities(self) -> tuple[Equality, ...]:
        """All of them in the order of the file."""
        is_on_here = all(is_on(self._root, stage) for stage in ("constraint", "equality"))
        return tuple(self._equality(element, is_on_here) for element in self._root.iterfind("equality/*"))

    def _equality(self, element: etree._Element, is_on_here: bool) -> Equality:
        readers: Mapping[str, Callable[[etree._Element], Rows]] = {
            "connect": self._connect,
            "weld": self._weld,
            "joint": lambda coupling: Linkage(*self._coupled(coupling, self._single)),
            "tendon": lambda coupling: TendonLinkage(*self._coupled(coupling, self._tendon)),
        }
        says, why_not, softness = None, _UNWRITTEN, None
        try:
            if element.tag in readers:
                says, why_not, softness = readers[str(element.tag)](element), "", _softness(self._attributes, element)
        except NotRead as problem:
            says, why_not = None, str(problem)
        if isinstance(says, TendonLinkage) and any(isinstance(tendon, Polygon) for tendon in says.tendons):
            why_not = _ALONG_PATH
        place, (line,) = self._source.place(element), self._source.lines([element])
        is_active = is_on_here and resolved_text(element, "active", "true") != "false"
        return Equality(str(element.tag), place, line, says, why_not, softness, is_active, str(element.get("name") or ""))

    def _connect(self, element: etree._Element) -> Meeting:
        if "site1" in element.attrib:
            return Meeting(*self._sites_of(element))
        bodies = self._body(element, "body1"), self._body(element, "body2")
        return Meeting(bodies, (Placement(vector(self._source.numbers(element, "anchor", None, count=3))),), None, self._floating)

    def _weld(self, element: etree._Element) -> Weld:
        scale = self._source.number(element, "torquescale", 1.0)
        if "site1" in element.attrib:
            return Weld(*self._sites_of(element), torque_scale=scale)
        # The frame of the second body at its anchor is the one that is given; that of the first may be where it is at the reference.
        bodies = self._body(element, "body2"), self._body(element, "body1")
        anchor = Placement(vector(self._source.numbers(element, "anchor", (0, 0, 0))))
        relative = self._source.numbers(element, "relpose", _AT_REFERENCE)
        held = (Placement(vector(relative[:3]), (Quaternion(tuple(relative[3:])),)),) if any(relative[3:]) else None
        return Weld(bodies, (anchor,), held, self._floating, scale)

    def _sites_of(self, element: etree._Element) -> tuple[tuple[str, str], Pose, Pose]:
        """The bodies of the two sites that a constraint names, and their places there."""
        (one, first), (other, second) = (self.at(self.sites[named(element, name, self.sites)]) for name in ("site1", "site2"))
        return (one, other), first, second

    def _body(self, element: etree._Element, attribute: str) -> str:
        if element.get(attribute, WORLD) == WORLD:
            return WORLD
        return self._name(self._bodies[named(element, attribute, self._bodies)])

    def _single(self, element: etree._Element, attribute: str) -> str:
        """The hinge or slide that an attribute names."""
        named(element, attribute, self._joints)
        joint = str(element.get(attribute))
        if joint not in self.singles:
            raise NotRead(f"couples joint {joint!r}, which is no hinge or slide")
        return joint

    def _coupled(
        self, element: etree._Element, read: Callable[[etree._Element, str], _Coupled]
    ) -> tuple[_Coupled, _Coupled | None, tuple[Given, ...]]:
        """The coupled part, its leader, and the coefficients."""
        first, second = f"{element.tag}1", f"{element.tag}2"
        tied, leader = read(element, first), read(element, second) if second in element.attrib else None
        return tied, leader, self._attributes.numbers(element, "polycoef", POLYNOMIAL)

    def _tendon(self, element: etree._Element, attribute: str = "") -> Tendon:
        """A tendon that is an element, or that an attribute of it names."""
        tendon = self._tendons[named(element, attribute, self._tendons)] if attribute else element
        name, parts = str(tendon.get("name")), list(tendon.iterchildren("*"))
        if tendon.tag == "fixed":
            return Sum(name, tuple((self._single(part, "joint"), self._source.number(part, "coef", None)) for part in parts))
        if any(part.tag != "site" for part in parts):
            raise NotRead(_ALONG_PATH)
        return Polygon(name, tuple(self.at(self.sites[named(part, "site", self.sites)]) for part in parts))


def _bound(attributes: Attributes, element: etree._Element, tendon: Tendon, place: Place, why_not: str) -> BoundTendon:
    lower, upper = attributes.numbers(element, "range", (0, 0))
    return BoundTendon(
        tendon,
        friction_loss=attributes.number(element, "frictionloss", 0.0, not_negative),
        friction_softness=attributes.softness(element, "friction"),
        limits=(lower, upper) if attributes.is_limited(element) and lower < upper else None,
        margin=attributes.number(element, "margin", 0.0),
        limit_softness=attributes.softness(element, "limit"),
        place=place,
        why_not=why_not,
    )


def _of_flexes(source: Source, attributes: Attributes) -> Iterator[Unread]:
    springs, dampers = attributes.acts("spring"), attributes.acts("damper")
    for flex in source.root.iterfind("deformable/flex"):
        numbers = (("edge", "stiffness", springs), ("edge", "damping", dampers), ("elasticity", "young", springs or dampers))
        for part, name, acts in numbers:
            element = flex.find(part)
            # A surface is neither stretched nor bent unless elastic2d says so.
            is_limp = part == "elasticity" and flex.get("dim", "2") == "2" and flex.xpath("string(elasticity/@elastic2d)") in ("", "none")
            if element is not None and acts and not is_limp and source.number(element, name, 0.0):
                what = f'<{part} {name}="{element.get(name)}"> of {describe(flex)} is a passive force that stays on with constraints off'
                yield Unread(source.place(element), what, _WITHOUT_IT)
                break


def _of_plugins(source: Source) -> Iterator[Unread]:
    """Elements that have a plugin come first: an instance in <extension> may act without."""
    declared = {
        instance.get("name"): str(plugin.get("plugin"))
        for plugin in source.root.iterfind("extension/plugin")
        for instance in plugin.iterchildren("instance")
    }
    users = [plugin for plugin in source.root.iter("plugin") if plugin.getparent().tag != "extension"]
    for plugin in (*users, *(one for one in source.root.iterfind("extension/plugin") if one.find("instance") is not None)):
        name = plugin.get("plugin") or declared.get(plugin.get("instance"), "")
        if not name.startswith(_OFF_WITH_STAGES):
            what = f"plugin {name!r} in {describe(plugin.getparent())} is code that may push bodies with constraints and actuators off"
            yield Unread(source.place(plugin), what, _WITHOUT_IT)


def _by_name(elements: Iterable[etree._Element]) -> Elements:
    return {str(element.get("name")): element for element in elements if element.get("name")}


def _rest(attributes: Attributes, tendon: etree._Element) -> tuple[Given, Given]:
    """The two lengths between which a tendon's spring is at rest; ``_AUTOMATIC`` twice where those of the joints' springs are."""
    lower, upper = attributes.numbers(tendon, "springlength", (-1, -1))
    written = resolved(tendon, "springlength")
    return (lower, lower) if written is not None and len(written.text.split()) == 1 else (lower, upper)


def _softness(attributes: Attributes, element: etree._Element) -> SolverParameters:
    found = attributes.softness(element)
    time, ratio = map(float, found.solref)
    if complaint := one_sign((time, ratio)):
        raise NotRead(f'has solref="{time:g} {ratio:g}" with its default class, which {complaint}')
    return found
