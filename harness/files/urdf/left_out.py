"""What a URDF says besides the equations of motion of its tree.

Source: http://wiki.ros.org/urdf/XML; SDFormat extensions to URDF; MuJoCo documentation, Modeling, section URDF extensions.
"""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from harness.files.document.source import Source
from harness.files.document.xml import literal_tag
from harness.files.findings import LeftOut
from harness.files.urdf.beside import FORCES_WITHOUT_AXIS, UNREAD_ROTORS, has_rotor
from harness.files.urdf.kinds import BALL_CONSTRAINT, FIXED, JOINT_TAGS, LIMITED, POINT_SPRING
from harness.files.urdf.reading import DAMPING_OF_SEVERAL

_VISUAL, _CONTACTS, _UNKNOWN = "visual geometry", "contacts", "elements that URDF does not know"
_LIMITS, _FRICTION, _EFFORT = "joint limits", "friction loss", "effort and velocity limits"
_TRANSMISSIONS, _GAZEBO, _XACRO = "transmissions", "gazebo elements", "xacro leftovers"
_MUJOCO = "options of MuJoCo's own reader"
_LOOPS = "Drake's ball constraints, which no engine's reader reads"
# What each is, and whether an engine that has it switched on could give other accelerations for it.
_BEARS_ON_MOTION = {
    _CONTACTS: True,
    _LIMITS: True,
    _FRICTION: True,
    DAMPING_OF_SEVERAL: True,
    FORCES_WITHOUT_AXIS: True,
    UNREAD_ROTORS: True,
    _MUJOCO: True,
    _LOOPS: True,
    _EFFORT: False,
    _TRANSMISSIONS: False,
    "safety controllers and calibration": False,
    _VISUAL: False,
    _GAZEBO: False,
    _XACRO: False,
    _UNKNOWN: False,
}
_LEFT_OUT = {
    "link/visual": _VISUAL,
    "link/collision": _CONTACTS,
    "robot/material": _VISUAL,
    "robot/transmission": _TRANSMISSIONS,
    "robot/gazebo": _GAZEBO,
    "robot/mujoco": _MUJOCO,
    f"robot/{BALL_CONSTRAINT}": _LOOPS,
    "joint/safety_controller": "safety controllers and calibration",
    "joint/calibration": "safety controllers and calibration",
}
# What is read.
_OF_JOINTS = ("parent", "child", "origin", "axis", "limit", "dynamics", "mimic")
_READ = frozenset(
    ["robot/link", *(f"robot/{tag}" for tag in JOINT_TAGS), f"robot/{POINT_SPRING}", "link/inertial"]
    + [f"{tag}/{part}" for tag in JOINT_TAGS for part in _OF_JOINTS]
)


def left_out(source: Source, root: etree._Element) -> tuple[LeftOut, ...]:
    """What is left out of a tree that has been read, what bears on the motion first."""
    found: dict[str, set[int]] = {}
    for what, element in _findings(source, root):
        found.setdefault(what, set()).update(source.lines([element]))
    for one in source.passed_over:
        found.setdefault(one.what, set()).add(one.line)
    return tuple(LeftOut(what, tuple(sorted(found[what])), bears) for what, bears in _BEARS_ON_MOTION.items() if what in found)


def _findings(source: Source, root: etree._Element) -> Iterator[tuple[str, etree._Element]]:
    for element in root.iterchildren("*"):
        tag = literal_tag(element)
        yield from _of_part(f"robot/{tag}", element)
        if tag in ("link", *JOINT_TAGS):
            for part in element.iterchildren("*"):
                yield from _of_part(f"{tag}/{literal_tag(part)}", part)
        if tag == "joint":
            yield from _of_joint(source, element)


def _of_part(path: str, element: etree._Element) -> Iterator[tuple[str, etree._Element]]:
    if literal_tag(element).startswith("xacro:"):
        yield _XACRO, element
    elif path in _LEFT_OUT:
        if _is_read(element):
            return
        yield _LEFT_OUT[path], element
    elif path not in _READ:
        yield _UNKNOWN, element


def _is_read(element: etree._Element) -> bool:
    """True for springs and rotors, which the equations of motion hold, or which are passed over for a reason of their own."""
    if element.tag == "gazebo":
        return {literal_tag(part) for part in element.iterchildren("*")} - {"springReference"} == {"springStiffness"}
    return element.tag == "transmission" and has_rotor(element)


def _of_joint(source: Source, joint: etree._Element) -> Iterator[tuple[str, etree._Element]]:
    kind, limit, dynamics = joint.get("type"), joint.find("limit"), joint.find("dynamics")
    if limit is not None:
        if kind in LIMITED and source.number(limit, "lower", 0.0) < source.number(limit, "upper", 0.0):
            yield _LIMITS, limit
        if {"effort", "velocity"} & set(limit.attrib):
            yield _EFFORT, limit
    if dynamics is not None and kind != FIXED and source.number(dynamics, "friction", 0.0):
        yield _FRICTION, dynamics
