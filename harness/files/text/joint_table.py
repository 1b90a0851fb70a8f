"""The joints of a model file as its author wrote them, for people who compare two files by eye.

Texts are the file's own; what it leaves out and its reader then assumes stands in parentheses.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path

from lxml import etree

from harness.errors import InvalidModel
from harness.files.document.xml import Document, literal_tag, read_document
from harness.files.equalities import Equality, Linkage, Meeting, TendonLinkage
from harness.files.facts import point_of
from harness.files.joint_kinds import JointKind
from harness.files.mjcf.defaults import resolved_text
from harness.files.mjcf.options import KINDS, ORIENTATIONS
from harness.files.model_file import ROOT_TAGS, ModelFile, PointSpring, document_of
from harness.files.urdf.kinds import OF_AXIS
from harness.library import Library


@dataclass(frozen=True)
class JointRow:
    """One moving joint of one file; "" where the file has nothing to say.

    ``origin`` is the joint's frame in its parent's at zero, ``mass`` that of the body it carries, ``armature``
    a reflected inertia; ``line`` is that of the joint's element.
    """

    joint: str
    kind: str
    axis: str
    origin: str
    body: str
    mass: str
    damping: str
    stiffness: str
    armature: str
    line: int


COLUMNS = tuple(field.name for field in fields(JointRow))


def joint_rows(model: ModelFile) -> list[JointRow]:
    """A row per moving joint, in document order."""
    document = document_of(model)
    rows = {"mjcf": _mjcf_row, "urdf": _urdf_row}[model.format]
    moving = set(model.joint_lines.items())
    return [
        rows(document, model, element, name)
        for element in _joints(document, model.format)
        if (name := element.get("name"), document.lines[element]) in moving
    ]


def moving_joints(path: Path, model_format: str) -> frozenset[str]:
    """Names of the moving joints in a file that need not be a valid model, such as a robot's with its meshes.

    Raises:
        InvalidModel: the file cannot be read, or is not XML of that format.
    """
    document = read_document(path, ROOT_TAGS[model_format])
    return frozenset(element.get("name", "") for element in _joints(document, model_format) if _moves_by_itself(element))


def systems_with_joints_of(library: Library, path: Path, model_format: str) -> list[str]:
    """The systems whose own model in that format has moving joints of the same names as a file; none for a file without any.

    Raises:
        InvalidModel: as ``moving_joints`` of the file.
    """
    joints = moving_joints(path, model_format)
    return [name for name in library.system_names() if joints and joints == _joints_of(library, name, model_format)]


def _joints_of(library: Library, name: str, model_format: str) -> frozenset[str]:
    """The moving joints of a system's own model; none where it has no file that can be read."""
    path = library.model_path(name, model_format)
    with contextlib.suppress(InvalidModel):
        if path.is_file():
            return moving_joints(path, model_format)
    return frozenset()


def _moves_by_itself(joint: etree._Element) -> bool:
    return joint.get("type") != "fixed" and joint.find("mimic") is None


def _joints(document: Document, model_format: str) -> Iterator[etree._Element]:
    # A URDF has other elements called joint inside of its transmissions.
    among = {"mjcf": document.root.iterfind("worldbody//*"), "urdf": document.root.iterchildren("*")}[model_format]
    return (element for element in among if "joint" in literal_tag(element))


def point_springs(model: ModelFile) -> list[str]:
    """A line of text for each spring that does not stand in a joint."""
    if model.format == "urdf":
        return [
            f"line {spring.line}: spring from {spring.body_a} at {_numbers(spring.point_a)} "
            f"to {spring.body_b} at {_numbers(spring.point_b)}, "
            + ", ".join(
                f"{name.replace('_', ' ')} {_numbers((getattr(spring, name),))}" for name in ("stiffness", "damping", "free_length")
            )
            for spring in model.force_elements
            if isinstance(spring, PointSpring)
        ]
    document = document_of(model)
    return [f"line {document.lines[tendon]}: {_summary(tendon)}" for tendon in document.root.iterfind("tendon/*")]


def constraint_texts(model: ModelFile) -> list[str]:
    """A line of text for each constraint."""
    return [f"line {one.line}: constraint {one.name} {_tied(one)}" for one in model.constraints]


def _tied(constraint: Equality) -> str:
    says = constraint.says
    if isinstance(says, Meeting):
        ends = (f"of {body} at {_numbers(point_of(pose))}" for body, pose in says.ends)
        return f"holds a {constraint.couples} " + " at one ".join(ends)
    assert isinstance(says, Linkage | TendonLinkage)
    coefficients = _numbers(tuple(map(float, says.coefficients)))
    if isinstance(says, Linkage):
        return f"moves joint {says.joint} by {coefficients} of powers of {says.leader or 'nothing'}"
    return f"has tendon {says.tendon.name} as long as {coefficients} of powers of {says.leader.name if says.leader else 'nothing'}"


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(repr(value).removesuffix(".0") for value in values)


def _summary(element: etree._Element) -> str:
    """The element's attributes and those of its children, without the markup."""
    parts = [f"{child.tag} {' '.join(child.attrib.values())}" for child in element.iterchildren("*")]
    attributes = [f"{name} {value}" for name, value in element.attrib.items()]
    return f"{element.tag} tendon over {', '.join(parts)}: {', '.join(attributes)}"


def _mjcf_row(document: Document, model: ModelFile, joint: etree._Element, name: str) -> JointRow:
    kind = JointKind.FREE if joint.tag == "freejoint" else resolved_text(joint, "type", "(hinge)")
    inner = list(_frames_around(joint))
    body = (inner[-1] if inner else joint).getparent()
    shift = resolved_text(joint, "pos")
    inertial = body.find("inertial")
    return JointRow(
        joint=name,
        kind=kind,
        axis=resolved_text(joint, "axis", "(0 0 1)" if kind == "(hinge)" or KINDS[kind].has_axis else ""),
        origin=", ".join(
            [
                _pose(body),
                *(f"body in frame {_pose(frame)}" for frame in _frames_around(body)),
                *([f"joint at {shift}"] if shift else []),
                *(f"in frame {_pose(frame)}" for frame in inner),
            ]
        ),
        body=body.get("name", ""),
        mass="" if inertial is None else inertial.get("mass", ""),
        damping=resolved_text(joint, "damping"),
        stiffness=resolved_text(joint, "stiffness"),
        armature=resolved_text(joint, "armature"),
        line=document.lines[joint],
    )


def _frames_around(element: etree._Element) -> Iterator[etree._Element]:
    """The MJCF frames that ``element`` stands in directly, the innermost first."""
    return itertools.takewhile(lambda ancestor: ancestor.tag == "frame", element.iterancestors())


def _pose(element: etree._Element) -> str:
    turns = [f"{name} {element.get(name)}" for name in ORIENTATIONS if name in element.attrib]
    return ", ".join([*filter(None, [element.get("pos")]), *turns]) or "(0 0 0)"


def _urdf_row(document: Document, model: ModelFile, joint: etree._Element, name: str) -> JointRow:
    kind = joint.get("type", "")
    child = joint.find("child").get("link", "")
    springs = [element.find("springStiffness") for element in document.root.iterchildren("gazebo") if element.get("reference") == name]
    links = [element for element in document.root.iterchildren("link") if element.get("name") == child]
    armature = [element.reflected_inertia for element in model.armatures if element.joint == name]
    origin = joint.find("origin")
    turned = "" if origin is None else origin.get("rpy", "")
    return JointRow(
        joint=name,
        kind=kind,
        axis=_urdf(joint, "axis", "xyz") or ("(1 0 0)" if kind in OF_AXIS else ""),
        origin=(_urdf(joint, "origin", "xyz") or "(0 0 0)") + (f", rpy {turned}" if turned else ""),
        body=child,
        mass="".join(_urdf(link, "inertial/mass", "value") for link in links),
        damping=_urdf(joint, "dynamics", "damping"),
        stiffness="".join((spring.text or "").strip() for spring in springs if spring is not None),
        armature=_numbers(tuple(armature)),
        line=document.lines[joint],
    )


def _urdf(element: etree._Element, path: str, attribute: str) -> str:
    found = element.find(path)
    return "" if found is None else str(found.get(attribute, ""))
