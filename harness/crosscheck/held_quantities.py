"""The quantities that a static audit compares, each with its value as plain data and the measure of its differences.

A difference is measured in ulps: divided by the spacing of float64 at the natural magnitude of the quantity, which is the
largest value or norm that is compared; for points at least the mechanism's length, the farthest of its points from the
origin, since a point that engines reach by adding offsets is rounded like the offsets; for an inertia its largest principal
moment; for an axis 1.

What no motion feels is not compared: where on its axis a hinge has its anchor, any anchor of a slide, the centre of what has
no mass, the reference of what has no stiffness. MuJoCo takes no moving body whose mass or principal moment is below
``LEAST``, so an MJCF writes that much where a URDF has nothing: the two are the same.

Source: MuJoCo documentation, XML reference, compiler/boundmass (mjMINVAL).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines import HeldBody, HeldJoint, HeldSpring
from harness.files.joint_kinds import JointKind
from harness.files.lint.formats import LEAST
from harness.files.text import lines as quantities

Value = float | str | list[float]


def _ulps(difference: float, magnitude: float) -> float:
    if difference == 0.0:
        return 0.0
    unit = float(np.spacing(magnitude)) if math.isfinite(magnitude) else 0.0
    return difference / unit if unit and math.isfinite(difference) else math.inf


def _vectors(one: Array, other: Array, least: float = 0.0) -> float:
    norms = [float(np.linalg.norm(vector)) for vector in (one, other, one - other)]
    return _ulps(norms[2], max(norms[0], norms[1], least))


def _kinds(one: HeldJoint, other: HeldJoint, length: float) -> float:
    return 0.0 if (one.kind, one.parent) == (other.kind, other.parent) else math.inf


def _anchors(one: HeldJoint, other: HeldJoint, length: float) -> float:
    if JointKind.SLIDE in (one.kind, other.kind):
        return 0.0
    apart = other.anchor - one.anchor
    # Zero for joints without an axis.
    apart = apart - (apart @ one.axis) * one.axis
    return _vectors(one.anchor, one.anchor + apart, length)


def _masses(one: HeldBody, other: HeldBody, length: float) -> float:
    apart = abs(one.mass - other.mass)
    if min(one.mass, other.mass) < LEAST:
        apart = max(apart - LEAST, 0.0)
    return _ulps(apart, max(one.mass, other.mass))


def _centres(one: HeldBody, other: HeldBody, length: float) -> float:
    if min(one.mass, other.mass) <= LEAST:
        return 0.0
    return _vectors(one.centre, other.centre, length)


def _inertias(one: HeldBody, other: HeldBody, length: float) -> float:
    difference = one.inertia - other.inertia
    if not np.isfinite(difference).all():
        return math.inf
    moments, axes = np.linalg.eigh((one.inertia + other.inertia) / 2)
    largest = max(float(np.abs(np.linalg.eigvalsh(body.inertia)).max()) for body in (one, other))
    # A moment of zero comes out as a rounding of the largest. It excuses nothing about the other axes.
    without = axes[:, moments < LEAST + 8 * np.spacing(largest)]
    about_these = without @ (without.T @ difference @ without) @ without.T
    excused = about_these * min(1.0, LEAST / max(float(np.abs(np.linalg.eigvalsh(about_these)).max()), LEAST))
    return _ulps(float(np.abs(difference - excused).max()), largest)


def _ends(one: HeldSpring, other: HeldSpring, length: float) -> float:
    if one.points.shape != other.points.shape:
        return math.inf
    orders = (other.points, other.points[::-1])
    return min(max(_vectors(a, b, length) for a, b in zip(one.points, order, strict=True)) for order in orders)


def _inertia_values(body: HeldBody) -> list[float]:
    return [float(body.inertia[place]) for place in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


@dataclass(frozen=True)
class HeldQuantity:
    """``value`` of an item as plain data, and ``ulps`` between two items given the mechanism's length [m]."""

    value: Callable[[Any], Value]
    ulps: Callable[[Any, Any, float], float]


def _number(attribute: str, of_springs: bool = False) -> HeldQuantity:
    """A number; ``of_springs``: compared where both items have a stiffness."""

    def ulps(one: Any, other: Any, length: float) -> float:
        first, second = getattr(one, attribute), getattr(other, attribute)
        return _ulps(abs(first - second), max(abs(first), abs(second))) if not of_springs or (one.stiffness and other.stiffness) else 0.0

    return HeldQuantity(lambda item: float(getattr(item, attribute)), ulps)


def _vector(attribute: str, least: float) -> HeldQuantity:
    return HeldQuantity(
        lambda item: np.ravel(getattr(item, attribute)).tolist(),
        lambda one, other, length: _vectors(np.ravel(getattr(one, attribute)), np.ravel(getattr(other, attribute)), least),
    )


OF_JOINTS: Mapping[str, HeldQuantity] = {
    quantities.JOINT: HeldQuantity(lambda joint: f"{joint.kind} on {joint.parent or 'world'}", _kinds),
    quantities.ANCHOR: HeldQuantity(lambda joint: joint.anchor.tolist(), _anchors),
    quantities.AXIS: _vector("axis", 1.0),
    quantities.FRAME: _vector("frame", 1.0),
    quantities.ARMATURE: _number("armature"),
    quantities.DAMPING: _number("damping"),
    quantities.STIFFNESS: _number("stiffness"),
    quantities.SPRING_REFERENCE: _number("spring_reference", of_springs=True),
}
OF_BODIES: Mapping[str, HeldQuantity] = {
    quantities.MASS: HeldQuantity(lambda body: float(body.mass), _masses),
    quantities.CENTRE: HeldQuantity(lambda body: body.centre.tolist(), _centres),
    quantities.INERTIA: HeldQuantity(_inertia_values, _inertias),
}
OF_SPRINGS: Mapping[str, HeldQuantity] = {
    quantities.SPRING_ENDS: HeldQuantity(lambda spring: spring.points.ravel().tolist(), _ends),
    quantities.SPRING_STIFFNESS: _number("stiffness"),
    quantities.SPRING_DAMPING: _number("damping"),
    quantities.SPRING_LENGTH: _number("free_length", of_springs=True),
}
OF_MODELS: Mapping[str, HeldQuantity] = {quantities.GRAVITY: _vector("gravity", 0.0)}
NOTHING = HeldBody(0.0, np.zeros(3), np.zeros((3, 3)))
# Names of all of them.
ALL = (*OF_MODELS, *OF_JOINTS, *OF_BODIES, *OF_SPRINGS)
