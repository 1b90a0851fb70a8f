"""What an MJCF says besides the equations of motion of its tree.

Source: MuJoCo documentation, XML reference.
"""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from harness.files.document.source import Source
from harness.files.findings import LeftOut
from harness.files.mjcf.defaults import resolved_text
from harness.files.mjcf.numbers import JOINTS
from harness.files.tree import Tree

# Sections of a file, each of whose elements is one of these.
_SECTIONS = {
    "equality": ("equality constraints", True),
    "actuator": ("actuators", True),
    "deformable": ("deformable bodies", True),
    "sensor": ("sensors", False),
    "keyframe": ("keyframes", False),
    "asset": ("meshes, textures and materials", False),
    "custom": ("custom data", False),
    "extension": ("plugins", True),
}
_ALONE = {"visual": "settings of the picture", "statistic": "settings of the picture", "size": "sizes of memory"}
_IN_BODIES = {"camera": "cameras and lights", "light": "cameras and lights", "plugin": "plugins"}
_READ = ("compiler", "option", "default", "worldbody", "tendon", "contact")
_OF_FLUID = ("density", "viscosity", "wind")


def left_out(source: Source, root: etree._Element, tree: Tree) -> tuple[LeftOut, ...]:
    """What is left out, what bears on the motion first."""
    found: dict[tuple[str, bool], list[etree._Element]] = {}
    for what, bears, element in (*_of_sections(root), *_of_bodies(root), *_of_tendons(root), *_of_joints(source, root, tree)):
        found.setdefault((what, bears), []).append(element)
    parts = [LeftOut(what, source.lines(elements), bears) for (what, bears), elements in found.items()]
    return tuple(sorted(parts, key=lambda part: not part.bears_on_motion))


Found = Iterator[tuple[str, bool, etree._Element]]


def _of_sections(root: etree._Element) -> Found:
    for section in root.iterchildren("*"):
        if section.tag in _SECTIONS:
            for element in section.iterchildren("*"):
                yield *_SECTIONS[section.tag], element
        elif section.tag == "contact":
            for element in section.iterchildren("*"):
                yield ("contacts", True, element) if element.tag == "pair" else ("contacts that are excluded", False, element)
        elif section.tag == "option" and any(_is_felt(section.get(name, "")) for name in _OF_FLUID):
            yield "fluid", True, section
        elif section.tag not in _READ:
            yield _ALONE.get(section.tag, "elements that MJCF does not know"), False, section


def _is_felt(text: str) -> bool:
    """Whether a list of numbers holds another one than 0."""
    return any(word.strip("+-0.") for word in text.split())


def _of_bodies(root: etree._Element) -> Found:
    """Geoms, and what bodies hold besides."""
    for world in root.iterchildren("worldbody"):
        for element in world.iterdescendants("*"):
            if element.tag == "geom":
                touches = any(resolved_text(element, name, "1") != "0" for name in ("contype", "conaffinity"))
                yield ("contacts", True, element) if touches else ("visual geometry", False, element)
            elif element.tag in _IN_BODIES:
                yield _IN_BODIES[element.tag], element.tag == "plugin", element
            elif element.tag == "body":
                if _is_felt(element.get("gravcomp", "")):
                    yield "gravity compensation", True, element
                if element.get("mocap") == "true":
                    yield "bodies moved from outside", False, element


def _of_tendons(root: etree._Element) -> Found:
    for section in root.iterchildren("tendon"):
        for tendon in section.iterchildren("*"):
            if _is_limited(root, tendon):
                yield "tendon limits", True, tendon
            if _is_felt(resolved_text(tendon, "frictionloss")):
                yield "friction loss", True, tendon


def _is_limited(root: etree._Element, tendon: etree._Element) -> bool:
    """Whether a tendon has a range that holds."""
    automatic = next((one.get("autolimits") for one in reversed([*root.iterchildren("compiler")]) if "autolimits" in one.attrib), "true")
    limited = resolved_text(tendon, "limited", "auto")
    return limited == "true" or (limited == "auto" and automatic == "true" and bool(resolved_text(tendon, "range")))


def _of_joints(source: Source, root: etree._Element, tree: Tree) -> Found:
    """Friction and limits, which the tree knows."""
    elements = {source.place(joint): joint for world in root.iterchildren("worldbody") for joint in world.iter(*JOINTS)}
    for joint in tree.joints:
        element = elements[joint.place] if joint.place else root
        if joint.friction_loss:
            yield "friction loss", True, element
        if joint.limits is not None:
            yield "joint limits", True, element
        if resolved_text(element, "actuatorfrcrange"):
            yield "limits of actuators' forces", False, element
