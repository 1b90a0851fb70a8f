"""The gravity, springs and dampers that an MJCF states, for engines whose readers pass over them.

MuJoCo applies them itself. What no ``ForceElement`` expresses is listed with its line, so that whoever depends on these
elements can refuse the model instead of leaving a force out.

Source: MuJoCo documentation, XML reference, ``option``, ``joint`` and ``tendon/spatial``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from lxml import etree

from harness.files.constraints import Point
from harness.files.tree import WORLD
from harness.models.mjcf.defaults import Written, resolved, resolved_text, writings
from harness.models.mjcf.options import in_degrees, is_on
from harness.models.urdf_forces import ForceElement, JointDamper, JointSpring, PointSpring
from harness.models.xml import Document, describe, shorten


@dataclass(frozen=True)
class Unexpressed:
    """A force, or an inertia, that the file states and that no force element expresses."""

    line: int
    what: str


def read_forces(document: Document) -> tuple[tuple[ForceElement, ...], tuple[Unexpressed, ...]]:
    """The springs and dampers of a valid MJCF that are switched on, joints' before tendons', and what is missing among them."""
    found = [*_of_joints(document), *_of_tendons(document)]
    return (
        tuple(item for item in found if not isinstance(item, Unexpressed)),
        tuple(item for item in found if isinstance(item, Unexpressed)),
    )


def _numbers(text: str) -> tuple[float, ...]:
    return tuple(map(float, text.split()))


def _coefficient(document: Document, element: etree._Element, name: str, stage: str) -> float | Unexpressed:
    """A stiffness or damping, 0 where there is none; Unexpressed where it depends on the displacement or rate."""
    coefficients: list[float] = []
    if not is_on(document.root, stage):
        return 0.0
    for written in writings(element, name):
        further = _numbers(written.text)[len(coefficients) :]
        if any(further if coefficients else further[1:]):
            return _unexpressed(document, element, name, written, "is not linear")
        coefficients += further
    return coefficients[0] if coefficients else 0.0


def _unexpressed(document: Document, element: etree._Element, name: str, written: Written | None, why: str) -> Unexpressed:
    shown = describe(element) if written is None else f'{describe(element)} {name}="{shorten(written.text)}"'
    return Unexpressed(document.lines[element if written is None else written.owner], f"{shown} {why}")


def _of_joints(document: Document) -> Iterator[ForceElement | Unexpressed]:
    for joint in (joint for world in document.root.iterfind("worldbody") for joint in world.iter("joint")):
        name, kind = str(joint.get("name")), resolved_text(joint, "type", "hinge")
        stiffness, damping = (_coefficient(document, joint, *of) for of in (("stiffness", "spring"), ("damping", "damper")))
        if isinstance(stiffness, Unexpressed):
            yield stiffness
        elif stiffness and kind not in ("hinge", "slide"):
            yield _unexpressed(document, joint, "stiffness", resolved(joint, "stiffness"), f"is a spring in a {kind} joint")
        elif stiffness:
            reference = float(resolved_text(joint, "springref", "0"))
            if kind == "hinge" and in_degrees(document.root):
                reference = math.radians(reference)
            yield JointSpring(name, stiffness, reference, _line(document, joint, "stiffness"))
        if isinstance(damping, Unexpressed):
            yield damping
        elif damping:
            yield JointDamper(name, damping, _line(document, joint, "damping"))


def _line(document: Document, element: etree._Element, name: str) -> int:
    written = resolved(element, name)
    return document.lines[element if written is None else written.owner]


def _of_tendons(document: Document) -> Iterator[ForceElement | Unexpressed]:
    sites = {site.get("name"): site for world in document.root.iterfind("worldbody") for site in world.iter("site")}
    for tendon in document.root.iterfind("tendon/*"):
        armature = resolved(tendon, "armature")
        if armature is not None and any(_numbers(armature.text)):
            yield _unexpressed(document, tendon, "armature", armature, "is an inertia in a tendon")
            continue
        stiffness, damping = (_coefficient(document, tendon, *of) for of in (("stiffness", "spring"), ("damping", "damper")))
        if isinstance(stiffness, Unexpressed):
            yield stiffness
        elif isinstance(damping, Unexpressed):
            yield damping
        elif stiffness or damping:
            yield _point_spring(document, tendon, stiffness, damping, sites)


def _point_spring(
    document: Document, tendon: etree._Element, stiffness: float, damping: float, sites: dict[str | None, etree._Element]
) -> PointSpring | Unexpressed:
    path = list(tendon.iterchildren("*"))
    if tendon.tag != "spatial" or [part.tag for part in path] != ["site", "site"]:
        return _unexpressed(document, tendon, "", None, "does not run straight from one site to another")
    written = resolved(tendon, "springlength")
    lengths = _numbers("-1" if written is None else written.text)
    if stiffness and min(lengths) < 0:
        return _unexpressed(document, tendon, "springlength", written, "leaves its springlength to the reader; write it")
    if stiffness and lengths[0] != lengths[-1]:
        return _unexpressed(document, tendon, "springlength", written, "is slack between two lengths")
    ends = [_end(sites.get(part.get("site"))) for part in path]
    if ends[0] is None or ends[1] is None:
        part = path[0] if ends[0] is None else path[1]
        return Unexpressed(document.lines[part], f'<site site="{part.get("site")}"> is not the name of a site right inside a named body')
    (body_a, point_a), (body_b, point_b) = ends[0], ends[1]
    return PointSpring(body_a, point_a, body_b, point_b, max(lengths[0], 0.0), stiffness, damping, document.lines[tendon])


def _end(site: etree._Element | None) -> tuple[str, Point] | None:
    """The body of a site, and its place in it; None where a frame around the site shifts that."""
    if site is None or site.getparent().tag not in ("body", "worldbody"):
        return None
    body = WORLD if site.getparent().tag == "worldbody" else site.getparent().get("name")
    x, y, z = _numbers(resolved_text(site, "pos", "0 0 0"))
    return (body, (x, y, z)) if body else None
