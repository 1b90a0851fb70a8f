"""The certified reference against mpmath: the value, its data roundoff, and what cannot be certified."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from dataclasses import fields, replace
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp
from exact import solved
from sympy.physics.mechanics import dynamicsymbols

from harness.lagrange.system import TIME, System
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.numbers import SMALLEST_SCALE, UNIT_ROUNDOFF
from harness.programs.states import States
from harness.truth.compare import CERTIFIED_RADIUS
from harness.truth.reference import PRECISIONS, Reference, ReferenceKernel, energy_norm
from harness.truth.sampling import generic_sample

t = TIME
m, rod, g, k, w, big = sp.symbols("m rod g k w big", positive=True)
theta, phi, x = dynamicsymbols("theta phi x")
massless = sp.Symbol("massless", nonnegative=True)
# Half of the smallest subnormal number: float64 cannot write a remainder nearer than that.
SUBNORMAL = mpmath.mpf(2) ** -1075
# Random states of a system that mpmath evaluates; the special states come on top.
RANDOM = 10


def special_states(mechanism: Mechanism) -> States:
    """Zero, quarter turns, angles beyond 10^15, subnormal numbers, and mixtures of them, within the declared ranges."""
    nv = mechanism.nv
    values = [0.0, *(step * math.pi / 2 for step in (1, -1, 2, 3, 4)), 1e15, -1e15, 5e-324, -5e-324, 2.5e-310, 1e-160]

    def within(value: float, bounds: tuple[float, float] | None) -> float:
        return value if bounds is None else min(max(value, bounds[0]), bounds[1])

    rows = [[values[(start + 5 * column) % len(values)] for column in range(nv)] for start in range(len(values))]
    q = [[within(value, bounds) for value, bounds in zip(row, mechanism.position_ranges, strict=True)] for row in rows]
    small = [0.0, 5e-324, -1e-308, 3.0]
    v = [[within(small[(row + column) % 4], mechanism.rate_ranges[column]) for column in range(nv)] for row in range(len(values))]
    tau = [[(0.0, 5e-324, 1e8, -7.0)[(row // 2 + column) % 4] for column in range(nv)] for row in range(len(values))]
    return States.at(q, v, tau)


def flat(exact: Any, states: States, index: int) -> list[Any]:
    return [*states.q[index], *states.v[index], *states.tau[index], states.time[index], *exact.parameters]


def random_states(mechanism: Mechanism, count: int) -> States:
    return generic_sample(mechanism, count, zlib.crc32(mechanism.name.encode()))


@pytest.fixture(scope="session")
def plain_reference(plain_mechanism: Mechanism) -> ReferenceKernel:
    return ReferenceKernel(plain_mechanism)


def assert_encloses(reference: Reference, exact: Any, states: States) -> None:
    """The exact answer lies within the radius of high + low."""
    with mpmath.workdps(80):
        for index in np.flatnonzero(reference.certified):
            arguments = flat(exact, states, index)
            answer, mass = exact.accelerations(arguments), exact.mass(arguments)
            high, low = (mpmath.matrix(list(map(mpmath.mpf, part[index].tolist()))) for part in (reference.high, reference.low))
            error = exact.energy_norm(arguments, high + low - answer)
            smallest = sum(mpmath.sqrt(mass[i, i]) * SUBNORMAL for i in range(exact.nv))
            # The radius is a float64 norm, good to a few ulps; mpmath's own 80 digits lose what cancels.
            radius = mpmath.mpf(float(reference.radius[index])) * (1 + mpmath.mpf(2) ** -40)
            assert error <= radius + smallest + exact.energy_norm(arguments, answer) * mpmath.mpf(10) ** -40, states.as_json(index)


def test_midpoints_are_within_their_radius_of_mpmath(plain_mechanism: Mechanism, plain_reference: Any, plain_exact: Any) -> None:
    states = States.concatenate([random_states(plain_mechanism, RANDOM), special_states(plain_mechanism)])
    reference = plain_reference.evaluate(states)
    # Quarter turns are where coordinates are singular, if a system has any; a random state is not there.
    assert reference.certified[:RANDOM].all()
    assert_encloses(reference, plain_exact, states)


@pytest.mark.parametrize("name", ["collar", "bar_pendulum", "spring_damper", "cart_pendulum", "arm_2r"])
def test_seed_systems_are_certified_at_every_special_state(name: str) -> None:
    from harness.lagrange.derivation import load_mechanism
    from harness.library import Library

    mechanism = load_mechanism(Library.built_in(), name)
    assert ReferenceKernel(mechanism).evaluate(special_states(mechanism)).certified.all()


def test_high_is_high_plus_low_rounded(plain_mechanism: Mechanism, plain_reference: Any) -> None:
    states = States.concatenate([random_states(plain_mechanism, 200), special_states(plain_mechanism)])
    reference = plain_reference.evaluate(states)
    high, low = reference.high[reference.certified], reference.low[reference.certified]
    # A midpoint beside a tie has a low part that itself rounds to the half ulp; then either neighbour is right.
    tie = np.abs(low) == np.spacing(np.abs(high)) / 2
    assert ((high + low == high) | tie).all()
    assert tie.mean() < 0.25
    # And low is no idle zero: half of all answers are further than a quarter ulp from a float64.
    assert np.mean(reference.low[:200] != 0) > 0.25


def exact_sensitivity(exact: Any, arguments: list[Any]) -> tuple[mpmath.mpf, mpmath.mpf]:
    """sum over inputs of |dqdd/dz z|_M, by central differences with a step that leaves 40 digits, and sum over angles i of
    2 T |M^-1 e_i|_M, whose square is (2 T)^2 (M^-1)_ii."""
    with mpmath.workdps(80):
        arguments = list(map(mpmath.mpf, arguments))
        mass, total = exact.mass(arguments), mpmath.mpf(0)
        for index, value in enumerate(arguments):
            step = mpmath.mpf(10) ** -20 * max(abs(value), mpmath.mpf(10) ** -5)
            ahead, behind = (exact.accelerations([*arguments[:index], value + s, *arguments[index + 1 :]]) for s in (step, -step))
            change = (ahead - behind) / (2 * step)
            total += mpmath.sqrt((change.T * mass * change)[0]) * max(abs(value), mpmath.mpf(SMALLEST_SCALE))
        v = mpmath.matrix(arguments[exact.nv : 2 * exact.nv])
        inverse = mass**-1
        turning = [mpmath.sqrt(inverse[i, i]) for i, angle in enumerate(exact.system.rotating) if angle]
        return total, (v.T * mass * v)[0] * mpmath.fsum(turning)


def test_data_roundoff_is_what_half_an_ulp_in_every_input_does(plain_mechanism: Mechanism, plain_reference: Any, plain_exact: Any) -> None:
    states = random_states(plain_mechanism, 2 if len(plain_mechanism.parameters) < 20 else 1)
    reference = plain_reference.evaluate(states)
    for index in range(len(states)):
        sensitivity, motion = exact_sensitivity(plain_exact, flat(plain_exact, states, index))
        assert float(sensitivity) == pytest.approx(reference.sensitivity[index], rel=1e-6)
        fall = plain_mechanism.gravity * math.sqrt(plain_mechanism.total_mass)
        weight = fall if reference.size[index] < fall / 8 else 0.0
        assert float(motion) + weight == pytest.approx(reference.share[index], rel=1e-6)
        assert reference.data_roundoff[index] == 2.0**-53 * reference.sensitivity[index]


def test_inputs_that_are_zero_still_round_as_the_smallest_normal_numbers_do(mechanism_of: Callable[[System], Mechanism]) -> None:
    """At rest only x, v and tau of m a = tau - k x - c v matter; half an ulp of each is 2^-1074 (Demmel 1984)."""
    c = sp.Symbol("c", positive=True)
    system = System(
        coordinates={x: "slide"},
        kinetic=m * x.diff(t) ** 2 / 2,
        potential=k * x**2 / 2,
        generalised_forces={x: -c * x.diff(t)},
        parameters={m: (4.0, "kg"), k: (80.0, "N/m"), c: (0.5, "N s/m")},
        total_mass=m,
    )
    reference = ReferenceKernel(mechanism_of(system)).evaluate(States.at([[0.0]], [[0.0]], [[0.0]]))
    assert reference.certified.all()
    assert reference.sensitivity[0] == pytest.approx(2.0**-1021 * (80.0 + 0.5 + 1.0) / 2.0, rel=1e-12)


def test_norm_factor_is_a_root_of_the_mass_matrix(plain_mechanism: Mechanism, plain_reference: Any, plain_exact: Any) -> None:
    states = random_states(plain_mechanism, 3)
    reference = plain_reference.evaluate(states)
    vectors = np.linspace(-1.0, 2.0, 3 * plain_mechanism.nv).reshape(3, -1)
    for index, norm in enumerate(energy_norm(reference.norm_factor, vectors)):
        arguments = flat(plain_exact, states, index)
        expected = plain_exact.energy_norm(arguments, mpmath.matrix(vectors[index].tolist()))
        assert float(expected) == pytest.approx(norm, rel=1e-9)
        assert np.array_equal(reference.norm_factor[index], np.triu(reference.norm_factor[index]))


def oscillator_chain(metre: float) -> System:
    """Cart with a pendulum whose lengths are counted in units of 1 / ``metre`` metres."""
    position = x / metre
    centre = sp.Matrix([position + rod * sp.sin(theta), -rod * sp.cos(theta)])
    velocity = centre.diff(t)
    return System(
        coordinates={x: "slide", theta: "pin"},
        kinetic=m * position.diff(t) ** 2 / 2 + m * velocity.dot(velocity) / 2,
        potential=k * position**2 / 2 - m * g * rod * sp.cos(theta),
        parameters={m: (1.3, "kg"), rod: (0.7, "m"), g: (9.81, "m/s^2"), k: (31.0, "N/m")},
        total_mass=2 * m,
        gravity=g,
        # A coordinate without a range is taken for an angle, and an angle has no unit to choose.
        ranges={x: (-1e4, 1e4)},
    )


def test_norms_do_not_depend_on_the_unit_of_a_coordinate(mechanism_of: Callable[[System], Mechanism]) -> None:
    """A length in units of 2^-10 m is the same float64 but for its exponent, so nothing but rounding may change."""
    unit = 1024.0
    q, v, tau = np.array([[0.3, 1.1], [-2.0, 3.0]]), np.array([[1.0, -2.0], [0.5, 4.0]]), np.array([[3.0, 0.2], [0.0, 1.0]])
    metres = ReferenceKernel(mechanism_of(oscillator_chain(1))).evaluate(States.at(q, v, tau))
    factor = np.array([unit, 1.0])
    other = ReferenceKernel(mechanism_of(oscillator_chain(sp.Integer(1024)))).evaluate(States.at(q * factor, v * factor, tau / factor))
    assert np.array_equal(other.high, metres.high * factor)
    for name in ("sensitivity", "instability"):
        assert getattr(other, name) == pytest.approx(getattr(metres, name), rel=1e-12)
    vectors = np.array([[1.0, 2.0], [-3.0, 0.5]])
    assert energy_norm(other.norm_factor, vectors * factor) == pytest.approx(energy_norm(metres.norm_factor, vectors), rel=1e-13)


def double_pendulum(relative: bool, second_mass: float = 2.0) -> System:
    """Two point masses on rods, the second angle counted from the first rod or from the vertical."""
    m2 = sp.Symbol("m2", nonnegative=True)
    second = theta + phi if relative else phi
    one = rod * sp.Matrix([sp.sin(theta), -sp.cos(theta)])
    two = one + rod * sp.Matrix([sp.sin(second), -sp.cos(second)])
    first_velocity, second_velocity = one.diff(t), two.diff(t)
    return System(
        coordinates={theta: "a", phi: "b"},
        kinetic=m * first_velocity.dot(first_velocity) / 2 + m2 * second_velocity.dot(second_velocity) / 2,
        potential=m * g * one[1] + m2 * g * two[1],
        parameters={m: (1.0, "kg"), m2: (second_mass, "kg"), rod: (0.5, "m"), g: (9.81, "m/s^2")},
        total_mass=m + m2,
        gravity=g,
    )


def test_energy_norm_is_the_same_in_relative_and_absolute_angles(mechanism_of: Callable[[System], Mechanism]) -> None:
    """|x|_M is the kinetic energy of the motion x; the angles are chosen so that their sums are exact."""
    states = States.at([[0.5, 0.75]], [[1.5, -0.25]], [[0.0, 0.0]])
    relative = ReferenceKernel(mechanism_of(double_pendulum(relative=True))).evaluate(states)
    sums = States.at([[0.5, 1.25]], [[1.5, 1.25]], [[0.0, 0.0]])
    absolute = ReferenceKernel(mechanism_of(double_pendulum(relative=False))).evaluate(sums)
    to_absolute = np.array([[1.0, 0.0], [1.0, 1.0]])
    answer = relative.high[0] + relative.low[0]
    assert to_absolute @ answer == pytest.approx(absolute.high[0], rel=1e-14)
    size = energy_norm(relative.norm_factor, relative.high)
    assert size == pytest.approx(energy_norm(absolute.norm_factor, absolute.high), rel=1e-13)
    # And it is no plain norm, which does change.
    assert abs(np.linalg.norm(relative.high) / np.linalg.norm(absolute.high) - 1) > 0.01


def spherical_pendulum() -> System:
    return System(
        coordinates={theta: "tilt", phi: "turn"},
        kinetic=m * rod**2 * (theta.diff(t) ** 2 + sp.sin(theta) ** 2 * phi.diff(t) ** 2) / 2,
        potential=-m * g * rod * sp.cos(theta),
        parameters={m: (1.0, "kg"), rod: (0.5, "m"), g: (9.81, "m/s^2")},
        total_mass=m,
        gravity=g,
    )


def test_a_singular_mass_matrix_is_marked_and_its_neighbours_are_certified(mechanism_of: Callable[[System], Mechanism]) -> None:
    kernel = ReferenceKernel(mechanism_of(spherical_pendulum()))
    reference = kernel.evaluate(States.at([[1.0, 0.2], [0.0, 0.2], [math.pi, 0.2]], [[1.0, 2.0]] * 3, [[0.1, 0.2]] * 3))
    # math.pi is not pi: sin of it is 1.2e-16, and the mass matrix is regular there.
    assert reference.certified.tolist() == [True, False, True]
    assert reference.bits[1] == PRECISIONS[-1]
    assert len(reference) == 3


def test_a_mass_matrix_singular_everywhere_is_never_certified(mechanism_of: Callable[[System], Mechanism]) -> None:
    massless = mechanism_of(double_pendulum(relative=True, second_mass=0.0))
    reference = ReferenceKernel(massless).evaluate(States.at([[0.3, 0.4], [0.0, 0.0]], [[1.0, 2.0]] * 2, [[0.0, 1.0]] * 2))
    assert not reference.certified.any()


def test_the_reason_of_each_state_that_is_undecided_is_told(mechanism_of: Callable[[System], Mechanism]) -> None:
    mechanism = mechanism_of(double_pendulum(relative=True))
    found = ReferenceKernel(mechanism).evaluate(random_states(mechanism, 7))
    assert found.certified.all() and not list(found.why_undecided())
    high, condition, sensitivity = found.high.copy(), found.condition.copy(), found.sensitivity.copy()
    radius, bits = found.radius.copy(), found.bits.copy()
    high[0, 0] = condition[1] = sensitivity[2] = math.inf
    bits[4:6], radius[4:6], sensitivity[6], radius[6] = [PRECISIONS[0], PRECISIONS[-1]], 0.25 * sensitivity[4:6], 0.0, 1.0
    certified = np.arange(7) == 7
    changed = replace(found, high=high, condition=condition, sensitivity=sensitivity, radius=radius, bits=bits, certified=certified)
    for reason, said in zip(
        [
            f"M is singular, or not certainly regular at {PRECISIONS[-1]} bits, or it is not certain on which side",
            "M is not certainly positive definite",
            f"the equations have no derivative there that {PRECISIONS[-1]} bits would show",
            "the state does not close the constraints",
            f"the radius is 2.5e-01 of the sensitivity at {PRECISIONS[0]} bits; 8.7e-19 is needed; accelerations cancel further",
            f"the radius is 2.5e-01 of the sensitivity at {PRECISIONS[-1]} bits; 8.7e-19 is needed",
            "the radius is inf of the sensitivity at ",
        ],
        changed.why_undecided(),
        strict=True,
    ):
        assert said.startswith(reason)
    reasons = list(changed.why_undecided())
    assert reasons[5].endswith("is needed") and reasons[6].endswith("holds them")


def test_an_engine_of_single_precision_is_judged_by_what_that_rounds(mechanism_of: Callable[[System], Mechanism]) -> None:
    mechanism = mechanism_of(double_pendulum(relative=True))
    double, single = ReferenceKernel(mechanism), ReferenceKernel(mechanism, unit_roundoff=2.0**-24)
    states = random_states(mechanism, 5)
    asked = single.asked_at(states)
    for name in ("q", "v", "tau"):
        given, taken = getattr(states, name), getattr(asked, name)
        assert (taken == taken.astype(np.float32)).all() and (np.abs(taken - given) <= 2.0**-24 * np.abs(given)).all()
        assert (taken != given).any()
    assert double.asked_at(states) is states
    own, of_single = double.evaluate(asked), single.evaluate(asked)
    np.testing.assert_array_equal(of_single.high, own.high)
    np.testing.assert_array_equal(of_single.radius, own.radius)
    for name in ("sensitivity", "share", "instability"):
        np.testing.assert_array_equal(getattr(of_single, name), 2.0**29 * getattr(own, name))


def test_one_coordinate_without_inertia_is_not_certified(mechanism_of: Callable[[System], Mechanism]) -> None:
    system = System(
        coordinates={x: "a"},
        kinetic=massless * x.diff(t) ** 2 / 2,
        potential=k * x**2,
        parameters={massless: (0.0, "kg"), k: (1.0, "N/m")},
        total_mass=massless,
    )
    assert not ReferenceKernel(mechanism_of(system)).evaluate(States.at([[1.0]], [[0.0]], [[0.0]])).certified.any()


def cancelling() -> System:
    """Acceleration big (1 + x/big) - big, which is x."""
    return System(
        coordinates={x: "a"},
        kinetic=m * x.diff(t) ** 2 / 2,
        potential=0,
        generalised_forces={x: big * (1 + x / big) - big},
        parameters={m: (1.0, "kg"), big: (2.0**150, "N")},
        total_mass=m,
    )


def test_precision_grows_with_cancellation(mechanism_of: Callable[[System], Mechanism]) -> None:
    """At 128 bits nothing of x is left: the answer needs 256."""
    states = States.at([[0.3], [-1e-3]], [[0.0]] * 2, [[0.0]] * 2)
    reference = ReferenceKernel(mechanism_of(cancelling())).evaluate(states)
    assert reference.certified.all()
    assert (reference.bits > PRECISIONS[0]).all()
    assert np.array_equal(reference.high[:, 0], states.q[:, 0])
    assert (reference.radius <= CERTIFIED_RADIUS * reference.sensitivity).all()


def test_accelerations_alone_are_asked_of_pairs_of_float64_and_of_one_precision_of_balls(
    mechanism_of: Callable[[System], Mechanism],
) -> None:
    """Digits of x are left in pairs of float64 where nothing cancels, then in balls, then in neither."""
    sizes = np.array([1.0, 2.0**60, 2.0**150, 2.0**60, 1.0])
    states = States.at([[0.3]] * 5, *np.zeros((2, 5, 1)))
    high, low = ReferenceKernel(mechanism_of(cancelling())).accelerations(states, np.column_stack([np.ones(5), sizes]))
    np.testing.assert_array_equal(high[:, 0], np.where(sizes < 2.0**150, 0.3, math.nan))
    np.testing.assert_array_equal(np.abs(low[:, 0]) < 2.0**-60, sizes < 2.0**150)


@pytest.mark.parametrize(("light", "is_certified"), [(1e-20, True), (1e-38, False)])
def test_what_high_and_low_lose_is_part_of_the_radius(
    light: float, is_certified: bool, mechanism_of: Callable[[System], Mechanism]
) -> None:
    """Accelerations of 1e38 m/s^2 that cancel but for 1 m/s^2: their storage is far beyond data roundoff."""
    e, other = sp.Symbol("e", positive=True), dynamicsymbols("other")
    system = System(
        coordinates={x: "a", other: "b"},
        kinetic=m * (x.diff(t) + other.diff(t)) ** 2 / 2 + e * other.diff(t) ** 2 / 2,
        potential=0,
        parameters={m: (1.0, "kg"), e: (light, "kg")},
        total_mass=m + e,
    )
    applied = (0.1, 0.7)
    reference = ReferenceKernel(mechanism_of(system)).evaluate(States.at([[0.0, 0.0]], [[0.0, 0.0]], [list(applied)]))
    first, second = map(Fraction, applied)
    exact_b = (second - first) / Fraction(light)
    exact = (first - exact_b, exact_b)
    lost = [Fraction(high) + Fraction(low) - one for high, low, one in zip(reference.high[0], reference.low[0], exact, strict=True)]
    length = math.sqrt((lost[0] + lost[1]) ** 2 + Fraction(light) * lost[1] ** 2)
    assert 0 < length <= reference.radius[0]
    assert reference.certified.tolist() == [is_certified]
    assert reference.bits[0] < PRECISIONS[-1]
    assert is_certified or "than high + low holds them" in next(reference.why_undecided())


def test_states_that_are_no_numbers_are_marked(plain_mechanism: Mechanism, plain_reference: Any) -> None:
    nv = plain_mechanism.nv
    good = random_states(plain_mechanism, 1)
    rows = [good]
    for name in ("q", "v", "tau"):
        for bad in (math.nan, math.inf, -math.inf):
            parts = {field.name: getattr(good, field.name).copy() for field in fields(States)}
            parts[name][0, nv - 1] = bad
            rows.append(States(**parts))
    reference = plain_reference.evaluate(States.concatenate(rows))
    assert reference.certified.tolist() == [True] + [False] * 9


def test_no_state_at_all_gives_an_empty_reference(plain_mechanism: Mechanism, plain_reference: Any) -> None:
    reference = plain_reference.evaluate(random_states(plain_mechanism, 0))
    assert len(reference) == 0
    assert reference.high.shape == (0, plain_mechanism.nv)


def test_many_states_are_those_of_smaller_batches(plain_mechanism: Mechanism, plain_reference: Any) -> None:
    """More states than are evaluated at once; the order is kept."""
    states = random_states(plain_mechanism, 2100)
    whole = plain_reference.evaluate(states)
    ends = plain_reference.evaluate(States.concatenate([states[:3], states[2045:2052], states[2097:]]))
    indices = [*range(3), *range(2045, 2052), *range(2097, 2100)]
    assert len(whole) == 2100
    assert np.array_equal(whole.high[indices], ends.high)
    assert np.array_equal(whole.low[indices], ends.low)


def test_time_is_an_input(mechanism_of: Callable[[System], Mechanism]) -> None:
    """Pendulum whose pivot shakes as b cos(w t): rod a = -(g - b w^2 cos(w t)) sin(theta) (Landau, Lifshitz, section 5)."""
    b = sp.Symbol("b", positive=True)
    pivot = b * sp.cos(w * t)
    velocity = sp.Matrix([rod * sp.sin(theta), pivot - rod * sp.cos(theta)]).diff(t)
    system = System(
        coordinates={theta: "pin"},
        kinetic=m * velocity.dot(velocity) / 2,
        potential=m * g * (pivot - rod * sp.cos(theta)),
        parameters={m: (1.5, "kg"), rod: (0.7, "m"), g: (9.81, "m/s^2"), b: (0.1, "m"), w: (7.0, "1/s")},
        total_mass=m,
        gravity=g,
    )
    times = np.array([0.0, 0.1, 1.7, 1e6])
    reference = ReferenceKernel(mechanism_of(system)).evaluate(States.at([[0.6]] * 4, [[2.0]] * 4, [[0.0]] * 4, times))
    assert reference.certified.all()
    with mpmath.workdps(80):
        length, gravity, stroke, rate, angle = map(mpmath.mpf, (0.7, 9.81, 0.1, 7.0, 0.6))
        for index, time in enumerate(times.tolist()):
            expected = -(gravity - stroke * rate**2 * mpmath.cos(rate * mpmath.mpf(time))) / length * mpmath.sin(angle)
            high, low, norm, radius = (
                mpmath.mpf(float(part[index].item())) for part in (reference.high, reference.low, reference.norm_factor, reference.radius)
            )
            assert abs(high + low - expected) <= radius / norm + abs(high) * mpmath.mpf(2) ** -106
    assert len(set(reference.high[:, 0].tolist())) == 4


def test_instability_is_the_documented_bound(plain_mechanism: Mechanism, plain_reference: Any, plain_exact: Any) -> None:
    """16 nv kappa_s (|qdd|_M + norms of M^-1 tau, M^-1 c, M^-1 g, M^-1 p), kappa_s of M scaled to unit diagonal."""
    exact = plain_exact
    states = random_states(plain_mechanism, 3)
    reference = plain_reference.evaluate(states)
    if plain_mechanism.constraints is not None:
        # Of the tree; tests/truth/test_manifold.py has what constraints add.
        tree = replace(plain_mechanism, program=plain_mechanism.constraints.tree, constraints=None)
        reference = ReferenceKernel(tree).evaluate(states)
    equations = exact.equations
    separate = exact.function([*exact.forces, *equations.velocity_terms, *equations.gravity_terms, *equations.passive_forces])
    for index in range(3):
        arguments = flat(exact, states, index)
        with mpmath.workdps(80):
            mass, n = exact.mass(arguments), exact.nv
            values = separate(arguments)
            size = exact.energy_norm(arguments, solved(*exact.mass_and_force(arguments)))
            for part in range(4):
                size += exact.energy_norm(arguments, solved(mass, mpmath.matrix(values[part * n : (part + 1) * n])))
            scaled = mpmath.matrix(n, n)
            for i in range(n):
                for j in range(n):
                    scaled[i, j] = mass[i, j] / mpmath.sqrt(mass[i, i] * mass[j, j])
            eigenvalues = mpmath.eigsy(scaled, eigvals_only=True)
            expected = 16 * n * max(eigenvalues) / min(eigenvalues) * size
        assert float(expected) == pytest.approx(reference.instability[index], rel=1e-6)


def test_unit_roundoff_is_that_of_float64() -> None:
    assert 1.0 + UNIT_ROUNDOFF == 1.0
    assert 1.0 + np.nextafter(UNIT_ROUNDOFF, 1.0) > 1.0
