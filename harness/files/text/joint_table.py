"""The joints of a model file as its author wrote them, for people who compare two files by eye.

Texts are the file's own; what it leaves out and its reader then assumes stands in parentheses.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

from harness.errors import InvalidModel
from harness.files.document.xml import literal_tag, parse_document, read_text
from harness.files.equalities import Equality, Linkage, Meeting, TendonLinkage
from harness.files.facts import point_of
from harness.files.given import Given, Place, Placement, numbers_in
from harness.files.joint_kinds import JointKind
from harness.files.mjcf.attributes import ORIENTATIONS
from harness.files.model_file import ROOT_TAGS, ModelFile, PointSpring, meaning_of
from harness.files.text.scan import Element, all_elements
from harness.files.tree import Body, Joint
from harness.library import Library

_NOWHERE = "(0 0 0)"
_TURNS = (*ORIENTATIONS, "rpy")


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
    elements = all_elements(model.text, model.format)
    bodies = meaning_of(model).tree.bodies
    found = [_row(elements, body, one, one.place) for body in bodies for one in body.joints if one.place and not one.follows]
    return sorted(found, key=lambda row: list(model.joint_lines).index(row.joint))


def moving_joints(path: Path, model_format: str) -> frozenset[str]:
    """Names of the moving joints in a file that need not be a valid model, such as a robot's with its meshes.

    Raises:
        InvalidModel: the file cannot be read, or is not XML of that format.
    """
    root = parse_document(path, read_text(path), ROOT_TAGS[model_format]).root
    # A URDF has other elements called joint inside of its transmissions.
    among = root.iterfind("worldbody//*") if model_format == "mjcf" else root.iterchildren("*")
    joints = (one for one in among if "joint" in literal_tag(one) and one.get("type") != "fixed" and one.find("mimic") is None)
    return frozenset(joint.get("name", "") for joint in joints)


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
    elements = all_elements(model.text, model.format)
    return [f"line {one.line}: {_summary(one, filter(one.holds, elements))}" for one in elements if one.path[1:-1] == ("tendon",)]


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


def _summary(tendon: Element, parts: Iterable[Element]) -> str:
    """The element's attributes and those of its parts, without the markup."""
    over = [f"{part.tag} {' '.join(one.value for one in part.attributes)}" for part in parts]
    return f"{tendon.tag} tendon over {', '.join(over)}: {', '.join(f'{one.name} {one.value}' for one in tendon.attributes)}"


def _row(elements: Sequence[Element], body: Body, joint: Joint, place: Place) -> JointRow:
    def text(values: object) -> str:
        """An attribute as written; "" where nobody gives it."""
        return next(((elements[one.place.element].get(one.attribute) or "").strip() for one in numbers_in(values)), "")

    def poses(frames: Iterable[Placement]) -> Iterator[str]:
        return (_pose(elements[x.place.element]) for frame in frames for x in frame.position[:1] if isinstance(x, Given))

    own = elements[place.element]
    is_urdf = own.path[0] == "robot"
    written = own.get("type") or ("" if is_urdf else f"({joint.kind})" if joint.kind is JointKind.HINGE else joint.kind)
    standard = f"({_numbers(tuple(map(float, joint.axis)))})" if joint.kind.has_axis else ""
    shift = text(joint.anchor)
    if is_urdf:
        origin = [*poses(body.pose)] or [_NOWHERE]
    else:
        frames = [f"body in frame {pose}" for pose in poses(reversed(body.pose[:-1]))]
        around = [*([f"joint at {shift}"] if shift else []), *(f"in frame {pose}" for pose in poses(reversed(joint.pose)))]
        origin = [*([_pose(elements[body.place.element])] if body.place else []), *frames, *around]
    return JointRow(
        joint=joint.name,
        kind=written,
        axis=text(joint.axis) or standard,
        origin=", ".join(origin),
        body="" if body.is_unnamed else body.name,
        mass="" if body.inertia is None else text(body.inertia.mass),
        damping=text(joint.damping),
        stiffness=text(joint.stiffness),
        armature=_numbers((float(joint.armature),)) if is_urdf and joint.armature else "" if is_urdf else text(joint.armature),
        line=place.line,
    )


def _pose(element: Element) -> str:
    """The placement that an element gives, in the words of its format."""
    at, turns = element.get("pos") or element.get("xyz"), [f"{name} {value}" for name in _TURNS if (value := element.get(name))]
    return ", ".join([*filter(None, [at or (_NOWHERE if not turns or element.tag == "origin" else "")]), *turns])
