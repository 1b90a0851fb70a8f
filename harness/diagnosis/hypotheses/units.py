"""Masses in grams, lengths in millimetres, or inertias in the units that these make."""

from __future__ import annotations

from collections.abc import Iterator

from harness.diagnosis.hypotheses._changes import FixedChange, Write, Writes, hypothesis, times
from harness.models.anatomy.parts import ENTRIES, Anatomy, Inertial, Slot

# Of a mass or length, and of an inertia: g m^2, kg mm^2 and g mm^2, and back.
_FACTORS, _OF_INERTIA = ("0.001", "1000"), ("1000", "0.001", "1e6", "1e-6", "1e9", "1e-9")


def _times(slot: Slot, factor: str) -> Write:
    return slot, times(slot.words, factor)


def _inertia(inertial: Inertial, factor: str) -> Writes:
    return inertial.rewritten({name: times([inertial.words[name]], factor)[0] for name in ENTRIES})


def _changes(parts: Anatomy) -> Iterator[FixedChange]:
    for factor in _FACTORS:
        for slot in parts.vectors:
            yield FixedChange("length in other units", [_times(slot, factor)])
        for inertial in parts.inertials:
            mass = _times(inertial.mass, factor)
            yield FixedChange("mass in other units", [mass])
            yield FixedChange("mass and inertia in other units", [mass, *_inertia(inertial, factor)])
    for inertial in parts.inertials:
        for factor in _OF_INERTIA:
            yield FixedChange("inertia in other units", _inertia(inertial, factor))
    for factor in _FACTORS:
        masses = [_times(inertial.mass, factor) for inertial in parts.inertials]
        yield FixedChange("all masses in other units", [*masses, *(write for one in parts.inertials for write in _inertia(one, factor))])
        lengths = [_times(slot, factor) for slot in parts.vectors]
        squared = times([factor], factor)[0]
        yield FixedChange("all lengths in other units", [*lengths, *(write for one in parts.inertials for write in _inertia(one, squared))])


HYPOTHESIS = hypothesis(
    "units",
    "mass or length in other units",
    "computer-aided design programs export grams and millimetres; both formats hold kilograms and metres",
    _changes,
)
