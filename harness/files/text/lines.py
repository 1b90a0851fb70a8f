"""The lines of a model file that decide a quantity of the static audit, from its tree, whose numbers know their places.

Sources: MuJoCo XML reference, body, joint and inertial; http://wiki.ros.org/urdf/XML; ``harness.files.model_file`` for the
conventions that URDF borrows.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

from harness.files.given import Place, Placement, numbers_in
from harness.files.mjcf.attributes import ORIENTATIONS
from harness.files.model_file import ModelFile, meaning_of
from harness.files.text.scan import Element, all_elements, innermost
from harness.files.tree import Body, Inertia, Joint, Spring, Tree

GRAVITY, JOINT, ANCHOR, AXIS, FRAME = "gravity", "joint", "anchor", "axis", "frame"
ARMATURE, DAMPING, STIFFNESS, SPRING_REFERENCE = "armature", "damping", "stiffness", "spring reference"
MASS, CENTRE, INERTIA = "mass", "centre", "inertia"
SPRING_ENDS, SPRING_STIFFNESS = "point spring ends", "point spring stiffness"
SPRING_DAMPING, SPRING_LENGTH = "point spring damping", "point spring length"

# Quantity to the field of a joint, or of a spring between points, that holds it.
_OF_JOINTS = {ARMATURE: "armature", DAMPING: "damping", STIFFNESS: "stiffness", SPRING_REFERENCE: "spring_reference"}
_OF_SPRINGS = {SPRING_ENDS: "ends", SPRING_STIFFNESS: "stiffness", SPRING_DAMPING: "damping", SPRING_LENGTH: "free_length"}
# Quantity to the stage of MuJoCo's pipeline that applies it.
_STAGES = {GRAVITY: "gravity", DAMPING: "damper", STIFFNESS: "spring", SPRING_DAMPING: "damper", SPRING_STIFFNESS: "spring"}
_TURNS = (*ORIENTATIONS, "rpy")
# The part of Drake's spring that names a link.
_LINK = "_body_"
_GEAR = "drake:gear_ratio"

# An element's place and an attribute, which need not be there.
Spot = tuple[Place, str]


def lines_of(model: ModelFile, quantity: str, joint: str) -> tuple[int, ...]:
    """1-based lines that decide ``quantity`` of ``joint`` and of the body it carries, the likeliest first.

    A file that leaves the quantity out has the line of what would hold it, or of the joint; one that holds no gravity has
    none. Where the quantity is one of a spring between points, ``joint`` is its number among those that the file switches
    on, from 1, and "0" where it has none.
    """
    page = _Page(_elements(model.text, model.format), meaning_of(model).tree)
    stages, default = [_STAGES.get(quantity, "")], tuple[int, ...]()
    if quantity == GRAVITY:
        found = [] if model.gravity_line is None else [model.gravity_line]
    elif quantity in _OF_SPRINGS:
        springs = [one for one in page.tree.springs if one.stiffness or one.damping][: int(joint)][int(joint) - 1 :]
        found = [line for one in springs for line in page.of_spring(one, quantity)]
        stages = stages if found else ["spring", "damper"]
    else:
        carried = [(body, one) for body in page.tree.bodies for one in body.joints if one.name == joint]
        found, default = (
            [line for pair in carried for line in page.of_joint(*pair, quantity)],
            (model.joint_lines.get(joint, model.root_line),),
        )
    switched_off = [line for stage in stages for line in page.switched_off(stage)]
    return tuple(dict.fromkeys(found + switched_off)) or default


@lru_cache(maxsize=8)
def _elements(text: str, model_format: str) -> tuple[Element, ...]:
    return tuple(all_elements(text, model_format))


@dataclass(frozen=True)
class _Page:
    """The elements of a file, by the numbers of places, and its tree."""

    elements: Sequence[Element]
    tree: Tree

    def switched_off(self, stage: str) -> list[int]:
        flags = [attribute for element in self.elements if element.tag == "flag" for attribute in element.attributes]
        return [flag.line for flag in flags if flag.name == stage and flag.value == "disable"]

    def of_joint(self, body: Body, joint: Joint, quantity: str) -> list[int]:
        """Lines of the attributes that decide a quantity; of their elements where none of the first of them is written."""
        first, *others = self._spots(body, joint, quantity)
        found = self._written(first) or [self.elements[place.element].line for place, _ in first]
        return found + [line for spots in others for line in self._written(spots)]

    def _spots(self, body: Body, joint: Joint, quantity: str) -> list[list[Spot]]:
        """Places that decide a quantity, in order of their weight."""
        if quantity in _OF_JOINTS:
            spots = _given(getattr(joint, _OF_JOINTS[quantity]))
            geared = [part for place, _ in spots if quantity == ARMATURE for part in self._parts(place, _GEAR)]
            return [[*spots, *((part, "value") for part in geared)]]
        # The body's own placement first, then those of the frames around it and around the joint.
        at = _given(_positions([*body.pose[-1:], *body.pose[:-1], *joint.pose]))
        if not at and body.place and body.place.tag == "body":
            # Of a body that floats the position says where it starts.
            at = [(body.place, "pos")]
        carried = self._carried(body)
        centres = [_given(_positions(one.pose)) for one in carried]
        return {
            JOINT: [[(joint.place, "")] if joint.place else []],
            ANCHOR: [at, _given(joint.anchor)],
            AXIS: [_given(joint.axis), _turns(at)],
            FRAME: [_turns(at)],
            MASS: [_given(tuple(one.mass for one in carried))],
            CENTRE: [
                [spot for one, spots in zip(carried, centres, strict=True) for spot in spots or ([(one.place, "")] if one.place else [])],
                [spot for one in at for spot in (one, *_turns([one]))],
            ],
            INERTIA: [
                [spot for one, spots in zip(carried, centres, strict=True) for spot in (*_given(one.moments), *_turns(spots))],
                _turns(at),
            ],
        }[quantity]

    def _parts(self, place: Place, tag: str) -> list[Place]:
        """The places of elements with such a tag inside of an element, or beside it."""
        own = self.elements[place.element]
        holder = own if own.closed > own.opened else innermost(self.elements, own)
        parts = enumerate(self.elements)
        return [Place(place.path, part.line, number) for number, part in parts if holder and holder.holds(part) and tag in part.tag]

    def _carried(self, body: Body) -> list[Inertia]:
        """The inertias of a body and of all that is fixed to it."""
        fixed = {body.name}
        for one in self.tree.bodies:
            if one.parent in fixed and not one.joints:
                fixed.add(one.name)
        return [one.inertia for one in self.tree.bodies if one.name in fixed and one.inertia is not None]

    def of_spring(self, spring: Spring, quantity: str) -> Iterator[int]:
        """Lines of the parts that decide the quantity, then that of the whole spring."""
        assert spring.place is not None
        spots = _given(getattr(spring, _OF_SPRINGS[quantity]))
        if quantity == SPRING_ENDS:
            spots += [(place, "") for place in self._parts(spring.place, _LINK)]
            spots.sort(key=lambda spot: spot[0].element)
        for place, attribute in spots:
            yield from self._written([(place, attribute)])
            if quantity == SPRING_ENDS:
                yield self.elements[place.element].line
        yield self.elements[spring.place.element].line

    def _written(self, spots: Iterable[Spot]) -> list[int]:
        """The lines of the attributes that are there."""
        return [line for place, name in spots for line in (one.line for one in self.elements[place.element].attributes if one.name == name)]


def _given(values: object) -> list[Spot]:
    return list(dict.fromkeys((one.place, one.attribute) for one in numbers_in(values)))


def _positions(frames: Iterable[Placement]) -> tuple[object, ...]:
    return tuple(frame.position for frame in frames)


def _turns(positions: Iterable[Spot]) -> list[Spot]:
    """The attributes that may turn frames, in the elements that give their positions."""
    return [(place, name) for place, _ in positions for name in _TURNS]
