"""A spring is missing, counts twice, is relaxed at another position, or stands in one model only."""

from __future__ import annotations

from collections.abc import Iterator

from harness.diagnosis.hypotheses._changes import is_zero
from harness.diagnosis.hypotheses._coefficients import Coefficient, coefficient_hypothesis
from harness.models.anatomy.parts import Anatomy


def _springs(parts: Anatomy) -> Iterator[Coefficient]:
    for joint in parts.joints:
        if joint.stiffness is None:
            continue
        # A spring that is relaxed elsewhere than at zero would take its reference along.
        alone = joint.spring_reference is None or is_zero(joint.spring_reference.words)
        yield Coefficient(joint.stiffness, parts.inertia(joint), removable=alone)
        if joint.spring_reference is not None and not is_zero(joint.stiffness.words):
            yield Coefficient(joint.spring_reference, 1.0 if joint.kind == "hinge" else parts.length, removable=False)
    for stiffness, _, length in parts.others:
        yield Coefficient(stiffness, parts.mass, removable=False)
        yield Coefficient(length, parts.length, removable=False)


HYPOTHESIS = coefficient_hypothesis(
    "spring",
    "spring missing, doubled, left in, or relaxed elsewhere",
    "Pinocchio's MJCF reader passes over stiffness and springref; a plain URDF has no springs",
    _springs,
    "spring",
)
