"""A damper is missing, counts twice, or stands in one model only."""

from __future__ import annotations

from collections.abc import Iterator

from harness.diagnosis.hypotheses._coefficients import Coefficient, coefficient_hypothesis
from harness.models.anatomy.parts import Anatomy


def _dampers(parts: Anatomy) -> Iterator[Coefficient]:
    for joint in parts.joints:
        if joint.damping is not None:
            yield Coefficient(joint.damping, parts.inertia(joint))
    for _, damping, _ in parts.others:
        yield Coefficient(damping, parts.mass, removable=False)


HYPOTHESIS = coefficient_hypothesis(
    "damping",
    "damping missing, doubled or left in",
    "Pinocchio's aba stores <dynamics damping> and does not apply it; MuJoCo, XML reference, joint/damping",
    _dampers,
    "damper",
)
