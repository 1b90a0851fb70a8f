"""Gravity is missing, left in, or points along another axis. A URDF holds none."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from harness.diagnosis.hypotheses._changes import FixedChange, hypothesis, is_zero
from harness.models.anatomy.parts import Anatomy

STANDARD = "-9.81"


def _changes(parts: Anatomy) -> Iterator[FixedChange]:
    gravity = parts.gravity
    if gravity is None:
        return
    stage = next(slot for name, slot in parts.stages if name == "gravity")
    for first, second in itertools.combinations(range(3), 2):
        words = list(gravity.words)
        words[first], words[second] = words[second], words[first]
        yield FixedChange("gravity along another axis", [(gravity, words)])
    if stage.words == ("disable",):
        yield FixedChange("gravity switched off", [(stage, ["enable"])])
        for axis in range(3):
            words = ["0", "0", "0"]
            words[axis] = STANDARD
            yield FixedChange("gravity missing", [(gravity, words), (stage, ["enable"])])
    elif not is_zero(gravity.words):
        yield FixedChange("gravity switched off", [(stage, ["disable"])])
        yield FixedChange("gravity missing", [(gravity, ["0", "0", "0"])])
    else:
        for axis in range(3):
            words = ["0", "0", "0"]
            words[axis] = STANDARD
            yield FixedChange("gravity missing", [(gravity, words)])


HYPOTHESIS = hypothesis(
    "gravity",
    "gravity missing, left in, or along another axis",
    "Pinocchio's MJCF reader passes over option/gravity; many tools take y upwards",
    _changes,
)
