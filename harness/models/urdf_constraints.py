"""The constraints of a URDF: Drake's ball constraint, and joints that mimic another.

Drake gives its constraint no name. The harness finds a constraint by its name, so that the element has a ``name`` here, which Drake
passes over.

Sources: Drake, "Parsing model files", tag drake:ball_constraint, and drake::multibody::MultibodyPlant::AddBallConstraint;
http://wiki.ros.org/urdf/XML/joint, element ``mimic``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from lxml import etree

from harness.files.constraints import End, JointConstraint, ModelConstraint, PointConstraint
from harness.models.checks import numbers
from harness.models.formats import BALL_CONSTRAINT
from harness.models.urdf_forces import Elements
from harness.models.urdf_mimics import Mimic
from harness.models.values import Numbers
from harness.models.xml import Document, add_named, describe, literal_tag, resolve


def read_constraints(document: Document, links: Elements, mimics: Iterable[Mimic]) -> tuple[ModelConstraint, ...]:
    """Ball constraints in document order, then couplings of joints that mimic another, each named like its joint.

    Raises:
        InvalidModel: at the line of a malformed one.
    """
    couplings = [
        JointConstraint(one.joint, one.line, None, one.joint, one.leader, (one.offset, one.multiplier, 0.0, 0.0, 0.0)) for one in mimics
    ]
    return (*_ball_constraints(document, links, {one.name for one in couplings}), *couplings)


def _ball_constraints(document: Document, links: Elements, taken: set[str]) -> Iterator[PointConstraint]:
    known: dict[str, etree._Element] = {}
    for element in document.root.iterchildren("*"):
        if literal_tag(element) != BALL_CONSTRAINT:
            continue
        add_named(document, element, known)
        name = str(element.get("name"))
        if name in taken:
            document.refuse(element, f"{describe(element)} has the name of a joint that mimics another; give each constraint its own")
        first, second = (_end(document, element, links, *tags) for tags in (("body_A", "p_AP"), ("body_B", "p_BQ")))
        if first.body == second.body:
            document.refuse(element, f"{describe(element)} holds two points of link {first.body!r} together; name another link")
        yield PointConstraint(name, document.lines[element], None, (first, second))


def _end(document: Document, element: etree._Element, links: Elements, body: str, point: str) -> End:
    parts: dict[str, etree._Element] = {}
    for part in element.iterchildren("*"):
        tag = literal_tag(part).removeprefix(f"{BALL_CONSTRAINT}_")
        if tag in parts:
            document.refuse(part, f"second <{literal_tag(part)}> in {describe(element)}; expected one, keep the right one")
        parts[tag] = part
    for tag in (body, point):
        if tag not in parts:
            document.refuse(element, f"{describe(element)} has no <{BALL_CONSTRAINT}_{tag}>; add it")
    x, y, z = numbers(document, parts[point], "value", Numbers(3))
    return End(resolve(document, parts[body], "name", links), (x, y, z))
