"""The frame of a body is turned against its parent's, and its rotation was dropped, reversed, or left in."""

from __future__ import annotations

from collections.abc import Iterator

from harness.diagnosis.hypotheses import _rotations
from harness.diagnosis.hypotheses._changes import FixedChange, FreeChange, hypothesis
from harness.models.anatomy.parts import Anatomy, Slot


def _slots(parts: Anatomy) -> Iterator[tuple[str, Slot]]:
    for body in parts.bodies:
        if body.rotation is not None:
            yield f"the frame of {body.name}", body.rotation


def _changes(parts: Anatomy) -> Iterator[FixedChange]:
    return _rotations.changes(_slots, parts)


def _free(parts: Anatomy) -> Iterator[FreeChange]:
    return _rotations.free(_slots, parts)


def _plants(parts: Anatomy) -> Iterator[FixedChange]:
    return _rotations.plants(_slots, parts)


HYPOTHESIS = hypothesis(
    "frame_rotation",
    "rotation of a body's frame dropped, reversed or left in",
    "MuJoCo, XML reference, body/quat; http://wiki.ros.org/urdf/XML/joint, origin rpy",
    _changes,
    _free,
    _plants,
)
