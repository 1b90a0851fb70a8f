"""The kinds of joints by their names in URDF.

Source: http://wiki.ros.org/urdf/XML/joint; Drake, "Parsing model files", tag drake:joint.
"""

from __future__ import annotations

from lxml import etree

from harness.files.document.source import Source
from harness.files.document.xml import describe, literal_tag
from harness.files.joint_kinds import JointKind

FIXED = "fixed"
KINDS = {
    "revolute": JointKind.HINGE,
    "continuous": JointKind.HINGE,
    "prismatic": JointKind.SLIDE,
    "floating": JointKind.FREE,
    "planar": JointKind.PLANAR,
}
# All of URDF, in the order in which a refusal names them.
TYPES = ("revolute", "prismatic", "continuous", FIXED, "floating", *[name for name, kind in KINDS.items() if kind is JointKind.PLANAR])
OF_AXIS = [name for name in TYPES if name != FIXED and KINDS[name].has_axis]
SINGLE_AXIS = " or ".join(name for name, kind in KINDS.items() if kind.is_single)
LIMITED = ("revolute", "prismatic")
# Drake's element for a joint of a kind that URDF does not know, and the one kind of those that is read.
DRAKE_JOINT = "drake:joint"
DRAKE_KINDS = {"ball": JointKind.BALL}
JOINT_TAGS = ("joint", DRAKE_JOINT)
# Drake's elements for a spring and damper between two points, and for two points that are held together; their parts have a suffix.
POINT_SPRING, BALL_CONSTRAINT = "drake:linear_spring_damper", "drake:ball_constraint"
# Of a joint that moves as another does, which is a constraint.
MIMIC = "mimic"


def needs_axis(joint: etree._Element, what: str) -> str:
    """The complaint about something in a joint that is not one of a single axis."""
    return f"{describe(joint)} is {joint.get('type')}; {what} needs a joint that is {SINGLE_AXIS}"


def kind_of(source: Source, joint: etree._Element) -> JointKind | None:
    """The kind of a joint, None for a fixed one; raises InvalidModel where it has none."""
    written, kinds = str(joint.get("type")), DRAKE_KINDS if literal_tag(joint) == DRAKE_JOINT else KINDS
    if written == FIXED:
        return None
    if written not in kinds:
        source.refuse(joint, f"{describe(joint)} is of type {written!r}; expected one of {', '.join((FIXED, *kinds))}")
    return kinds[written]
