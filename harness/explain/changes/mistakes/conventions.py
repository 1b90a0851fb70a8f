"""Another convention of signs, axes and names.

The axis of a joint points the other way, or along another coordinate; two joints bear each other's names, so that positions and forces
reach the wrong joint. A length, an offset, a spring's reference or a force law has the wrong sign. Gravity is missing, left in, or points
along another axis; a URDF holds none.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from harness.explain.changes.mistakes import COMPONENTS, FixedChange, Mistake, Write, along, exchanged, is_zero, times
from harness.files.joint_kinds import JointKind
from harness.files.text.slots import Anatomy, Slot


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
