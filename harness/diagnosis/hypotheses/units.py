"""Masses in grams, lengths in millimetres, or inertias in the units that these make."""

from __future__ import annotations

from collections.abc import Iterator

from harness.diagnosis.hypotheses._changes import FixedChange, Write, Writes, hypothesis, times
from harness.models.anatomy.parts import ENTRIES, Anatomy, Inertial

_THOUSAND, _THOUSANDTH = "1000", "0.001"
# Of an inertia: g m^2, kg mm^2 and g mm^2, and back.
_INERTIA = {"1000": "g m^2", "0.001": "kg m^2", "1e6": "kg mm^2", "1e-6": "kg m^2", "1e9": "g mm^2", "1e-9": "kg m^2"}


def _inertia(inertial: Inertial, factor: str) -> Writes:
    return inertial.rewritten({name: times([inertial.words[name]], factor)[0] for name in ENTRIES})


def _squared(factor: str) -> str:
    return str(times([factor], factor)[0])


def _changes(parts: Anatomy) -> Iterator[FixedChange]:
    factors = (_THOUSANDTH, _THOUSAND)
    for factor in factors:
        for slot in parts.vectors:
            yield FixedChange("length in other units", [(slot, times(slot.words, factor))])
        for inertial in parts.inertials:
            yield FixedChange("mass in other units", [(inertial.mass, times(inertial.mass.words, factor))])
            whole = [(inertial.mass, times(inertial.mass.words, factor)), *_inertia(inertial, factor)]
            yield FixedChange("mass and inertia in other units", whole)
    for inertial in parts.inertials:
        for factor in _INERTIA:
            yield FixedChange("inertia in other units", _inertia(inertial, factor))
    for factor in factors:
        masses = [write for inertial in parts.inertials for write in [(inertial.mass, times(inertial.mass.words, factor))]]
        yield FixedChange("all masses in other units", [*masses, *(write for one in parts.inertials for write in _inertia(one, factor))])
        lengths: list[Write] = [(slot, times(slot.words, factor)) for slot in parts.vectors]
        inertias = [write for one in parts.inertials for write in _inertia(one, _squared(factor))]
        yield FixedChange("all lengths in other units", [*lengths, *inertias])


HYPOTHESIS = hypothesis(
    "units",
    "mass or length in other units",
    "computer-aided design programs export grams and millimetres; both formats hold kilograms and metres",
    _changes,
)
