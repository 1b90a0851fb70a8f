"""Numbers that a joint may have or not: dampers, springs, rotors. They go missing, count twice, or are left in."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from harness.diagnosis.hypotheses import Hypothesis
from harness.diagnosis.hypotheses._changes import FixedChange, FreeChange, divided, hypothesis, is_zero, rounded, times
from harness.models.anatomy.parts import Anatomy, Slot

# What a mistake leaves in, of the natural size.
_LEFT_IN = 0.1


@dataclass(frozen=True)
class Coefficient:
    """A slot with its natural size; ``removable``: it is taken away by leaving it out, and not by writing zero."""

    slot: Slot
    size: float
    removable: bool = True


Coefficients = Callable[[Anatomy], Iterator[Coefficient]]


def coefficient_hypothesis(name: str, title: str, source: str, coefficients: Coefficients, stage: str = "") -> Hypothesis:
    """Missing, doubled or left in; and the ``stage`` of MJCF that applies them switched off."""

    def stages(parts: Anatomy) -> Iterator[Slot]:
        return (slot for known, slot in parts.stages if known == stage)

    def changes(parts: Anatomy) -> Iterator[FixedChange]:
        for slot in stages(parts):
            if slot.words == ("disable",):
                yield FixedChange(f"{stage} stage switched off", [(slot, ["enable"])])
        for one in coefficients(parts):
            if not is_zero(one.slot.words):
                yield FixedChange("counted twice", [(one.slot, divided(one.slot.words, "2"))])
                yield FixedChange("left in", [(one.slot, None if one.removable else ["0"])])

    def free(parts: Anatomy) -> Iterator[FreeChange]:
        for one in coefficients(parts):
            if one.slot.absent:
                yield FreeChange("left out", lambda value, slot=one.slot: [(slot, [repr(value)])], one.size)  # type: ignore[misc]

    def plants(parts: Anatomy) -> Iterator[FixedChange]:
        present = [one for one in coefficients(parts) if not is_zero(one.slot.words)]
        for slot in stages(parts):
            if present and slot.words == ("enable",):
                yield FixedChange(f"{stage} stage switched off", [(slot, ["disable"])])
        for one in coefficients(parts):
            if one in present:
                yield FixedChange("doubled", [(one.slot, times(one.slot.words, "2"))])
                yield FixedChange("left out", [(one.slot, None if one.removable else ["0"])])
            elif one.slot.absent:
                yield FixedChange("left in", [(one.slot, [rounded(_LEFT_IN * one.size)])])

    return hypothesis(name, title, source, changes, free, plants)
