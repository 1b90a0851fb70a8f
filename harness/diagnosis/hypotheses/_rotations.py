"""Orientations of frames in either format, as rotation matrices, and the mistakes people make with them.

Sources: MuJoCo 4, modeling, frame orientations; http://wiki.ros.org/urdf/XML/joint, origin (fixed axes x, y, z).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator

import numpy as np

from harness.arrays import Array
from harness.diagnosis.hypotheses._changes import FixedChange, FreeChange, Write, is_zero
from harness.models.anatomy.parts import Anatomy, Slot

# What a mistake turns a frame by [rad].
TURN = 0.5
_COMPONENTS = "xyz"

Slots = Callable[[Anatomy], Iterator[tuple[str, Slot]]]


def about(axis: Array, angle: float) -> Array:
    """Rotation matrix, (3, 3), by an angle [rad] about an axis (3,); Rodrigues."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross)


def matrix_of(slot: Slot, parts: Anatomy) -> Array:
    """The orientation that a slot holds, (3, 3): columns are the axes of the frame."""
    if slot.absent:
        return np.eye(3)
    values = slot.values
    unit = math.pi / 180 if parts.angle is not None and parts.angle.words != ("radian",) else 1.0
    match slot.place.attribute:
        case "quat":
            w, vector = values[0] / np.linalg.norm(values), values[1:] / np.linalg.norm(values)
            angle = 2 * math.atan2(float(np.linalg.norm(vector)), w)
            return about(vector, angle) if vector.any() else np.eye(3)
        case "axisangle":
            return about(values[:3], values[3] * unit)
        case "euler":
            sequence = parts.euler_sequence
            turns = [about(np.eye(3)["xyz".index(letter.lower())], value * unit) for letter, value in zip(sequence, values, strict=True)]
            turns = turns if sequence.islower() else turns[::-1]
            return np.asarray(turns[0] @ turns[1] @ turns[2])
        case "xyaxes":
            x = values[:3] / np.linalg.norm(values[:3])
            y = values[3:] - x @ values[3:] * x
            y = y / np.linalg.norm(y)
            return np.stack([x, y, np.cross(x, y)], axis=1)
        case "zaxis":
            z = values / np.linalg.norm(values)
            cross = np.cross([0.0, 0.0, 1.0], z)
            angle = math.atan2(float(np.linalg.norm(cross)), z[2])
            return about(cross, angle) if cross.any() else np.diag([1.0, z[2], z[2]])
        case _:
            return np.asarray(about(np.eye(3)[2], values[2]) @ about(np.eye(3)[1], values[1]) @ about(np.eye(3)[0], values[0]))


def written(slot: Slot, rotation: Array, model_format: str) -> Write:
    """The slot with another orientation: a quaternion in MJCF, roll, pitch and yaw in URDF."""
    if model_format == "mjcf":
        return slot.called("quat"), [repr(float(part)) for part in _quaternion(rotation)]
    roll = math.atan2(rotation[2, 1], rotation[2, 2])
    pitch = math.atan2(-rotation[2, 0], math.hypot(rotation[2, 1], rotation[2, 2]))
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    return slot, [repr(roll), repr(pitch), repr(yaw)]


def _quaternion(rotation: Array) -> Array:
    """(w, x, y, z), from the column of 4 q q' that is largest."""
    trace = float(np.trace(rotation))
    products = np.empty((4, 4))
    products[0, 0] = 1 + trace
    products[1:, 1:] = rotation + rotation.T + (1 - trace) * np.eye(3)
    products[0, 1:] = products[1:, 0] = [
        rotation[2, 1] - rotation[1, 2],
        rotation[0, 2] - rotation[2, 0],
        rotation[1, 0] - rotation[0, 1],
    ]
    column = products[:, int(np.argmax(np.diag(products)))]
    quaternion = column / np.linalg.norm(column)
    return np.asarray(quaternion if quaternion[0] >= 0 else -quaternion)


def changes(slots: Slots, parts: Anatomy) -> Iterator[FixedChange]:
    """A rotation taken away, taken the other way, or its numbers in another order."""
    for what, slot in slots(parts):
        if slot.absent:
            continue
        yield FixedChange(f"rotation of {what} left in", [(slot, None)])
        yield FixedChange(f"rotation of {what} the other way", [written(slot, matrix_of(slot, parts).T, parts.model.format)])
        if slot.place.attribute == "quat":
            yield FixedChange("quaternion with its scalar last", [(slot, [*slot.words[1:], slot.words[0]])])
            yield FixedChange("quaternion with its scalar first", [(slot, [slot.words[-1], *slot.words[:-1]])])
        if slot.place.attribute in ("rpy", "euler"):
            yield FixedChange("angles in the opposite order", [(slot, slot.words[::-1])])


def free(slots: Slots, parts: Anatomy) -> Iterator[FreeChange]:
    """A turn by a free angle about each axis of the frame."""
    for what, slot in slots(parts):
        present = matrix_of(slot, parts)
        for axis, letter in enumerate(_COMPONENTS):

            def turned(angle: float, slot: Slot = slot, present: Array = present, axis: int = axis) -> list[Write]:
                return [written(slot, present @ about(np.eye(3)[axis], angle), parts.model.format)]

            yield FreeChange(f"{what} turned about its {letter}", turned, 1.0)


def plants(slots: Slots, parts: Anatomy) -> Iterator[FixedChange]:
    """``changes``, and frames turned that are not."""
    yield from changes(slots, parts)
    for (what, slot), axis in itertools.product(slots(parts), range(3)):
        if slot.absent or is_zero(slot.words):
            turned = written(slot, about(np.eye(3)[axis], TURN), parts.model.format)
            yield FixedChange(f"{what} turned about its {_COMPONENTS[axis]}", [turned])
