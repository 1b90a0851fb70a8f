"""From a URDF to its tree of bodies.

Source: http://wiki.ros.org/urdf/XML, ``link`` and ``joint``; Drake, "Parsing model files", for ``drake:joint``.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from lxml import etree

from harness.models.model_file import ROOT_TAGS, ModelFile
from harness.models.xml import Document, literal_tag, parse_document
from harness.robots.tree import ORIGIN, WORLD, Body, Inertia, Joint, Placement, Tree, Turn, Vector, vector

_KINDS = {"revolute": "hinge", "continuous": "hinge", "prismatic": "slide", "floating": "free", "ball": "ball"}
_ROLL_PITCH_YAW = (vector((1, 0, 0)), vector((0, 1, 0)), vector((0, 0, 1)))
_JOINTS = ("joint", "drake:joint")
_MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


def read_tree(model: ModelFile, gravity: float) -> Tree:
    """The tree of a validated URDF, whose format holds no gravity [m/s^2, along -z].

    Raises:
        InvalidModel: a planar joint, whose positions engines count differently.
    """
    document = parse_document(model.path, model.text, ROOT_TAGS["urdf"])
    root = document.root
    links = {str(link.get("name")): link for link in root.iterchildren("link")}
    above = {str(joint.find("child").get("link")): joint for joint in root.iterchildren("*") if literal_tag(joint) in _JOINTS}
    more: dict[str, dict[str, Any]] = {one.joint: {"armature": Fraction(one.reflected_inertia)} for one in model.armatures}
    for one in model.mimics:
        more[one.joint] = {"follows": one.leader, "multiplier": Fraction(one.multiplier), "offset": Fraction(one.offset)}
    bodies: list[Body] = []
    waiting = [name for name in links if name not in above or above[name].find("parent").get("link") not in links]
    while waiting:
        name = waiting.pop(0)
        waiting += [child for child, joint in above.items() if joint.find("parent").get("link") == name]
        bodies.append(_body(document, name, links[name], above.get(name), more))
    return Tree(tuple(bodies), (Fraction(0), Fraction(0), -Fraction(gravity)), model.force_elements)


def _body(document: Document, name: str, link: etree._Element, above: etree._Element | None, more: Mapping[str, Mapping[str, Any]]) -> Body:
    inertial = link.find("inertial")
    inertia = None
    if inertial is not None:
        moments = inertial.find("inertia")
        mass = Fraction(float(inertial.find("mass").get("value")))
        inertia = Inertia((_placement(inertial),), mass, tuple(Fraction(float(moments.get(moment))) for moment in _MOMENTS))
    if above is None:
        # The root link is fixed; one called world is the world itself.
        return Body(name, WORLD, (), (), inertia)
    parent = str(above.find("parent").get("link"))
    return Body(name, parent, (_placement(above),), _joints(document, above, more), inertia)


def _joints(document: Document, element: etree._Element, more: Mapping[str, Mapping[str, Any]]) -> tuple[Joint, ...]:
    name, kind = str(element.get("name")), str(element.get("type"))
    if kind == "fixed":
        return ()
    if kind not in _KINDS:
        document.refuse(element, f"joint {name!r} is {kind}; write two prismatic joints and a revolute one in its place")
    axis = ORIGIN if kind in ("ball", "floating") else _vector(element.find("axis"), "xyz", "1 0 0")
    return (Joint(name, _KINDS[kind], axis, **more.get(name, {})),)


def _placement(element: etree._Element) -> Placement:
    """The ``<origin>`` of an element; its roll, pitch and yaw are about axes that stay."""
    origin = element.find("origin")
    turns = [Turn(axis, angle) for axis, angle in zip(_ROLL_PITCH_YAW, _vector(origin, "rpy"), strict=True) if angle]
    return Placement(_vector(origin, "xyz"), tuple(reversed(turns)))


def _vector(element: etree._Element | None, attribute: str, default: str = "0 0 0") -> Vector:
    text = default if element is None else element.get(attribute, default)
    return vector([float(word) for word in text.split()])
