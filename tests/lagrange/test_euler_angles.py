"""Ball and free joints: Euler angles, quaternions, velocities, and charts that cover each other."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import mpmath
import numpy as np
import pytest
import sympy as sp
from support import is_zero
from sympy.physics.mechanics import dynamicsymbols

from harness.errors import InvalidSystem
from harness.lagrange.derivation import derive_mechanism, load_atlas, load_mechanism
from harness.lagrange.equations import derive
from harness.lagrange.euler_angles import Attitude, body_rates, rotation, sines_and_cosines
from harness.lagrange.system import TIME, System
from harness.library import Library
from harness.programs.mechanisms.kernel import Charts
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.truth.compare import compare
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import generic_sample

LIBRARY = Library.built_in()
SEQUENCES = ["".join(axes) for axes in itertools.product("xyz", repeat=3) if axes[0] != axes[1] != axes[2]]
ANGLES = dynamicsymbols("a b c")


def with_attitudes() -> list[str]:
    """Systems with a ball or free joint, told by their files' text so that nothing is derived on collection."""
    return [
        name
        for name in LIBRARY.system_names()
        if LIBRARY.system_path(name).is_file() and "Attitude(" in LIBRARY.system_path(name).read_text()
    ]


@pytest.fixture(params=with_attitudes())
def mechanism(request: pytest.FixtureRequest) -> Mechanism:
    return load_mechanism(LIBRARY, request.param)


@pytest.mark.parametrize("sequence", SEQUENCES)
def test_angles_come_back_from_the_rotation_matrix(sequence: str) -> None:
    middle = sp.Rational(7, 5) if sequence[0] == sequence[2] else sp.Rational(-6, 5)
    angles = (sp.Rational(-5, 2), middle, sp.Rational(13, 5))
    pairs, regularity = sines_and_cosines(sequence, rotation(sequence, angles))
    assert float(regularity) > 0.1
    for angle, (sine, cosine) in zip(angles, pairs, strict=True):
        assert abs(sp.N(sine - sp.sin(angle), 50)) < 1e-45
        assert abs(sp.N(cosine - sp.cos(angle), 50)) < 1e-45


@pytest.mark.parametrize("sequence", SEQUENCES)
def test_body_rates_are_those_of_the_rotation_matrix(sequence: str) -> None:
    turned = rotation(sequence, ANGLES)
    skew = turned.T * turned.diff(TIME)
    omega = body_rates(sequence, ANGLES) * sp.Matrix(ANGLES).diff(TIME)
    difference = sp.Matrix([skew[2, 1], skew[0, 2], skew[1, 0]]) - omega
    assert all(map(is_zero, difference))


def test_charts_agree_where_both_are_regular(mechanism: Mechanism) -> None:
    states = generic_sample(mechanism, 64, seed=5)
    first = ReferenceKernel(replace(mechanism, other_charts=())).evaluate(states)
    second = ReferenceKernel(replace(mechanism, program=mechanism.other_charts[0], other_charts=())).evaluate(states)
    assert first.certified.all() and second.certified.all()
    difference = np.abs((first.high - second.high) + (first.low - second.low))
    # Both are within 2^-80 of data that are of the order of the answers' norms.
    assert (difference <= 2.0**-70 * (1 + first.sensitivity[:, None])).all()
    np.testing.assert_allclose(first.sensitivity, second.sensitivity, rtol=1e-6)


@pytest.mark.parametrize(
    "rotation_quaternion", [(1, 0, 0, 0), (0, 0, 0, 1), (0, 1, 0, 0), (0.5, 0.5, 0.5, 0.5), (1, 1, 0, 0), (1, 0, 1, 0)]
)
def test_one_chart_covers_where_the_other_is_singular(mechanism: Mechanism, rotation_quaternion: tuple[float, ...]) -> None:
    states = generic_sample(mechanism, 1, seed=5)
    place = mechanism.attitudes[0]
    states.q[:, place : place + 4] = rotation_quaternion
    assert ReferenceKernel(mechanism).evaluate(states).certified.all()
    alone = [replace(mechanism, program=program, other_charts=()) for program in mechanism.charts(linear_velocity_in_body=False)]
    certified = [bool(ReferenceKernel(chart).evaluate(states).certified[0]) for chart in alone]
    assert any(certified)
    if rotation_quaternion == (1, 0, 0, 0):
        regularity = Charts(mechanism.charts(linear_velocity_in_body=False)).regularity(states.q)
        assert regularity.min() == 0 < regularity.max()
        # Equations that hold no angle any more, as those of a free body, which a top between contacts is, are certified in any chart.
        assert not all(certified) or mechanism.name in ("free_body", "tippe_top")


@pytest.mark.parametrize("quaternion", [(1, 0, 0, 0), (0.5, 0.5, 0.5, 0.5), (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0)])
def test_float64_accelerations_are_those_of_the_most_regular_chart(mechanism: Mechanism, quaternion: tuple[float, ...]) -> None:
    states = generic_sample(mechanism, 33, seed=5)
    place = mechanism.attitudes[0]
    states.q[::2, place : place + 4] = quaternion
    found = mechanism.float64().accelerations(states.q, states.v, states.tau)
    terms = mechanism.float64().terms(states.q, states.v, states.tau)
    charts = mechanism.charts(linear_velocity_in_body=False)
    used = list(Charts(charts).split(states.q))
    assert len(used) == 2
    for chart, chosen in used:
        alone = replace(mechanism, program=charts[chart], other_charts=()).float64()
        chosen_states = [part[chosen] for part in (states.q, states.v, states.tau)]
        np.testing.assert_allclose(found[chosen], alone.accelerations(*chosen_states), rtol=1e-13, atol=1e-11)
        for name, term in alone.terms(*chosen_states).items():
            np.testing.assert_allclose(terms[name][chosen], term, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("name", ["heavy_top", "quadrotor"])
def test_a_state_that_no_chart_covers_is_undecided(name: str) -> None:
    mechanism = load_mechanism(LIBRARY, name)
    single = replace(mechanism, other_charts=(), charts_in_body=())
    states = generic_sample(mechanism, 1, seed=5)
    place = mechanism.attitudes[0]
    half = math.sqrt(0.5)
    verdicts = set()
    for quaternion in ((1.0, 0.0, 0.0, 0.0), (half, 0.0, half, 0.0)):
        states.q[:, place : place + 4] = quaternion
        reference = ReferenceKernel(single).evaluate(states)
        verdicts.add(compare(reference, np.zeros((1, single.nv))).verdicts[0])
    assert "undecided" in verdicts


def test_the_length_of_a_quaternion_does_not_matter(mechanism: Mechanism) -> None:
    states = generic_sample(mechanism, 8, seed=2)
    place = mechanism.attitudes[0]
    q = states.q.copy()
    q[:, place : place + 4] *= 4.0
    longer = States.at(q, states.v, states.tau)
    kernel = ReferenceKernel(mechanism)
    np.testing.assert_array_equal(kernel.evaluate(states).high, kernel.evaluate(longer).high)


def test_both_frames_of_the_linear_velocity_tell_the_same_motion() -> None:
    """With v = R u, dv/dt = R (du/dt + omega x u) for the same rotation, and omega' is the same."""
    mechanism = load_mechanism(LIBRARY, "free_body")
    states = generic_sample(mechanism, 16, seed=9)
    in_body = ReferenceKernel(mechanism, linear_velocity_in_body=True).evaluate(states)
    assert in_body.certified.all()
    with mpmath.workdps(60):
        for index in range(len(states)):
            turned = _matrix(states.q[index, 3:])
            linear, omega = mpmath.matrix(states.v[index, :3].tolist()), states.v[index, 3:].tolist()
            force = mpmath.matrix(states.tau[index, :3].tolist())
            # Newton's law in the body's frame; the applied force is given there too.
            mass = mpmath.mpf(0.5)
            weight = turned.T * mpmath.matrix([0, 0, -mpmath.mpf(9.81)])
            a, b, c = omega
            cross = mpmath.matrix([[0, -c, b], [c, 0, -a], [-b, a, 0]]) * linear
            expected = force / mass + weight - cross
            for axis in range(3):
                found = mpmath.mpf(float(in_body.high[index, axis])) + mpmath.mpf(float(in_body.low[index, axis]))
                assert abs(found - expected[axis]) <= mpmath.mpf(2) ** -95 * (1 + abs(expected[axis]) + mpmath.norm(cross))


def test_free_body_obeys_eulers_equations() -> None:
    """A omega1' - (B - C) omega2 omega3 = torque, and cyclically (Goldstein, equation 5.39)."""
    mechanism = load_mechanism(LIBRARY, "free_body")
    states = generic_sample(mechanism, 16, seed=4)
    reference = ReferenceKernel(mechanism).evaluate(states)
    moments = [Fraction(1, 4), Fraction(3, 8), Fraction(1, 2)]
    for index in range(len(states)):
        omega = [Fraction(float(value)) for value in states.v[index, 3:]]
        for axis in range(3):
            j, k = (axis + 1) % 3, (axis + 2) % 3
            torque = Fraction(float(states.tau[index, 3 + axis]))
            expected = (torque + (moments[j] - moments[k]) * omega[j] * omega[k]) / moments[axis]
            found = Fraction(float(reference.high[index, 3 + axis])) + Fraction(float(reference.low[index, 3 + axis]))
            assert abs(found - expected) <= Fraction(2) ** -90 * (1 + abs(expected) + abs(torque) + abs(omega[j] * omega[k]))


def test_heavy_top_precesses_steadily() -> None:
    """At theta with rates (Omega, 0, s): m g l = Omega (I3 w3 - I1 Omega cos theta) keeps theta'' = 0 (Goldstein, 5.76)."""
    system = load_atlas(LIBRARY.system_path("heavy_top"))[0][0]
    equations = derive(system)
    phi_dot, theta_dot, psi_dot = equations.rates
    theta = equations.coordinates[1]
    m, length, across, along, g = system.parameters
    spin = (m * g * length / phi_dot + across * phi_dot * sp.cos(theta)) / along - phi_dot * sp.cos(theta)
    acceleration = equations.mass_matrix.LUsolve(equations.right_hand_side)
    steady = acceleration.subs(theta_dot, 0).subs(psi_dot, spin)
    assert all(map(is_zero, steady))


def _matrix(quaternion: np.ndarray) -> mpmath.matrix:
    """1 + 2 (w r + r r) / |quaternion|^2, r the matrix of the vector product with the vector part (Rodrigues)."""
    w, x, y, z = (mpmath.mpf(float(part)) for part in quaternion)
    across = mpmath.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return mpmath.eye(3) + (w * across + across * across) * 2 / (w * w + x * x + y * y + z * z)


@pytest.mark.parametrize(
    ("sequence", "angles", "position", "message"),
    [
        ("zz", ANGLES, (), "sequence"),
        ("xxy", ANGLES, (), "sequence"),
        ("abc", ANGLES, (), "sequence"),
        ("xyz", ANGLES[:2], (), "2 angles"),
        ("xyz", ANGLES, ANGLES[:1], "1 positions"),
    ],
)
def test_a_wrong_attitude_is_refused(sequence: str, angles: list[sp.Expr], position: list[sp.Expr], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Attitude("joint", tuple(angles), sequence, tuple(position))


def test_coordinates_must_fit_their_attitude() -> None:
    a, b, c = ANGLES
    m = sp.Symbol("m")
    with pytest.raises(ValueError, match="do not stand together"):
        System(
            coordinates={a: "ball", c: "ball", b: "ball"},
            attitudes=(Attitude("ball", (a, b, c), "xyz"),),
            kinetic=m * (a.diff(TIME) ** 2 + b.diff(TIME) ** 2 + c.diff(TIME) ** 2),
            potential=0,
            parameters={m: (1.0, "kg")},
            total_mass=m,
        )


def test_an_atlas_of_different_mechanisms_is_refused(tmp_path: Path) -> None:
    source = LIBRARY.system_path("heavy_top").read_text()
    path = tmp_path / "heavy_top.py"
    path.write_text(source + "\nfrom dataclasses import replace\nATLAS = (SYSTEM, replace(ATLAS[1], total_mass=2 * m))\n")
    with pytest.raises(InvalidSystem, match="ATLAS"):
        derive_mechanism(path, "heavy_top")
