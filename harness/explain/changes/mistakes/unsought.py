"""Mistakes that no diagnosis looks for.

Several numbers of a file are wrong at once: any two, all moments of inertia, or a mass and its centre whose product is right. Readers
answer wrongly above a speed: no number of the file says so, and no slow motion shows it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.explain.changes import Change
from harness.explain.changes.mistakes import Mistake
from harness.explain.changes.numbers import INERTIAS, place_of
from harness.files.model_file import ModelFile
from harness.files.text.scan import Number, TextPlace, find_elements, find_numbers, with_values
from harness.files.text.slots import Anatomy

_MASSES = {("inertial", "mass"), ("mass", "value")}
_CENTRES = {"pos", "xyz"}
# What MuJoCo accepts at least, where the motion feels no inertia.
_NEGLIGIBLE = 1e-12


def _planted(model: ModelFile, kind: str, statement: str, factors: Mapping[Number, Callable[[float], float]]) -> Change:
    """The mistake that multiplies each number by its factor of the size."""

    def at(size: float) -> str:
        return with_values(model.text, {number: number.value * factor(size) for number, factor in factors.items()})

    return Change(kind, statement, tuple(place_of(model, one) for one in factors), at, 0.0)


def _enlarged(size: float) -> float:
    return 1.0 + size


def _enlarged_by_half(size: float) -> float:
    return 1.0 + size / 2


def _reduced(size: float) -> float:
    """The inverse of ``_enlarged``; without a mass there is nothing to undo."""
    return 1.0 / (1.0 + size) if size > -1.0 else 0.0


def _felt(model: ModelFile) -> list[Number]:
    return [one for one in find_numbers(model.text, model.format) if abs(one.value) > _NEGLIGIBLE]


def _two_numbers(parts: Anatomy) -> Iterator[Change]:
    """Each number with the one that is half of the file away, so that every number has its turn and no pair comes twice."""
    numbers = [one for one in _felt(parts.model) if "axis" not in (one.element, one.attribute)]
    half = len(numbers) // 2
    for one, other in zip(numbers[:half], numbers[half:], strict=False):
        statement = f"and {other.element} {other.attribute} in line {other.line} half as much"
        yield _planted(parts.model, "two_numbers", statement, {one: _enlarged, other: _enlarged_by_half})


def _density(parts: Anatomy) -> Iterator[Change]:
    model = parts.model
    moments = [one for one in _felt(model) if one.attribute in INERTIAS.get((model.format, one.element), ())]
    if len({(one.line, one.element) for one in moments}) > 1:
        yield _planted(model, "density", "all moments of inertia by one factor", dict.fromkeys(moments, _enlarged))


def _balanced(parts: Anatomy) -> Iterator[Change]:
    model = parts.model
    numbers = find_numbers(model.text, model.format)
    for inertial in (element for element in find_elements(model.text, model.format) if element.tag == "inertial"):
        own = [one for one in numbers if inertial.holds(one)]
        masses = [one for one in own if (one.element, one.attribute) in _MASSES and one.value > _NEGLIGIBLE]
        centre = [one for one in own if one.attribute in _CENTRES and one.value]
        if masses and centre:
            factors = {**dict.fromkeys(masses, _enlarged), **dict.fromkeys(centre, _reduced)}
            yield _planted(model, "balanced_mass", "with its centre nearer, so that its weight is felt as before", factors)


TWO_NUMBERS = Mistake(
    "two_numbers",
    "two numbers wrong at once",
    "Reiter, A theory of diagnosis from first principles (1987): multiple faults",
    None,
    plants=_two_numbers,
)
DENSITY = Mistake(
    "density",
    "all moments of inertia off by one factor",
    "moments of inertia that a drawing gives for one material, beside masses that were weighed",
    changes=None,
    plants=_density,
)
BALANCED_MASS = Mistake(
    "balanced_mass",
    "mass and centre of mass off, their product and so the torque of the weight right",
    "Atkeson, An, Hollerbach, Estimation of inertial parameters of manipulator loads and links, IJRR 5(3), 1986: first moments",
    changes=None,
    plants=_balanced,
)


# A quarter of the rates that are sampled by default [rad/s], and a drag [1/rad] that is one thousandth of the acceleration there.
SPEED, DRAG = 2.5, 1e-3


class _Dragged:
    """A loaded model, or an engine that loads such, with a drag that sets in above ``SPEED``; else the one that it wraps."""

    def __init__(self, wrapped: Any) -> None:
        self._wrapped = wrapped

    def __getattr__(self, name: str) -> Any:
        return getattr(self._wrapped, name)

    def load(self, *arguments: Any) -> _Dragged:
        return _Dragged(self._wrapped.load(*arguments))

    def forward_dynamics(self, q: Array, v: Array, tau: Array, *time: Array) -> Array:
        excess = np.maximum(np.abs(v) - SPEED, 0.0)
        return np.asarray(self._wrapped.forward_dynamics(q, v, tau, *time) - DRAG * np.sign(v) * excess**2)


def _above_speed(parts: Anatomy) -> Iterator[Change]:
    place, text = TextPlace(0, "engine", "", None, ""), parts.model.text
    yield Change("above_speed", f"a drag above {SPEED:g} per second", (place,), lambda size: text, through=_Dragged)


ABOVE_SPEED = Mistake(
    "above_speed",
    "answers wrong above a speed only",
    "drag, saturation and speed limits that an engine applies and no textbook equation holds",
    changes=None,
    plants=_above_speed,
)
