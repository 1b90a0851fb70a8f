"""Rules for the model of a mechanism beyond the tables of elements and attributes: what it must not leave to its readers.

A file that passes has been read: here stands what is well-defined, but taken differently by some engine, or felt by none.
"""

from __future__ import annotations

from collections.abc import Mapping

from lxml import etree

from harness.errors import InvalidModel
from harness.files.document.source import children, positive
from harness.files.document.xml import Document, describe, shorten
from harness.files.equalities import Linkage, Meeting
from harness.files.lint.checks import check_inertia
from harness.files.lint.formats import SOLVER_OPTIONS
from harness.files.mjcf.attributes import JOINTS, ORIENTATIONS, is_on, resolved
from harness.files.reading import Meaning
from harness.files.tree import WORLD
from harness.files.urdf.kinds import BALL_CONSTRAINT, DRAKE_JOINT, FIXED, JOINT_TAGS, needs_axis

_UNIVERSE = "universe"
_NO_JOINT = {
    "mjcf": "has no joint in any body; expected one for each coordinate of the system",
    "urdf": "has no moving joint; expected one for each coordinate of the system",
}
_LACKS_INERTIAL = {"mjcf": "pos, mass and diaginertia", "urdf": "mass and inertia"}


def check_joints(document: Document, model_format: str) -> None:
    """Hold the joints of a file that fits the tables, and is yet to be read, against what engines need.

    Raises:
        InvalidModel: at the line of the first element that does not fit.
    """
    root = document.root
    if model_format == "mjcf":
        joints = [joint for world in root.iterfind("worldbody") for joint in world.iter(*JOINTS)]
        for joint in joints:
            holder = next(one for one in joint.iterancestors() if one.tag != "frame")
            if holder.tag != "body":
                document.refuse(joint, f"{describe(joint)} stands in <{holder.tag}>; a joint belongs in the <body> that it moves")
    else:
        joints = list(children(root, *JOINT_TAGS))
        if not root.get("name"):
            document.refuse(root, "<robot> has no name, without which URDF readers give up; add one")
    for name, joint in document.by_name(joints).items():
        if name == _UNIVERSE:
            document.refuse(joint, f"joint {_UNIVERSE!r}, as Pinocchio calls the world: its reader aborts on that; give it another name")
    for number, joint in enumerate(children(root, DRAKE_JOINT)):
        if number:
            document.refuse(joint, f"second <{DRAKE_JOINT}>; one ball joint can hang the root link on the world, and no other is read")
        parent = joint.find("parent")
        found = None if parent is None else parent.get("link")
        if found != WORLD:
            where = joint if parent is None else parent
            hung = f"{describe(joint)} has parent link {found!r}, expected {WORLD!r}"
            document.refuse(where, f"{hung}: it hangs the root link on the world")
        for link in root.iterfind(f"link[@name='{WORLD}']"):
            hung = f"{describe(joint)} hangs the root link on the world, which a <{DRAKE_JOINT}> knows by itself"
            document.refuse(link, f"{describe(link)} is a second root: {hung}; remove the link")


def check_reading(document: Document, reading: Meaning) -> None:
    """Hold what has been read against what engines need; raises as ``check_joints``."""
    if not reading.moving:
        document.refuse(document.root, _NO_JOINT[reading.format])
    _check_bodies(document, reading)
    {"mjcf": _check_equalities, "urdf": _check_urdf}[reading.format](document, reading)
    _check_actuators(document, reading)
    for one in reading.passed_over:
        raise InvalidModel(one.place.path, one.place.line, one.problem)


def _check_bodies(document: Document, reading: Meaning) -> None:
    elements, bodies = list(document.lines), reading.tree.bodies
    inner, moving = {body.parent for body in bodies}, set()
    for body in bodies:
        assert body.place is not None
        element = elements[body.place.element]
        if body.joints or body.parent in moving:
            moving.add(body.name)
        if body.inertia is None:
            if body.name in moving:
                problem = f"moves but has no <inertial>; add one with {_LACKS_INERTIAL[reading.format]}"
                document.refuse(element, f"{describe(element)} {problem}")
            continue
        mass, moments = map(body.inertia.place_of, ("mass", "moments"))
        inertial = elements[moments.element]
        if reading.format == "mjcf" and not {"diaginertia", "fullinertia"} & set(inertial.attrib):
            problem = "has neither diaginertia nor fullinertia; expected one of them"
            document.refuse(inertial, f"<inertial> of {describe(element)} {problem}")
        check_inertia(document, inertial, [float(moment) for moment in body.inertia.moments])
        complaint = positive((float(body.inertia.mass),))
        if complaint and body.name in moving and body.name not in inner:
            holder = elements[mass.element]
            name = "mass" if reading.format == "mjcf" else "value"
            document.refuse(holder, f'{describe(holder)} {name}="{shorten(holder.get(name))}" {complaint}')


# MJCF.


def _check_equalities(document: Document, reading: Meaning) -> None:
    found: list[etree._Element] = []
    for section in document.root.iterfind("equality"):
        if section.find("*") is None:
            document.refuse(section, "<equality> holds no constraint; remove it")
        found += section.iterchildren("*")
    elements = document.by_name(found)
    for element in found:
        _refuse_switched_off(document, element)
    if not elements and not any(joint.friction_loss or joint.limits for joint in reading.tree.joints):
        _refuse_options(document)
    sites = {site.get("name"): site for site in document.root.iterfind("worldbody//site")}
    tendons = {tendon.get("name"): tendon for tendon in document.root.iterfind("tendon/*")}
    for equality, element in zip(reading.equalities, found, strict=True):
        said = equality.says
        if said is None:
            document.refuse(element, f"{describe(element)} {equality.why_not}")
        tied: tuple[str | None, ...]
        held: list[etree._Element] = []
        problem = f"couples {equality.couples} {{!r}} to itself; name another one"
        if isinstance(said, Meeting):
            tied, held = said.bodies, [sites[element.get(name)] for name in ("site1", "site2")]
            problem = "holds two sites of body {!r} together; name one of another body"
        elif isinstance(said, Linkage):
            tied = said.joint, said.leader
        else:
            tied = tuple(one.name for one in said.tendons)
            held = [sites[part.get("site")] for name in tied for part in tendons[name].iterchildren("site")]
        if len(set(tied)) < len(tied):
            document.refuse(element, f"{describe(element)} {problem.format(tied[0])}")
        for site in held:
            _check_site(document, site, turned=element.tag == "weld")


def _check_actuators(document: Document, reading: Meaning) -> None:
    document.by_name(document.root.iterfind("actuator/*"))
    elements = list(document.lines)
    for one in reading.actuators:
        assert one.place is not None
        if one.why_not:
            document.refuse(elements[one.place.element], f"{describe(elements[one.place.element])} {one.why_not}")


def _check_site(document: Document, site: etree._Element, turned: bool) -> None:
    """Refuse a site of a constraint whose place in its body, or orientation there, some engine reads otherwise."""
    holder = site.getparent()
    if holder.tag == "frame":
        document.refuse(site, f"{describe(site)} of a constraint stands in a <frame>, which is not read; write its pose in its body")
    if holder.tag != "worldbody" and not holder.get("name"):
        document.refuse(holder, f"<body> holds {describe(site)} of a constraint and has no name; add one")
    for name in ORIENTATIONS if turned else ():
        if name != "quat" and resolved(site, name) is not None:
            document.refuse(site, f"{describe(site)} of a weld is turned by {name!r}, which is not read there; write a quat")


def _refuse_switched_off(document: Document, element: etree._Element) -> None:
    active = resolved(element, "active")
    if active is not None and active.text == "false":
        document.refuse(element, f'{describe(element)} is switched off by active="false", so that nothing feels it; remove one of them')
    for stage in ("constraint", "equality"):
        if not is_on(document.root, stage):
            document.refuse(element, f'{describe(element)} is switched off by <flag {stage}="disable">; remove one of them')


def _refuse_options(document: Document) -> None:
    """Refuse what bears on constraints alone."""
    for option in document.root.iterfind("option"):
        for name in (name for name in SOLVER_OPTIONS if name in option.attrib):
            shown = f'<option {name}="{shorten(option.get(name))}">'
            document.refuse(option, f"{shown} is for constraints, of which the file has none; remove it")
    for flag in document.root.iterfind("option/flag[@diagexact]"):
        document.refuse(flag, "<flag diagexact> is for constraints, of which the file has none; remove it")


# URDF.


def _check_urdf(document: Document, reading: Meaning) -> None:
    for joint in document.root.iterfind("joint"):
        _check_dynamics(document, joint)
    followers = {joint.name: joint.follows for joint in reading.tree.joints if joint.follows}
    _refuse_in_followers(document, followers)
    for name, element in document.by_name(children(document.root, BALL_CONSTRAINT)).items():
        if name in followers:
            document.refuse(element, f"{describe(element)} has the name of a joint that mimics another; give each constraint its own")


def _check_dynamics(document: Document, joint: etree._Element) -> None:
    dynamics = joint.find("dynamics")
    if dynamics is None:
        return
    if not {"damping", "friction"} & set(dynamics.attrib):
        document.refuse(dynamics, f"<dynamics> of {describe(joint)} has no damping; add it, or remove the element")
    if joint.get("type") == FIXED and float(dynamics.get("damping", 0)):
        document.refuse(dynamics, needs_axis(joint, "a damper"))


def _refuse_in_followers(document: Document, followers: Mapping[str, str]) -> None:
    """Refuse forces and rotors in joints that mimic another."""
    root = document.root
    acting = [(spring, "reference", "spring") for spring in root.iterchildren("gazebo")]
    acting += [(joint, "name", "transmission") for joint in root.iterfind("transmission/joint")]
    acting += [(joint, "name", "damper") for joint in root.iterfind("joint") if joint.find("dynamics[@damping]") is not None]
    for element, attribute, what in acting:
        if (name := element.get(attribute)) in followers:
            problem = f"has a {what} in a joint that mimics another, which is not read; give it to {followers[name]!r}"
            document.refuse(element, f"{describe(element)} {problem}")
