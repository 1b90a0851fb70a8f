"""Another convention of signs, axes, names and units.

The axis of a joint points the other way, or along another coordinate; two joints bear each other's names, so that positions and forces
reach the wrong joint. A length, an offset, a spring's reference or a force law has the wrong sign. Gravity is missing, left in, or points
along another axis; a URDF holds none. Masses are in grams, lengths in millimetres, inertias in the units that these make; degrees stand
where radians are meant, or the other way.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

from harness.explain.changes.mistakes import COMPONENTS, FixedChange, Mistake, Write, Writes, along, exchanged, is_zero, times
from harness.files.joint_kinds import JointKind
from harness.files.text.slots import ENTRIES, Anatomy, InertialSlots, Slot

# Of a mass or length, and of an inertia: g m^2, kg mm^2 and g mm^2, and back.
_FACTORS, _OF_INERTIA = ("0.001", "1000"), ("1000", "0.001", "1e6", "1e-6", "1e9", "1e-9")
# A degree [rad]; stiffness and damping may be given per degree.
_DEGREE = math.pi / 180
_UNITS = {"radian": "degree", "degree": "radian"}


def _turned(parts: Anatomy) -> Iterator[FixedChange]:
    for joint in parts.joints:
        if joint.axis is None:
            continue
        yield FixedChange("axis reversed", [(joint.axis, times(joint.axis.words, "-1"))])
        for first, second in itertools.combinations(range(3), 2):
            statement = f"{COMPONENTS[first]} and {COMPONENTS[second]} of the axis exchanged"
            yield FixedChange(statement, [(joint.axis, exchanged(joint.axis.words, first, second))])


def _renamed(parts: Anatomy) -> Iterator[FixedChange]:
    for one, other in itertools.combinations(parts.joints, 2):
        if one.kind == other.kind or (JointKind(one.kind).is_single and JointKind(other.kind).is_single):
            statement = f"joints {one.name.words[0]} and {other.name.words[0]} exchanged"
            yield FixedChange(statement, [(one.name, other.name.words), (other.name, one.name.words)])


AXIS = Mistake(
    "axis",
    "joint axis reversed or along another coordinate",
    "Featherstone, Rigid Body Dynamics Algorithms, section 4.4: the sign of a joint's axis is a convention of the model",
    _turned,
)
JOINT_ORDER = Mistake(
    "joint_order",
    "joint order permuted",
    "Pinocchio orders joints by name, MuJoCo by document; a vector handed from one to the other is permuted",
    _renamed,
)


def _slots(parts: Anatomy) -> Iterator[Slot]:
    yield from parts.vectors
    for joint in parts.joints:
        yield from (slot for slot in (joint.damping, joint.stiffness, joint.spring_reference) if slot is not None)
    for stiffness, damping, _ in parts.others:
        yield from (stiffness, damping)
    # The sign of a gravity that is switched off matters to nobody.
    if parts.gravity is not None and parts.stages["gravity"].words != ("disable",):
        yield parts.gravity


def _flipped(parts: Anatomy) -> Iterator[FixedChange]:
    for slot in _slots(parts):
        live = [index for index, word in enumerate(slot.words) if float(word)]
        for index in live:
            flipped = [*slot.words[:index], *times([slot.words[index]], "-1"), *slot.words[index + 1 :]]
            yield FixedChange("sign flipped", [(slot, flipped)])
        if len(live) > 1:
            yield FixedChange("all signs flipped", [(slot, times(slot.words, "-1"))])


SIGN = Mistake(
    "sign",
    "sign of a length, an offset or a force law flipped",
    "Khalil, Dombre, Modeling, Identification and Control of Robots, chapter 3: conventions of link frames",
    _flipped,
)


def _gravity(parts: Anatomy) -> Iterator[FixedChange]:
    gravity = parts.gravity
    if gravity is None:
        return
    stage = parts.stages["gravity"]
    for first, second in itertools.combinations(range(3), 2):
        yield FixedChange("gravity along another axis", [(gravity, exchanged(gravity.words, first, second))])
    switched: list[Write] = [(stage, ["enable"])] if stage.words == ("disable",) else []
    missing = [along(axis, "-9.81") for axis in range(3)]
    if switched:
        yield FixedChange("gravity switched off", switched)
    elif not is_zero(gravity.words):
        yield FixedChange("gravity switched off", [(stage, ["disable"])])
        missing = [["0", "0", "0"]]
    for words in missing:
        yield FixedChange("gravity missing", [(gravity, words), *switched])


GRAVITY = Mistake(
    "gravity",
    "gravity missing, left in, or along another axis",
    "Pinocchio's MJCF reader passes over option/gravity; many tools take y upwards",
    _gravity,
)


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
