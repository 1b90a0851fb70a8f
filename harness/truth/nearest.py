"""The nearest points of two shapes, by closed forms in balls: distance, normal and the point midway between their surfaces.

Planes reach everywhere. A capsule is the segment of its axis with a radius, and touches a plane with both of its ends; a box does with
those of its corners that are no higher than its centre, of which corners as high as the centre may be left out. A sphere whose centre is in
a box leaves it through the nearest face. Of capsules that are parallel any two points that face one another are right.

Sources: MuJoCo documentation, API reference, ``mjContact``; Ericson, Real-Time Collision Detection, sections 5.1.3 (boxes) and 5.1.9
(segments).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from flint import arb

from harness.files.shapes import BOX, CAPSULE, PLANE, SPHERE
from harness.trees.shapes import PlacedShape
from harness.verdict import AGREEMENT

# Squares of the sine between two axes that are taken for parallel, and parts of its size by which two centres are apart that are taken
# for one: where these hold the closed form has too few digits for anyone.
_PARALLEL, _SAME = 1e-8, 1e-8
# Squares of the sine between axes that are parallel but for rounding.
_ROUNDED = 1e-30
_ROUNDOFF = 2.0**-53
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
        is_sure: false of a corner of a box that is as high as its centre, to rounding.
    """

    distance: Any
    normal: Vector
    point: Vector
    size: float
    of_normal: float
    of_point: float
    of_frame: float = 1.0
    is_sure: bool = True


def is_closed_form(first: str, second: str) -> bool:
    """True where shapes of two kinds have one here."""
    kinds = {first, second}
    return (kinds <= {PLANE, *_ROUND} and kinds != {PLANE}) or kinds in ({PLANE, BOX}, {SPHERE, BOX})


def nearest(first: PlacedShape, second: PlacedShape, roundoff: float = _ROUNDOFF, every_corner: bool = False) -> list[Nearest] | None:
    """The points of two shapes; None where they have no closed form, or are not unique, or nearly so.

    ``roundoff``: of the numbers that are held against them. ``every_corner``: a box touches a plane with those above its centre, too.
    """
    if not is_closed_form(first.shape.kind, second.shape.kind):
        return None
    if second.shape.kind == PLANE or (second.shape.kind, first.shape.kind) == (SPHERE, BOX):
        found = nearest(second, first, roundoff, every_corner)
        return None if found is None else [_turned(one) for one in found]
    if second.shape.kind == BOX:
        return _corners_on_plane(first, second, roundoff, every_corner) if first.shape.kind == PLANE else _in_box(first, second)
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


def _corners_on_plane(plane: PlacedShape, box: PlacedShape, roundoff: float, every_corner: bool) -> list[Nearest]:
    """The corners that are not surely higher than the centre; of a box in general four."""
    size, found = plane.size + box.size, []
    above, room = _dot(plane.axis, _minus(box.centre, plane.centre)), AGREEMENT * roundoff * (plane.size + box.size)
    for signs in itertools.product((-1, 1), repeat=3):
        corner, height = box.centre, arb(0)
        for sign, axis, half in zip(signs, box.axes, box.halves, strict=True):
            corner, height = _along(corner, axis, sign * half), height + sign * half * _dot(plane.axis, axis)
        if every_corner or not height > room:
            distance = above + height
            point = _along(corner, plane.axis, -distance / 2)
            found.append(Nearest(distance, plane.axis, point, size, 1.0, size, is_sure=every_corner or bool(height < -room)))
    return found


def _in_box(ball: PlacedShape, box: PlacedShape) -> list[Nearest] | None:
    """The point of a sphere and a box; None where the centre is nearly on the surface, or as near to two faces from within."""
    between, size = _minus(ball.centre, box.centre), ball.size + box.size
    places = [_dot(axis, between) for axis in box.axes]
    beyond = [place - _within(place, half) for place, half in zip(places, box.halves, strict=True)]
    apart = _dot(beyond, beyond).sqrt()
    if apart > _SAME * size:
        # The normal turns by as much as the centre moves.
        of_normal, out = 1.0 + size / float(apart.mid()), [part / apart for part in beyond]
    else:
        depths = [half - abs(place) for place, half in zip(places, box.halves, strict=True)]
        least, second, _ = sorted(float(depth.mid()) for depth in depths)
        if least < _SAME * size or second - least < _SAME * size:
            return None
        face = min(range(3), key=lambda axis: float(depths[axis].mid()))
        of_normal, apart = 1.0, -depths[face]
        out = [places[axis] / abs(places[axis]) if axis == face else arb(0) for axis in range(3)]
    normal = [-_dot(out, along) for along in zip(*box.axes, strict=True)]
    distance = apart - ball.radius
    arm = ball.radius + distance / 2
    return [Nearest(distance, normal, _along(ball.centre, normal, arm), size, of_normal, size + abs(float(arm.mid())) * of_normal)]


def are_parallel(first: PlacedShape, second: PlacedShape) -> bool:
    """True for two capsules whose axes are parallel but for rounding."""
    return first.shape.kind == second.shape.kind == CAPSULE and _squared_sine(first, second) < _ROUNDED


def facing(first: PlacedShape, second: PlacedShape, point: Sequence[float]) -> Nearest | None:
    """The points of two parallel capsules that face one another beside ``point``; None where they are nowhere near the least distance."""
    # Of two ends that face one another, the point midway stands beyond both.
    place = _within(_dot(first.axis, _minus([*map(arb, point)], first.centre)), first.half)
    across = _minus(_along(first.centre, first.axis, place), second.centre)
    found = _apart(first, second, (place, _within(_dot(second.axis, across), second.half)))
    least = _apart(first, second, _places(first, second, _minus(second.centre, first.centre)))
    if found is None or least is None:
        return None
    return found if float((found.distance - least.distance).mid()) <= AGREEMENT * _ROUNDOFF * found.size else None


def _squared_sine(first: PlacedShape, second: PlacedShape) -> float:
    return float((1 - _dot(first.axis, second.axis) ** 2).mid())


def _between_segments(first: PlacedShape, second: PlacedShape) -> list[Nearest] | None:
    between, square = _minus(second.centre, first.centre), 1.0
    places = _within(_dot(first.axis, between), first.half), _within(-_dot(second.axis, between), second.half)
    if first.shape.kind == second.shape.kind == CAPSULE:
        square = _squared_sine(first, second)
        if square < _PARALLEL:
            return None
        places = _places(first, second, between)
    found = _apart(first, second, places, square)
    return None if found is None else [found]


def _apart(first: PlacedShape, second: PlacedShape, places: tuple[Any, Any], square: float = 1.0) -> Nearest | None:
    """The points beside two places on the axes, which a roundoff moves by that over ``square``; None where the axes nearly meet there."""
    size = first.size + second.size
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
    return Nearest(distance, normal, point, size, of_normal, size / square + abs(arm) * of_normal)


def _places(first: PlacedShape, second: PlacedShape, between: Vector) -> tuple[Any, Any]:
    """Places on both axes, from the centres: the least of a convex function in a rectangle, inside or on an edge."""
    slant, one, other = _dot(first.axis, second.axis), _dot(first.axis, between), _dot(second.axis, between)
    bent = 1 - slant * slant
    # Of exactly parallel axes this is no number, which is less than nothing.
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
