"""In which lines of a model file a quantity of the static audit stands, so that a reader can open the place.

Sources: MuJoCo XML reference, body, joint and inertial; http://wiki.ros.org/urdf/XML; ``harness.models`` for the
conventions that URDF borrows.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache

from harness.attributes import Element, find_elements
from harness.models import ModelFile

GRAVITY, JOINT, ANCHOR, AXIS, FRAME = "gravity", "joint", "anchor", "axis", "frame"
ARMATURE, DAMPING, STIFFNESS, SPRING_REFERENCE = "armature", "damping", "stiffness", "spring reference"
MASS, CENTRE, INERTIA = "mass", "centre", "inertia"
SPRING_ENDS, SPRING_STIFFNESS = "point spring ends", "point spring stiffness"
SPRING_DAMPING, SPRING_LENGTH = "point spring damping", "point spring length"

_POINT_SPRING = "drake:linear_spring_damper"
# format -> quantity of a spring between points -> attributes of the tendon, or ends of the tags in Drake's element
_SPRING_PARTS: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "mjcf": {
        SPRING_ENDS: (),
        SPRING_STIFFNESS: ("stiffness",),
        SPRING_DAMPING: ("damping",),
        SPRING_LENGTH: ("springlength",),
    },
    "urdf": {
        SPRING_ENDS: ("body_A", "p_AP", "body_B", "p_BQ"),
        SPRING_STIFFNESS: ("stiffness",),
        SPRING_DAMPING: ("damping",),
        SPRING_LENGTH: ("free_length",),
    },
}
# Quantity to the stage of MuJoCo's pipeline that applies it.
_STAGES = {DAMPING: "damper", STIFFNESS: "spring", SPRING_DAMPING: "damper", SPRING_STIFFNESS: "spring"}
_TURNS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")
# format -> quantity -> (part of the model that belongs to the joint, attributes of it that decide the quantity), the likeliest
# first; of the first part the element itself is told where it has none of them
_PLACES: Mapping[str, Mapping[str, tuple[tuple[str, tuple[str, ...]], ...]]] = {
    "mjcf": {
        JOINT: (("joint", ()),),
        ANCHOR: (("body", ("pos",)), ("joint", ("pos",))),
        AXIS: (("joint", ("axis",)), ("body", _TURNS)),
        FRAME: (("body", _TURNS),),
        ARMATURE: (("joint", ("armature",)),),
        DAMPING: (("joint", ("damping",)),),
        STIFFNESS: (("joint", ("stiffness",)),),
        SPRING_REFERENCE: (("joint", ("springref",)),),
        MASS: (("inertial", ("mass",)),),
        CENTRE: (("inertial", ("pos",)), ("body", ("pos", *_TURNS))),
        INERTIA: (("inertial", ("diaginertia", "fullinertia", *_TURNS)), ("body", _TURNS)),
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
    none. ``joint`` is the number of a spring between points, from 1, where the quantity is one of such a spring.
    """
    elements = _elements(model.text, model.format)
    if quantity == GRAVITY:
        return _unique([line for line in [model.gravity_line] if line is not None] + _switched_off(elements, "gravity"))
    if quantity in _SPRING_PARTS[model.format]:
        found = list(_spring_lines(model.format, elements, quantity, int(joint)))
        return _unique(found + _switched_off(elements, _STAGES.get(quantity, "")))
    parts: dict[str, list[Element]] = {}
    for name, element in {"mjcf": _mjcf_parts, "urdf": _urdf_parts}[model.format](elements, joint):
        parts.setdefault(name, []).append(element)
    found = []
    for number, (part, names) in enumerate(_PLACES[model.format][quantity]):
        own = parts.get(part, [])
        written = [attribute.line for element in own for attribute in element.attributes if attribute.name in names]
        found += written or ([element.line for element in own] if number == 0 else [])
    found += _switched_off(elements, _STAGES.get(quantity, ""))
    return _unique(found) or (model.joint_lines.get(joint, model.root_line),)


def _unique(lines: Iterable[int]) -> tuple[int, ...]:
    return tuple(dict.fromkeys(lines))


def _switched_off(elements: Sequence[Element], stage: str) -> list[int]:
    flags = [attribute for element in elements if element.tag == "flag" for attribute in element.attributes]
    return [flag.line for flag in flags if flag.name == stage and flag.value == "disable"]


def _spring_lines(model_format: str, elements: Sequence[Element], quantity: str, number: int) -> Iterator[int]:
    """Lines of the parts that decide the quantity, then that of the whole spring; none where there are not so many."""
    springs = [element for element in elements if element.path[-2:] == ("tendon", "spatial") or element.tag == _POINT_SPRING]
    names = _SPRING_PARTS[model_format][quantity]
    for spring in springs[number - 1 : number]:
        yield from (attribute.line for attribute in spring.attributes if attribute.name in names)
        inside = [element for element in elements if _inside(element, spring)]
        yield from (element.line for element in inside if element.tag.removeprefix(f"{_POINT_SPRING}_") in names)
        ends = {element.get("site") for element in inside if quantity == SPRING_ENDS and element.tag == "site"}
        yield from (element.line for element in elements if element.tag == "site" and element.get("name") in ends - {None})
        yield spring.line


@lru_cache(maxsize=8)
def _elements(text: str, model_format: str) -> tuple[Element, ...]:
    return tuple(find_elements(text, model_format))


def _inside(element: Element, other: Element) -> bool:
    return other.start < element.start and element.end <= other.end


def _mjcf_parts(elements: Sequence[Element], joint: str) -> Iterator[tuple[str, Element]]:
    """The joint, its body with the frames around joint and body, and the inertials of all that is welded to the body."""
    own = next((element for element in elements if element.tag in ("joint", "freejoint") and element.get("name") == joint), None)
    if own is None:
        return
    yield "joint", own
    bodies = [element for element in elements if element.tag == "body"]

    def body_of(element: Element) -> Element | None:
        around = [body for body in bodies if _inside(element, body)]
        return max(around, key=lambda body: body.start, default=None)

    body = body_of(own)
    if body is None:
        return
    jointed = {id(body_of(element)) for element in elements if element.tag in ("joint", "freejoint")}
    yield "body", body
    above = body_of(body)
    for frame in elements:
        if frame.tag == "frame" and (_inside(own, frame) or _inside(body, frame)) and body_of(frame) in (above, body):
            yield "body", frame
    for inertial in elements:
        if inertial.tag == "inertial":
            carrier = body_of(inertial)
            while carrier is not None and carrier is not body and id(carrier) not in jointed:
                carrier = body_of(carrier)
            if carrier is body:
                yield "inertial", inertial


def _urdf_parts(elements: Sequence[Element], joint: str) -> Iterator[tuple[str, Element]]:
    """The joint, what is declared for it, and the inertials of its child link and of all that fixed joints add to it."""

    def within(owner: Element, *tags: str) -> Iterator[Element]:
        return (element for element in elements if element.tag in tags and _inside(element, owner))

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
