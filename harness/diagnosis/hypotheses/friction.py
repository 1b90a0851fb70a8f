"""Coulomb friction was left in one model.

The smooth equations hold none, so the validator refuses a model with some by line and attribute. It never reaches a
diagnosis: the mistake is planted, to see that it is refused, and has no mend.
"""

from __future__ import annotations

from collections.abc import Iterator

from harness.diagnosis.hypotheses._changes import FixedChange, hypothesis
from harness.models.anatomy.parts import Anatomy

_LEFT_IN = "0.1"


def _plants(parts: Anatomy) -> Iterator[FixedChange]:
    return (FixedChange("left in", [(joint.friction, [_LEFT_IN])]) for joint in parts.joints if joint.friction is not None)


HYPOTHESIS = hypothesis(
    "friction",
    "Coulomb friction left in",
    "MuJoCo, XML reference, joint/frictionloss; http://wiki.ros.org/urdf/XML/joint, dynamics",
    changes=lambda parts: (),
    plants=_plants,
)
