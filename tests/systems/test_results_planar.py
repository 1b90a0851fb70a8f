"""Results that the texts print for the planar mechanisms, each written down by hand and held against the derivation.

A text that measures absolute angles has equations E of its own; with phi = A q, those of the joints are A' E.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp
from support import is_zero, linearised
from sympy.physics.mechanics import dynamicsymbols

from harness.lagrange.derivation import load_mechanism, load_system
from harness.lagrange.equations import EquationsOfMotion, derive
from harness.library import Library
from harness.programs.states import States
from harness.truth.reference import ReferenceKernel


def load(name: str) -> tuple[EquationsOfMotion, SimpleNamespace, dict[sp.Symbol, float]]:
    """Equations of a built-in system, its symbols by name (accelerations as q_ddot), and its parameters' values."""
    system, _ = load_system(Library.built_in().system_path(name))
    equations = derive(system)
    symbols = {symbol.name: symbol for symbol in (*equations.coordinates, *equations.rates, *system.parameters)}
    symbols |= {f"{q.name}_ddot": sp.Symbol(f"{q.name}_ddot", real=True) for q in equations.coordinates}
    return equations, SimpleNamespace(**symbols), {symbol: value for symbol, (value, _) in system.parameters.items()}


def load_rolled_bead() -> tuple[EquationsOfMotion, SimpleNamespace]:
    """The bead on the cycloid in the angle phi of the text alone: its energies where the hub's way is R phi."""
    system, _ = load_system(Library.built_in().system_path("cycloid_bead"))
    way, turn = system.coordinates
    phi = dynamicsymbols("phi")
    R = next(symbol for symbol in system.parameters if symbol.name == "R")
    # What both are measured from does not move the bead.
    rolled = {way: R * phi, turn: phi - sp.pi / 2}
    kinetic, potential = (energy.subs(rolled).doit() for energy in (system.kinetic, system.potential))
    alone = replace(
        system, coordinates={phi: "wheel"}, kinetic=kinetic, potential=potential, ranges={phi: (0.3, 5.9)}, constraints={}, assembly={}
    )
    equations = derive(alone)
    symbols = {symbol.name: symbol for symbol in (*equations.coordinates, *equations.rates, *system.parameters)}
    return equations, SimpleNamespace(**symbols, phi_ddot=sp.Symbol("phi_ddot", real=True))


def balance(equations: EquationsOfMotion) -> sp.Matrix:
    """M qdd + c + g - p, which equals the applied forces."""
    accelerations = sp.Matrix([sp.Symbol(f"{q.name}_ddot", real=True) for q in equations.coordinates])
    return equations.mass_matrix * accelerations - equations.right_hand_side


def accelerations(equations: EquationsOfMotion) -> sp.Matrix:
    return equations.mass_matrix.LUsolve(equations.right_hand_side)


def assert_equal(found: Any, expected: Any) -> None:
    found, expected = list(found), list(expected)
    assert [difference for a, b in zip(found, expected, strict=True) if not is_zero(difference := a - b)] == []


def assert_squared_frequencies(equations: EquationsOfMotion, expected: Any, equilibrium: Any = None, limit: Any = None) -> None:
    """The roots w of det(K - w M), about ``equilibrium`` and under the substitution ``limit``, are ``expected``."""
    mass, _, stiffness = linearised(equations, equilibrium)
    w = sp.Symbol("w")
    found = (stiffness - w * mass).det().subs(limit or {})
    leading = mass.det().subs(limit or {})
    polynomial = leading * sp.prod([root - w for root in expected])
    assert sp.simplify(sp.expand(found - polynomial)) == 0


def test_simple_pendulum() -> None:
    """Landau, Lifshitz, section 11, problem 1: the equation, and the period 4 sqrt(L/g) K(sin(phi0/2))."""
    equations, s, values = load("simple_pendulum")
    assert_equal(accelerations(equations), [-s.g / s.L * sp.sin(s.theta)])
    assert_squared_frequencies(equations, [s.g / s.L])
    start = sp.Integer(2)
    exact = {symbol: sp.Rational(value) for symbol, value in values.items()}
    rate = sp.sqrt(2 * (equations.potential.subs(s.theta, start) - equations.potential) / equations.mass_matrix[0]).subs(exact)
    with mpmath.workdps(40):
        period = 4 * mpmath.quad(sp.lambdify(s.theta, 1 / rate, "mpmath"), [0, 2])
        length, gravity = mpmath.mpf(values[s.L]), mpmath.mpf(values[s.g])
        expected = 4 * mpmath.sqrt(length / gravity) * mpmath.ellipk(mpmath.sin(1) ** 2)
        # At the turning point the rate is a root, which leaves half of the 40 digits.
        assert abs(period / expected - 1) < mpmath.mpf(10) ** -15


def test_double_pendulum() -> None:
    """Goldstein, chapter 1, exercise 22 (equations); Landau, Lifshitz, section 23, problem 2 (small oscillations)."""
    equations, s, _ = load("double_pendulum")
    total, slant = s.m1 + s.m2, -s.q2
    phi1, phi2 = s.q1, s.q1 + s.q2
    turn1, turn2 = s.q1_dot, s.q1_dot + s.q2_dot
    grow1, grow2 = s.q1_ddot, s.q1_ddot + s.q2_ddot
    upper = total * s.l1 * grow1 + s.m2 * s.l2 * (grow2 * sp.cos(slant) + turn2**2 * sp.sin(slant)) + total * s.g * sp.sin(phi1)
    lower = s.l2 * grow2 + s.l1 * grow1 * sp.cos(slant) - s.l1 * turn1**2 * sp.sin(slant) + s.g * sp.sin(phi2)
    upper, lower = s.l1 * upper, s.m2 * s.l2 * lower
    assert_equal(balance(equations), [upper + lower, lower])

    root = sp.sqrt(total) * sp.sqrt(total * (s.l1 + s.l2) ** 2 - 4 * s.m1 * s.l1 * s.l2)
    factor = s.g / (2 * s.m1 * s.l1 * s.l2)
    assert_squared_frequencies(equations, [factor * (total * (s.l1 + s.l2) + sign * root) for sign in (1, -1)])


def test_torsional_pendulum() -> None:
    """Rao, section 2.3: sqrt(k_t/J_0) without gravity, and the compound pendulum's sqrt(m g d/J_0) without the spring."""
    equations, s, _ = load("torsional_pendulum")
    inertia, arm = s.m * s.L**2 / 3, s.L / 2
    assert_equal(balance(equations), [inertia * s.theta_ddot + s.k_t * s.theta + s.m * s.g * arm * sp.sin(s.theta)])
    assert_squared_frequencies(equations, [s.k_t / inertia], limit={s.g: 0})
    assert_squared_frequencies(equations, [s.m * s.g * arm / inertia], limit={s.k_t: 0})
    assert_squared_frequencies(equations, [3 * s.k_t / (s.m * s.L**2) + 3 * s.g / (2 * s.L)])


def test_coupled_oscillators() -> None:
    """Taylor, equation 11.2, and the normal modes of equal masses and outer springs, sections 11.2 and 11.3."""
    equations, s, values = load("coupled_oscillators")
    pull = sp.Symbol("pull", positive=True)
    at_equilibrium = {s.e1: pull / s.k1, s.e2: pull / s.k2, s.e3: pull / s.k3}
    left = s.m1 * s.x1_ddot + (s.k1 + s.k2) * s.x1 - s.k2 * s.x2
    right = s.m2 * s.x2_ddot - s.k2 * s.x1 + (s.k2 + s.k3) * s.x2
    assert_equal(balance(equations).subs(at_equilibrium), [left, right])
    assert values[s.k1] * values[s.e1] == values[s.k2] * values[s.e2] == values[s.k3] * values[s.e3]

    equal = {s.m2: s.m1, s.k3: s.k1}
    assert_squared_frequencies(equations, [s.k1 / s.m1, (s.k1 + 2 * s.k2) / s.m1], limit=equal)
    mass, _, stiffness = linearised(equations)
    for mode, squared in ((sp.Matrix([1, 1]), s.k1 / s.m1), (sp.Matrix([1, -1]), (s.k1 + 2 * s.k2) / s.m1)):
        assert_equal((stiffness - squared * mass).subs(equal) * mode, [0, 0])


def test_quarter_car() -> None:
    """Rajamani, chapter 10: the two equations of the heights, the two natural frequencies, and what no suspension changes."""
    equations, s, values = load("quarter_car")
    suspension = s.b_s * s.z_r_dot + s.k_s * s.z_r
    body = s.m_s * (s.z_u_ddot + s.z_r_ddot) + suspension + s.m_s * s.g
    wheel = s.m_u * s.z_u_ddot - suspension + s.k_t * s.z_u + s.m_u * s.g
    # z_u moves both, z_r the body alone.
    assert_equal(balance(equations), [body + wheel, body])
    invariant = s.m_s * (s.z_u_ddot + s.z_r_ddot) + s.m_u * s.z_u_ddot + s.k_t * s.z_u + (s.m_s + s.m_u) * s.g
    assert_equal([balance(equations)[0]], [invariant])
    static = {s.z_u: -(s.m_s + s.m_u) * s.g / s.k_t, s.z_r: -s.m_s * s.g / s.k_s}
    assert_equal(equations.right_hand_side.subs(static).subs(dict.fromkeys(equations.rates, 0)), [0, 0])

    heights_mass = np.diag([values[s.m_s], values[s.m_u]])
    heights_stiffness = np.array([[values[s.k_s], -values[s.k_s]], [-values[s.k_s], values[s.k_s] + values[s.k_t]]])
    expected = np.sort(np.linalg.eigvals(np.linalg.solve(heights_mass, heights_stiffness)))
    mass, damping, stiffness = (np.array(matrix.subs(values), dtype=float) for matrix in linearised(equations))
    squared = np.sort(np.linalg.eigvals(np.linalg.solve(mass, stiffness)))
    np.testing.assert_allclose(squared, expected, rtol=1e-13)
    assert damping.tolist() == [[0, 0], [0, values[s.b_s]]]
    # The rules of thumb: the body on both springs in series, the wheel between both.
    series = values[s.k_s] * values[s.k_t] / (values[s.k_s] + values[s.k_t])
    thumb = [series / values[s.m_s], (values[s.k_s] + values[s.k_t]) / values[s.m_u]]
    np.testing.assert_allclose(np.sqrt(squared), np.sqrt(thumb), rtol=0.01)


def test_spring_pendulum() -> None:
    """Taylor, problem 7.36: the two equations, and the small oscillations about the length l = l_0 + m g/k."""
    equations, s, _ = load("spring_pendulum")
    radial = s.r_ddot - (s.r * s.phi_dot**2 + s.g * sp.cos(s.phi) - s.k / s.m * (s.r - s.l_0))
    transverse = s.r * s.phi_ddot + 2 * s.r_dot * s.phi_dot + s.g * sp.sin(s.phi)
    expected = {s.phi: s.m * s.r * transverse, s.r: s.m * radial}
    assert_equal(balance(equations), [expected[q] for q in equations.coordinates])
    length = s.l_0 + s.m * s.g / s.k
    assert_squared_frequencies(equations, [s.k / s.m, s.g / length], equilibrium={s.r: length})


def test_inertia_wheel_pendulum() -> None:
    """Block, Astrom, Spong, chapter 2: with absolute angles the motor's torque alone couples pendulum and wheel."""
    equations, s, _ = load("inertia_wheel_pendulum")
    J = s.J_p + s.m_p * s.l_p**2 + s.m_r * s.l_r**2
    moment = s.m_p * s.l_p + s.m_r * s.l_r
    pendulum = J * s.theta_ddot + moment * s.g * sp.sin(s.theta)
    wheel = s.J_r * (s.theta_ddot + s.phi_ddot)
    assert_equal(balance(equations), [pendulum + wheel, wheel])
    assert_squared_frequencies(equations, [moment * s.g / J, 0])
    # What the book prints for its device: parts, and the whole made of them.
    parts = {s.m_p: 0.2164, s.m_r: 0.0850, s.J_p: 2.233e-4, s.J_r: 2.495e-5, s.l_p: 0.1173, s.l_r: 0.1270}
    locked = float((equations.mass_matrix[0, 0] - equations.mass_matrix[1, 1]).subs(s.theta, 0).subs(parts))
    weight = float(equations.gravity_terms[0].diff(s.theta).subs({s.theta: 0, s.g: 1}).subs(parts))
    mass = parts[s.m_p] + parts[s.m_r]
    assert (f"{mass:.4f}", f"{weight / mass:.4f}", f"{locked:.3e}") == ("0.3014", "0.1200", "4.572e-03")


def test_cart_double_pendulum() -> None:
    """Bogdanov, section 2: D(theta) theta'' + C(theta, theta') theta' + G(theta) = H u, and the spring of the cart."""
    equations, s, _ = load("cart_double_pendulum")
    lc1, lc2 = s.L1 / 2, s.L2 / 2
    d1, d2, d3 = s.m0 + s.m1 + s.m2, s.m1 * lc1 + s.m2 * s.L1, s.m2 * lc2
    d4, d5 = s.m1 * lc1**2 + s.m2 * s.L1**2 + s.m1 * s.L1**2 / 12, s.m2 * s.L1 * lc2
    d6 = s.m2 * lc2**2 + s.m2 * s.L2**2 / 12
    f1, f2 = (s.m1 * lc1 + s.m2 * s.L1) * s.g, s.m2 * lc2 * s.g
    theta1, theta2 = s.q1, s.q1 + s.q2
    slant = theta1 - theta2
    cos1, cos2, cos12 = sp.cos(theta1), sp.cos(theta2), sp.cos(slant)
    sin1, sin2, sin12 = sp.sin(theta1), sp.sin(theta2), sp.sin(slant)
    rates = sp.Matrix([s.x_dot, s.q1_dot, s.q1_dot + s.q2_dot])
    growths = sp.Matrix([s.x_ddot, s.q1_ddot, s.q1_ddot + s.q2_ddot])
    D = sp.Matrix([[d1, d2 * cos1, d3 * cos2], [d2 * cos1, d4, d5 * cos12], [d3 * cos2, d5 * cos12, d6]])
    C = sp.Matrix([[0, -d2 * sin1 * rates[1], -d3 * sin2 * rates[2]], [0, 0, d5 * sin12 * rates[2]], [0, -d5 * sin12 * rates[1], 0]])
    G = sp.Matrix([0, -f1 * sin1, -f2 * sin2])
    cart, lower, upper = D * growths + C * rates + G
    assert_equal(balance(equations), [cart + s.k * s.x, lower + upper, upper])


def test_acrobot() -> None:
    """Spong, IEEE Control Systems Magazine 15 (1995): d_ij, h_i and phi_i."""
    equations, s, _ = load("acrobot")
    d11 = s.m1 * s.lc1**2 + s.m2 * (s.l1**2 + s.lc2**2 + 2 * s.l1 * s.lc2 * sp.cos(s.q2)) + s.I1 + s.I2
    d12 = s.m2 * (s.lc2**2 + s.l1 * s.lc2 * sp.cos(s.q2)) + s.I2
    d22 = s.m2 * s.lc2**2 + s.I2
    coupling = s.m2 * s.l1 * s.lc2 * sp.sin(s.q2)
    h1 = -coupling * s.q2_dot**2 - 2 * coupling * s.q2_dot * s.q1_dot
    h2 = coupling * s.q1_dot**2
    phi2 = s.m2 * s.lc2 * s.g * sp.cos(s.q1 + s.q2)
    phi1 = (s.m1 * s.lc1 + s.m2 * s.l1) * s.g * sp.cos(s.q1) + phi2
    assert_equal(equations.mass_matrix, [d11, d12, d12, d22])
    assert_equal(equations.velocity_terms, [h1, h2])
    assert_equal(equations.gravity_terms, [phi1, phi2])


def test_incline_pendulum_on_level_ground() -> None:
    """Landau, Lifshitz, section 5, problem 2: Lagrange's equations of the Lagrangian it gives."""
    equations, s, _ = load("incline_pendulum")
    level = (s.M + s.m) * s.s_ddot + s.m * s.L * (s.theta_ddot * sp.cos(s.theta) - s.theta_dot**2 * sp.sin(s.theta))
    swing = s.m * s.L * (s.L * s.theta_ddot + s.s_ddot * sp.cos(s.theta) + s.g * sp.sin(s.theta))
    assert_equal(balance(equations).subs(s.alpha, 0), [level, swing])


def test_incline_pendulum_slides_square_to_the_slope() -> None:
    """Seen from the cart gravity is g cos(alpha), square to the slope: Taylor, section 9.1, for a car that accelerates."""
    equations, s, values = load("incline_pendulum")
    sliding = {s.theta: -s.alpha, s.s_ddot: s.g * sp.sin(s.alpha), s.theta_ddot: 0, s.s_dot: 0, s.theta_dot: 0}
    assert_equal(balance(equations).subs(sliding), [0, 0])
    stiffness = balance(equations).jacobian([s.s, s.theta]).subs(sliding)
    w = sp.Symbol("w")
    frequency = (s.M + s.m) * s.g * sp.cos(s.alpha) / (s.M * s.L)
    determinant = (stiffness - w * equations.mass_matrix.subs(sliding)).det()
    assert_equal([determinant], [w * (w - frequency) * s.M * s.m * s.L**2])
    # On a cart so heavy that it does not feel the mass.
    light = accelerations(equations).applyfunc(sp.cancel).subs(s.m, 0)
    assert_equal(light, [s.g * sp.sin(s.alpha), -s.g * sp.cos(s.alpha) / s.L * sp.sin(s.theta + s.alpha)])
    assert (np.cos(values[s.alpha]), np.sin(values[s.alpha])) == (0.8, 0.6)


def test_cycloid_bead() -> None:
    """Taylor, problem 6.25: with the arc s from the lowest point, s'' = -(g/4R) s, so the period is 4 pi sqrt(R/g) from any height."""
    equations, s = load_rolled_bead()
    inertia = 2 * s.m * s.R**2 * (1 - sp.cos(s.phi))
    growth = s.m * s.R**2 * sp.sin(s.phi) * s.phi_dot**2
    assert_equal(balance(equations), [inertia * s.phi_ddot + growth - s.m * s.g * s.R * sp.sin(s.phi)])

    arc = -4 * s.R * sp.cos(s.phi / 2)
    assert_equal(equations.mass_matrix, [s.m * arc.diff(s.phi) ** 2])
    assert_equal([equations.potential - equations.potential.subs(s.phi, sp.pi)], [s.m * s.g * arc**2 / (8 * s.R)])
    (acceleration,) = accelerations(equations)
    assert_equal([arc.diff(s.phi, 2) * s.phi_dot**2 + arc.diff(s.phi) * acceleration], [-s.g / (4 * s.R) * arc])
    assert_squared_frequencies(equations, [s.g / (4 * s.R)], equilibrium={s.phi: sp.pi})


def test_cycloid_bead_is_on_the_brachistochrone() -> None:
    """Taylor, example 6.2: depth (1 + (d depth/dx)^2) is constant along the curve of quickest descent, here 2 R."""
    equations, s = load_rolled_bead()
    depth = -equations.potential / (s.m * s.g)
    path_squared = equations.mass_matrix[0] / s.m
    along_squared = path_squared - depth.diff(s.phi) ** 2
    assert_equal([depth * path_squared / along_squared], [2 * s.R])
    # From rest in the cusp, phi grows by sqrt(g/R) all the way.
    assert_equal([2 * s.g * depth / path_squared], [s.g / s.R])


def periods(name: str, lowest: float, starts: Sequence[float], longest: float, ways: Sequence[float] = (1.0,)) -> list[float]:
    """Seconds from one passage of the ``lowest`` point to the next in the same sense, let go at each of ``starts``; at most ``longest``.

    Accelerations are certified, for the float64 kernel loses digits where the bead on the cycloid passes its lowest point; those of all
    motions at once. Joint i of the mechanism is tied to be at ``ways[i]`` times the last one.
    """
    from scipy.integrate import solve_ivp

    mechanism = load_mechanism(Library.built_in(), name)
    kernel, tied, count = ReferenceKernel(mechanism), np.array(ways), len(starts)

    def motion(_: float, state: np.ndarray) -> np.ndarray:
        positions, rates = state[:count, None], state[count:, None]
        return np.concatenate([state[count:], kernel.evaluate(States.at(tied * positions, tied * rates, 0 * tied * rates)).high[:, -1]])

    def passage(number: int) -> Callable[[float, np.ndarray], float]:
        def above(_: float, state: np.ndarray) -> float:
            return float(state[number]) - lowest

        above.direction = 1.0  # type: ignore[attr-defined]
        return above

    passages = [passage(number) for number in range(count)]
    # From rest above, the first passage is after three quarters of a period, or after one from below, and the second a period later.
    span, start = (0.0, 2.0 * longest), [*starts, *[0.0] * count]
    solution = solve_ivp(motion, span, start, method="DOP853", events=passages, rtol=1e-13, atol=1e-13)
    return [float(times[1] - times[0]) for times in solution.t_events]


@pytest.mark.ci
def test_cycloid_bead_takes_the_same_time_from_every_height() -> None:
    """4 pi sqrt(R/g); a pendulum's period, 4 sqrt(L/g) K(sin(start/2)), grows with the height, and the same measurement shows it."""
    from scipy.special import ellipk

    _, s, values = load("cycloid_bead")
    expected = 4 * np.pi * np.sqrt(values[s.R] / values[s.g])
    found = periods("cycloid_bead", np.pi / 2, [start - np.pi / 2 for start in (0.3, 2.0, 3.14)], 1.01 * expected, ways=(values[s.R], 1.0))
    np.testing.assert_allclose(found, expected, rtol=1e-10)

    _, s, values = load("simple_pendulum")
    expected = 4 * np.sqrt(values[s.L] / values[s.g]) * ellipk(np.sin(np.array([0.5, 2.5]) / 2) ** 2)
    swings = periods("simple_pendulum", 0.0, [-0.5, -2.5], 1.01 * expected.max())
    np.testing.assert_allclose(swings, expected, rtol=1e-10)
    assert swings[1] > 1.5 * swings[0]
