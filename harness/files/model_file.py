"""Read and validate one MJCF or URDF file before any engine sees it: engines take much of it in silence.

An element or attribute is understood and checked (``harness.files.lint.formats``), or is decoration that no
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
  files", tag drake:ball_constraint (``harness.files.urdf.beside``);
- a ball joint, ``<drake:joint>`` of type ball from ``world``, which is not declared, to the root link. Source:
  Drake, "Parsing model files", tag drake:joint.

A joint with ``<mimic>`` is read, and is none of ``joint_lines``: it moves as another does (``harness.files.urdf.beside``), and is
one of the ``constraints``. An engine that is not asked for its acceleration refuses the model for itself.

MJCF states gravity, springs, dampers and ``armature`` itself. MuJoCo applies them; for readers that pass over them
they are listed like those of a URDF (``harness.files.facts``). It states constraints in ``<equality>``
(``harness.files.mjcf.between``).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from lxml import etree

from harness.files.document.source import Unread
from harness.files.document.xml import Document, parse_document, read_text
from harness.files.equalities import Constraint, Equality, frictions_of, limits_of
from harness.files.facts import (
    ForceElement,
    JointDamper,
    JointSpring,
    PointSpring,
    joint_forces,
    point_springs,
)
from harness.files.joint_kinds import JointKind
from harness.files.tree import Joint, Spring
from harness.files.urdf.kinds import MIMIC

if TYPE_CHECKING:
    from harness.files.reading import Meaning

__all__ = ["ForceElement", "JointDamper", "JointSpring", "ModelFile", "PointSpring", "parse_model", "read_model"]

ROOT_TAGS = {"mjcf": "mujoco", "urdf": "robot"}
# Path of elements below the root to the attributes that they get; see ``with_attributes``.
Attributes = Mapping[str, Mapping[str, str]]
_CONSTRAINTS = {"point": "loops", "frame": "loops", "joint": "coupled joints", "tendon": "coupled tendons"}
_JOINTS = {JointKind.BALL: "ball joints", JointKind.FREE: "free joints"}


@dataclass(frozen=True)
class ModelFile:
    """One validated model file; can be pickled.

    Attributes:
        format: "mjcf" or "urdf".
        text: the content handed to the engine, exactly as read.
        joint_lines: joint that moves by itself to the line of its element, in document order.
        joints: every joint to its kind and the name of the joint that carries it, "" for none; parents first.
        gravity_line: MJCF: line of the option with ``gravity``, else of an option, else of the root. URDF: None.
        root_line: line of the root element.
        force_elements: springs and dampers that the file declares; the harness adds them where a reader passes over them.
        armatures: joints to which a URDF declares reflected inertias, in document order, to be added likewise; none for MJCF.
        ball_joint: name of the ball joint that hangs a URDF's root link on the world; None without one.
        constraints: what closes loops and couples joints, in document order; a joint that mimics another is among them.
        bounded: the dry friction and the limits of its joints. acting: names of those that an engine is to apply; none of a file as it is
            read, since a mechanism says which are meant.
        actuators: names of its actuators with their lines, in the order of the file. driven: names of those that an engine is to apply, in
            the order of controls; none of a file as it is read.
        gravity: MJCF: [m/s^2], (x, y, z), zero where it is switched off. URDF holds none: None.
        unexpressed: MJCF: forces and inertias it states that are not among ``force_elements``.
    """

    path: Path
    format: str
    text: str
    joint_lines: Mapping[str, int]
    joints: Mapping[str, tuple[JointKind, str]]
    gravity_line: int | None
    root_line: int
    force_elements: tuple[ForceElement, ...]
    armatures: tuple[Joint, ...] = ()
    ball_joint: str | None = None
    gravity: tuple[float, float, float] | None = None
    unexpressed: tuple[Unread, ...] = ()
    constraints: tuple[Equality, ...] = ()
    bounded: tuple[Constraint, ...] = ()
    acting: tuple[str, ...] = ()
    actuators: tuple[tuple[str, int], ...] = ()
    driven: tuple[str, ...] = ()

    def with_text(self, text: str) -> ModelFile:
        """The file with another text; raises as ``read_model``."""
        return replace(_validated(self.path, text, self.format), acting=self.acting, driven=self.driven)

    @property
    def all_acting(self) -> Sequence[Constraint]:
        """Its constraints, and the dry friction and limits that act."""
        return [*self.constraints, *(one for one in (self.bounded if self.acting else ()) if one.name in self.acting)]

    @property
    def mimics(self) -> tuple[Equality, ...]:
        """The constraints that are joints of a URDF which mimic another, each by its name."""
        return tuple(one for one in self.constraints if one.kind == MIMIC)


def read_model(path: Path, format: str) -> ModelFile:
    """Read and validate the model file at ``path``; ``format`` is "mjcf" or "urdf".

    Whether its joints are those of a system is not asked here.

    Raises:
        InvalidModel: the file cannot be read, or is not a well-formed, physical model.
        ValueError: no such format.
    """
    _root_tag(format)
    return _validated(path, read_text(path), format)


def parse_model(path: Path, text: str, format: str) -> ModelFile:
    """``read_model`` of a file at ``path`` that would hold ``text``; raises the same."""
    return _validated(path, text, format)


def document_of(model: ModelFile) -> Document:
    """The elements of the file of a model, for whoever leaves them as they are; those of the last files are kept."""
    return _document(model.path, model.text, model.format)


def meaning_of(model: ModelFile) -> Meaning:
    """Meaning of the file of a model; that of the last files is kept."""
    return _meaning(model.path, model.text, model.format)


@lru_cache(maxsize=8)
def _document(path: Path, text: str, format: str) -> Document:
    return parse_document(path, text, _root_tag(format))


@lru_cache(maxsize=8)
def _meaning(path: Path, text: str, format: str) -> Meaning:
    # Imported late, as what checks a file: the process of an engine is handed one that is checked.
    from harness.files.reading import read

    return read(_document(path, text, format))


def _root_tag(format: str) -> str:
    if format not in ROOT_TAGS:
        raise ValueError(f"model format {format!r}; expected one of {sorted(ROOT_TAGS)}")
    return ROOT_TAGS[format]


# Each reader of a changed text reads it.
@lru_cache(maxsize=8)
def _validated(path: Path, text: str, format: str) -> ModelFile:
    from harness.files.lint.checks import check_elements
    from harness.files.lint.mechanisms import check_joints, check_reading

    document = _document(path, text, format)
    check_elements(document, format)
    check_joints(document, format)
    reading = _meaning(path, text, format)
    check_reading(document, reading)
    tree = reading.tree
    in_order = sorted(tree.joints, key=lambda joint: joint.place.element if joint.place else 0)
    forces = [*joint_forces(in_order), *point_springs(tree)]
    if format == "urdf":
        forces.sort(key=lambda one: one.line)
    options = [*document.root.iterfind("option[@gravity]")] or [*document.root.iterfind("option")] or [document.root]
    of_mjcf = format == "mjcf"
    x, y, z = map(float, tree.gravity)
    before = tree.joints_before
    return ModelFile(
        path=document.path,
        format=format,
        text=document.text,
        joint_lines={joint.name: joint.place.line for joint in in_order if joint.place and not joint.follows},
        joints={joint.name: (joint.kind, before[joint.name]) for joint in tree.joints},
        gravity_line=document.lines[options[-1]] if of_mjcf else None,
        root_line=document.lines[document.root],
        force_elements=tuple(one for one in forces if not isinstance(one, Unread)),
        armatures=() if of_mjcf else tuple(joint for joint in in_order if joint.armature),
        ball_joint=None if of_mjcf else next((joint.name for joint in in_order if joint.kind is JointKind.BALL), None),
        gravity=(x, y, z) if of_mjcf else None,
        unexpressed=(*reading.unread, *(one for one in forces if isinstance(one, Unread))),
        constraints=reading.equalities,
        bounded=(*frictions_of(tree), *limits_of(tree)),
        actuators=tuple((one.name, one.line) for one in reading.actuators),
    )


def with_attributes(model: ModelFile, attributes: Attributes) -> ModelFile:
    """The model with attributes set on all elements of each path, as ``option/flag`` or ``equality/connect[@name='closure']``.

    An element that a path of plain tags does not find is made.

    Raises:
        ValueError: another path finds none.
        InvalidModel: the changed model is not physical.
    """
    root = parse_document(model.path, model.text, ROOT_TAGS[model.format]).root
    for path, values in attributes.items():
        # Comments match a path that ends with a star.
        found = [one for one in root.iterfind(path) if isinstance(one.tag, str)] or [_made(root, path)]
        for element in found if values else ():
            for name, value in values.items():
                element.set(name, value)
    return model.with_text(etree.tostring(root, encoding="unicode"))


def _made(root: etree._Element, path: str) -> etree._Element:
    element = root
    for tag in path.split("/"):
        if not tag.isidentifier():
            raise ValueError(f"the model has no element at {path!r}")
        inner = element.find(tag)
        element = etree.SubElement(element, tag) if inner is None else inner
    return element


def features_of(model: ModelFile) -> list[str]:
    """Features that it asks of an engine beyond hinges and slides, in a word or two each; a report gathers verdicts by them.

    Some of "actuators", "armature", "ball joints", "coupled joints", "coupled tendons", "dampers", "dry friction", "free joints", "limits",
    "loops", "mimic joints" and "springs", sorted; limits of an MJCF alone, since every URDF has some."""
    return sorted(set(_features(model)))


def _features(model: ModelFile) -> Iterator[str]:
    tree = meaning_of(model).tree
    acting: list[Joint | Spring] = [*tree.joints, *tree.springs]
    if any(one.stiffness for one in acting):
        yield "springs"
    if any(one.damping for one in acting):
        yield "dampers"
    if any(joint.friction_loss for joint in tree.joints):
        yield "dry friction"
    if model.format == "mjcf" and any(joint.limits for joint in tree.joints):
        yield "limits"
    followers = {joint.name for joint in tree.joints if joint.follows}
    if followers:
        yield "mimic joints"
    yield from (_CONSTRAINTS[one.couples] for one in model.constraints if one.name not in followers)
    if model.actuators:
        yield "actuators"
    if any(joint.armature for joint in tree.joints):
        yield "armature"
    yield from (_JOINTS[joint.kind] for joint in tree.joints if joint.kind in _JOINTS)
