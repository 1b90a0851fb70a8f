"""Where two shapes are nearest, by closed forms in balls: distance, normal and the point midway between their surfaces.

Planes reach everywhere. A capsule is the segment of its axis with a radius, and touches a plane with both of its ends.

Sources: MuJoCo documentation, API reference, ``mjContact``; Ericson, Real-Time Collision Detection, section 5.1.9 (segments).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from flint import arb

from harness.files.shapes import CAPSULE, PLANE, SPHERE
from harness.trees.shapes import PlacedShape

# Squares of the sine between two axes that are taken for parallel, and parts of its size by which two centres are apart that are taken
# for one: where these hold the closed form has too few digits for anyone.
_PARALLEL, _SAME = 1e-8, 1e-8
# Sine between an axis and a normal below which a frame is as good as here: nobody needs a tangent along such an axis.
_LEAST_SINE = 1e-4
_ROUND = (SPHERE, CAPSULE)
Vector = Sequence[Any]


@dataclass(frozen=True)
class Nearest:
    """One point of two shapes.

    Attributes:
        distance: of the surfaces, negative where they overlap [m]. normal: from the first to the second. point: midway [m].
        size: of what is added for the distance [m]; of_normal, of_point: what a roundoff of that does to the others.
        of_frame: what it does to tangents of which one is along the axis of a capsule.
    """

    distance: Any
    normal: Vector
    point: Vector
    size: float
    of_normal: float
    of_point: float
    of_frame: float = 1.0


def is_closed_form(first: str, second: str) -> bool:
    """Whether shapes of two kinds have one here."""
    return {first, second} <= {PLANE, *_ROUND} and (first, second) != (PLANE, PLANE)


def nearest(first: PlacedShape, second: PlacedShape) -> list[Nearest] | None:
    """The points of two shapes of such kinds; None where they are not unique, or nearly so."""
    if second.shape.kind == PLANE:
        found = nearest(second, first)
        return None if found is None else [_turned(one) for one in found]
    if first.shape.kind == PLANE:
        signs = (1, -1) if second.shape.kind == CAPSULE else (0,)
        return [_on_plane(first, second, sign) for sign in signs]
    return _between_segments(first, second)


def _turned(one: Nearest) -> Nearest:
    return replace(one, normal=[-part for part in one.normal])


def _on_plane(plane: PlacedShape, other: PlacedShape, sign: int) -> Nearest:
    end = _along(other.centre, other.axis, sign * other.half)
    distance = _dot(plane.axis, _minus(end, plane.centre)) - other.radius
    size = plane.size + other.size
    point = _along(end, plane.axis, -(other.radius + distance / 2))
    square = float((1 - _dot(plane.axis, other.axis) ** 2).mid())
    steep = 1 / max(math.sqrt(max(square, 0.0)), _LEAST_SINE) if sign else 1.0
    return Nearest(distance, plane.axis, point, size, 1.0, size, steep)


def _between_segments(first: PlacedShape, second: PlacedShape) -> list[Nearest] | None:
    between, size = _minus(second.centre, first.centre), first.size + second.size
    square = 1.0
    places = _within(_dot(first.axis, between), first.half), _within(-_dot(second.axis, between), second.half)
    if first.shape.kind == second.shape.kind == CAPSULE:
        square = float((1 - _dot(first.axis, second.axis) ** 2).mid())
        if square < _PARALLEL:
            return None
        places = _places(first, second, between)
    start, end = _along(first.centre, first.axis, places[0]), _along(second.centre, second.axis, places[1])
    gap = _minus(end, start)
    apart = _dot(gap, gap).sqrt()
    if not apart > _SAME * size:
        return None
    normal, distance = [part / apart for part in gap], apart - first.radius - second.radius
    # The normal turns by as much as its ends move, and the point moves along.
    steep, arm = size / float(apart.mid()), float((first.radius + distance / 2).mid())
    of_normal = 1.0 + steep / square
    point = _along(start, normal, first.radius + distance / 2)
    return [Nearest(distance, normal, point, size, of_normal, size / square + abs(arm) * of_normal)]


def _places(first: PlacedShape, second: PlacedShape, between: Vector) -> tuple[Any, Any]:
    """Where on both axes, from the centres: the least of a convex function in a rectangle, inside or on an edge."""
    slant, one, other = _dot(first.axis, second.axis), _dot(first.axis, between), _dot(second.axis, between)
    bent = 1 - slant * slant
    inside = (one - slant * other) / bent, (slant * one - other) / bent
    if abs(inside[0]) < first.half and abs(inside[1]) < second.half:
        return inside
    edges = [(sign * first.half, _within(slant * sign * first.half - other, second.half)) for sign in (1, -1)]
    edges += [(_within(slant * sign * second.half + one, first.half), sign * second.half) for sign in (1, -1)]

    def square(places: tuple[Any, Any]) -> Any:
        s, t = places
        return (s * s + t * t - 2 * slant * s * t - 2 * one * s + 2 * other * t).mid()

    return min(edges, key=square)


def _within(place: Any, half: Any) -> Any:
    return place.min(half).max(-half)


def _along(start: Vector, axis: Vector, way: Any) -> list[Any]:
    return [part + way * one for part, one in zip(start, axis, strict=True)]


def _minus(first: Vector, second: Vector) -> list[Any]:
    return [one - other for one, other in zip(first, second, strict=True)]


def _dot(first: Vector, second: Vector) -> Any:
    return sum(itertools.starmap(lambda one, other: one * other, zip(first, second, strict=True)), arb(0))
