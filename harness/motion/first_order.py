"""Equations of motion as a first-order system: q' = N(q) v, v' = M^-1 (p - c - g), and the work of the forces.

Quaternions turn with half of their product with the angular velocity in the body's frame; every other
position is the integral of its velocity. No forces are applied. Everything is built of heyoka expressions,
so that a Taylor integrator or a whole step of another one compiles into one function.

Source: Featherstone, Rigid Body Dynamics Algorithms, equation 4.13 (quaternion rates); Diebel, Representing
attitude, 2006, section 6.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.programs.kernels import MOST_INSTRUCTIONS_UNROLLED, heyoka_expressions, solve_symmetric
from harness.programs.machine_code import load_heyoka
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.program import right_hand_side

Expressions = Sequence[Any]


@dataclass(frozen=True)
class FirstOrderSystem:
    """One chart of a mechanism as a first-order system; parameter i is heyoka's ``par[i]``.

    Attributes:
        mechanism: the mechanism; chart: which of ``mechanism.charts(False)`` the equations are from.
    """

    mechanism: Mechanism
    chart: int = 0

    @property
    def is_long(self) -> bool:
        """True if it is to be compiled in compact mode."""
        return len(self.mechanism.charts(linear_velocity_in_body=False)[self.chart].instructions) > MOST_INSTRUCTIONS_UNROLLED

    def compiled(self, expressions: Expressions, variables: Expressions) -> Any:
        """A function (inputs, outputs=None, time=None) of arrays that evaluates ``expressions`` at the mechanism's parameters."""
        heyoka = load_heyoka()

        function = heyoka.cfunc(list(expressions), vars=list(variables), compact_mode=self.is_long)
        # heyoka wants as many parameters as the highest that occurs.
        parameters = np.array(self.mechanism.parameter_values[: function.nparams])
        return functools.partial(function, pars=parameters)

    def variables(self) -> tuple[list[Any], list[Any]]:
        """Symbols of q (nq) and v (nv), which no mechanism's names clash with."""
        heyoka = load_heyoka()

        mechanism = self.mechanism
        positions = [heyoka.expression(f"q{i}") for i in range(mechanism.nq)]
        return positions, [heyoka.expression(f"v{i}") for i in range(mechanism.nv)]

    def position_rates(self, q: Expressions, v: Expressions) -> list[Any]:
        """q', (nq)."""
        rates: list[Any] = []
        for coordinate in range(self.mechanism.nv):
            first = max((place for place in self.mechanism.attitudes if place <= coordinate < place + 3), default=None)
            if first is None:
                rates.append(v[coordinate])
            elif first == coordinate:
                w, x, y, z = q[len(rates) : len(rates) + 4]
                a, b, c = v[first : first + 3]
                doubled = [-x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a]
                rates.extend(0.5 * rate for rate in doubled)
        return rates

    def accelerations(self, q: Expressions, v: Expressions, time: Any) -> list[Any]:
        """v', (nv)."""
        terms = heyoka_expressions(self.mechanism.charts(linear_velocity_in_body=False)[self.chart], self._inputs(q, v, time))
        return solve_symmetric(terms["mass"], right_hand_side(terms))

    def energies(self, q: Expressions, v: Expressions, time: Any) -> dict[str, Any]:
        """The outputs of the energy program of one number each."""
        outputs = heyoka_expressions(self.mechanism.energy_programs[self.chart], self._inputs(q, v, time))
        return {name: values[0] for name, values in outputs.items() if name != "forces"}

    def generalised_forces(self, q: Expressions, v: Expressions, time: Any) -> list[Any]:
        """The non-conservative generalised forces Q, (nv)."""
        return heyoka_expressions(self.mechanism.energy_programs[self.chart], self._inputs(q, v, time))["forces"]

    def _inputs(self, q: Expressions, v: Expressions, time: Any) -> list[Any]:
        heyoka = load_heyoka()

        parameters = [heyoka.par[i] for i in range(len(self.mechanism.parameters))]
        return [*q, *v, *[heyoka.expression(0.0)] * self.mechanism.nv, time, *parameters]


def conjugate_product(a: Array, b: Array) -> Array:
    """conj(a) b for quaternions (n, 4), as (w, x, y, z)."""
    scalar = np.sum(a * b, axis=-1, keepdims=True)
    vector = a[..., :1] * b[..., 1:] - b[..., :1] * a[..., 1:] - np.cross(a[..., 1:], b[..., 1:])
    return np.concatenate([scalar, vector], axis=-1)


def rotation_vectors(quaternions: Array) -> Array:
    """Rotation vectors (n, 3), no longer than pi, of quaternions (n, 4) of any length but 0."""
    scalar, vector = quaternions[..., :1], quaternions[..., 1:]
    sine = np.linalg.norm(vector.astype(np.float64), axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, np.abs(scalar).astype(np.float64))
    ratio = np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 0)
    return np.asarray(np.where(scalar < 0, -1.0, 1.0) * ratio * vector, dtype=np.float64)


def displacement(mechanism: Mechanism, start: Array, end: Array) -> Array:
    """Tangent vectors (n, nv) from positions ``start`` to ``end``, (n, nq) each: a rotation as its vector in the body's frame."""
    parts: list[Array] = []
    position = 0
    for coordinate in range(mechanism.nv):
        first = max((place for place in mechanism.attitudes if place <= coordinate < place + 3), default=None)
        if first is None:
            parts.append((end[:, position : position + 1] - start[:, position : position + 1]).astype(np.float64))
            position += 1
        elif first == coordinate:
            turned = conjugate_product(start[:, position : position + 4], end[:, position : position + 4])
            parts.append(rotation_vectors(turned))
            position += 4
    return np.concatenate(parts, axis=1)


def linear_velocities_turned(mechanism: Mechanism, q: Array, v: Array, into_body: bool) -> Array:
    """``v`` (n, nv) with the linear velocities of free joints given in the other frame: the body's, or the joint's."""
    turned = v.copy()
    for number, place in enumerate(mechanism.attitudes):
        if mechanism.joints.count(mechanism.joints[place]) == 6:
            quaternion = q[:, place + number : place + number + 4]
            sign = -1.0 if into_body else 1.0
            scalar, axis = quaternion[:, :1], sign * quaternion[:, 1:]
            linear = v[:, place - 3 : place]
            cross = np.cross(axis, linear)
            square = np.sum(quaternion**2, axis=1, keepdims=True)
            turned[:, place - 3 : place] = linear + 2 * (scalar * cross + np.cross(axis, cross)) / square
    return turned
