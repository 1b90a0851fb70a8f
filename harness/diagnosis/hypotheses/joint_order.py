"""Two joints bear each other's names, so that their positions and forces reach the wrong one."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from harness.diagnosis.hypotheses._changes import FixedChange, hypothesis
from harness.models.anatomy.parts import Anatomy


def _changes(parts: Anatomy) -> Iterator[FixedChange]:
    for one, other in itertools.combinations(parts.joints, 2):
        if one.kind == other.kind or {one.kind, other.kind} <= {"hinge", "slide"}:
            statement = f"joints {one.name.words[0]} and {other.name.words[0]} exchanged"
            yield FixedChange(statement, [(one.name, other.name.words), (other.name, one.name.words)])


HYPOTHESIS = hypothesis(
    "joint_order",
    "joint order permuted",
    "Pinocchio orders joints by name, MuJoCo by document; a vector handed from one to the other is permuted",
    _changes,
)
