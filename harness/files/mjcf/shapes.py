"""The shapes of an MJCF that may touch, and what it says of pairs of them.

Source: MuJoCo documentation, XML reference, ``body/geom``, ``contact/pair``, ``contact/exclude`` and ``option/flag``.
"""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence

from lxml import etree

from harness.errors import InvalidModel
from harness.files.document.source import Source
from harness.files.given import Direction, Placement, Vector, vector
from harness.files.mjcf.attributes import Attributes, inside, is_on, resolved, resolved_text
from harness.files.shapes import BOX, CAPSULE, LEAST_FRICTION, PLANE, SPHERE, ContactNumbers, Shape, Shapes
from harness.files.tree import WORLD, Tree

# Numbers of ``size`` of a shape that stands by a pose, and of one between two points.
_SIZES = {PLANE: (0, 0), SPHERE: (1, 1), CAPSULE: (2, 1), BOX: (3, 1)}
_BETWEEN = (CAPSULE, BOX)
_FRICTION = (1.0, 0.005, 0.0001)
_PAIR_FRICTION = (1.0, 1.0, 0.005, 0.0001, 0.0001)


def shapes_in(source: Source, tree: Tree) -> Shapes:
    """The shapes of a file whose included files and replicas are in place."""
    root, attributes = source.root, Attributes(source)
    # An included file has a worldbody of its own, whose shapes are those of one world.
    worlds = list(root.iterchildren("worldbody"))
    elements = [body for world in worlds for body in world.iter("body")]
    # The tree has them in this order; replicas stand at one place.
    names = {element: body.name for element, body in zip(elements, tree.bodies, strict=True)}
    try:
        explicit = defaultdict[frozenset[str], list[ContactNumbers]](list)
        for one in root.iterfind("contact/pair"):
            explicit[_pair(one)].append(_numbers_of(attributes, one))
        paired = frozenset(itertools.chain.from_iterable(explicit))
        shapes = tuple(
            shape
            for owner, parts in [(WORLD, worlds), *((names[body], [body]) for body in elements)]
            for shape in _of_body(source, attributes, (owner, parts), paired)
        )
    except (InvalidModel, ValueError) as error:
        return Shapes(why_not=f"has shapes that are not read: {error}")
    return Shapes(
        shapes=shapes,
        excluded=frozenset(frozenset((one.get("body1"), one.get("body2"))) for one in root.iterfind("contact/exclude")),
        explicit=dict(explicit),
        filters_parents=is_on(root, "filterparent"),
        why_not=_why_not(root),
    )


def _why_not(root: etree._Element) -> str:
    if [flag.get("override") for flag in root.iterfind("option/flag[@override]")][-1:] == ["enable"]:
        return "overrides the numbers of all contacts"
    if root.find("worldbody//body[@mocap='true']") is not None:
        return "has bodies that are moved from outside"
    return "has deformable bodies" if root.find("deformable") is not None or root.find("worldbody//flexcomp") is not None else ""


def _pair(pair: etree._Element) -> frozenset[str]:
    return frozenset((str(pair.get("geom1")), str(pair.get("geom2"))))


def _numbers_of(attributes: Attributes, pair: etree._Element) -> ContactNumbers:
    """The numbers that a pair gives its contacts, which take nothing from its shapes."""
    friction = [max(LEAST_FRICTION, float(one)) for one in attributes.numbers(pair, "friction", _PAIR_FRICTION)]
    softness = attributes.softness(pair)
    margin, gap = (float(attributes.number(pair, name, 0.0)) for name in ("margin", "gap"))
    return ContactNumbers(
        friction=tuple(friction[: int(resolved_text(pair, "condim", "3")) - 1]),
        solref=tuple(map(float, softness.solref)),
        solimp=tuple(map(float, softness.solimp)),
        margin=margin,
        detected=margin + gap,
        sliding=tuple(map(float, attributes.numbers(pair, "solreffriction", (0.0, 0.0)))),
    )


def _of_body(
    source: Source, attributes: Attributes, body: tuple[str, Sequence[etree._Element]], paired: Collection[str]
) -> Iterator[Shape]:
    """The shapes of a body, of its name and elements, that may touch; those ``paired`` by name do although they have no types."""
    owner, number = body[0], 0
    for geom in (one for element in body[1] for one in inside(element, "geom")):
        contype, conaffinity = (int(resolved_text(geom, name, "1")) for name in ("contype", "conaffinity"))
        number += bool(contype or conaffinity)
        if not (contype or conaffinity or geom.get("name") in paired):
            continue
        is_mesh = resolved(geom, "mesh") is not None
        kind = "mesh" if is_mesh else resolved_text(geom, "type", SPHERE)
        points = attributes.numbers(geom, "fromto", (0,) * 6) if kind in _BETWEEN and resolved(geom, "fromto") is not None else ()
        pose = attributes.pose(geom)
        ends: tuple[Vector, ...] = ()
        if points:
            first, second = vector(points[:3]), vector(points[3:])
            pose, ends = (*pose[:-1], Placement(first, (Direction(first, second),), second)), (first, second)
        slide, spin, roll = map(float, attributes.numbers(geom, "friction", _FRICTION))
        yield Shape(
            name=geom.get("name") or f"(geom {number} of {owner})",
            body=owner,
            kind=kind,
            size=attributes.numbers(geom, "size", (0, 0, 0))[: _SIZES.get(kind, (0, 0))[bool(points)]],
            pose=pose,
            place=source.place(geom),
            types=(contype, conaffinity),
            condim=int(resolved_text(geom, "condim", "3")),
            priority=int(resolved_text(geom, "priority", "0")),
            solmix=float(attributes.number(geom, "solmix", 1.0)),
            friction=(slide, spin, roll),
            softness=attributes.softness(geom),
            margin=float(attributes.number(geom, "margin", 0.0)),
            gap=float(attributes.number(geom, "gap", 0.0)),
            ends=ends,
        )
