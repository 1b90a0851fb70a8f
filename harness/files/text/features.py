"""What a model file asks of an engine beyond hinges and slides, in a word or two each: what a report gathers verdicts by."""

from __future__ import annotations

from collections.abc import Iterator

from harness.files.document.xml import parse_any
from harness.files.model_file import JointDamper, JointSpring, ModelFile, PointSpring

_CONSTRAINTS = {"point": "loops", "frame": "loops", "joint": "coupled joints", "tendon": "coupled tendons"}
_JOINTS = {"ball": "ball joints", "free": "free joints", "floating": "free joints"}


def features_of(model: ModelFile) -> list[str]:
    """Some of "armature", "ball joints", "coupled joints", "coupled tendons", "dampers", "free joints", "loops", "mimic joints" and
    "springs", sorted."""
    return sorted(set(_features(model)))


def _features(model: ModelFile) -> Iterator[str]:
    for element in model.force_elements:
        if isinstance(element, JointSpring) or (isinstance(element, PointSpring) and element.stiffness):
            yield "springs"
        if isinstance(element, JointDamper) or (isinstance(element, PointSpring) and element.damping):
            yield "dampers"
    followers = {mimic.joint for mimic in model.mimics}
    if followers:
        yield "mimic joints"
    for constraint in model.constraints:
        if constraint.name not in followers:
            yield _CONSTRAINTS[constraint.couples]
    if model.armatures:
        yield "armature"
    if model.ball_joint:
        yield "ball joints"
    for joint in parse_any(model.path, model.text, "a model").root.iter("joint", "freejoint"):
        kind = "free" if joint.tag == "freejoint" else joint.get("type", "")
        if kind in _JOINTS:
            yield _JOINTS[kind]
        # Of a default class too: what it is for.
        if float(joint.get("armature", "0").split()[0]):
            yield "armature"
