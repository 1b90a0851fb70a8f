"""What a model file asks of an engine beyond hinges and slides, in a word or two each: what a report gathers verdicts by."""

from __future__ import annotations

from collections.abc import Iterator

from harness.files.joint_kinds import JointKind
from harness.files.model_file import ModelFile, meaning_of
from harness.files.tree import Joint, Spring

_CONSTRAINTS = {"point": "loops", "frame": "loops", "joint": "coupled joints", "tendon": "coupled tendons"}
_JOINTS = {JointKind.BALL: "ball joints", JointKind.FREE: "free joints"}


def features_of(model: ModelFile) -> list[str]:
    """Some of "armature", "ball joints", "coupled joints", "coupled tendons", "dampers", "free joints", "loops", "mimic joints" and
    "springs", sorted."""
    return sorted(set(_features(model)))


def _features(model: ModelFile) -> Iterator[str]:
    tree = meaning_of(model).tree
    acting: list[Joint | Spring] = [*tree.joints, *tree.springs]
    if any(one.stiffness for one in acting):
        yield "springs"
    if any(one.damping for one in acting):
        yield "dampers"
    followers = {joint.name for joint in tree.joints if joint.follows}
    if followers:
        yield "mimic joints"
    yield from (_CONSTRAINTS[one.couples] for one in model.constraints if one.name not in followers)
    if any(joint.armature for joint in tree.joints):
        yield "armature"
    yield from (_JOINTS[joint.kind] for joint in tree.joints if joint.kind in _JOINTS)
