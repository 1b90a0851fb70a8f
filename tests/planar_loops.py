"""Planar mechanisms with constraints at 50 digits: energies by SymPy, the saddle point and the regularised optimum by mpmath.

Shares nothing with the equations of the harness and asks no engine.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mpmath as mp
import numpy as np
import sympy as sp

from harness.arrays import Array
from harness.engines import ConstraintLaw, InverseWeight

DIGITS = 50
# A relative step that is far below the digits that matter of a data roundoff, and far above those that are carried.
STEP = mp.mpf(10) ** -18
HALF_ULP = mp.mpf(2) ** -53

# (positions, velocities, parameters) -> (T, V)
Energies = Callable[[Sequence[sp.Symbol], Sequence[sp.Symbol], Sequence[sp.Symbol]], tuple[sp.Expr, sp.Expr]]
# (positions, parameters) -> the rows of each constraint by name
Rows = Callable[[Sequence[sp.Symbol], Sequence[sp.Symbol]], Mapping[str, Sequence[sp.Expr]]]
Answer = Callable[[Sequence[Any]], Any]


@dataclass
class Softened:
    """The laws of a loop's constraints and the inverse weights that they name."""

    laws: Mapping[str, ConstraintLaw]
    weights: Mapping[InverseWeight, float]


@dataclass
class Loop:
    """Coordinates of the tree, energies, rows, and the values of the parameters."""

    joints: tuple[str, ...]
    energies: Energies
    rows: Rows
    values: Sequence[float]
    # The rows that are not identically zero, and the coordinates that they determine.
    independent: Sequence[int]
    determined: Sequence[int]
    assembled: Sequence[float]

    @cached_property
    def _functions(self) -> tuple[Callable[..., Any], list[tuple[str, int]]]:
        n = len(self.joints)
        q, v, p = (sp.symbols(f"{name}0:{count}") for name, count in (("q", n), ("v", n), ("p", len(self.values))))
        kinetic, potential = self.energies(q, v, p)
        rates = sp.Matrix(v)
        momenta = sp.Matrix([sp.diff(kinetic, rate) for rate in v])
        bias = momenta.jacobian(q) * rates - sp.Matrix([sp.diff(kinetic - potential, position) for position in q])
        named = self.rows(q, p)
        rows = sp.Matrix([row for each in named.values() for row in each])
        jacobian = rows.jacobian(q)
        drift = (jacobian * rates).jacobian(q) * rates
        whole = [momenta.jacobian(v), bias, rows, jacobian, drift]
        return sp.lambdify([q, v, p], whole, modules="mpmath", cse=True), [(name, len(each)) for name, each in named.items()]

    def _parts(self, q: Sequence[Any], v: Sequence[Any], p: Sequence[Any] | None = None) -> Any:
        return self._functions[0](*(list(map(mp.mpf, values)) for values in (q, v, self.values if p is None else p)))

    def rigid(self, inputs: Sequence[Any]) -> Any:
        """qdd of the saddle point; ``inputs`` are q, v, tau and the parameters."""
        q, v, tau, p = self._split(inputs)
        mass, bias, _, jacobian, drift = self._parts(q, v, p)
        n, m = len(q), len(self.independent)
        matrix, side = mp.zeros(n + m), mp.zeros(n + m, 1)
        matrix[:n, :n], side[:n, 0] = mass, mp.matrix(list(tau)) - bias
        for place, row in enumerate(self.independent):
            side[n + place] = -drift[row]
            for column in range(n):
                matrix[n + place, column] = matrix[column, n + place] = jacobian[row, column]
        return mp.lu_solve(matrix, side)[:n, 0]

    def softened(self, soft: Softened) -> Answer:
        """qdd of the regularised optimum of ``harness.engines.ConstraintLaw``."""

        def answer(inputs: Sequence[Any]) -> Any:
            q, v, tau, p = self._split(inputs)
            mass, bias, rows, jacobian, drift = self._parts(q, v, p)
            rates = jacobian * mp.matrix(list(v))
            weight, reference = mp.zeros(jacobian.rows), mp.zeros(jacobian.rows, 1)
            first = 0
            for name, count in self._functions[1]:
                law = soft.laws[name]
                places = range(first, first + count)
                d = impedance(law, mp.norm(mp.matrix([rows[i] for i in places])))
                for number, i in enumerate(places):
                    approximate = (
                        (jacobian[i, :] * mp.inverse(mass) * jacobian[i, :].T)[0]
                        if law.weights is None
                        else sum((mp.mpf(soft.weights[one]) for one in law.weights[number]), mp.mpf(0))
                    )
                    weight[i, i] = 1 / max((1 - d) / d * approximate, mp.mpf(law.least_regularisation))
                    reference[i] = -law.damping * rates[i] - law.stiffness * d * rows[i] - (drift[i] if law.has_curvature else 0)
                first += count
            return mp.lu_solve(mass + jacobian.T * weight * jacobian, mp.matrix(list(tau)) - bias + jacobian.T * weight * reference)

        return answer

    def _split(self, inputs: Sequence[Any]) -> tuple[Sequence[Any], ...]:
        n = len(self.joints)
        return inputs[:n], inputs[n : 2 * n], inputs[2 * n : 3 * n], inputs[3 * n :]

    def states(self, count: int, seed: int) -> list[tuple[list[float], list[float], list[float]]]:
        """(q, v, tau) on the constraints, rounded to doubles; the coordinate that is not determined is drawn and led there in steps."""
        generator, n = np.random.default_rng(seed), len(self.joints)
        (free,) = set(range(n)) - set(self.determined)
        found = []
        for _ in range(count):
            q = list(map(mp.mpf, self.assembled))
            for value in np.linspace(self.assembled[free], generator.uniform(-3, 3), 12)[1:].tolist():
                q[free] = mp.mpf(value)
                solution = mp.findroot(lambda *x, q=q: self._residual(q, x), [q[i] for i in self.determined])
                for place, root in zip(self.determined, solution, strict=True):
                    q[place] = root
            found.append((list(map(float, q)), self._rates(q, free, generator.uniform(-5, 5)), generator.uniform(-20, 20, n).tolist()))
        return found

    def _residual(self, q: Sequence[Any], determined: Sequence[Any]) -> list[Any]:
        whole = list(q)
        for place, value in zip(self.determined, determined, strict=True):
            whole[place] = value
        rows = self._parts(whole, [0] * len(q))[2]
        return [rows[i] for i in self.independent]

    def _rates(self, q: Sequence[Any], free: int, rate: float) -> list[float]:
        jacobian = self._parts(q, [0] * len(q))[3]
        matrix = mp.matrix([[jacobian[row, column] for column in self.determined] for row in self.independent])
        solution = mp.lu_solve(matrix, mp.matrix([-jacobian[row, free] * rate for row in self.independent]))
        v = [0.0] * len(q)
        v[free] = rate
        for place, value in zip(self.determined, solution, strict=True):
            v[place] = float(value)
        return v

    def backward_error(self, answer: Answer, state: tuple[Sequence[float], ...], found: Array) -> float:
        """Distance of ``found`` from an answer in data roundoffs, in the norm of the kinetic energy."""
        with mp.workdps(DIGITS):
            inputs = [mp.mpf(value) for part in (*state, self.values) for value in part]
            mass = self._parts(state[0], state[1])[0]

            def norm(x: Any) -> Any:
                return mp.sqrt((x.T * mass * x)[0])

            exact, roundoff = answer(inputs), mp.mpf(0)
            for place, value in enumerate(inputs):
                if value:
                    moved = answer([*inputs[:place], value * (1 + STEP), *inputs[place + 1 :]])
                    roundoff += norm((moved - exact) / STEP)
            return float(norm(mp.matrix(found.tolist()) - exact) / (HALF_ULP * roundoff))

    def worst(self, answer: Answer, states: Sequence[tuple[list[float], ...]], found: Array) -> float:
        """The largest backward error of accelerations (n, nv); inf where one is not finite."""
        if not np.isfinite(found).all():
            return float("inf")
        return max(self.backward_error(answer, state, row) for state, row in zip(states, found, strict=True))


def impedance(law: ConstraintLaw, distance: Any) -> Any:
    """MuJoCo documentation, Computation, Solver parameters: the function d(r)."""
    least, most, width, midpoint, power = (
        mp.mpf(value)
        for value in (law.impedance.least, law.impedance.most, law.impedance.width, law.impedance.midpoint, law.impedance.power)
    )
    if law.impedance.is_constant:
        return (least + most) / 2
    x = min(distance / width, mp.mpf(1))
    y = x**power / midpoint ** (power - 1) if x <= midpoint else 1 - (1 - x) ** power / (1 - midpoint) ** (power - 1)
    return least + y * (most - least)


def _along(angle: Any) -> sp.Matrix:
    return sp.Matrix([sp.cos(angle), sp.sin(angle)])


def _across(angle: Any) -> sp.Matrix:
    return sp.Matrix([-sp.sin(angle), sp.cos(angle)])


def _bar(mass: Any, length: Any, start: sp.Matrix, velocity: sp.Matrix, angle: Any, rate: Any, gravity: Any) -> tuple[Any, Any]:
    """T and V of a uniform bar from its starting point."""
    centre, moving = start + length / 2 * _along(angle), velocity + length / 2 * rate * _across(angle)
    return mass * moving.dot(moving) / 2 + mass * length**2 * rate**2 / 24, mass * gravity * centre[1]


STILL = sp.Matrix([0, 0])


def _four_bar_energies(q: Sequence[Any], v: Sequence[Any], p: Sequence[Any]) -> tuple[Any, Any]:
    a, b, c, d, *masses, g = p
    bars = (
        _bar(masses[0], a, STILL, STILL, q[0], v[0], g),
        _bar(masses[1], b, a * _along(q[0]), a * v[0] * _across(q[0]), q[0] + q[1], v[0] + v[1], g),
        _bar(masses[2], c, sp.Matrix([d, 0]), STILL, q[2], v[2], g),
    )
    return sum(kinetic for kinetic, _ in bars), sum(potential for _, potential in bars)


def four_bar_gap(q: Sequence[Any], p: Sequence[Any]) -> sp.Matrix:
    """From the follower's end to the coupler's (x, z)."""
    a, b, c, d, *_ = p
    return a * _along(q[0]) + b * _along(q[0] + q[1]) - sp.Matrix([d, 0]) - c * _along(q[2])


def _closure(gap: sp.Matrix) -> tuple[Any, ...]:
    return gap[0], sp.Integer(0), gap[1]


FOUR_BAR = Loop(
    joints=("crank", "coupler", "follower"),
    energies=_four_bar_energies,
    rows=lambda q, p: {"closure": _closure(four_bar_gap(q, p))},
    values=(0.6, 1.5, 1.3, 2.0, 0.5, 1.2, 0.9, 9.81),
    independent=(0, 2),
    determined=(1, 2),
    assembled=(0.0, 0.9272952180016122, 1.965587446494658),
)


def _slider_crank_energies(q: Sequence[Any], v: Sequence[Any], p: Sequence[Any]) -> tuple[Any, Any]:
    a, b, crank, rod, slider, g = p
    bars = (
        _bar(crank, a, STILL, STILL, q[0], v[0], g),
        _bar(rod, b, a * _along(q[0]), a * v[0] * _across(q[0]), q[0] + q[1], v[0] + v[1], g),
    )
    return bars[0][0] + bars[1][0] + slider * v[2] ** 2 / 2, bars[0][1] + bars[1][1]


def _slider_crank_rows(q: Sequence[Any], p: Sequence[Any]) -> dict[str, tuple[Any, ...]]:
    a, b, *_ = p
    return {"closure": _closure(a * _along(q[0]) + b * _along(q[0] + q[1]) - sp.Matrix([q[2], 0]))}


SLIDER_CRANK = Loop(
    joints=("crank", "rod", "slide"),
    energies=_slider_crank_energies,
    rows=_slider_crank_rows,
    values=(0.5, 1.3, 1.2, 0.6, 2.0, 9.81),
    independent=(0, 2),
    determined=(1, 2),
    assembled=(0.0, 0.0, 1.8),
)
LOOPS = {"four_bar": FOUR_BAR, "slider_crank": SLIDER_CRANK}
