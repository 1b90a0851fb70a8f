"""The reflected inertia of a rotor is missing, counts twice, or stands in one model only."""

from __future__ import annotations

from collections.abc import Iterator

from harness.diagnosis.hypotheses._coefficients import Coefficient, coefficient_hypothesis
from harness.models.anatomy.parts import Anatomy


def _rotors(parts: Anatomy) -> Iterator[Coefficient]:
    return (Coefficient(joint.armature, parts.inertia(joint)) for joint in parts.joints if joint.armature is not None)


HYPOTHESIS = coefficient_hypothesis(
    "armature",
    "reflected inertia of a rotor missing, doubled or left in",
    "MuJoCo, XML reference, joint/armature; Drake, Parsing model files, Reflected Inertia",
    _rotors,
)
