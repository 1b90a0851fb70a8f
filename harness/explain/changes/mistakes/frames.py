"""A frame is turned or moved against the one around it.

Its rotation was dropped, reversed, or left in; its offset stands in the wrong body, in its inertial, or nowhere.

Sources: MuJoCo 4, modeling, frame orientations; http://wiki.ros.org/urdf/XML/joint, origin (fixed axes x, y, z).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from harness.arrays import Array
from harness.explain.changes.mistakes import COMPONENTS, FixedChange, FreeChange, Mistake, Rewrites, Write, along, is_zero, plus
from harness.files.text.slots import ENTRIES, Anatomy, Slot

# What a mistake turns a frame by [rad].
TURN = 0.5


def _about(axis: Array, angle: float) -> Array:
    """Rotation matrix, (3, 3), by an angle [rad] about an axis (3,) of any length."""
    return np.asarray(Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix())


def matrix_of(slot: Slot, parts: Anatomy) -> Array:
    """The orientation that a slot holds, (3, 3): columns are the axes of the frame."""
    if slot.absent:
        return np.eye(3)
    values = slot.values
    in_degrees = parts.angle is not None and parts.angle.words != ("radian",)
    match slot.place.attribute:
        case "quat":
            return np.asarray(Rotation.from_quat(values, scalar_first=True).as_matrix())
        case "axisangle":
            return _about(values[:3], math.radians(values[3]) if in_degrees else values[3])
        case "euler":
            # SciPy writes axes that move along in capitals, MuJoCo those that stand still.
            return np.asarray(Rotation.from_euler(parts.euler_sequence.swapcase(), values, in_degrees).as_matrix())
        case "xyaxes":
            x = values[:3] / np.linalg.norm(values[:3])
            y = values[3:] - x @ values[3:] * x
            y = y / np.linalg.norm(y)
            return np.stack([x, y, np.cross(x, y)], axis=1)
        case "zaxis":
            z = values / np.linalg.norm(values)
            cross = np.cross([0.0, 0.0, 1.0], z)
            angle = math.atan2(float(np.linalg.norm(cross)), z[2])
            return _about(cross, angle) if cross.any() else np.diag([1.0, z[2], z[2]])
        case _:
            return np.asarray(Rotation.from_euler("xyz", values).as_matrix())


def _written(slot: Slot, rotation: Array, model_format: str) -> Write:
    """The slot with another orientation: a quaternion in MJCF, roll, pitch and yaw in URDF."""
    if model_format == "mjcf":
        quaternion = Rotation.from_matrix(rotation).as_quat(canonical=True, scalar_first=True)
        return slot.called("quat"), [repr(float(part)) for part in quaternion]
    roll = math.atan2(rotation[2, 1], rotation[2, 2])
    pitch = math.atan2(-rotation[2, 0], math.hypot(rotation[2, 1], rotation[2, 2]))
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    return slot, [repr(roll), repr(pitch), repr(yaw)]


def _turned(slot: Slot, axis: int, parts: Anatomy, angle: float) -> list[Write]:
    """The slot turned further by an angle [rad] about one of its own axes."""
    return [_written(slot, matrix_of(slot, parts) @ _about(np.eye(3)[axis], angle), parts.model.format)]


def _rotation_mistake(
    name: str, title: str, source: str, slots: Callable[[Anatomy], Iterable[tuple[str, Slot]]], further_plants: Rewrites = lambda parts: ()
) -> Mistake:
    """A rotation taken away, taken the other way, or its numbers in another order; a turn by a free angle about each axis."""

    def changes(parts: Anatomy) -> Iterator[FixedChange]:
        for what, slot in slots(parts):
            if slot.absent:
                continue
            yield FixedChange(f"rotation of {what} left in", [(slot, None)])
            yield FixedChange(f"rotation of {what} the other way", [_written(slot, matrix_of(slot, parts).T, parts.model.format)])
            if slot.place.attribute == "quat":
                yield FixedChange("quaternion with its scalar last", [(slot, [*slot.words[1:], slot.words[0]])])
                yield FixedChange("quaternion with its scalar first", [(slot, [slot.words[-1], *slot.words[:-1]])])
            if slot.place.attribute in ("rpy", "euler"):
                yield FixedChange("angles in the opposite order", [(slot, slot.words[::-1])])

    def free(parts: Anatomy) -> Iterator[FreeChange]:
        for (what, slot), axis in itertools.product(slots(parts), range(3)):
            yield FreeChange(f"{what} turned about its {COMPONENTS[axis]}", partial(_turned, slot, axis, parts), 1.0)

    def plants(parts: Anatomy) -> Iterator[FixedChange]:
        """``changes``, and frames turned that are not."""
        yield from changes(parts)
        for (what, slot), axis in itertools.product(slots(parts), range(3)):
            if slot.absent or is_zero(slot.words):
                yield FixedChange(f"{what} turned about its {COMPONENTS[axis]}", _turned(slot, axis, parts, TURN))
        yield from further_plants(parts)

    return Mistake(name, title, source, changes, free, plants)


def _principal_axes_dropped(parts: Anatomy) -> Iterator[FixedChange]:
    """The same body by its principal moments, whose frame is turned; that is forgotten."""
    for inertial in parts.inertials:
        if is_zero([inertial.words[name] for name in ENTRIES[3:]]):
            continue
        _, axes = np.linalg.eigh(inertial.matrix)
        axes = axes[:, np.argmax(np.abs(axes), axis=1)]
        moments = [repr(float(moment)) for moment in np.diag(axes.T @ inertial.matrix @ axes)]
        writes = inertial.rewritten(dict(zip(ENTRIES, [*moments, "0", "0", "0"], strict=True)))
        yield FixedChange(f"rotation of the principal axes of {inertial.body} dropped", writes, [inertial.rotation])


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


def _misplaced(parts: Anatomy) -> Iterator[FixedChange]:
    yield from _exchanges(parts)
    for body in parts.bodies:
        if body.offset is not None and not body.offset.absent:
            yield FixedChange(f"offset of {body.name} left in", [(body.offset, None)])


def _left_out(parts: Anatomy) -> Iterator[FreeChange]:
    for slot in parts.frames:
        for axis, letter in enumerate(COMPONENTS if slot.absent else ""):

            def placed(value: float, slot: Slot = slot, axis: int = axis) -> list[Write]:
                return [(slot, along(axis, repr(value)))]

            yield FreeChange(f"left out along {letter}", placed, parts.length)


def _displaced(parts: Anatomy) -> Iterator[FixedChange]:
    yield from _exchanges(parts)
    for slot in parts.frames:
        for index, word in enumerate(slot.words):
            if float(word):
                words = [*slot.words[:index], "0", *slot.words[index + 1 :]]
                yield FixedChange("left out", [(slot, None if is_zero(words) and slot.place.element != "inertial" else words)])


FRAME_OFFSET = Mistake(
    "frame_offset",
    "offset of a frame misplaced: in another body, in the inertial, or missing",
    "Khalil, Dombre, Modeling, Identification and Control of Robots, chapter 3; http://wiki.ros.org/urdf/XML/joint, origin",
    _misplaced,
    _left_out,
    _displaced,
)
FRAME_ROTATION = _rotation_mistake(
    "frame_rotation",
    "rotation of a body's frame dropped, reversed or left in",
    "MuJoCo, XML reference, body/quat; http://wiki.ros.org/urdf/XML/joint, origin rpy",
    lambda parts: [(f"the frame of {body.name}", body.rotation) for body in parts.bodies if body.rotation is not None],
)
INERTIAL_ROTATION = _rotation_mistake(
    "inertial_rotation",
    "rotation of an inertial frame dropped, reversed or left in",
    "MuJoCo, XML reference, inertial/quat; http://wiki.ros.org/urdf/XML/link, inertial origin rpy",
    lambda parts: [
        (f"the inertial frame of {inertial.body}", inertial.rotation)
        for inertial in parts.inertials
        # Beside all six entries an MJCF gives no orientation.
        if inertial.entries[0].place.attribute != "fullinertia"
    ],
    _principal_axes_dropped,
)
