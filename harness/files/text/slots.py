"""Bodies, joints and inertias of a model in either format, each as places in its text that can be written.

A hypothesis speaks of a body's offset or a joint's damping; ``harness.files.text.anatomy`` says what these are called in each format,
and where they go when they are absent.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from harness.arrays import Array
from harness.files.joint_kinds import JointKind
from harness.files.model_file import ModelFile
from harness.files.text.scan import Edit, TextPlace

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
    anchor: Array = field(default_factory=lambda: np.zeros(3))
    axis: Slot | None = None
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
