"""The frame that an inertia is given in is turned, and its rotation was dropped, reversed, or left in."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from harness.diagnosis.hypotheses import _rotations
from harness.diagnosis.hypotheses._changes import FixedChange, FreeChange, hypothesis, is_zero
from harness.models.anatomy.parts import ENTRIES, Anatomy, Slot


def _slots(parts: Anatomy) -> Iterator[tuple[str, Slot]]:
    for body in parts.bodies:
        if body.inertial is not None:
            yield f"the inertial frame of {body.name}", body.inertial.rotation


def _changes(parts: Anatomy) -> Iterator[FixedChange]:
    return _rotations.changes(_slots, parts)


def _free(parts: Anatomy) -> Iterator[FreeChange]:
    return _rotations.free(_slots, parts)


def _plants(parts: Anatomy) -> Iterator[FixedChange]:
    yield from _rotations.plants(_slots, parts)
    for body in parts.bodies:
        if body.inertial is None or is_zero([body.inertial.words[name] for name in ENTRIES[3:]]):
            continue
        # The same body by its principal moments, whose frame is turned; that is forgotten.
        _, axes = np.linalg.eigh(body.inertial.matrix)
        order = np.argmax(np.abs(axes), axis=1)
        moments = np.diag(axes[:, order].T @ body.inertial.matrix @ axes[:, order])
        words = {**dict.fromkeys(ENTRIES, "0"), **dict(zip(ENTRIES, (repr(float(moment)) for moment in moments), strict=False))}
        yield FixedChange(
            f"rotation of the principal axes of {body.name} dropped", body.inertial.rewritten(words), [body.inertial.rotation]
        )


HYPOTHESIS = hypothesis(
    "inertial_rotation",
    "rotation of an inertial frame dropped, reversed or left in",
    "MuJoCo, XML reference, inertial/quat; http://wiki.ros.org/urdf/XML/link, inertial origin rpy",
    _changes,
    _free,
    _plants,
)
