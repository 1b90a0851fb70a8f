"""The optimum that MuJoCo documents for contacts, of two bodies whose equations stand here, by another way than the harness.

The cost of an elliptic cone is half the square of the distance to a circular one, in coordinates in which D is 1, and its gradient what
the projection on that cone leaves (Moreau). The gradient of the whole is led to zero by Newton's method with differences for
derivatives, in mpmath with 60 digits; that it is small proves the answer, for F is strongly convex.

The bodies are a free one of mass m and principal moments I, whose velocities are linear in the world and angular in the body, and an arm
on a hinge about y at the origin, of moment ``ARM`` about it, with its centre ``REACH`` along x.

Source: MuJoCo documentation, Computation, sections Primal problem, Friction cones and Parameters; Modeling, section Solver parameters;
Bauschke, Combettes, Convex Analysis and Monotone Operator Theory in Hilbert Spaces, 2nd ed., example 29.12 (projection).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mpmath
from mpmath import mpf

DIGITS = 60
MASS, MOMENTS, ARM_MASS, ARM, REACH, GRAVITY, STEP = 2.0, (0.25, 0.5, 0.375), 1.5, 0.75, 0.5, 9.75, 0.002
MODEL = f"""<mujoco><option gravity="0 0 -{GRAVITY}" {{option}}>{{flag}}</option><worldbody>
<body name="ball"><freejoint/><inertial pos="0 0 0" mass="{MASS}" diaginertia="{MOMENTS[0]} {MOMENTS[1]} {MOMENTS[2]}"/></body>
<body name="arm"><joint name="hinge" axis="0 1 0"/>
<inertial pos="{REACH} 0 0" mass="{ARM_MASS}" diaginertia=".375 {ARM - ARM_MASS * REACH**2} .375"/></body>
</worldbody></mujoco>"""


@dataclass(frozen=True)
class Point:
    """A contact of two of "world", "ball" and "arm", as of ``FoundContact``; ``spring`` and ``damper`` are k and b, rounded."""

    bodies: tuple[str, str]
    point: Sequence[float]
    axes: Sequence[Sequence[float]]
    distance: float
    margin: float
    friction: Sequence[float]
    solimp: Sequence[float]
    spring: float
    damper: float
    sliding: float


def _turn(quaternion: Sequence[float]) -> Any:
    w, x, y, z = (mpf(one) / mpmath.norm([mpf(other) for other in quaternion]) for one in quaternion)
    return mpmath.matrix(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _cross(a: Sequence[Any], b: Sequence[Any]) -> list[Any]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    return sum((one * other for one, other in zip(a, b, strict=True)), mpf(0))


def _row(body: str, q: Sequence[float], turn: Any, point: Sequence[Any], axis: Sequence[Any], about: bool) -> list[Any]:
    """By which each velocity moves a point of a body along an axis, or turns the body about it."""
    found = [mpf(0)] * 7
    if body == "arm":
        spin = [mpf(0), mpf(1), mpf(0)]
        found[6] = _dot(axis, spin if about else _cross(spin, point))
    if body == "ball":
        arm = [point[k] - mpf(q[k]) for k in range(3)]
        for k in range(3):
            spin = [turn[j, k] for j in range(3)]
            found[k] = mpf(0) if about else axis[k]
            found[3 + k] = _dot(axis, spin if about else _cross(spin, arm))
    return found


def _impedance(solimp: Sequence[float], distance: Any) -> Any:
    least, most, width, midpoint, power = map(mpf, solimp)
    x = min(distance / width, mpf(1))
    y = x**power / midpoint ** (power - 1) if x <= midpoint else 1 - (1 - x) ** power / (1 - midpoint) ** (power - 1)
    return least + y * (most - least)


def _translations(bodies: Sequence[str]) -> Any:
    """The sum of the inverse weights, each rounded once."""
    return mpf(
        float(sum(mpf(float({"world": mpf(0), "ball": 1 / mpf(MASS), "arm": mpf(REACH) ** 2 / mpf(ARM) / 3}[one])) for one in bodies))
    )


@dataclass(frozen=True)
class _Cone:
    """Rows J, aref and D of one contact."""

    jacobian: Any
    wanted: Any
    weights: Sequence[Any]
    steepness: Any

    def pull(self, a: Any) -> Any:
        """The gradient of its cost by a."""
        y = self.jacobian * a - self.wanted
        if self.steepness is None:
            left = [weight * min(one, mpf(0)) for weight, one in zip(self.weights, y, strict=True)]
            return self.jacobian.T * mpmath.matrix(left)
        x = [mpmath.sqrt(weight) * one for weight, one in zip(self.weights, y, strict=True)]
        beside = [one - near for one, near in zip(x, _projected(x, self.steepness), strict=True)]
        return self.jacobian.T * mpmath.matrix([mpmath.sqrt(weight) * one for weight, one in zip(self.weights, beside, strict=True)])


def _projected(x: Sequence[Any], steepness: Any) -> list[Any]:
    """The point nearest to x of the cone x_0 >= steepness |x_1, ...|."""
    height, across = x[0], mpmath.norm(x[1:])
    if height >= steepness * across:
        return list(x)
    if steepness * height <= -across:
        return [mpf(0)] * len(x)
    radius = (across + steepness * height) / (1 + steepness**2)
    return [steepness * radius, *(radius * one / across for one in x[1:])]


def _cone(one: Point, q: Sequence[float], v: Any, elliptic: bool, ratio: float) -> _Cone:
    turn, point = _turn(q[3:7]), [mpf(value) for value in one.point]
    axes = [[mpf(value) for value in axis] for axis in one.axes]
    motions = [(axis, False) for axis in axes] + [(axis, True) for axis in axes]
    rows = []
    for axis, about in motions[: 1 + len(one.friction)]:
        first, second = (_row(body, q, turn, point, axis, about) for body in one.bodies)
        rows.append([b - a for a, b in zip(first, second, strict=True)])
    friction, depth = [mpf(value) for value in one.friction], mpf(one.distance) - mpf(one.margin)
    impedance, weight = _impedance(one.solimp, abs(depth)), _translations(one.bodies)
    rest, ratio = (1 - impedance) / impedance, mpf(ratio)
    push = mpf(one.spring) * impedance * depth
    if elliptic and friction:
        first = 1 / (rest * weight)
        weights = [first, *(first * ratio * (mu / friction[0]) ** 2 for mu in friction)]
        jacobian = mpmath.matrix(rows)
        rate = jacobian * v
        dampers = [mpf(one.damper)] + [mpf(one.sliding)] * len(friction)
        wanted = mpmath.matrix([-dampers[i] * rate[i] - (push if not i else 0) for i in range(len(rows))])
        return _Cone(jacobian, wanted, weights, friction[0] / mpmath.sqrt(ratio))
    edges = [
        [n + sign * mu * t for n, t in zip(rows[0], row, strict=True)]
        for mu, row in zip(friction, rows[1:], strict=True)
        for sign in (1, -1)
    ]
    jacobian = mpmath.matrix(edges or rows[:1])
    soft = rest * weight if not friction else 2 * friction[0] ** 2 / ratio * rest * weight * (1 + friction[0] ** 2)
    wanted = -mpf(one.damper) * (jacobian * v) - mpmath.matrix([push] * jacobian.rows)
    return _Cone(jacobian, wanted, [1 / soft] * jacobian.rows, None)


def optimum(
    q: Sequence[float], v: Sequence[float], tau: Sequence[float], points: Sequence[Point], elliptic: bool, ratio: float
) -> list[Any]:
    """The accelerations, (7,)."""
    with mpmath.workdps(DIGITS):
        speed = mpmath.matrix([mpf(one) for one in v])
        spin, moments = list(speed[3:6]), [mpf(one) for one in MOMENTS]
        gyroscopic = _cross(spin, [moment * one for moment, one in zip(moments, spin, strict=True)])
        lever = mpf(ARM_MASS) * mpf(GRAVITY) * mpf(REACH) * mpmath.cos(mpf(q[7]))
        own = [mpf(0), mpf(0), -mpf(MASS) * mpf(GRAVITY), *(-one for one in gyroscopic), lever]
        force = mpmath.matrix([mpf(one) + other for one, other in zip(tau, own, strict=True)])
        mass = [mpf(MASS)] * 3 + moments + [mpf(ARM)]
        cones = [_cone(one, q, speed, elliptic, ratio) for one in points]

        def gradient(a: Any) -> Any:
            found = mpmath.matrix([m * one - pull for m, one, pull in zip(mass, a, force, strict=True)])
            return sum((cone.pull(a) for cone in cones), found)

        def length(own: Any) -> Any:
            return mpmath.sqrt(sum((one**2 / m for one, m in zip(own, mass, strict=True)), mpf(0)))

        a, little = mpmath.matrix([one / m for one, m in zip(force, mass, strict=True)]), mpf(10) ** (-DIGITS // 2)
        for _ in range(200):
            before = gradient(a)
            if length(before) < mpf(10) ** -40:
                return list(a)
            slopes = mpmath.matrix(7, 7)
            for k in range(7):
                moved = a.copy()
                moved[k] += little
                slopes[:, k] = (gradient(moved) - before) / little
            step, share = mpmath.lu_solve(slopes, -before), mpf(1)
            # Along the step F falls, and its derivative rises.
            while _dot(list(gradient(a + share * step)), list(step)) > abs(_dot(list(before), list(step))) / 2 and share > little:
                share /= 2
            a = a + share * step
        raise AssertionError("the gradient is not led to zero")
