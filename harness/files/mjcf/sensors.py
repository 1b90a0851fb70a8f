"""The sensors of an MJCF that its motion and its actuators decide: of sites and joints, of what a body transmits, and of actuators.

Source: MuJoCo documentation, XML reference, ``sensor``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from lxml import etree

from harness.files.document.source import Source
from harness.files.document.xml import describe
from harness.files.equalities import Polygon
from harness.files.findings import SWITCHED_OFF
from harness.files.mjcf.attributes import Attributes, NotRead, is_on, named
from harness.files.mjcf.between import ElementsBetween
from harness.files.tree import Sensor, SensorKind, Tree

_OBJECT = "objtype"


def sensors_of(source: Source, attributes: Attributes, between: ElementsBetween, tree: Tree) -> Iterator[Sensor]:
    """Those of the kinds of ``SensorKind`` in the order of the file; raises InvalidModel where a number is none."""
    for number, element in enumerate(source.root.iterfind("sensor/*")):
        if element.tag not in list(SensorKind):
            continue
        place, (line,), kind = source.place(element), source.lines([element]), SensorKind(str(element.tag))
        known = Sensor(kind, str(element.get("name") or ""), line, number, place=place)
        try:
            known = _measured(source, element, known, between)
        except NotRead as problem:
            yield replace(known, why_not=str(problem))
            continue
        yield replace(known, why_not=_why_not(source, attributes, element, kind, tree))


def _measured(source: Source, element: etree._Element, known: Sensor, between: ElementsBetween) -> Sensor:
    """The sensor with its site, its actuator or its joint."""
    if known.kind is SensorKind.ACTUATOR_FORCE:
        actuators = {str(one.get("name")): number for number, one in enumerate(source.root.iterfind("actuator/*")) if one.get("name")}
        return replace(known, actuator=actuators[named(element, "actuator", actuators)])
    if known.kind is SensorKind.JOINT_ACTUATOR_FORCE or known.kind.is_of_joints:
        return replace(known, joint=named(element, "joint", between.singles))
    body, pose = between.at(_site(element, known.kind, between))
    return replace(known, body=body, pose=pose)


def _site(element: etree._Element, kind: SensorKind, between: ElementsBetween) -> etree._Element:
    if kind in (SensorKind.LINEAR_ACCELERATION, SensorKind.ANGULAR_ACCELERATION):
        if element.get(_OBJECT) != "site":
            raise NotRead(f"is about a {element.get(_OBJECT)}; name a site in its place to have it judged")
        return between.sites[named(element, "objname", between.sites)]
    return between.sites[named(element, "site", between.sites)]


def _why_not(source: Source, attributes: Attributes, element: etree._Element, kind: SensorKind, tree: Tree) -> str:
    """Why its value is not judged; "" where it is."""
    if not is_on(source.root, "sensor"):
        return SWITCHED_OFF
    if attributes.number(element, "cutoff", 0.0):
        return f"{describe(element)} has a cutoff, which hides what is beyond"
    if kind.is_transmitted and (pulling := next(_pulling(source, tree), "")):
        return f"is of what bodies transmit, where {pulling} them from outside"
    return ""


def _pulling(source: Source, tree: Tree) -> Iterator[str]:
    """Elements that act on bodies and through no joint, but for equalities of points and frames, which stand in the truth."""
    if tree.springs or any(body.gravity_compensation for body in tree.bodies):
        yield "springs between points or gravcomp pull"
    if source.root.find("actuator/*[@site]") is not None:
        yield "actuators at sites push"
    is_tied = source.root.find("equality/tendon") is not None and source.root.find("tendon/spatial") is not None
    if is_tied or any(isinstance(one.tendon, Polygon) for one in tree.tendons):
        yield "tendons through sites pull"
