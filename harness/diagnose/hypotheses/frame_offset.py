"""The offset of a body's frame stands in the wrong body, in its inertial, or nowhere."""

from __future__ import annotations

from collections.abc import Iterator

from harness.diagnose.hypotheses._changes import Change, FreeChange, Write, hypothesis, is_zero, plus
from harness.models.anatomy.parts import Anatomy, Slot

_COMPONENTS = "xyz"


def _exchanges(parts: Anatomy) -> Iterator[Change]:
    for body in parts.bodies:
        parent = parts.body(body.parent)
        if body.offset is None:
            continue
        if parent is not None and parent.offset is not None:
            statement = f"offsets of {parent.name} and {body.name} exchanged"
            yield Change(statement, [(body.offset, parent.offset.words), (parent.offset, body.offset.words)])
        if body.inertial is None:
            continue
        centre = body.inertial.centre
        yield Change(f"offset and centre of mass of {body.name} exchanged", [(body.offset, centre.words), (centre, body.offset.words)])
        for sign, statement in ((1, "without"), (-1, "with")):
            moved = plus(centre.words, body.offset.words, sign)
            yield Change(f"centre of mass of {body.name} {statement} its offset", [(centre, moved)])


def _changes(parts: Anatomy) -> Iterator[Change]:
    yield from _exchanges(parts)
    for body in parts.bodies:
        if body.offset is not None and not body.offset.absent:
            yield Change(f"offset of {body.name} left in", [(body.offset, None)])


def _free(parts: Anatomy) -> Iterator[FreeChange]:
    for slot in parts.frames:
        if not slot.absent:
            continue
        for axis, letter in enumerate(_COMPONENTS):

            def along(value: float, slot: Slot = slot, axis: int = axis) -> list[Write]:
                words = ["0", "0", "0"]
                words[axis] = repr(value)
                return [(slot, words)]

            yield FreeChange(f"left out along {letter}", along, parts.length)


def _plants(parts: Anatomy) -> Iterator[Change]:
    yield from _exchanges(parts)
    for slot in parts.frames:
        for index, word in enumerate(slot.words):
            if float(word):
                words = [*slot.words[:index], "0", *slot.words[index + 1 :]]
                yield Change("left out", [(slot, None if is_zero(words) and slot.place.element != "inertial" else words)])


HYPOTHESIS = hypothesis(
    "frame_offset",
    "offset of a frame misplaced: in another body, in the inertial, or missing",
    "Khalil, Dombre, Modeling, Identification and Control of Robots, chapter 3; http://wiki.ros.org/urdf/XML/joint, origin",
    _changes,
    _free,
    _plants,
)
