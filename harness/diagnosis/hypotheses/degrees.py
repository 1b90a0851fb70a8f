"""An angle in degrees where radians are meant, or the other way; also stiffness and damping per degree."""

from __future__ import annotations

import math
from collections.abc import Iterator

from harness.diagnosis.hypotheses._changes import FixedChange, hypothesis
from harness.models.anatomy.parts import Anatomy, Slot

_DEGREE = math.pi / 180
_UNITS = {"radian": "degree", "degree": "radian"}


def _angles(parts: Anatomy) -> Iterator[tuple[Slot, tuple[int, ...]]]:
    """Slots with angles, or numbers per angle, and which of their numbers these are."""
    rotations = [body.rotation for body in parts.bodies if body.rotation is not None]
    rotations += [inertial.rotation for inertial in parts.inertials]
    for slot in rotations:
        if not slot.absent and slot.place.attribute in ("euler", "rpy", "axisangle"):
            yield slot, (3,) if slot.place.attribute == "axisangle" else (0, 1, 2)
    for joint in parts.joints:
        if joint.kind == "hinge":
            for found in (joint.spring_reference, joint.stiffness, joint.damping):
                if found is not None:
                    yield found, (0,)


def _changes(parts: Anatomy) -> Iterator[FixedChange]:
    if parts.angle is not None:
        yield FixedChange("angles of the whole file in the other unit", [(parts.angle, [_UNITS[parts.angle.words[0]]])])
    for slot, places in _angles(parts):
        for factor, statement in ((_DEGREE, "degrees for radians"), (1 / _DEGREE, "radians for degrees")):
            for chosen in [places] if len(places) == 1 else [places, *((place,) for place in places)]:
                words = [repr(float(word) * factor) if index in chosen else word for index, word in enumerate(slot.words)]
                yield FixedChange(statement, [(slot, words)])


HYPOTHESIS = hypothesis(
    "degrees",
    "degrees for radians, or radians for degrees",
    "MuJoCo, XML reference, compiler/angle (degrees by default); URDF always holds radians",
    _changes,
)
