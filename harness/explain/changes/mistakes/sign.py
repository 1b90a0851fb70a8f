"""A length, an offset, a spring's reference or a force law has the wrong sign."""

from __future__ import annotations

from collections.abc import Iterator

from harness.explain.changes.mistakes import FixedChange, Mistake, times
from harness.models.anatomy.parts import Anatomy, Slot


def _slots(parts: Anatomy) -> Iterator[Slot]:
    yield from parts.vectors
    for joint in parts.joints:
        yield from (slot for slot in (joint.damping, joint.stiffness, joint.spring_reference) if slot is not None)
    for stiffness, damping, _ in parts.others:
        yield from (stiffness, damping)
    # The sign of a gravity that is switched off matters to nobody.
    if parts.gravity is not None and parts.stages["gravity"].words != ("disable",):
        yield parts.gravity


def _changes(parts: Anatomy) -> Iterator[FixedChange]:
    for slot in _slots(parts):
        live = [index for index, word in enumerate(slot.words) if float(word)]
        for index in live:
            flipped = [*slot.words[:index], *times([slot.words[index]], "-1"), *slot.words[index + 1 :]]
            yield FixedChange("sign flipped", [(slot, flipped)])
        if len(live) > 1:
            yield FixedChange("all signs flipped", [(slot, times(slot.words, "-1"))])


MISTAKE = Mistake(
    "sign",
    "sign of a length, an offset or a force law flipped",
    "Khalil, Dombre, Modeling, Identification and Control of Robots, chapter 3: conventions of link frames",
    _changes,
)
