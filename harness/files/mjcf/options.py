"""Options of an MJCF that bear on all of it.

Source: MuJoCo documentation, XML reference, ``compiler``, ``option`` and ``option/flag``.
"""

from __future__ import annotations

from lxml import etree

from harness.files.joint_kinds import JointKind

# By their names in MJCF, in the order of its reference.
KINDS = {kind.value: kind for kind in (JointKind.HINGE, JointKind.SLIDE, JointKind.BALL, JointKind.FREE)}
# What MuJoCo takes without an option.
GRAVITY = (0.0, 0.0, -9.81)
# The attributes of which one gives a frame its orientation.
ORIENTATIONS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")


def is_on(root: etree._Element, stage: str) -> bool:
    """False where a stage of MuJoCo's pipeline, like "spring", is switched off."""
    return [flag.get(stage) for flag in root.iterfind("option/flag") if stage in flag.attrib][-1:] != ["disable"]
