"""Masses in grams, lengths in millimetres, inertias in the units that these make; degrees where radians are meant, or the other way."""

from __future__ import annotations

import math
from collections.abc import Iterator

from harness.explain.changes.mistakes import FixedChange, Mistake, Write, Writes, times
from harness.files.joint_kinds import JointKind
from harness.files.text.slots import ENTRIES, Anatomy, InertialSlots, Slot

# Of a mass or length, and of an inertia: g m^2, kg mm^2 and g mm^2, and back.
_FACTORS, _OF_INERTIA = ("0.001", "1000"), ("1000", "0.001", "1e6", "1e-6", "1e9", "1e-9")
# A degree [rad]; stiffness and damping may be given per degree.
_DEGREE = math.pi / 180
_UNITS = {"radian": "degree", "degree": "radian"}


def _times(slot: Slot, factor: str) -> Write:
    return slot, times(slot.words, factor)


def _inertia(inertial: InertialSlots, factor: str) -> Writes:
    return inertial.rewritten({name: times([inertial.words[name]], factor)[0] for name in ENTRIES})


def _in_other_units(parts: Anatomy) -> Iterator[FixedChange]:
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


def _angles(parts: Anatomy) -> Iterator[tuple[Slot, tuple[int, ...]]]:
    """Slots with angles, or numbers per angle, and which of their numbers these are."""
    rotations = [body.rotation for body in parts.bodies if body.rotation is not None]
    rotations += [inertial.rotation for inertial in parts.inertials]
    for slot in rotations:
        if not slot.absent and slot.place.attribute in ("euler", "rpy", "axisangle"):
            yield slot, (3,) if slot.place.attribute == "axisangle" else (0, 1, 2)
    for joint in parts.joints:
        if joint.kind == JointKind.HINGE:
            for found in (joint.spring_reference, joint.stiffness, joint.damping):
                if found is not None:
                    yield found, (0,)


def _in_degrees(parts: Anatomy) -> Iterator[FixedChange]:
    if parts.angle is not None:
        yield FixedChange("angles of the whole file in the other unit", [(parts.angle, [_UNITS[parts.angle.words[0]]])])
    for slot, places in _angles(parts):
        for factor, statement in ((_DEGREE, "degrees for radians"), (1 / _DEGREE, "radians for degrees")):
            for chosen in [places] if len(places) == 1 else [places, *((place,) for place in places)]:
                words = [repr(float(word) * factor) if index in chosen else word for index, word in enumerate(slot.words)]
                yield FixedChange(statement, [(slot, words)])


MASSES_AND_LENGTHS = Mistake(
    "units",
    "mass or length in other units",
    "computer-aided design programs export grams and millimetres; both formats hold kilograms and metres",
    _in_other_units,
)
ANGLES = Mistake(
    "degrees",
    "degrees for radians, or radians for degrees",
    "MuJoCo, XML reference, compiler/angle (degrees by default); URDF always holds radians",
    _in_degrees,
)
