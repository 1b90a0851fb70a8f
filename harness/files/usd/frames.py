"""Frames of prims: the transform operations of UsdGeom as frames one in the other, and the units of a stage.

The first operation of ``xformOpOrder`` is the outermost. ``rotateXYZ`` turns about x first. A matrix holds the new axes in its rows.

Source: OpenUSD documentation, UsdGeomXformable, and "Stage metrics": a stage that does not say is in centimetres.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from harness.errors import InvalidModel
from harness.files.document.stage import Prim, Property, UsdDocument
from harness.files.given import ORIGIN, Axes, Given, Placement, Pose, Quaternion, Turn, Vector, vector

CENTIMETRE = 0.01
# A scale or an angle between axes that float32 rounds.
_ROUNDING = 1e-5
UNITS = {"X": vector((1, 0, 0)), "Y": vector((0, 1, 0)), "Z": vector((0, 0, 1))}
_INVERTED, _RESET, _OPERATION = "!invert!", "!resetXformStack!", "xformOp:"


def times(number: Given, factor: float) -> Given:
    """A number in another unit, rounded to float64; itself where the unit is the same."""
    return number if factor == 1 else Given(float(number) * factor, number.place, number.attribute, number.index)


@dataclass(frozen=True)
class Units:
    """Units of a stage: ``metre`` [m] of a length, ``kilogram`` [kg] of a mass."""

    metre: float
    kilogram: float

    @classmethod
    def of(cls, layer: Mapping[str, Property]) -> Units:
        """The units of a stage; raises InvalidModel for one that is no size."""
        for name, _ in _UNITS:
            value = layer.get(name)
            if value is not None and not (value.numbers and 0 < value.numbers[0] < math.inf):
                raise InvalidModel(value.place.path, value.place.line, f"{name} is no size of a unit; expected more than zero")
        return cls(*(layer[name].numbers[0] if name in layer else default for name, default in _UNITS))

    def lengths(self, numbers: Sequence[Given]) -> Vector:
        return vector([times(number, self.metre) for number in numbers])


_UNITS = (("metersPerUnit", CENTIMETRE), ("kilogramsPerUnit", 1.0))


class Frames:
    """The frames of the prims of a stage.

    Raises:
        InvalidModel: a prim by which a body stands is scaled, or moved by an operation that is none.
    """

    def __init__(self, document: UsdDocument) -> None:
        self.units, self._prims = Units.of(document.layer), {prim.path: prim for prim in document.prims}

    def between(self, above: str, path: str, any_scale: bool = False) -> Pose:
        """The frame of a prim in that of one above it, "" for the world; ``any_scale`` leaves out how the prim itself is scaled."""
        found: Pose = ()
        while path != above and path:
            prim = self._prims[path]
            if _RESET in prim.words("xformOpOrder") and above:
                prim.refuse("stands in the world, whatever is above it; leave !resetXformStack! out", "xformOpOrder")
            found = (*self._local(prim, any_scale), *found)
            path = "" if _RESET in prim.words("xformOpOrder") else prim.parent
            any_scale = False
        return found

    def _local(self, prim: Prim, any_scale: bool) -> Iterator[Placement]:
        for word in prim.words("xformOpOrder"):
            if word == _RESET:
                continue
            name = word.removeprefix(_INVERTED)
            if not name.startswith(_OPERATION) or name not in prim.values:
                prim.refuse(
                    f"has the operation {word!r} in its xformOpOrder and no such attribute; write it, or take it out", "xformOpOrder"
                )
            kind = name.removeprefix(_OPERATION).partition(":")[0]
            if kind.startswith("scale"):
                if not any_scale and any(abs(float(number) - 1) > _ROUNDING for number in prim.finite(name)):
                    found = " ".join(f"{float(number):g}" for number in prim.finite(name))
                    prim.refuse(f"{name} is {found}; expected 1 1 1 on a body and above it, for a scale has no inertia", name)
                continue
            yield from self._operation(prim, name, kind, word.startswith(_INVERTED))

    def _operation(self, prim: Prim, name: str, kind: str, inverse: bool) -> Iterator[Placement]:
        numbers = prim.finite(name)
        if kind == "translate" and len(numbers) == 3:
            yield Placement(self.units.lengths(numbers), is_inverse=inverse)
        elif kind == "orient" and len(numbers) == 4:
            if rotation := _felt(turned(prim, name)):
                yield Placement(rotation=rotation, is_inverse=inverse)
        elif kind.startswith("rotate") and set(kind[6:]) <= set(UNITS) and len(numbers) == len(kind[6:]):
            # The angles of rotateZYX are those about x, y and z all the same.
            angles = dict(zip(UNITS if len(numbers) == 3 else kind[6:], numbers, strict=True))
            turns = tuple(Turn(UNITS[axis], angles[axis], in_degrees=True) for axis in reversed(kind[6:]) if angles[axis])
            yield Placement(rotation=turns, is_inverse=inverse)
        elif kind == "transform" and len(numbers) == 16:
            yield self._matrix(prim, name, numbers, inverse)
        else:
            prim.refuse(
                f"{name} is no operation that is read; expected translate, orient, rotateXYZ or transform, with finite numbers", name
            )

    def _matrix(self, prim: Prim, name: str, numbers: Sequence[Given], inverse: bool) -> Placement:
        rows = [numbers[4 * row : 4 * row + 3] for row in range(4)]
        products = [[sum(float(a) * float(b) for a, b in zip(one, other, strict=True)) for one in rows[:3]] for other in rows[:3]]
        if any(abs(products[i][j] - (i == j)) > _ROUNDING for i in range(3) for j in range(3)) or _determinant(rows) < 0:
            prim.refuse(f"{name} scales, shears or mirrors; expected a rotation and a translation, for a scale has no inertia", name)
        return Placement(self.units.lengths(rows[3]), (Axes(vector(rows[0]), vector(rows[1])),), is_inverse=inverse)


def _determinant(rows: Sequence[Sequence[Given]]) -> float:
    (a, b, c), (d, e, f), (g, h, i) = ([float(number) for number in row] for row in rows[:3])
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


def turned(prim: Prim, name: str) -> Quaternion:
    """The rotation of an attribute; raises InvalidModel for a quaternion without length."""
    numbers = prim.finite(name)
    if len(numbers) != 4 or not any(numbers):
        prim.refuse(f"{name} is no rotation; expected a quaternion (w, x, y, z) of a length", name)
    return Quaternion(numbers)


def _felt(quaternion: Quaternion) -> tuple[Quaternion, ...]:
    """The rotation where it is one."""
    return (quaternion,) if any(quaternion.components[1:]) else ()


def joint_frame(prim: Prim, side: int, units: Units) -> Placement:
    """The frame of a joint in the prim that ``physics:body0`` or ``physics:body1`` names."""
    position, rotation = f"physics:localPos{side}", f"physics:localRot{side}"
    at = units.lengths(numbers) if len(numbers := prim.finite(position)) == 3 else ORIGIN
    quaternion = turned(prim, rotation) if rotation in prim.values else None
    return Placement(at, () if quaternion is None else _felt(quaternion))


def reversed_placement(placement: Placement) -> Pose:
    """The frame around a placement in it; none where they are one."""
    return (Placement(placement.position, placement.rotation, None, True),) if any(placement.position) or placement.rotation else ()


def opposite(axis: Vector) -> Vector:
    x, y, z = (-component for component in axis)
    return x, y, z


def radians(number: Fraction, place_of: Given) -> Given:
    """An angle of degrees in radians, rounded to float64."""
    return Given(math.radians(number), place_of.place, place_of.attribute, place_of.index)
