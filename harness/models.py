"""Read and validate one MJCF or URDF file before any engine sees it: engines take much of it in silence.

A URDF declares no springs of its own. These conventions, and no others, are read as force elements:

- viscous damping of a joint, ``<dynamics damping>`` (http://wiki.ros.org/urdf/XML/joint);
- a spring in a joint, ``<gazebo reference="JOINT">`` with ``<springStiffness>`` and ``<springReference>``:
  force -k (q - reference). Source: SDFormat extensions to URDF, "<gazebo> elements for joints"
  (gazebosim/sdf_tutorials, docs/urdf/sdf_extensions.md);
- a spring and damper between points of two links, ``<drake:linear_spring_damper>``: force
  k (length - free length) + c d(length)/dt along the line between them. Source: Drake, "Parsing model
  files", tag drake:linear_spring_damper, and drake::multibody::LinearSpringDamper.

MJCF states springs and dampers itself, and the engine that reads them applies them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from lxml import etree

from harness.model_formats import Numbers, check_elements, check_inertia, not_negative, numbers, positive
from harness.model_xml import MAXIMUM_DEPTH, Document, add_named, describe, literal_tag, read_document, resolve, shorten

ROOT_TAGS = {"mjcf": "mujoco", "urdf": "robot"}
_SINGLE_AXIS = ("revolute", "prismatic", "continuous")
_POINT_SPRING = "drake:linear_spring_damper"

Point = tuple[float, float, float]
Elements = Mapping[str, etree._Element]


@dataclass(frozen=True)
class JointSpring:
    """Force -stiffness (q - reference) in a joint [N/m and m, or N m/rad and rad]."""

    joint: str
    stiffness: float
    reference: float
    line: int


@dataclass(frozen=True)
class JointDamper:
    """Force -damping v in a joint [N s/m or N m s/rad]."""

    joint: str
    damping: float
    line: int


@dataclass(frozen=True)
class PointSpring:
    """Spring and damper between a point of body A and a point of body B, each in its link's frame [m].

    ``stiffness`` [N/m] acts on the length beyond ``free_length`` [m], ``damping`` [N s/m] on its rate.
    """

    body_a: str
    point_a: Point
    body_b: str
    point_b: Point
    free_length: float
    stiffness: float
    damping: float
    line: int


ForceElement = JointSpring | JointDamper | PointSpring


@dataclass(frozen=True)
class ModelFile:
    """One validated model file; can be pickled.

    Attributes:
        format: "mjcf" or "urdf".
        text: the content handed to the engine, exactly as read.
        joint_lines: moving joint to the line of its element, in document order.
        gravity_line: MJCF: line of the option with ``gravity``, else of an option, else of the root. URDF: None.
        root_line: line of the root element.
        force_elements: springs and dampers the harness must add, in document order; none for MJCF.
    """

    path: Path
    format: str
    text: str
    joint_lines: Mapping[str, int]
    gravity_line: int | None
    root_line: int
    force_elements: tuple[ForceElement, ...]


def read_model(path: Path, format: str) -> ModelFile:
    """Read and validate the model file at ``path``; ``format`` is "mjcf" or "urdf".

    Whether its joints are those of a system is not asked here.

    Raises:
        InvalidModel: the file cannot be read, or is not a well-formed, physical model.
        ValueError: no such format.
    """
    if format not in ROOT_TAGS:
        raise ValueError(f"model format {format!r}; expected one of {sorted(ROOT_TAGS)}")
    document = read_document(path, ROOT_TAGS[format])
    check_elements(document, format)
    return _READERS[format](document)


def _read_mjcf(document: Document) -> ModelFile:
    root = document.root
    joints: dict[str, etree._Element] = {}
    moving: set[etree._Element] = set()
    for world in root.iterfind("worldbody"):
        for joint in world.iter("joint", "freejoint"):
            body = _owner(joint)
            if body.tag != "body":
                document.refuse(joint, f"{describe(joint)} stands in <{body.tag}>; a joint belongs in the <body> that it moves")
            add_named(document, joint, joints)
            moving.add(body)
        for body in world.iter("body"):
            if _owner(body) in moving:
                moving.add(body)
            _check_mjcf_inertial(document, body, body in moving)
    if not joints:
        document.refuse(root, "has no joint in any body; expected one for each coordinate of the system")
    options = [*root.iterfind("option[@gravity]")] or [*root.iterfind("option")] or [root]
    lines = {name: document.lines[joint] for name, joint in joints.items()}
    return ModelFile(document.path, "mjcf", document.text, lines, document.lines[options[-1]], document.lines[root], ())


def _owner(element: etree._Element) -> etree._Element:
    """The element that holds ``element``, looking through MJCF frames, which only shift coordinates."""
    parent = element.getparent()
    while parent.tag == "frame":
        parent = parent.getparent()
    return parent


def _check_mjcf_inertial(document: Document, body: etree._Element, moves: bool) -> None:
    inertial = body.find("inertial")
    if inertial is None:
        if moves:
            document.refuse(body, f"{describe(body)} moves but has no <inertial>; add one with pos, mass and diaginertia")
        return
    given = [name for name in ("diaginertia", "fullinertia") if name in inertial.attrib]
    if len(given) != 1:
        found = "both diaginertia and fullinertia" if given else "neither diaginertia nor fullinertia"
        document.refuse(inertial, f"<inertial> of {describe(body)} has {found}; expected one of them")
    check_inertia(document, inertial, *numbers(document, inertial, given[0], Numbers(3, 6)))
    if moves and next(body.iterdescendants("body"), None) is None:
        numbers(document, inertial, "mass", Numbers(check=positive))


def _read_urdf(document: Document) -> ModelFile:
    root = document.root
    links: dict[str, etree._Element] = {}
    joints: dict[str, etree._Element] = {}
    if not root.get("name"):
        document.refuse(root, "<robot> has no name, without which URDF readers give up; add one")
    for link in root.iterfind("link"):
        add_named(document, link, links)
        inertia = link.find("inertial/inertia")
        if inertia is not None:
            order = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
            check_inertia(document, inertia, *(numbers(document, inertia, name, Numbers())[0] for name in order))
    if not links:
        document.refuse(root, "has no link; expected the bodies of the mechanism and the world they hang on")
    for joint in root.iterfind("joint"):
        add_named(document, joint, joints)
    moving_joints = {name: joint for name, joint in joints.items() if joint.get("type") != "fixed"}
    if not moving_joints:
        document.refuse(root, "has no moving joint; expected one for each coordinate of the system")
    _check_urdf_tree(document, links, joints)
    return ModelFile(
        path=document.path,
        format="urdf",
        text=document.text,
        joint_lines={name: document.lines[joint] for name, joint in moving_joints.items()},
        gravity_line=None,
        root_line=document.lines[root],
        force_elements=tuple(_force_elements(document, links, joints)),
    )


def _check_urdf_tree(document: Document, links: Elements, joints: Elements) -> None:
    """One root, every link reached from it once, and mass wherever a joint can move it."""
    below: dict[str, list[etree._Element]] = {name: [] for name in links}
    carried_by: dict[str, etree._Element] = {}
    for joint in joints.values():
        below[resolve(document, joint.find("parent"), "link", links)].append(joint)
        child = resolve(document, joint.find("child"), "link", links)
        if child in carried_by:
            other = describe(carried_by[child])
            document.refuse(joint, f"{describe(joint)} carries link {child!r}, and so does {other}; expected one joint")
        carried_by[child] = joint
    roots = [name for name in links if name not in carried_by]
    if not roots:
        document.refuse(next(iter(joints.values())), "every link is the child of a joint, so the joints form a cycle; expected a tree")
    for name in roots[1:]:
        document.refuse(links[name], f"link {name!r} hangs on no joint, nor does {roots[0]!r}; expected one root, join the other to it")

    reached = {roots[0]}
    level = [(roots[0], False)]
    depth = 0
    while level:
        depth += 1
        for name, moves in level:
            if depth > MAXIMUM_DEPTH:
                document.refuse(links[name], f"link {name!r} is more than {MAXIMUM_DEPTH} joints from the root; engines overflow on that")
            if moves:
                _check_moving_link(document, links[name], is_leaf=not below[name])
        level = [(joint.find("child").get("link"), moves or joint.get("type") != "fixed") for name, moves in level for joint in below[name]]
        reached |= {name for name, _ in level}
    for name in links:
        if name not in reached:
            joint = carried_by[name]
            document.refuse(joint, f"{describe(joint)} is part of a cycle that link {roots[0]!r} does not reach; expected a tree")


def _check_moving_link(document: Document, link: etree._Element, is_leaf: bool) -> None:
    if link.find("inertial") is None:
        document.refuse(link, f"{describe(link)} moves but has no <inertial>; add one with mass and inertia")
    if is_leaf:
        numbers(document, link.find("inertial/mass"), "value", Numbers(check=positive))


def _force_elements(document: Document, links: Elements, joints: Elements) -> Iterator[ForceElement]:
    sprung: set[str] = set()
    for element in document.root.iterchildren("*"):
        tag = literal_tag(element)
        if tag == "joint":
            yield from _joint_damper(document, element)
        elif tag == "gazebo":
            for spring in _joint_spring(document, element, joints):
                if spring.joint in sprung:
                    document.refuse(element, f"joint {spring.joint!r} has a second spring; expected one, with the sum of the stiffnesses")
                sprung.add(spring.joint)
                yield spring
        elif tag == _POINT_SPRING:
            yield _point_spring(document, element, links)


def _joint_damper(document: Document, joint: etree._Element) -> Iterator[JointDamper]:
    dynamics = joint.find("dynamics")
    if dynamics is None:
        return
    if not {"damping", "friction"} & set(dynamics.attrib):
        document.refuse(dynamics, f"<dynamics> of {describe(joint)} has no damping; add it, or remove the element")
    if "damping" not in dynamics.attrib:
        return
    (damping,) = numbers(document, dynamics, "damping", Numbers(check=not_negative))
    if joint.get("type") in _SINGLE_AXIS:
        yield JointDamper(joint.get("name"), damping, document.lines[dynamics])
    elif damping:
        document.refuse(dynamics, f"{describe(joint)} is {joint.get('type')} and damped; a damper needs a joint that is {_either()}")


def _joint_spring(document: Document, gazebo: etree._Element, joints: Elements) -> Iterator[JointSpring]:
    parts = {tag: gazebo.find(tag) for tag in ("springStiffness", "springReference")}
    if all(part is None for part in parts.values()):
        return
    values: list[float] = []
    for tag, part in parts.items():
        if part is None:
            document.refuse(gazebo, f"the spring of {describe(gazebo)} has no <{tag}>; add it")
        try:
            values.extend(Numbers().read(part.text or ""))
        except ValueError as complaint:
            document.refuse(part, f"<{tag}>{shorten(part.text or '')}</{tag}> {complaint}")
    name = resolve(document, gazebo, "reference", joints)
    kind = joints[name].get("type")
    if kind not in _SINGLE_AXIS:
        document.refuse(gazebo, f"{describe(joints[name])} is {kind}; a spring needs a joint that is {_either()}")
    yield JointSpring(name, values[0], values[1], document.lines[gazebo])


def _point_spring(document: Document, element: etree._Element, links: Elements) -> PointSpring:
    parts: dict[str, etree._Element] = {}
    for part in element.iterchildren("*"):
        if literal_tag(part) in parts:
            document.refuse(part, f"second <{literal_tag(part)}> in one spring; expected one, keep the right one")
        parts[literal_tag(part)] = part

    def part_named(suffix: str) -> etree._Element:
        tag = f"{_POINT_SPRING}_{suffix}"
        if tag not in parts:
            document.refuse(element, f"<{_POINT_SPRING}> has no <{tag}>; add it")
        return parts[tag]

    def point(suffix: str) -> Point:
        x, y, z = numbers(document, part_named(suffix), "value", Numbers(3))
        return x, y, z

    def scalar(suffix: str, rule: Numbers) -> float:
        return numbers(document, part_named(suffix), "value", rule)[0]

    return PointSpring(
        body_a=resolve(document, part_named("body_A"), "name", links),
        point_a=point("p_AP"),
        body_b=resolve(document, part_named("body_B"), "name", links),
        point_b=point("p_BQ"),
        free_length=scalar("free_length", Numbers(check=positive)),
        stiffness=scalar("stiffness", Numbers(check=not_negative)),
        damping=scalar("damping", Numbers(check=not_negative)),
        line=document.lines[element],
    )


def _either() -> str:
    return " or ".join(_SINGLE_AXIS)


_READERS = {"mjcf": _read_mjcf, "urdf": _read_urdf}
