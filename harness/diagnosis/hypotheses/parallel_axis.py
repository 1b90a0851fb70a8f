"""An inertia was given about the joint and not about the centre of mass, or the parallel axis was taken off once too often."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from harness.diagnosis.hypotheses._changes import FixedChange, hypothesis
from harness.diagnosis.hypotheses._inertia import parallel_axis, with_added
from harness.diagnosis.hypotheses._rotations import matrix_of
from harness.models.anatomy.parts import Anatomy


def _changes(parts: Anatomy) -> Iterator[FixedChange]:
    for body in parts.bodies:
        if body.inertial is None:
            continue
        inertial = body.inertial
        anchors = {tuple(joint.anchor): joint.anchor for joint in body.joints} or {(): np.zeros(3)}
        for anchor in anchors.values():
            arm = matrix_of(inertial.rotation, parts).T @ (inertial.centre.values - anchor)
            added = parallel_axis(float(inertial.mass.values[0]), arm)
            for sign, statement in ((-1, "parallel axis counted twice"), (1, "parallel axis taken off twice")):
                yield FixedChange(f"{statement} in {body.name}", with_added(inertial, added, sign, parts.model.format))


HYPOTHESIS = hypothesis(
    "parallel_axis",
    "inertia about the joint instead of the centre of mass, or the parallel axis taken off twice",
    "Featherstone, Rigid Body Dynamics Algorithms, section 2.13; http://wiki.ros.org/urdf/XML/link, inertial",
    _changes,
)
