"""The sensors of an MJCF that the motion of its bodies decides: velocities and accelerations of sites, and what a body transmits at one.

Source: MuJoCo documentation, XML reference, ``sensor``.
"""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from harness.files.document.source import Source
from harness.files.document.xml import describe
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
            body, pose = between.at(_site(source, element, kind, between))
        except NotRead as problem:
            yield Sensor(kind, known.name, line, number, why_not=str(problem), place=place)
            continue
        yield Sensor(kind, known.name, line, number, body, pose, _why_not(source, attributes, element, kind, tree), place)


def _site(source: Source, element: etree._Element, kind: SensorKind, between: ElementsBetween) -> etree._Element:
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
    is_pulled = tree.springs or any(body.gravity_compensation for body in tree.bodies)
    if kind.is_transmitted and is_pulled:
        return "is of what bodies transmit, where springs between points or gravcomp pull them from outside"
    return ""
