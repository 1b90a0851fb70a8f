"""The lines of a model file that decide a quantity of the static audit.

Sources: MuJoCo XML reference, body, joint and inertial; http://wiki.ros.org/urdf/XML; ``harness.files.model_file`` for the
conventions that URDF borrows.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from lxml import etree

from harness.files.document.xml import literal_tag, parse_document
from harness.files.lint.formats import rules_at
from harness.files.mjcf.defaults import resolved
from harness.files.mjcf.options import ORIENTATIONS, is_on
from harness.files.model_file import ROOT_TAGS, ModelFile
from harness.files.text.scan import Element, find_elements, innermost
from harness.files.urdf.kinds import POINT_SPRING

GRAVITY, JOINT, ANCHOR, AXIS, FRAME = "gravity", "joint", "anchor", "axis", "frame"
ARMATURE, DAMPING, STIFFNESS, SPRING_REFERENCE = "armature", "damping", "stiffness", "spring reference"
MASS, CENTRE, INERTIA = "mass", "centre", "inertia"
SPRING_ENDS, SPRING_STIFFNESS = "point spring ends", "point spring stiffness"
SPRING_DAMPING, SPRING_LENGTH = "point spring damping", "point spring length"

# format -> quantity of a spring between points -> attributes of the tendon, or ends of the tags in Drake's element
_COEFFICIENTS = {SPRING_STIFFNESS: ("stiffness",), SPRING_DAMPING: ("damping",)}
_SPRING_PARTS: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "mjcf": {**_COEFFICIENTS, SPRING_ENDS: (), SPRING_LENGTH: ("springlength",)},
    "urdf": {**_COEFFICIENTS, SPRING_ENDS: ("body_A", "p_AP", "body_B", "p_BQ"), SPRING_LENGTH: ("free_length",)},
}
# Quantity to the stage of MuJoCo's pipeline that applies it.
_STAGES = {DAMPING: "damper", STIFFNESS: "spring", SPRING_DAMPING: "damper", SPRING_STIFFNESS: "spring"}
# format -> quantity -> (part of the model that belongs to the joint, attributes of it that decide the quantity), the likeliest
# first; of the first part the element itself is reported where it has none of them
_PLACES: Mapping[str, Mapping[str, tuple[tuple[str, tuple[str, ...]], ...]]] = {
    "mjcf": {
        JOINT: (("joint", ()),),
        ANCHOR: (("body", ("pos",)), ("joint", ("pos",))),
        AXIS: (("joint", ("axis",)), ("body", ORIENTATIONS)),
        FRAME: (("body", ORIENTATIONS),),
        ARMATURE: (("joint", ("armature",)),),
        DAMPING: (("joint", ("damping",)),),
        STIFFNESS: (("joint", ("stiffness",)),),
        SPRING_REFERENCE: (("joint", ("springref",)),),
        MASS: (("inertial", ("mass",)),),
        CENTRE: (("inertial", ("pos",)), ("body", ("pos", *ORIENTATIONS))),
        INERTIA: (("inertial", ("diaginertia", "fullinertia", *ORIENTATIONS)), ("body", ORIENTATIONS)),
    },
    "urdf": {
        JOINT: (("joint", ()),),
        ANCHOR: (("joint/origin", ("xyz",)),),
        AXIS: (("joint/axis", ("xyz",)), ("joint/origin", ("rpy",))),
        FRAME: (("joint/origin", ("rpy",)),),
        ARMATURE: (("actuator/drake:rotor_inertia", ("value",)), ("actuator/drake:gear_ratio", ("value",))),
        DAMPING: (("joint/dynamics", ("damping",)),),
        STIFFNESS: (("gazebo/springStiffness", ("",)),),
        SPRING_REFERENCE: (("gazebo/springReference", ("",)),),
        MASS: (("inertial/mass", ("value",)),),
        CENTRE: (("inertial/origin", ("xyz",)), ("joint/origin", ("xyz", "rpy"))),
        INERTIA: (
            ("inertial/inertia", ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")),
            ("inertial/origin", ("rpy",)),
            ("joint/origin", ("rpy",)),
        ),
    },
}


def lines_of(model: ModelFile, quantity: str, joint: str) -> tuple[int, ...]:
    """1-based lines that decide ``quantity`` of ``joint`` and of the body it carries, the likeliest first.

    A file that leaves the quantity out has the line of what would hold it, or of the joint; one that holds no gravity has
    none. Where the quantity is one of a spring between points, ``joint`` is its number among those that the file switches
    on, from 1, and "0" where it has none.
    """
    text = _parsed(model.text, model.format)
    elements = text.elements
    if quantity == GRAVITY:
        return _unique([line for line in [model.gravity_line] if line is not None] + _switched_off(elements, "gravity"))
    if quantity in _SPRING_PARTS[model.format]:
        springs = [spring for number, spring in enumerate(filter(text.is_spring, elements), 1) if number == int(joint)]
        found = [line for spring in springs for line in _spring_lines(text, spring, _SPRING_PARTS[model.format][quantity], quantity)]
        stages = [_STAGES.get(quantity, "")] if springs else ["spring", "damper"]
        return _unique(found + [line for stage in stages for line in _switched_off(elements, stage)])
    parts: dict[str, list[Element]] = {}
    for name, element in {"mjcf": _mjcf_parts, "urdf": _urdf_parts}[model.format](elements, joint):
        parts.setdefault(name, []).append(element)
    found = []
    for number, (part, names) in enumerate(_PLACES[model.format][quantity]):
        own = parts.get(part, [])
        written = [line for element in own for name in names for line in text.lines(element, name)]
        found += written or ([element.line for element in own] if number == 0 else [])
    found += _switched_off(elements, _STAGES.get(quantity, ""))
    return _unique(found) or (model.joint_lines.get(joint, model.root_line),)


@dataclass(frozen=True)
class _Text:
    """The elements of a file with their places, and the same ones as a tree."""

    elements: tuple[Element, ...]
    nodes: tuple[etree._Element, ...]

    def written(self, element: Element, name: str) -> tuple[Element, str] | None:
        """The element that an attribute is written in, for MJCF maybe a default class, and its text; None where nobody gives it."""
        found = resolved(self.nodes[self.elements.index(element)], name)
        return None if found is None else (self.elements[self.nodes.index(found.owner)], found.text)

    def lines(self, element: Element, name: str) -> list[int]:
        """Line of an attribute, or of the text for ""; none where nobody gives it."""
        owner, _ = self.written(element, name) or (element, "") if name else (element, "")
        return [attribute.line for attribute in owner.attributes if attribute.name == name]

    def number(self, element: Element, name: str) -> float:
        """The first number of an attribute, 0 where nobody gives it."""
        _, text = self.written(element, name) or (element, "0")
        return float(text.split()[0])

    def is_spring(self, element: Element) -> bool:
        """True for a spring or damper between points that is switched on."""
        if element.tag == POINT_SPRING:
            parts = filter(element.holds, self.elements)
            return any(self.number(part, "value") for part in parts if part.tag.endswith(("_stiffness", "_damping")))
        if element.path[-2:] != ("tendon", "spatial"):
            return False
        return any(self.number(element, name) and is_on(self.nodes[0], _STAGES[name]) for name in (STIFFNESS, DAMPING))


@lru_cache(maxsize=8)
def _parsed(text: str, model_format: str) -> _Text:
    root = parse_document(Path(f"model.{model_format}"), text, ROOT_TAGS[model_format]).root
    nodes = []
    for node in root.iter("*"):
        path = [literal_tag(node), *map(literal_tag, node.iterancestors())][::-1]
        if rules_at(model_format, path) is not None:
            nodes.append(node)
    elements = find_elements(text, model_format)
    assert len(elements) == len(nodes)
    return _Text(tuple(elements), tuple(nodes))


def _unique(lines: Iterable[int]) -> tuple[int, ...]:
    return tuple(dict.fromkeys(lines))


def _switched_off(elements: Sequence[Element], stage: str) -> list[int]:
    flags = [attribute for element in elements if element.tag == "flag" for attribute in element.attributes]
    return [flag.line for flag in flags if flag.name == stage and flag.value == "disable"]


def _spring_lines(text: _Text, spring: Element, names: Sequence[str], quantity: str) -> Iterator[int]:
    """Lines of the parts that decide the quantity, then that of the whole spring."""
    for name in names:
        yield from text.lines(spring, name)
    inside = list(filter(spring.holds, text.elements))
    yield from (element.line for element in inside if element.tag.removeprefix(f"{POINT_SPRING}_") in names)
    ends = {element.get("site") for element in inside if quantity == SPRING_ENDS and element.tag == "site"}
    for site in text.elements:
        if site.tag == "site" and site.get("name") in ends - {None}:
            yield from (*text.lines(site, "pos"), site.line)
    yield spring.line


def _mjcf_parts(elements: Sequence[Element], joint: str) -> Iterator[tuple[str, Element]]:
    """The joint, its body with the frames around joint and body, and the inertials of all that is welded to the body."""
    # A constraint may have the tag and the name of a joint.
    named = (element for element in elements if element.tag in ("joint", "freejoint") and element.get("name") == joint)
    own = next((element for element in named if "worldbody" in element.path), None)
    if own is None:
        return
    yield "joint", own
    bodies = [element for element in elements if element.tag == "body"]
    body = innermost(bodies, own)
    if body is None:
        return
    jointed = {id(innermost(bodies, element)) for element in elements if element.tag in ("joint", "freejoint")}
    yield "body", body
    above = innermost(bodies, body)
    for frame in elements:
        if frame.tag == "frame" and (frame.holds(own) or frame.holds(body)) and innermost(bodies, frame) in (above, body):
            yield "body", frame
    for inertial in elements:
        if inertial.tag == "inertial":
            carrier = innermost(bodies, inertial)
            while carrier is not None and carrier is not body and id(carrier) not in jointed:
                carrier = innermost(bodies, carrier)
            if carrier is body:
                yield "inertial", inertial


def _urdf_parts(elements: Sequence[Element], joint: str) -> Iterator[tuple[str, Element]]:
    """The joint, what is declared for it, and the inertials of its child link and of all that fixed joints add to it."""

    def within(owner: Element, *tags: str) -> Iterator[Element]:
        return (element for element in elements if element.tag in tags and owner.holds(element))

    def link(owner: Element, tag: str) -> str | None:
        return next((element.get("link") for element in within(owner, tag)), None)

    joints = [element for element in elements if element.path[1:] in (("joint",), ("drake:joint",))]
    welded: set[str | None] = set()
    for own in joints:
        if own.get("name") == joint:
            yield "joint", own
            for part in within(own, "origin", "axis", "dynamics"):
                yield f"joint/{part.tag}", part
            welded.add(link(own, "child"))
    fixed = [(link(element, "parent"), link(element, "child")) for element in joints if element.get("type") == "fixed"]
    for _ in fixed:
        welded |= {child for parent, child in fixed if parent in welded}
    for element in elements:
        if element.path[1:] == ("link",) and element.get("name") in welded:
            for inertial in within(element, "inertial"):
                parts = {part.tag: part for part in within(inertial, "mass", "inertia", "origin")}
                for tag in ("mass", "inertia", "origin"):
                    yield f"inertial/{tag}", parts.get(tag, inertial)
        elif element.path[1:] == ("gazebo",) and element.get("reference") == joint:
            for part in within(element, "springStiffness", "springReference"):
                yield f"gazebo/{part.tag}", part
        elif element.path[1:] == ("transmission",) and any(part.get("name") == joint for part in within(element, "joint")):
            for part in within(element, "drake:rotor_inertia", "drake:gear_ratio"):
                yield f"actuator/{part.tag}", part
