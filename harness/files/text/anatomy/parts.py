"""Bodies, joints and inertias of a model in either format, each as places in its text that can be written.

A hypothesis speaks of a body's offset or a joint's damping; what these are called, and where they go when they are
absent, is said here once for MJCF and URDF. A value that an MJCF joint inherits from a default class counts as absent.

Sources: MuJoCo 4 XML reference; http://wiki.ros.org/urdf/XML; ``harness.files.model_file`` for springs and rotors in a URDF.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from harness.arrays import Array
from harness.files.joint_kinds import JointKind
from harness.files.model_file import ModelFile
from harness.files.text.scan import Attribute, Edit, Element, TextPlace, find_elements

# Of an inertia matrix, in MuJoCo's order; both formats call them so.
ENTRIES = ("xx", "yy", "zz", "xy", "xz", "yz")
Words = Sequence[str]


@dataclass(frozen=True)
class Slot:
    """An attribute that stands in the text, or the place where it would stand.

    Attributes:
        place: of the attribute; ``found`` is "" where it is absent.
        start, end: the text that is replaced when it is written; head, tail: what surrounds its value there.
        inserted_line: line on which it stands once written. absent_line: line of what lacks it once it is gone.
        words: of its value, or of the default where it is absent.
        removed: the text that goes with it.
        along: what else must change for it to be felt, as a stage that is switched on.
        renamed: name of the attribute once it is written, where that is another.
    """

    place: TextPlace
    start: int
    end: int
    head: str
    tail: str
    inserted_line: int
    absent_line: int
    words: tuple[str, ...]
    removed: tuple[int, int]
    along: tuple[Edit, ...] = ()
    renamed: str = ""

    @property
    def absent(self) -> bool:
        return not self.place.found

    @property
    def values(self) -> Array:
        """Its numbers."""
        return np.array([float(word) for word in self.words])

    def written(self, words: Words) -> list[Edit]:
        """The edits that give it another value."""
        return [(self.start, self.end, self.head + " ".join(words) + self.tail), *self.along]

    def gone(self, text: str) -> list[Edit]:
        """The edits that take it away; no line moves."""
        start, end = self.removed
        return [] if self.absent else [(start, end, "\n" * text.count("\n", start, end))]

    def called(self, attribute: str) -> Slot:
        """The same place for another attribute that says the same."""
        if attribute == self.place.attribute:
            return self
        return replace(self, head=self.head.replace(self.place.attribute, attribute), renamed=attribute)


@dataclass(frozen=True)
class JointSlots:
    """A joint that moves; what a ball or free joint has not is None.

    ``anchor`` is its place in the body, (3,) [m].
    """

    name: Slot
    kind: JointKind
    anchor: Array
    axis: Slot | None
    damping: Slot | None = None
    stiffness: Slot | None = None
    spring_reference: Slot | None = None
    armature: Slot | None = None
    friction: Slot | None = None


@dataclass(frozen=True)
class InertialSlots:
    """Name of the body, its mass, centre of mass, inertia by its entries, and orientation of the frame that both are given in."""

    body: str
    mass: Slot
    centre: Slot
    entries: tuple[Slot, ...]
    rotation: Slot

    @cached_property
    def words(self) -> dict[str, str]:
        """Every entry of the inertia matrix as written."""
        if len(self.entries) > 1:
            return {name: slot.words[0] for name, slot in zip(ENTRIES, self.entries, strict=True)}
        return dict(zip(ENTRIES, (*self.entries[0].words, "0", "0", "0"), strict=False))

    @property
    def matrix(self) -> Array:
        """(3, 3) about the centre of mass [kg m^2]."""
        xx, yy, zz, xy, xz, yz = (float(self.words[name]) for name in ENTRIES)
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def rewritten(self, words: dict[str, str]) -> Sequence[tuple[Slot, Words | None]]:
        """Slots and values for other entries; an MJCF file holds all six where any product is not zero."""
        new = {**self.words, **words}
        if len(self.entries) > 1:
            return [(slot, [new[name]]) for name, slot in zip(ENTRIES, self.entries, strict=True) if new[name] != self.words[name]]
        diagonal = not any(float(new[name]) for name in ENTRIES[3:])
        slot = self.entries[0].called("diaginertia" if diagonal else "fullinertia")
        return [(slot, [new[name] for name in (ENTRIES[:3] if diagonal else ENTRIES)])]


@dataclass(frozen=True)
class BodySlots:
    """A body or link with the joints that move it against its parent, which is None for the world and for what hangs on it."""

    name: str
    parent: str | None
    offset: Slot | None
    rotation: Slot | None
    inertial: InertialSlots | None
    joints: tuple[JointSlots, ...]


@dataclass(frozen=True)
class Anatomy:
    """A model taken apart.

    Attributes:
        bodies: in document order.
        positions: every vector of lengths beside offsets and centres of mass: points of springs and constraints, places of joints.
        gravity: None in a URDF. stages: those of MJCF that a file can switch off. angle: unit of MJCF's angles;
            euler_sequence: axes they turn about, lower case where these move along.
        others: springs and dampers between points: (stiffness, damping, length).
    """

    model: ModelFile
    bodies: tuple[BodySlots, ...]
    positions: tuple[Slot, ...]
    others: tuple[tuple[Slot, Slot, Slot], ...]
    gravity: Slot | None = None
    stages: Mapping[str, Slot] = field(default_factory=dict)
    angle: Slot | None = None
    euler_sequence: str = "xyz"

    @property
    def joints(self) -> list[JointSlots]:
        return [joint for body in self.bodies for joint in body.joints]

    @property
    def inertials(self) -> list[InertialSlots]:
        return [body.inertial for body in self.bodies if body.inertial is not None]

    def body(self, name: str | None) -> BodySlots | None:
        return next((body for body in self.bodies if body.name == name), None)

    @property
    def frames(self) -> list[Slot]:
        """Offsets of bodies and their centres of mass."""
        slots = [slot for body in self.bodies for slot in (body.offset, None if body.inertial is None else body.inertial.centre)]
        return [slot for slot in slots if slot is not None]

    @property
    def vectors(self) -> list[Slot]:
        """Every vector of lengths."""
        return [*self.frames, *self.positions]

    @property
    def length(self) -> float:
        """The largest length of any vector, 1 where all are zero [m]."""
        return max((float(np.abs(slot.values).max()) for slot in self.vectors), default=0.0) or 1.0

    @property
    def mass(self) -> float:
        """The largest mass [kg]."""
        return max((float(inertial.mass.values[0]) for inertial in self.inertials), default=0.0) or 1.0

    def inertia(self, joint: JointSlots) -> float:
        """A natural size of what a joint moves: kg m^2 where it turns, kg where it slides."""
        return self.mass * self.length**2 if joint.kind is JointKind.HINGE else self.mass


class Parts:
    """The elements of a model, and slots for their attributes."""

    def __init__(self, model: ModelFile) -> None:
        self.model, self.text = model, model.text
        self.elements = find_elements(model.text, model.format)

    def all(self, *path: str) -> list[Element]:
        """Elements whose path ends so."""
        return [element for element in self.elements if element.path[-len(path) :] == path]

    def inside(self, holder: Element, tag: str) -> Element | None:
        """The first child of ``holder`` with that tag."""
        path = (*holder.path, tag)
        return next((element for element in self.elements if element.path == path and holder.holds(element)), None)

    def line(self, position: int) -> int:
        return self.text.count("\n", 0, position) + 1

    def slot(self, element: Element, name: str, default: str = "0 0 0", along: tuple[Edit, ...] = (), alone: bool = False) -> Slot:
        """Attribute ``name`` of an element that is there; ``alone``: the element goes with it where it has no other attribute."""
        found = next((attribute for attribute in element.attributes if attribute.name == name), None)
        if found is None:
            end = element.opened - (2 if self.text[element.opened - 2] == "/" else 1)
            return self.missing(element, end, (element.tag, name), (f' {name}="', '"'), default, along)
        span = (element.start, element.end) if alone and len(element.attributes) == 1 else (found.start, found.end)
        return self._standing(element, found, span, element.line, along)

    def slot_inside(
        self, holder: Element, tag: str, name: str, default: str = "0 0 0", along: tuple[Edit, ...] = (), alone: bool = True
    ) -> Slot:
        """Attribute ``name`` of the child ``tag`` of an element, which itself may be absent."""
        child = self.inside(holder, tag)
        if child is None:
            return self.missing(holder, holder.opened, (tag, name), (f'<{tag} {name}="', '"/>'), default, along)
        slot = self.slot(child, name, default, along, alone)
        return replace(slot, absent_line=holder.line) if slot.removed == (child.start, child.end) else slot

    def text_slot(self, element: Element, holder: Element, absent_line: int) -> Slot:
        """The text between the tags of an element that goes with ``holder``."""
        found = next(attribute for attribute in element.attributes if attribute.name == "")
        return self._standing(element, found, (holder.start, holder.end), absent_line, ())

    def missing(
        self, owner: Element, at: int, what: tuple[str, str], around: tuple[str, str], default: str = "0", along: tuple[Edit, ...] = ()
    ) -> Slot:
        """An attribute that is not there, and would stand at a position of the text with ``around`` before and behind its value."""
        place = TextPlace(owner.line, *what, None, "")
        return Slot(place, at, at, *around, self.line(at), owner.line, tuple(default.split()), (at, at), along)

    def _standing(self, element: Element, found: Attribute, removed: tuple[int, int], absent_line: int, along: tuple[Edit, ...]) -> Slot:
        place = TextPlace(found.line, element.tag, found.name, None, found.value)
        whole = self.text[found.start : found.end]
        before = whole.rindex(found.value, 0, len(whole) - bool(found.name)) if found.value else len(whole) - 1
        head, tail = whole[:before], whole[before + len(found.value) :]
        words = tuple(found.value.split())
        return Slot(place, found.start, found.end, head, tail, found.line, absent_line, words, removed, along)
