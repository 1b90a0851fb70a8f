"""Gravity is missing, left in, or points along another axis. A URDF holds none."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from harness.explain.changes.mistakes import FixedChange, Mistake, Write, along, exchanged, is_zero
from harness.models.anatomy.parts import Anatomy

STANDARD = "-9.81"


def _changes(parts: Anatomy) -> Iterator[FixedChange]:
    gravity = parts.gravity
    if gravity is None:
        return
    stage = parts.stages["gravity"]
    for first, second in itertools.combinations(range(3), 2):
        yield FixedChange("gravity along another axis", [(gravity, exchanged(gravity.words, first, second))])
    switched: list[Write] = [(stage, ["enable"])] if stage.words == ("disable",) else []
    missing = [along(axis, STANDARD) for axis in range(3)]
    if switched:
        yield FixedChange("gravity switched off", switched)
    elif not is_zero(gravity.words):
        yield FixedChange("gravity switched off", [(stage, ["disable"])])
        missing = [["0", "0", "0"]]
    for words in missing:
        yield FixedChange("gravity missing", [(gravity, words), *switched])


MISTAKE = Mistake(
    "gravity",
    "gravity missing, left in, or along another axis",
    "Pinocchio's MJCF reader passes over option/gravity; many tools take y upwards",
    _changes,
)
