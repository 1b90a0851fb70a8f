"""What a URDF says besides the equations of motion of its tree.

Source: http://wiki.ros.org/urdf/XML; SDFormat extensions to URDF; MuJoCo documentation, Modeling, section URDF extensions.
"""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from harness.files.findings import LeftOut
from harness.models.formats import BALL_CONSTRAINT, POINT_SPRING
from harness.models.source import Source
from harness.models.xml import literal_tag

_VISUAL, _CONTACTS, _UNKNOWN = "visual geometry", "contacts", "elements that URDF does not know"
_LIMITS, _FRICTION, _EFFORT = "joint limits", "friction loss", "effort and velocity limits"
_TRANSMISSIONS, _GAZEBO, _XACRO = "transmissions", "gazebo elements", "xacro leftovers"
_DAMPING = "damping of joints of several degrees of freedom"
_MUJOCO = "options of MuJoCo's own reader"
_LOOPS = "Drake's ball constraints, which no engine's reader reads"
# What each is, and whether an engine that has it switched on could give other accelerations for it.
_BEARS_ON_MOTION = {
    _CONTACTS: True,
    _LIMITS: True,
    _FRICTION: True,
    _DAMPING: True,
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
    ["robot/link", "robot/joint", "robot/drake:joint", f"robot/{POINT_SPRING}", "link/inertial"]
    + [f"{tag}/{part}" for tag in ("joint", "drake:joint") for part in _OF_JOINTS]
)
_OF_SEVERAL = ("planar", "floating", "ball")
_LIMITED = ("revolute", "prismatic")


def left_out(source: Source, root: etree._Element) -> tuple[LeftOut, ...]:
    """What is left out, what bears on the motion first."""
    found: dict[str, list[etree._Element]] = {}
    for what, element in _findings(source, root):
        found.setdefault(what, []).append(element)
    return tuple(LeftOut(what, source.lines(found[what]), bears) for what, bears in _BEARS_ON_MOTION.items() if what in found)


def _findings(source: Source, root: etree._Element) -> Iterator[tuple[str, etree._Element]]:
    for element in root.iterchildren("*"):
        tag = literal_tag(element)
        yield from _of_part(f"robot/{tag}", element)
        if tag in ("link", "joint", "drake:joint"):
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
    """True for the elements of Gazebo and Drake that the equations of motion hold: springs and rotors."""
    return element.find("springStiffness") is not None or any(literal_tag(part) == "drake:rotor_inertia" for part in element.iter("*"))


def _of_joint(source: Source, joint: etree._Element) -> Iterator[tuple[str, etree._Element]]:
    kind, limit, dynamics = joint.get("type"), joint.find("limit"), joint.find("dynamics")
    if limit is not None:
        if kind in _LIMITED and source.number(limit, "lower", 0.0) < source.number(limit, "upper", 0.0):
            yield _LIMITS, limit
        if {"effort", "velocity"} & set(limit.attrib):
            yield _EFFORT, limit
    if dynamics is not None and kind != "fixed":
        if source.number(dynamics, "friction", 0.0):
            yield _FRICTION, dynamics
        if source.number(dynamics, "damping", 0.0) and kind in _OF_SEVERAL:
            yield _DAMPING, dynamics
