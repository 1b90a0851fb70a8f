"""The results of chapter 7.9, each against the derivation."""

from __future__ import annotations

import random
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp
from support import energy_function, is_zero, linearised

from harness.lagrange.derivation import load_system
from harness.lagrange.equations import EquationsOfMotion, derive
from harness.lagrange.system import System
from harness.library import Library

# Zero at 80 digits of which differences leave 50, relative to the largest term.
AT_ZERO = mpmath.mpf(10) ** -40
# States of every system at which mpmath evaluates an identity: one that holds at a state chosen at random holds at all.
COUNT = 2
SEED = ("collar", "bar_pendulum", "spring_damper", "cart_pendulum", "arm_2r")


def seed(name: str) -> tuple[System, EquationsOfMotion, dict[str, Any]]:
    """A seed system, its equations, and its symbols by name, with the applied forces as tau0, tau1, ..."""
    system, _ = load_system(Library.built_in().system_path(name))
    equations = derive(system)
    symbols = {symbol.name: symbol for symbol in (*equations.coordinates, *equations.rates, *system.parameters)}
    symbols |= {f"tau{i}": sp.Symbol(f"tau{i}") for i in range(len(equations.coordinates))}
    return system, equations, symbols


def accelerations(equations: EquationsOfMotion) -> sp.Matrix:
    applied = sp.Matrix([sp.Symbol(f"tau{i}") for i in range(len(equations.coordinates))])
    return equations.mass_matrix.LUsolve(applied + equations.right_hand_side)


def assert_zero(expressions: Any) -> None:
    assert [expression for expression in expressions if not is_zero(expression)] == []


def random_arguments(exact: Any, source: random.Random) -> list[mpmath.mpf]:
    """Rational q, v, tau and time of order one, and the parameters of the system."""
    free = [mpmath.mpf(source.randint(-2000, 2000)) / 1000 for _ in range(3 * exact.nv + 1)]
    ranges = exact.system.ranges
    for index, coordinate in enumerate(exact.system.coordinates):
        if coordinate in ranges:
            low, high = map(mpmath.mpf, ranges[coordinate])
            free[index] = low + (high - low) * source.randint(1, 999) / 1000
    return [*free, *exact.parameters]


def test_collar_is_newtons_second_law() -> None:
    _, equations, s = seed("collar")
    m, r, d, k, g, theta = (s[name] for name in ("m", "r", "d", "k", "g", "theta"))
    length = sp.sqrt(d**2 + 2 * d * r * sp.cos(theta) + r**2)
    newton = g / r * sp.cos(theta) + k * d / (m * r) * (1 - d / length) * sp.sin(theta)
    assert_zero([accelerations(equations)[0].subs(s["tau0"], 0) - newton])


def test_bar_pendulum_is_euler_about_the_pin() -> None:
    _, equations, s = seed("bar_pendulum")
    moments = s["I_O"] * sp.Symbol("acceleration") + s["c"] * s["theta_dot"] + s["m"] * s["g"] * s["r_G"] * sp.sin(s["theta"])
    assert_zero([moments.subs("acceleration", accelerations(equations)[0].subs(s["tau0"], 0))])


def test_spring_damper_is_newtons_second_law_under_the_applied_force() -> None:
    _, equations, s = seed("spring_damper")
    forces = s["m"] * sp.Symbol("acceleration") + s["c"] * s["x_dot"] + s["k"] * s["x"] - s["tau0"]
    assert_zero([forces.subs("acceleration", accelerations(equations)[0])])


def cart_by_newton_euler(s: dict[str, Any]) -> tuple[sp.Expr, sp.Expr]:
    """Accelerations from two free body diagrams; the pin pushes the bar by (O_x, O_z) and the guide the cart by N."""
    M, m, L, k, c, g, x, theta, theta_dot = (s[name] for name in ("M", "m", "L", "k", "c", "g", "x", "theta", "theta_dot"))
    a_x, a_theta, O_x, O_z, N, sine, cosine = sp.symbols("a_x a_theta O_x O_z N sine cosine")
    # Acceleration of the bar's centre seen from the pin: tangential along (cos, sin), centripetal towards the pin.
    centre_x = a_x + L / 2 * (a_theta * cosine - theta_dot**2 * sine)
    centre_z = L / 2 * (a_theta * sine + theta_dot**2 * cosine)
    arm_x, arm_z = -L / 2 * sine, L / 2 * cosine
    laws = [
        sp.Eq(M * a_x, -k * x - O_x),
        sp.Eq(0, N - M * g - O_z),
        sp.Eq(m * centre_x, O_x),
        sp.Eq(m * centre_z, O_z - m * g),
        sp.Eq(m * L**2 / 12 * a_theta, arm_x * O_z - arm_z * O_x - c * theta_dot),
    ]
    (solution,) = sp.solve(laws, [a_x, a_theta, O_x, O_z, N], dict=True)
    angle = {sine: sp.sin(theta), cosine: sp.cos(theta)}
    return solution[a_x].subs(angle), solution[a_theta].subs(angle)


def test_cart_pendulum_is_the_five_newton_euler_equations() -> None:
    _, equations, s = seed("cart_pendulum")
    # M is regular, so what satisfies the equations is their only solution; this form simplifies at once.
    assert_zero(list(equations.mass_matrix * sp.Matrix(cart_by_newton_euler(s)) - equations.right_hand_side))


def test_cart_pendulum_without_damper_is_the_printed_solution() -> None:
    _, equations, s = seed("cart_pendulum")
    M, m, L, k, c, g, x, theta, theta_dot = (s[name] for name in ("M", "m", "L", "k", "c", "g", "x", "theta", "theta_dot"))
    divisor = 4 * M + 3 * m * sp.sin(theta) ** 2 + m
    a_x = (4 * L * theta_dot**2 * m * sp.sin(theta) + 3 * g * m * sp.sin(2 * theta) - 8 * k * x) / (2 * divisor)
    a_theta = -L * theta_dot**2 * m * sp.sin(2 * theta) / 2 - 2 * M * g * sp.sin(theta) - 2 * g * m * sp.sin(theta)
    a_theta = 3 * (a_theta + 2 * k * x * sp.cos(theta)) / (L * divisor)
    lagrange = accelerations(equations).subs({s["tau0"]: 0, s["tau1"]: 0, c: 0})
    assert_zero([lagrange[0] - a_x, lagrange[1] - a_theta])


def test_small_oscillations_of_the_cart() -> None:
    system, equations, s = seed("cart_pendulum")
    M, m, L, k, c, g = (s[name] for name in ("M", "m", "L", "k", "c", "g"))
    mass, damping, stiffness = linearised(equations)
    assert mass == sp.Matrix([[M + m, L * m / 2], [L * m / 2, L**2 * m / 3]])
    assert stiffness == sp.Matrix([[k, 0], [0, L * g * m / 2]])
    assert damping == sp.Matrix([[0, 0], [0, c]])
    values = {symbol: value for symbol, (value, _) in system.parameters.items()}
    numbers = [np.array(matrix.subs(values), dtype=float) for matrix in (mass, stiffness)]
    slow, fast = np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(*numbers))))
    assert (f"{slow:.2f}", f"{fast:.2f}", f"{2 * np.pi / (fast - slow):.2f}") == ("4.41", "5.76", "4.65")


def test_arm_is_the_textbook_manipulator_equation() -> None:
    """Spong, Hutchinson, Vidyasagar, section 7.3: planar elbow manipulator."""
    _, equations, s = seed("arm_2r")
    m1, m2, l1, lc1, lc2, I1, I2, g, q1, q2 = (s[name] for name in ("m1", "m2", "l1", "lc1", "lc2", "I1", "I2", "g", "q1", "q2"))
    off_diagonal = m2 * (lc2**2 + l1 * lc2 * sp.cos(q2)) + I2
    first = m1 * lc1**2 + m2 * (l1**2 + lc2**2 + 2 * l1 * lc2 * sp.cos(q2)) + I1 + I2
    assert_zero(list(equations.mass_matrix - sp.Matrix([[first, off_diagonal], [off_diagonal, m2 * lc2**2 + I2]])))
    h = -m2 * l1 * lc2 * sp.sin(q2)
    rate1, rate2 = s["q1_dot"], s["q2_dot"]
    assert_zero(list(equations.christoffel_matrix() - sp.Matrix([[h * rate2, h * (rate1 + rate2)], [-h * rate1, 0]])))
    second = m2 * lc2 * g * sp.cos(q1 + q2)
    assert_zero(list(equations.gravity_terms - sp.Matrix([(m1 * lc1 + m2 * l1) * g * sp.cos(q1) + second, second])))


def test_christoffel_matrix_of_the_arm_is_passive_and_gives_the_velocity_terms() -> None:
    _, equations, _ = seed("arm_2r")
    matrix = equations.christoffel_matrix()
    rates = sp.Matrix(equations.rates)
    growth = equations.mass_matrix.applyfunc(
        lambda entry: sum(entry.diff(q) * v for q, v in zip(equations.coordinates, equations.rates, strict=True))
    )
    skew = growth - 2 * matrix
    assert_zero(list(skew + skew.T))
    assert_zero(list(matrix * rates - equations.velocity_terms))


@mpmath.workdps(80)
def test_energy_function_is_that_of_the_parts_of_the_kinetic_energy(built_in_name: str, built_in_exact: Any) -> None:
    """h = T2 - T0 + V, T2 and T0 the parts of T of second and of no degree in the rates: T + V where T is a quadratic form."""
    exact, equations = built_in_exact, built_in_exact.equations
    values = exact.function([energy_function(equations), equations.kinetic, equations.potential])
    source = random.Random(built_in_name)
    for _ in range(COUNT):
        arguments = random_arguments(exact, source)
        back, rest = ([factor * a if exact.nv <= i < 2 * exact.nv else a for i, a in enumerate(arguments)] for factor in (-1, 0))
        (h, kinetic, potential), (_, reversed_, _), (_, at_rest, _) = map(values, (arguments, back, rest))
        expected = (kinetic + reversed_) / 2 - 2 * at_rest + potential
        assert abs(h - expected) <= AT_ZERO * (abs(kinetic) + abs(reversed_) + abs(at_rest) + abs(potential))
        if built_in_name in SEED:
            assert abs(h - kinetic - potential) <= AT_ZERO * (abs(kinetic) + abs(potential))


@mpmath.workdps(80)
def test_energy_changes_by_the_power_of_the_forces_alone(built_in_name: str, built_in_exact: Any) -> None:
    """dh/dt = sum Q v - dL/dt, the chapter's energy balance, with qdd from the equations of motion."""
    source = random.Random(built_in_name)
    for _ in range(COUNT):
        residual, scale = built_in_exact.energy_balance(random_arguments(built_in_exact, source))
        assert scale > 0
        assert abs(residual) <= AT_ZERO * scale


@pytest.mark.parametrize("name", SEED)
def test_energy_balance_is_a_symbolic_identity(name: str) -> None:
    """dh/dt = dh/dq v + dh/dv a, where dh/dv = M v and M a is the right-hand side and the applied forces."""
    _, equations, s = seed(name)
    h = energy_function(equations)
    rates = sp.Matrix(equations.rates)
    assert_zero(sp.Matrix([h.diff(v) for v in rates]) - equations.mass_matrix * rates)
    applied = sp.Matrix([s[f"tau{i}"] for i in range(len(rates))])
    growth = sum(h.diff(q) * v for q, v in zip(equations.coordinates, rates, strict=True)) + rates.dot(equations.right_hand_side + applied)
    assert_zero([growth - rates.dot(equations.generalised_forces + applied)])
