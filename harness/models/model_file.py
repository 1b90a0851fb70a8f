"""Read and validate one MJCF or URDF file before any engine sees it: engines take much of it in silence.

An element or attribute is understood and checked (``harness.models.formats``), or is decoration that no
acceleration feels and that a comment declares, or is refused by name. The comment names the elements and
attributes, in MJCF and URDF alike, anywhere in the file::

    <!-- decoration: geom asset rgba -->

URDF states neither springs nor reflected inertias. These conventions, and no others, are read:

- viscous damping of a joint, ``<dynamics damping>`` (http://wiki.ros.org/urdf/XML/joint);
- a spring in a joint, ``<gazebo reference="JOINT">`` with ``<springStiffness>`` and ``<springReference>``:
  force -k (q - reference). Source: SDFormat extensions to URDF, "<gazebo> elements for joints"
  (gazebosim/sdf_tutorials, docs/urdf/sdf_extensions.md);
- a spring and damper between points of two links, ``<drake:linear_spring_damper>``: force
  k (length - free length) + c d(length)/dt along the line between them. Source: Drake, "Parsing model
  files", tag drake:linear_spring_damper, and drake::multibody::LinearSpringDamper;
- reflected inertia of a joint's rotor, ``<drake:rotor_inertia value>`` and ``<drake:gear_ratio value>``
  (default 1) in the ``<actuator name>`` of a ``<transmission>`` with ``<type>``
  transmission_interface/SimpleTransmission and ``<joint name>``: gear_ratio^2 rotor_inertia is added to the
  joint's own inertia. As in Drake, the joint's effort limit must be above zero. Source: Drake, "Parsing
  model files", tags drake:rotor_inertia and drake:gear_ratio, and "Reflected Inertia";
- two points held together, ``<drake:ball_constraint>``, with a ``name`` that the harness finds it by. Source: Drake, "Parsing model
  files", tag drake:ball_constraint (``harness.models.urdf_constraints``);
- a ball joint, ``<drake:joint type="ball">`` from ``world``, which is not declared, to the root link. Source:
  Drake, "Parsing model files", tag drake:joint.

A joint with ``<mimic>`` is read, and is none of ``joint_lines``: it moves as another does (``harness.models.urdf_mimics``), and is
one of the ``constraints``. An engine that is not asked for its acceleration refuses the model for itself.

MJCF states gravity, springs, dampers and ``armature`` itself. MuJoCo applies them; for readers that pass over them
they are listed like those of a URDF (``harness.models.mjcf_forces``). It states constraints in ``<equality>``
(``harness.models.mjcf_constraints``).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from lxml import etree

from harness.files.constraints import ModelConstraint
from harness.models import mjcf_constraints, urdf_constraints
from harness.models.checks import check_elements, check_inertia, numbers
from harness.models.mjcf.options import gravity
from harness.models.mjcf_forces import Unexpressed, read_forces
from harness.models.urdf_forces import Armature, Elements, ForceElement, JointDamper, JointSpring, PointSpring, armatures, force_elements
from harness.models.urdf_mimics import Mimic, is_follower, mimics
from harness.models.values import Numbers, positive
from harness.models.xml import MAXIMUM_DEPTH, Document, add_named, describe, literal_tag, parse_document, read_document, resolve

__all__ = ["Armature", "ForceElement", "JointDamper", "JointSpring", "ModelFile", "PointSpring", "parse_model", "read_model"]

_DRAKE_JOINT = "drake:joint"
_UNIVERSE = "universe"
_WORLD = "world"
ROOT_TAGS = {"mjcf": "mujoco", "urdf": "robot"}


@dataclass(frozen=True)
class ModelFile:
    """One validated model file; can be pickled.

    Attributes:
        format: "mjcf" or "urdf".
        text: the content handed to the engine, exactly as read.
        joint_lines: joint that moves by itself to the line of its element, in document order.
        gravity_line: MJCF: line of the option with ``gravity``, else of an option, else of the root. URDF: None.
        root_line: line of the root element.
        force_elements: springs and dampers that the file declares; the harness adds them where a reader passes over them.
        armatures: reflected inertias that a URDF declares, in document order, to be added likewise; none for MJCF.
        ball_joint: name of the ball joint that hangs a URDF's root link on the world; None without one.
        mimics: joints of a URDF that mimic another.
        constraints: what closes loops and couples joints, in document order; a joint that mimics another is among them.
        gravity: MJCF: [m/s^2], (x, y, z), zero where it is switched off. URDF holds none: None.
        unexpressed: MJCF: forces and inertias it states that are not among ``force_elements``.
    """

    path: Path
    format: str
    text: str
    joint_lines: Mapping[str, int]
    gravity_line: int | None
    root_line: int
    force_elements: tuple[ForceElement, ...]
    armatures: tuple[Armature, ...] = ()
    ball_joint: str | None = None
    mimics: tuple[Mimic, ...] = ()
    gravity: tuple[float, float, float] | None = None
    unexpressed: tuple[Unexpressed, ...] = ()
    constraints: tuple[ModelConstraint, ...] = ()


def read_model(path: Path, format: str) -> ModelFile:
    """Read and validate the model file at ``path``; ``format`` is "mjcf" or "urdf".

    Whether its joints are those of a system is not asked here.

    Raises:
        InvalidModel: the file cannot be read, or is not a well-formed, physical model.
        ValueError: no such format.
    """
    return _validated(read_document(path, _root_tag(format)), format)


def parse_model(path: Path, text: str, format: str) -> ModelFile:
    """``read_model`` of a file at ``path`` that would hold ``text``; raises the same."""
    return _validated(parse_document(path, text, _root_tag(format)), format)


def _root_tag(format: str) -> str:
    if format not in ROOT_TAGS:
        raise ValueError(f"model format {format!r}; expected one of {sorted(ROOT_TAGS)}")
    return ROOT_TAGS[format]


def _validated(document: Document, format: str) -> ModelFile:
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
            _add_joint(document, joint, joints)
            moving.add(body)
        for body in world.iter("body"):
            if body.get("name") == _WORLD:
                document.refuse(
                    body, f"{describe(body)} has the name of the world itself, on which its joints hang it; give it another one"
                )
            if _owner(body) in moving:
                moving.add(body)
            _check_mjcf_inertial(document, body, body in moving)
    if not joints:
        document.refuse(root, "has no joint in any body; expected one for each coordinate of the system")
    options = [*root.iterfind("option[@gravity]")] or [*root.iterfind("option")] or [root]
    lines = {name: document.lines[joint] for name, joint in joints.items()}
    forces, unexpressed = read_forces(document)
    return ModelFile(
        path=document.path,
        format="mjcf",
        text=document.text,
        joint_lines=lines,
        gravity_line=document.lines[options[-1]],
        root_line=document.lines[root],
        force_elements=forces,
        gravity=gravity(root),
        unexpressed=unexpressed,
        constraints=mjcf_constraints.read_constraints(document, joints),
    )


def _add_joint(document: Document, joint: etree._Element, joints: dict[str, etree._Element]) -> None:
    add_named(document, joint, joints)
    if joint.get("name") == _UNIVERSE:
        document.refuse(joint, f"joint {_UNIVERSE!r}, as Pinocchio calls the world: its reader aborts on that; give it another name")


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
        _add_joint(document, joint, joints)
    moving_joints = {name: joint for name, joint in joints.items() if joint.get("type") != "fixed" and not is_follower(joint)}
    balls: dict[str, etree._Element] = {}
    for joint in (element for element in root.iterchildren("*") if literal_tag(element) == _DRAKE_JOINT):
        if balls:
            document.refuse(joint, f"second <{_DRAKE_JOINT}>; one ball joint can hang the root link on the world, and no other is read")
        _add_joint(document, joint, balls)
        if joint.get("name") in joints:
            document.refuse(joint, f"joint {joint.get('name')!r} is declared twice; give each joint its own name")
    moving_joints |= balls
    if not moving_joints:
        document.refuse(root, "has no moving joint; expected one for each coordinate of the system")
    for joint in balls.values() if _WORLD in links else ():
        hung = f"{describe(joint)} hangs the root link on the world, which a <{_DRAKE_JOINT}> knows by itself"
        document.refuse(links[_WORLD], f"{describe(links[_WORLD])} is a second root: {hung}; remove the link")
    root_link = _check_urdf_tree(document, links, joints, root_moves=bool(balls))
    for joint in balls.values():
        _check_ball_joint(document, joint, root_link)
    followers = tuple(mimics(document, joints))
    return ModelFile(
        path=document.path,
        format="urdf",
        text=document.text,
        joint_lines={name: document.lines[joint] for name, joint in moving_joints.items()},
        gravity_line=None,
        root_line=document.lines[root],
        force_elements=tuple(force_elements(document, links, joints)),
        armatures=tuple(armatures(document, joints)),
        ball_joint=next(iter(balls), None),
        mimics=followers,
        constraints=urdf_constraints.read_constraints(document, links, followers),
    )


def _check_ball_joint(document: Document, joint: etree._Element, root_link: str) -> None:
    for tag, expected in (("parent", _WORLD), ("child", root_link)):
        part = joint.find(tag)
        found = None if part is None else part.get("link")
        if found != expected:
            where = joint if part is None else part
            document.refuse(
                where, f"{describe(joint)} has {tag} link {found!r}, expected {expected!r}: it hangs the root link on the world"
            )


def _check_urdf_tree(document: Document, links: Elements, joints: Elements, root_moves: bool) -> str:
    """One root, whose name is returned, every link reached from it once, and mass wherever a joint can move it."""
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
    level = [(roots[0], root_moves)]
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
    return roots[0]


def _check_moving_link(document: Document, link: etree._Element, is_leaf: bool) -> None:
    if link.find("inertial") is None:
        document.refuse(link, f"{describe(link)} moves but has no <inertial>; add one with mass and inertia")
    if is_leaf:
        numbers(document, link.find("inertial/mass"), "value", Numbers(check=positive))


_READERS = {"mjcf": _read_mjcf, "urdf": _read_urdf}
