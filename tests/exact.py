"""An exact evaluation of any system by mpmath, and the mechanism of a system that has no file."""

from __future__ import annotations

import functools
from collections.abc import Callable
from functools import cached_property
from typing import Any

import flint
import mpmath
import sympy as sp

from harness.lagrange.assembly import constraints_of, energy_program_of, program_of
from harness.lagrange.derivation import load_system
from harness.lagrange.equations import EquationsOfMotion, derive
from harness.lagrange.system import TIME, System
from harness.library import Library
from harness.programs.mechanisms.constraint_forces import by_multipliers, constrained_program
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import DEFAULT_RATES

DIGITS = 80
# Bits that elimination may lose of those of mpmath.
_GUARD_BITS = 64


def solved(matrix: mpmath.matrix, right: mpmath.matrix) -> mpmath.matrix:
    """The solution of a linear system to the precision of mpmath, whose own elimination takes twenty times as long.

    Raises:
        ZeroDivisionError: the matrix is singular.
    """
    with flint.ctx.workprec(mpmath.mp.prec + _GUARD_BITS):
        balls, sides = (flint.arb_mat(part.rows, part.cols, list(map(flint.arb, part))) for part in (matrix, right))
        middles = [ball.mid().man_exp() for ball in balls.solve(sides).entries()]
    return mpmath.matrix([mpmath.ldexp(int(mantissa), int(exponent)) for mantissa, exponent in middles])


class Exact:
    """A system evaluated by mpmath at ``DIGITS`` digits, without the program and the kernels under test.

    Arguments are, in this order: q, v, tau, time, parameters, as one flat list.
    """

    def __init__(self, system: System, equations: EquationsOfMotion) -> None:
        self.system, self.equations = system, equations
        self.nv = len(equations.coordinates)
        self.forces = [sp.Symbol(f"applied_{i}") for i in range(self.nv)]
        self.arguments = [*equations.coordinates, *equations.rates, *self.forces, TIME, *system.parameters]
        self.parameters = [mpmath.mpf(value) for value, _ in system.parameters.values()]
        self._last: tuple[tuple[Any, ...], Any] | None = None

    def function(self, expressions: Any, extra: Any = ()) -> Callable[..., Any]:
        """``expressions`` as a function of the flat list of arguments, and of ``extra`` symbols."""
        compiled = sp.lambdify([*self.arguments, *extra], list(expressions), modules="mpmath", cse=True)

        def evaluate(arguments: Any, *others: Any) -> Any:
            with mpmath.workdps(DIGITS):
                return compiled(*map(mpmath.mpf, arguments), *map(mpmath.mpf, others))

        return evaluate

    @cached_property
    def _mass_and_force(self) -> Callable[..., Any]:
        equations = self.equations
        force = sp.Matrix(self.forces) + equations.passive_forces - equations.velocity_terms - equations.gravity_terms
        return self.function([*equations.mass_matrix, *force])

    def mass_and_force(self, arguments: Any) -> tuple[mpmath.matrix, mpmath.matrix]:
        """M and tau + p - c - g; those of the last arguments are kept, because norms and accelerations come in turns."""
        asked = tuple(arguments)
        if self._last is None or self._last[0] != asked:
            self._last = asked, self._mass_and_force(asked)
        values = self._last[1]
        with mpmath.workdps(DIGITS):
            mass = mpmath.matrix([values[i * self.nv : (i + 1) * self.nv] for i in range(self.nv)])
            return mass, mpmath.matrix(values[self.nv**2 :])

    def mass(self, arguments: Any) -> mpmath.matrix:
        return self.mass_and_force(arguments)[0]

    def accelerations(self, arguments: Any) -> mpmath.matrix:
        """Those of M a + J' lambda = tau + p - c - g, J a = -J' v, where there are constraints; what J does is a central difference."""
        with mpmath.workdps(DIGITS):
            mass, force = self.mass_and_force(arguments)
            rows = len(self.equations.constraint_rows)
            if not rows:
                return solved(mass, force)
            step, v = mpmath.mpf(10) ** -25, list(map(mpmath.mpf, arguments[self.nv : 2 * self.nv]))
            jacobian, ahead, behind = (self._jacobian_at(arguments, v, s) for s in (0, step, -step))
            bias = (ahead - behind) / (2 * step) * mpmath.matrix(v)
            whole, right = mpmath.zeros(self.nv + rows), mpmath.zeros(self.nv + rows, 1)
            for i in range(self.nv):
                right[i] = force[i]
                for j in range(self.nv):
                    whole[i, j] = mass[i, j]
                for row in range(rows):
                    whole[i, self.nv + row] = whole[self.nv + row, i] = jacobian[row, i]
            for row in range(rows):
                right[self.nv + row] = -bias[row]
            return solved(whole, right)[: self.nv, 0]

    def _jacobian_at(self, arguments: Any, v: list[mpmath.mpf], step: mpmath.mpf) -> mpmath.matrix:
        """J where the positions have moved by v times ``step``."""
        moved = [mpmath.mpf(q) + rate * step for q, rate in zip(arguments[: self.nv], v, strict=True)]
        entries = self._jacobian([*moved, *arguments[self.nv :]])
        return mpmath.matrix([entries[start : start + self.nv] for start in range(0, len(entries), self.nv)])

    @cached_property
    def _jacobian(self) -> Callable[..., Any]:
        return self.function([*self.equations.constraint_jacobian])

    def energy_norm(self, arguments: Any, vector: Any) -> mpmath.mpf:
        with mpmath.workdps(DIGITS):
            return mpmath.sqrt((vector.T * self.mass(arguments) * vector)[0])

    def along_the_motion(self, arguments: Any, accelerations: Any, step: mpmath.mpf) -> list[mpmath.mpf]:
        """The arguments a time ``step`` later, to second order in it."""
        n = self.nv
        q, v = arguments[:n], arguments[n : 2 * n]
        return [
            *(x + rate * step + a * step**2 / 2 for x, rate, a in zip(q, v, accelerations, strict=True)),
            *(rate + a * step for rate, a in zip(v, accelerations, strict=True)),
            *arguments[2 * n : 3 * n],
            arguments[3 * n] + step,
            *arguments[3 * n + 1 :],
        ]

    def energy_balance(self, arguments: Any) -> tuple[mpmath.mpf, mpmath.mpf]:
        """(residual, size of the energies and rates in it) of dh/dt = sum (Q + tau) v - dL/dt (chapter 7.9).

        Both time derivatives are central differences whose step leaves 50 digits.
        """
        n = self.nv
        with mpmath.workdps(DIGITS):
            step = mpmath.mpf(10) ** -25
            # Of the tree: states need not close constraints, whose forces would do work then.
            accelerations = solved(*self.mass_and_force(arguments))
            ahead, behind = (self._energies(self.along_the_motion(arguments, accelerations, s))[0] for s in (step, -step))
            later, earlier = (
                self._energies([*arguments[: 3 * n], arguments[3 * n] + s, *arguments[3 * n + 1 :]])[1] for s in (step, -step)
            )
            _, _, power, size = self._energies(arguments)
            residual = (ahead - behind) / (2 * step) - power + (later - earlier) / (2 * step)
            return residual, (1 + size) * (1 + max(map(abs, [*accelerations, *arguments[n : 2 * n]])))

    @cached_property
    def _energies(self) -> Callable[..., Any]:
        """h, L, the power of Q + tau, and |T| + |V| + |power|."""
        kinetic, potential, rates = self.equations.kinetic, self.equations.potential, self.equations.rates
        h = sum((v * kinetic.diff(v) for v in rates), -kinetic) + potential
        work = zip(self.equations.generalised_forces, self.forces, rates, strict=True)
        power = sum((given + applied) * v for given, applied, v in work)
        return self.function([h, kinetic - potential, power, abs(kinetic) + abs(potential) + abs(power)])

    def euler_lagrange(self, arguments: Any, accelerations: Any) -> list[mpmath.mpf]:
        """d/dt(dL/dv) - dL/dq - Q, all derivatives central differences that leave 30 digits: no symbolic step at all."""
        n = self.nv
        with mpmath.workdps(DIGITS):
            step = mpmath.mpf(10) ** -20
            arguments = list(map(mpmath.mpf, arguments))

            def slope(index: int, at: list[mpmath.mpf]) -> mpmath.mpf:
                ahead, behind = (self._lagrangian([*at[:index], at[index] + s, *at[index + 1 :]])[0] for s in (step, -step))
                return (ahead - behind) / (2 * step)

            later, earlier = (self.along_the_motion(arguments, accelerations, s) for s in (step, -step))
            forces = self._lagrangian(arguments)[1:]
            return [
                (slope(n + i, later) - slope(n + i, earlier)) / (2 * step) - slope(i, arguments) - force for i, force in enumerate(forces)
            ]

    @cached_property
    def _lagrangian(self) -> Callable[..., Any]:
        plain = dict(zip(self.system.rates, self.equations.rates, strict=True))
        position = dict(zip(self.system.coordinates, self.equations.coordinates, strict=True))
        forces = [self.system.generalised_forces.get(q, sp.S.Zero) for q in self.system.coordinates]
        return self.function([e.xreplace(plain).xreplace(position) for e in (self.system.kinetic - self.system.potential, *forces)])


@functools.cache
def system_of(name: str) -> System:
    return load_system(Library.built_in().system_path(name))[0]


@functools.cache
def exact_of(name: str) -> Exact:
    """One for all the test files of a process, with the functions it has compiled."""
    system = system_of(name)
    return Exact(system, derive(system))


def mechanism_of(system: System) -> Mechanism:
    equations = derive(system)
    tree = program_of(system, equations)
    constraints = constraints_of(system, tree) if system.constraints else None
    return Mechanism(
        name="test",
        description="",
        source="",
        coordinates=tuple(symbol.name for symbol in equations.coordinates),
        joints=tuple(system.coordinates.values()),
        parameters=tuple((symbol.name, float(value), unit) for symbol, (value, unit) in system.parameters.items()),
        gravity=0.0,
        total_mass=1.0,
        rotating=system.rotating,
        position_ranges=tuple(system.ranges.get(q) for q in system.coordinates),
        rate_ranges=tuple(system.ranges.get(v, DEFAULT_RATES) for v in system.rates),
        force_ranges=tuple((-10.0, 10.0) for _ in system.coordinates),
        program=tree if constraints is None else constrained_program(constraints, by_multipliers),
        constraints=constraints,
        energy_programs=(energy_program_of(system, equations),),
        equations_text="",
        equations_mathml="",
        derivation_seconds=0.0,
    )
