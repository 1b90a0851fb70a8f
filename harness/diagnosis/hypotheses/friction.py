"""Coulomb friction was left in one model.

The smooth equations hold none, so the validator refuses a model with some by line and attribute. It never reaches a
diagnosis: the mistake is planted, to see that it is refused, and has no mend.
"""

from __future__ import annotations

from harness.diagnosis.hypotheses._changes import FixedChange, hypothesis

HYPOTHESIS = hypothesis(
    "friction",
    "Coulomb friction left in",
    "MuJoCo, XML reference, joint/frictionloss; http://wiki.ros.org/urdf/XML/joint, dynamics",
    changes=lambda parts: (),
    plants=lambda parts: [FixedChange("left in", [(joint.friction, ["0.1"])]) for joint in parts.joints if joint.friction is not None],
)
