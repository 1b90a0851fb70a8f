"""Coulomb friction was left in one model; the smooth equations hold none, and a model with some is refused by name."""

from __future__ import annotations

from collections.abc import Iterator

from harness.hypotheses._anatomy import Anatomy
from harness.hypotheses._changes import Change, hypothesis, is_zero

_LEFT_IN = "0.1"


def _changes(parts: Anatomy) -> Iterator[Change]:
    for joint in parts.joints:
        if joint.friction is not None and not is_zero(joint.friction.words):
            yield Change("left in", [(joint.friction, ["0"])])


def _plants(parts: Anatomy) -> Iterator[Change]:
    return (Change("left in", [(joint.friction, [_LEFT_IN])]) for joint in parts.joints if joint.friction is not None)


HYPOTHESIS = hypothesis(
    "friction",
    "Coulomb friction left in",
    "MuJoCo, XML reference, joint/frictionloss; http://wiki.ros.org/urdf/XML/joint, dynamics",
    _changes,
    plants=_plants,
)
