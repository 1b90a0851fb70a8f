"""The offset of a body's frame stands in the wrong body, in its inertial, or nowhere."""

from __future__ import annotations

from collections.abc import Iterator

from harness.diagnosis.hypotheses._changes import COMPONENTS, FixedChange, FreeChange, Write, along, hypothesis, is_zero, plus
from harness.models.anatomy.parts import Anatomy, Slot


def _exchanges(parts: Anatomy) -> Iterator[FixedChange]:
    for body in parts.bodies:
        parent = parts.body(body.parent)
        if body.offset is None:
            continue
        if parent is not None and parent.offset is not None:
            statement = f"offsets of {parent.name} and {body.name} exchanged"
            yield FixedChange(statement, [(body.offset, parent.offset.words), (parent.offset, body.offset.words)])
        if body.inertial is None:
            continue
        centre = body.inertial.centre
        yield FixedChange(f"offset and centre of mass of {body.name} exchanged", [(body.offset, centre.words), (centre, body.offset.words)])
        for sign, statement in ((1, "without"), (-1, "with")):
            moved = plus(centre.words, body.offset.words, sign)
            yield FixedChange(f"centre of mass of {body.name} {statement} its offset", [(centre, moved)])


def _changes(parts: Anatomy) -> Iterator[FixedChange]:
    yield from _exchanges(parts)
    for body in parts.bodies:
        if body.offset is not None and not body.offset.absent:
            yield FixedChange(f"offset of {body.name} left in", [(body.offset, None)])


def _free(parts: Anatomy) -> Iterator[FreeChange]:
    for slot in parts.frames:
        for axis, letter in enumerate(COMPONENTS if slot.absent else ""):

            def placed(value: float, slot: Slot = slot, axis: int = axis) -> list[Write]:
                return [(slot, along(axis, repr(value)))]

            yield FreeChange(f"left out along {letter}", placed, parts.length)


def _plants(parts: Anatomy) -> Iterator[FixedChange]:
    yield from _exchanges(parts)
    for slot in parts.frames:
        for index, word in enumerate(slot.words):
            if float(word):
                words = [*slot.words[:index], "0", *slot.words[index + 1 :]]
                yield FixedChange("left out", [(slot, None if is_zero(words) and slot.place.element != "inertial" else words)])


HYPOTHESIS = hypothesis(
    "frame_offset",
    "offset of a frame misplaced: in another body, in the inertial, or missing",
    "Khalil, Dombre, Modeling, Identification and Control of Robots, chapter 3; http://wiki.ros.org/urdf/XML/joint, origin",
    _changes,
    _free,
    _plants,
)
