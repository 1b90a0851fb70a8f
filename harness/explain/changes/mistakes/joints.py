"""The axis of a joint points the other way, or along another coordinate; two joints bear each other's names.

Of exchanged names, positions and forces reach the wrong joint.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from harness.explain.changes.mistakes import COMPONENTS, FixedChange, Mistake, exchanged, times
from harness.files.joint_kinds import JointKind
from harness.models.anatomy.parts import Anatomy


def _turned(parts: Anatomy) -> Iterator[FixedChange]:
    for joint in parts.joints:
        if joint.axis is None:
            continue
        yield FixedChange("axis reversed", [(joint.axis, times(joint.axis.words, "-1"))])
        for first, second in itertools.combinations(range(3), 2):
            statement = f"{COMPONENTS[first]} and {COMPONENTS[second]} of the axis exchanged"
            yield FixedChange(statement, [(joint.axis, exchanged(joint.axis.words, first, second))])


def _renamed(parts: Anatomy) -> Iterator[FixedChange]:
    for one, other in itertools.combinations(parts.joints, 2):
        if one.kind == other.kind or (JointKind(one.kind).is_single and JointKind(other.kind).is_single):
            statement = f"joints {one.name.words[0]} and {other.name.words[0]} exchanged"
            yield FixedChange(statement, [(one.name, other.name.words), (other.name, one.name.words)])


AXIS = Mistake(
    "axis",
    "joint axis reversed or along another coordinate",
    "Featherstone, Rigid Body Dynamics Algorithms, section 4.4: the sign of a joint's axis is a convention of the model",
    _turned,
)
JOINT_ORDER = Mistake(
    "joint_order",
    "joint order permuted",
    "Pinocchio orders joints by name, MuJoCo by document; a vector handed from one to the other is permuted",
    _renamed,
)
