"""Results that papers and textbooks print, against the derivation: spatial mechanisms, arms and benchmarks of control."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace

import pytest
import sympy as sp
from support import is_zero

from harness.lagrange.derivation import load_system
from harness.lagrange.equations import derive
from harness.library import Library


def derived(name: str) -> tuple[SimpleNamespace, SimpleNamespace]:
    """(equations, symbols) of a system: parameters, coordinates and rates by name, ``a`` the accelerations, ``forces`` M a - f.

    ``forces`` are the applied forces that the motion q, v, a needs.
    """
    system, _ = load_system(Library.built_in().system_path(name))
    equations = derive(system)
    a = sp.Matrix([sp.Symbol(f"{q.name}_ddot", real=True) for q in equations.coordinates])
    forces = equations.mass_matrix * a - equations.right_hand_side
    values = {symbol: sp.Rational(str(value)) for symbol, (value, _) in system.parameters.items()}
    names = {symbol.name: symbol for symbol in (*system.parameters, *equations.coordinates, *equations.rates, *a)}
    momenta = sp.Matrix([equations.kinetic.diff(rate) for rate in equations.rates])
    return SimpleNamespace(equations=equations, forces=forces, momenta=momenta, values=values), SimpleNamespace(**names)


def assert_equal(left: Sequence[sp.Expr], right: Sequence[sp.Expr]) -> None:
    assert [difference for x, y in zip(left, right, strict=True) if not is_zero(difference := x - y)] == []


# Translational oscillator with a rotating actuator: Bupp, Bernstein, Coppola (1998), section 2.


def test_tora_equations_of_bupp_bernstein_and_coppola() -> None:
    d, s = derived("tora")
    q = s.x - s.d
    force = (s.M + s.m) * s.x_ddot + s.k * q + s.m * s.e * (s.theta_ddot * sp.cos(s.theta) - s.theta_dot**2 * sp.sin(s.theta))
    torque = (s.J + s.m * s.e**2) * s.theta_ddot + s.m * s.e * s.x_ddot * sp.cos(s.theta)
    assert_equal(d.forces, [force, torque])


def test_tora_coupling_of_the_testbed() -> None:
    """The normalised equations hold one number, epsilon = m e / sqrt((J + m e^2)(M + m)), printed as 0.200."""
    d, s = derived("tora")
    mass = d.equations.mass_matrix.subs(s.theta, 0)
    epsilon = mass[0, 1] / sp.sqrt(mass[0, 0] * mass[1, 1])
    assert f"{float(epsilon.subs(d.values)):.3f}" == "0.200"


# Ball and beam: Hauser, Sastry, Kokotovic (1992), section II, with J_b/R^2 = 0 for a ball that does not roll.


def test_ball_and_beam_equations_of_hauser_sastry_and_kokotovic() -> None:
    d, s = derived("ball_and_beam")
    along = s.M * s.r_ddot + s.M * s.g * sp.sin(s.theta) - s.M * s.r * s.theta_dot**2
    torque = (s.M * s.r**2 + s.J + s.J_b) * s.theta_ddot + 2 * s.M * s.r * s.r_dot * s.theta_dot + s.M * s.g * s.r * sp.cos(s.theta)
    assert_equal(d.forces, [along, torque])


# Planar 3R arm: Spong, Hutchinson, Vidyasagar, equation D = sum m Jv' Jv + Jw' R I R' Jw.


def jacobians_of_the_arm(s: SimpleNamespace) -> list[tuple[sp.Symbol, sp.Symbol, sp.Matrix, sp.Matrix]]:
    """(mass, inertia, Jv, Jw) of each link from joint axes and positions in space, column i = axis x (centre - joint i)."""
    axis = sp.Matrix([0, -1, 0])

    def link(length: sp.Expr, *angles: sp.Expr) -> sp.Matrix:
        return length * sp.Matrix([sp.cos(sum(angles)), 0, sp.sin(sum(angles))])

    joints = [sp.zeros(3, 1), link(s.l1, s.q1), link(s.l1, s.q1) + link(s.l2, s.q1, s.q2)]
    centres = [link(s.lc1, s.q1), joints[1] + link(s.lc2, s.q1, s.q2), joints[2] + link(s.lc3, s.q1, s.q2, s.q3)]
    result = []
    for number, (mass, inertia, centre) in enumerate(zip((s.m1, s.m2, s.m3), (s.I1, s.I2, s.I3), centres, strict=True)):
        moved_by = [joint if i <= number else None for i, joint in enumerate(joints)]
        linear = [sp.zeros(3, 1) if joint is None else axis.cross(centre - joint) for joint in moved_by]
        angular = [sp.zeros(3, 1) if joint is None else axis for joint in moved_by]
        result.append((mass, inertia, sp.Matrix.hstack(*linear), sp.Matrix.hstack(*angular)))
    return result


@pytest.mark.ci
def test_arm_3r_mass_matrix_and_gravity_from_jacobians() -> None:
    d, s = derived("arm_3r")
    links = jacobians_of_the_arm(s)
    mass = sum((m * linear.T * linear + inertia * angular.T * angular for m, inertia, linear, angular in links), sp.zeros(3, 3))
    assert_equal(d.equations.mass_matrix, mass)
    weight = sum((m * linear.T * sp.Matrix([0, 0, s.g]) for m, _, linear, _ in links), sp.zeros(3, 1))
    assert_equal(d.equations.gravity_terms, weight)


@pytest.mark.ci
def test_arm_3r_manipulator_equation_is_passive() -> None:
    """M' - 2C is skew and C v are the velocity terms: Spong, Hutchinson, Vidyasagar, section 7.5."""
    d, _ = derived("arm_3r")
    equations = d.equations
    matrix = equations.christoffel_matrix()
    growth = sum((equations.mass_matrix.diff(q) * v for q, v in zip(equations.coordinates, equations.rates, strict=True)), sp.zeros(3, 3))
    skew = growth - 2 * matrix
    assert_equal(skew + skew.T, sp.zeros(3, 3))
    assert_equal(matrix * sp.Matrix(equations.rates), equations.velocity_terms)


# Five-link biped in single support: Westervelt, Grizzle, Chevallereau, Choi, Morris, chapter 3: the angle at the
# stance foot is cyclic in T, its momentum sigma is the angular momentum about the foot, and sigma' = g m_tot x_cm.


def test_biped_momentum_about_the_stance_foot() -> None:
    d, s = derived("biped_five_link")
    total = s.q1, s.q1 + s.q2, s.q1 + s.q2 + s.q3, s.q1 + s.q2 + s.q3 + s.q4, s.q1 + s.q2 + s.q3 + s.q4 + s.q5
    shin, thigh, torso, swing_thigh, swing_shin = total
    rates = {q: sp.Symbol(f"{q.name}_dot", real=True) for q in (s.q1, s.q2, s.q3, s.q4, s.q5)}

    # (length, angle) of the links to climb from the foot, upwards or (negative) downwards
    to_hip = [(s.L_t, shin), (s.L_f, thigh)]
    to_swing_knee = [*to_hip, (-s.L_f, swing_thigh)]
    links = [
        (s.m_t, s.I_t, shin, [(s.L_t - s.p_t, shin)]),
        (s.m_f, s.I_f, thigh, [(s.L_t, shin), (s.L_f - s.p_f, thigh)]),
        (s.m_T, s.I_T, torso, [*to_hip, (s.p_T, torso)]),
        (s.m_f, s.I_f, swing_thigh, [*to_hip, (-s.p_f, swing_thigh)]),
        (s.m_t, s.I_t, swing_shin, [*to_swing_knee, (-s.p_t, swing_shin)]),
    ]

    def rate(expression: sp.Expr) -> sp.Expr:
        return sum((expression.diff(q) * v for q, v in rates.items()), sp.S.Zero)

    momentum, moment = sp.S.Zero, sp.S.Zero
    for mass, inertia, angle, path in links:
        x = sum((length * sp.sin(turned) for length, turned in path), sp.S.Zero)
        z = sum((length * sp.cos(turned) for length, turned in path), sp.S.Zero)
        momentum += mass * (z * rate(x) - x * rate(z)) + inertia * rate(angle)
        moment += mass * s.g * x
    assert_equal([d.momenta[0]], [momentum])
    assert_equal([-d.equations.gravity_terms[0]], [moment])
    assert all(map(is_zero, d.equations.mass_matrix.diff(s.q1)))
    assert d.equations.generalised_forces == sp.zeros(5, 1)


# Furuta pendulum: Cazzolato, Prime (2011), full equations of section 3 and the solved slender ones, (33) and (34).


def test_furuta_equations_of_cazzolato_and_prime() -> None:
    d, s = derived("furuta_pendulum")
    theta2 = s.swing + sp.pi / 2
    sine, cosine, double = sp.sin(theta2), sp.cos(theta2), sp.sin(2 * theta2)
    pivot = s.m2 * s.l2**2 + s.J2yy
    vertical = s.J1zz + s.m1 * s.l1**2 + s.m2 * s.L1**2 + pivot * sine**2 + s.J2xx * cosine**2
    coupling = s.m2 * s.L1 * s.l2
    first = (
        s.theta1_ddot * vertical
        + s.swing_ddot * coupling * cosine
        - coupling * sine * s.swing_dot**2
        + s.theta1_dot * s.swing_dot * double * (pivot - s.J2xx)
        + s.b1 * s.theta1_dot
    )
    second = (
        s.theta1_ddot * coupling * cosine
        + s.swing_ddot * (s.m2 * s.l2**2 + s.J2zz)
        + s.theta1_dot**2 * double * (s.J2xx - pivot) / 2
        + s.b2 * s.swing_dot
        + s.g * s.m2 * s.l2 * sine
    )
    assert_equal(d.forces, [first, second])


@pytest.mark.ci
def test_furuta_solved_equations_of_cazzolato_and_prime() -> None:
    d, s = derived("furuta_pendulum")
    slender = {s.J2xx: 0, s.J2yy: s.J2zz}
    theta2 = s.swing + sp.pi / 2
    sine, cosine, double = sp.sin(theta2), sp.cos(theta2), sp.sin(2 * theta2)
    J0 = s.J1zz + s.m1 * s.l1**2 + s.m2 * s.L1**2
    J2 = s.J2zz + s.m2 * s.l2**2
    k = s.m2 * s.L1 * s.l2
    tau1, tau2 = sp.symbols("tau1 tau2")
    divisor = J0 * J2 + J2**2 * sine**2 - k**2 * cosine**2
    motion = sp.Matrix([s.theta1_dot, s.swing_dot, s.theta1_dot * s.swing_dot, s.theta1_dot**2, s.swing_dot**2])
    load = sp.Matrix([tau1, tau2, s.g])
    turned = J0 + J2 * sine**2
    arm = sp.Matrix([[-J2 * s.b1, k * cosine * s.b2, -(J2**2) * double, -J2 * k * cosine * double / 2, J2 * k * sine]]) * motion
    arm += sp.Matrix([[J2, -k * cosine, s.m2**2 * s.l2**2 * s.L1 * double / 2]]) * load
    pendulum = sp.Matrix([[k * cosine * s.b1, -s.b2 * turned, k * J2 * cosine * double, double * J2 * turned / 2, -(k**2) * double / 2]])
    pendulum = pendulum * motion + sp.Matrix([[-k * cosine, turned, -s.m2 * s.l2 * sine * turned]]) * load
    solved = {s.theta1_ddot: arm[0] / divisor, s.swing_ddot: pendulum[0] / divisor}
    assert_equal(d.forces.subs(slender).subs(solved), [tau1, tau2])


# Spherical pendulum: Goldstein, chapter 1; Landau, Lifshitz, section 14.


def test_spherical_pendulum_equations() -> None:
    d, s = derived("spherical_pendulum")
    sine, cosine = sp.sin(s.theta), sp.cos(s.theta)
    polar = s.m * s.L**2 * (s.theta_ddot - s.phi_dot**2 * sine * cosine) + s.m * s.g * s.L * sine
    azimuth = s.m * s.L**2 * (s.phi_ddot * sine**2 + 2 * s.phi_dot * s.theta_dot * sine * cosine)
    assert_equal(d.forces, [polar, azimuth])
    assert_equal([d.momenta[1]], [s.m * s.L**2 * sine**2 * s.phi_dot])
    assert not d.equations.kinetic.has(s.phi)


def test_conical_pendulum() -> None:
    """omega^2 = g/(l cos theta), and small oscillations about the cone at omega^2 (1 + 3 cos^2 theta)."""
    d, s = derived("spherical_pendulum")
    omega = sp.sqrt(s.g / (s.L * sp.cos(s.theta)))
    steady = {s.theta_dot: 0, s.theta_ddot: 0, s.phi_ddot: 0, s.phi_dot: omega}
    assert_equal(d.forces.subs(steady), [0, 0])
    # With p_phi fixed, theta alone is left.
    momentum = sp.Symbol("momentum", positive=True)
    azimuth_rate = momentum / (s.m * s.L**2 * sp.sin(s.theta) ** 2)
    restoring = d.forces[0].subs({s.theta_ddot: 0, s.theta_dot: 0}).subs(s.phi_dot, azimuth_rate)
    stiffness = restoring.diff(s.theta).subs(momentum, s.m * s.L**2 * sp.sin(s.theta) ** 2 * omega)
    assert_equal([stiffness / (s.m * s.L**2)], [omega**2 * (1 + 3 * sp.cos(s.theta) ** 2)])


# Gyroscope in gimbals: Goldstein, section 5.7, for the top, with the gimbals' inertia added to A.


def gyroscope() -> tuple[SimpleNamespace, SimpleNamespace, sp.Expr, sp.Symbol, dict[sp.Symbol, sp.Expr]]:
    """Equations, symbols, theta, the spin's constant n = psi' + phi' cos theta, and the substitution that brings it in."""
    d, s = derived("gyroscope_gimbals")
    theta, n = s.tilt + sp.pi / 2, sp.Symbol("n", positive=True)
    return d, s, theta, n, {s.psi_dot: n - s.phi_dot * sp.cos(theta)}


def test_gyroscope_momenta_of_precession_and_spin_are_conserved() -> None:
    """Goldstein, equations 5.52 and 5.53: phi and psi are cyclic."""
    d, s, theta, n, with_spin = gyroscope()
    assert not (d.equations.kinetic + d.equations.potential).free_symbols & {s.phi, s.psi}
    across = s.I_o + (s.A + s.m * s.h**2 + s.I_y) * sp.sin(theta) ** 2 + s.I_z * sp.cos(theta) ** 2
    momenta = d.momenta.subs(with_spin)
    assert_equal([momenta[0], momenta[2]], [across * s.phi_dot + s.C * n * sp.cos(theta), s.C * n])
    for momentum, force in ((d.momenta[0], d.forces[0]), (d.momenta[2], d.forces[2])):
        rate = momentum.diff(s.tilt) * s.tilt_dot
        rate += sum(momentum.diff(v) * a for v, a in ((s.phi_dot, s.phi_ddot), (s.tilt_dot, s.tilt_ddot), (s.psi_dot, s.psi_ddot)))
        assert_equal([rate], [force])


def test_gyroscope_steady_precession() -> None:
    """Goldstein, equation 5.76: m g h = C n Omega - A' Omega^2 cos theta, A' with the inner gimbal's part."""
    d, s, theta, n, with_spin = gyroscope()
    steady = {s.phi_ddot: 0, s.tilt_ddot: 0, s.psi_ddot: 0, s.tilt_dot: 0}
    torques = d.forces.subs(steady).subs(with_spin)
    across = s.A + s.m * s.h**2 + s.I_y - s.I_z
    balance = s.C * n * s.phi_dot - across * s.phi_dot**2 * sp.cos(theta) - s.m * s.g * s.h
    assert_equal(torques, [0, balance * sp.sin(theta), 0])


@pytest.mark.parametrize("theta", [sp.pi / 3, sp.pi / 2, 2 * sp.pi / 3])
def test_fast_gyroscope_precesses_slowly(theta: sp.Expr) -> None:
    """Omega -> m g h/(C n) for a fast spin, whatever theta: Goldstein, section 5.7, the average precession."""
    d, s, _, n, with_spin = gyroscope()
    steady = {s.phi_ddot: 0, s.tilt_ddot: 0, s.psi_ddot: 0, s.tilt_dot: 0}
    torque = d.forces[1].subs(steady).subs(with_spin).subs(s.tilt, theta - sp.pi / 2)
    slow = sp.Symbol("slow")
    # Omega = slow/n: in the limit the balance is linear in it.
    limit = sp.limit(sp.expand(torque.subs(s.phi_dot, slow / n)), n, sp.oo)
    assert_equal(sp.solve(limit, slow), [s.m * s.g * s.h / s.C])


def test_gyroscope_nutation_frequency() -> None:
    """C n sin theta/sqrt(J_theta J_phi) without weight; without gimbals C n/A, as in Goldstein, section 5.7."""
    d, s, theta, n, _ = gyroscope()
    still = {s.phi_dot: 0, s.tilt_dot: 0, s.psi_dot: n}
    gyroscopic = d.forces.jacobian([s.phi_dot, s.tilt_dot, s.psi_dot]).subs(still)
    frequency = sp.Symbol("frequency", positive=True)
    free = (sp.I * frequency * d.equations.mass_matrix + gyroscopic).subs(s.g, 0)
    linear, cubic = sp.Poly(free.det(), frequency).all_coeffs()[-2::-2]
    about_nodes = s.A + s.m * s.h**2 + s.I_x
    about_vertical = s.I_o + (s.A + s.m * s.h**2 + s.I_y) * sp.sin(theta) ** 2 + s.I_z * sp.cos(theta) ** 2
    squared = s.C**2 * n**2 * sp.sin(theta) ** 2 / (about_nodes * about_vertical)
    assert_equal([-linear / cubic], [squared])
    assert_equal([squared.subs({s.I_o: 0, s.I_x: 0, s.I_y: 0, s.I_z: 0, s.h: 0})], [(s.C * n / s.A) ** 2])


# Bead on a rotating hoop: Taylor, Classical Mechanics, examples 7.6 and 7.7; theta from the lowest point.


def turning_hoop() -> tuple[SimpleNamespace, SimpleNamespace, sp.Expr, sp.Symbol, sp.Matrix]:
    """Equations, symbols, theta, Omega, and the forces at the constant rate Omega."""
    d, s = derived("rotating_hoop")
    omega = sp.Symbol("omega", positive=True)
    return d, s, s.rise + sp.pi / 2, omega, d.forces.subs({s.phi_ddot: 0, s.phi_dot: omega})


def test_bead_on_a_hoop_that_turns_steadily() -> None:
    """theta'' = (Omega^2 cos theta - g/R) sin theta, and the torque that keeps the hoop turning."""
    d, s, theta, omega, forces = turning_hoop()
    bead = s.m * s.R**2 * (s.rise_ddot - (omega**2 * sp.cos(theta) - s.g / s.R) * sp.sin(theta))
    torque = 2 * s.m * s.R**2 * omega * s.rise_dot * sp.sin(theta) * sp.cos(theta)
    assert_equal(forces, [torque, bead])
    assert_equal([d.momenta[0]], [(s.I_h + s.m * s.R**2 * sp.sin(theta) ** 2) * s.phi_dot])


def test_bead_rests_where_cosine_is_g_over_r_omega_squared() -> None:
    """cos theta = g/(R Omega^2), with small oscillations at sqrt(Omega^2 - (g/(Omega R))^2) about it."""
    _, s, theta, omega, forces = turning_hoop()
    bead = forces[1].subs({s.rise_ddot: 0, s.rise_dot: 0})
    cosine = s.g / (s.R * omega**2)
    rest = {s.rise: sp.acos(cosine) - sp.pi / 2}
    assert_equal([bead.subs(rest), sp.cos(theta).subs(rest)], [0, cosine])
    stiffness = bead.diff(s.rise).subs(rest) / (s.m * s.R**2)
    assert_equal([stiffness], [omega**2 - (s.g / (omega * s.R)) ** 2])
