"""The axis of a joint points the other way, or along another coordinate."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from harness.diagnosis.hypotheses._changes import COMPONENTS, FixedChange, exchanged, hypothesis, times
from harness.models.anatomy.parts import Anatomy


def _changes(parts: Anatomy) -> Iterator[FixedChange]:
    for joint in parts.joints:
        if joint.axis is None:
            continue
        yield FixedChange("axis reversed", [(joint.axis, times(joint.axis.words, "-1"))])
        for first, second in itertools.combinations(range(3), 2):
            statement = f"{COMPONENTS[first]} and {COMPONENTS[second]} of the axis exchanged"
            yield FixedChange(statement, [(joint.axis, exchanged(joint.axis.words, first, second))])


HYPOTHESIS = hypothesis(
    "axis",
    "joint axis reversed or along another coordinate",
    "Featherstone, Rigid Body Dynamics Algorithms, section 4.4: the sign of a joint's axis is a convention of the model",
    _changes,
)
