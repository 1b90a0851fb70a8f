"""Loops against what the literature says of them, and against themselves: by multipliers and by reduced equations."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import replace

import flint
import mpmath
import numpy as np
import pytest
from support_constraints import BITS, DIGITS, ExactMotion, balls, by_both_ways, enclose_each_other

from harness.lagrange.derivation import load_mechanism
from harness.library import Library
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.truth.compare import compare
from harness.truth.manifold import closes, enclosed
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import sample, sample_in_blocks
from harness.verdict import AGREEMENT

LOOPS = (
    "four_bar",
    "slider_crank",
    "parallelogram",
    "four_bar_chain_2",
    "four_bar_chain_5",
    "four_bar_chain_10",
    "andrews_squeezer",
    "bricard",
)
MOST_USED = ("four_bar", "slider_crank")
# Central differences in mpmath leave 40 digits, of which accelerations near a dead point lose some.
STEP, SAME = mpmath.mpf(10) ** -20, mpmath.mpf(10) ** -30


def load(name: str) -> Mechanism:
    return load_mechanism(Library.built_in(), name)


def values_of(mechanism: Mechanism) -> dict[str, mpmath.mpf]:
    return {name: mpmath.mpf(value) for name, value, _ in mechanism.parameters}


# Masses that move, with the coordinates that they move along, as (mass, value); the joints' positions; and the potential energy.
Closed = tuple[list[tuple[mpmath.mpf, mpmath.mpf]], list[mpmath.mpf], mpmath.mpf]


def bar(mass: mpmath.mpf, length: mpmath.mpf, angle: mpmath.mpf, x: mpmath.mpf, z: mpmath.mpf) -> list[tuple[mpmath.mpf, mpmath.mpf]]:
    return [(mass, x), (mass, z), (mass * length**2 / 12, angle)]


def four_bar(p: dict[str, mpmath.mpf], crank: mpmath.mpf) -> Closed:
    """Norton, Design of Machinery, 5th ed., section 4.5: both angles of the open linkage by the half-angle formula."""
    a, b, c, d = (p[name] for name in "abcd")
    k1, k2, k3 = d / a, d / c, (a**2 - b**2 + c**2 + d**2) / (2 * a * c)
    k4, k5 = d / b, (c**2 - d**2 - a**2 - b**2) / (2 * a * b)
    cosine, sine = mpmath.cos(crank), mpmath.sin(crank)

    def by_half_angle(first: mpmath.mpf, last: mpmath.mpf) -> mpmath.mpf:
        return 2 * mpmath.atan2(sine - mpmath.sqrt(sine**2 - first * last), first)

    follower = by_half_angle(cosine - k1 - k2 * cosine + k3, k1 - (k2 + 1) * cosine + k3)
    coupler = by_half_angle(cosine - k1 + k4 * cosine + k5, k1 + (k4 - 1) * cosine + k5)
    heights = [a / 2 * sine, a * sine + b / 2 * mpmath.sin(coupler), c / 2 * mpmath.sin(follower)]
    widths = [a / 2 * cosine, a * cosine + b / 2 * mpmath.cos(coupler), d + c / 2 * mpmath.cos(follower)]
    bars = zip((p["m_a"], p["m_b"], p["m_c"]), (a, b, c), (crank, coupler, follower), widths, heights, strict=True)
    potential = p["g"] * (p["m_a"] * heights[0] + p["m_b"] * heights[1] + p["m_c"] * heights[2])
    return [entry for one in bars for entry in bar(*one)], [crank, coupler - crank, follower], potential


def slider_crank(p: dict[str, mpmath.mpf], crank: mpmath.mpf) -> Closed:
    """Norton, section 4.6: the rod's angle by an arcsine."""
    a, b = p["a"], p["b"]
    rod = -mpmath.asin(a / b * mpmath.sin(crank))
    slide = a * mpmath.cos(crank) + b * mpmath.cos(rod)
    heights = [a / 2 * mpmath.sin(crank), a * mpmath.sin(crank) + b / 2 * mpmath.sin(rod)]
    widths = [a / 2 * mpmath.cos(crank), a * mpmath.cos(crank) + b / 2 * mpmath.cos(rod)]
    moving = [
        *bar(p["m_a"], a, crank, widths[0], heights[0]),
        *bar(p["m_b"], b, rod, widths[1], heights[1]),
        (p["m_s"], slide),
    ]
    return moving, [crank, rod - crank, slide], p["g"] * (p["m_a"] * heights[0] + p["m_b"] * heights[1])


def parallelogram(p: dict[str, mpmath.mpf], crank: mpmath.mpf) -> Closed:
    """All cranks are parallel; the coupler translates."""
    masses, height = [p["m_l"], p["m_m"], p["m_r"]], p["a"] * mpmath.sin(crank)
    moving = [(mass * p["a"] ** 2 / 3, crank) for mass in masses]
    moving += [(p["m_c"], p["a"] * mpmath.cos(crank)), (p["m_c"], height)]
    return moving, [crank, -crank, crank, crank], p["g"] * height * (mpmath.fsum(masses) / 2 + p["m_c"])


def four_bar_chain(p: dict[str, mpmath.mpf], crank: mpmath.mpf, n: int) -> Closed:
    """Gonzalez et al. 2006, A02: n + 1 parallel cranks, n couplers that translate."""
    m, length = p["m"], p["L"]
    height = length * mpmath.sin(crank)
    moving = [((n + 1) * m * length**2 / 3, crank), (n * m, length * mpmath.cos(crank)), (n * m, height)]
    return moving, [crank, *[-crank, crank] * n], m * p["g"] * height * (mpmath.mpf(n + 1) / 2 + n)


CLOSED: dict[str, Callable[[dict[str, mpmath.mpf], mpmath.mpf], Closed]] = {
    "four_bar": four_bar,
    "slider_crank": slider_crank,
    "parallelogram": parallelogram,
    **{f"four_bar_chain_{n}": functools.partial(four_bar_chain, n=n) for n in (2, 5, 10)},
}


def closed_motion(
    closed: Callable[[mpmath.mpf], Closed], crank: mpmath.mpf, rate: mpmath.mpf, tau: Sequence[mpmath.mpf]
) -> tuple[list[mpmath.mpf], list[mpmath.mpf]]:
    """Rates and accelerations of the joints of a mechanism of one degree of freedom, by Eksergian's equation.

    I a + I' rate^2 / 2 + V' = tau . q', with I = sum m y'^2, and y', y'' central differences of the closed form.
    Source: Paul, Kinematics and Dynamics of Planar Machinery, section 12.50.
    """
    moving, joints, potential = zip(*(closed(crank + number * STEP) for number in (-1, 0, 1)), strict=True)
    masses = [mass for mass, _ in moving[1]]
    paths = [*zip(*([y for _, y in at] for at in moving), strict=True)]

    def first(path: Sequence[mpmath.mpf]) -> mpmath.mpf:
        return (path[2] - path[0]) / (2 * STEP)

    def second(path: Sequence[mpmath.mpf]) -> mpmath.mpf:
        return (path[2] - 2 * path[1] + path[0]) / STEP**2

    inertia = mpmath.fsum(mass * first(path) ** 2 for mass, path in zip(masses, paths, strict=True))
    turning = mpmath.fsum(mass * first(path) * second(path) for mass, path in zip(masses, paths, strict=True))
    ways = [*zip(*joints, strict=True)]
    work = mpmath.fsum(force * first(way) for force, way in zip(tau, ways, strict=True))
    acceleration = (work - first(potential) - turning * rate**2) / inertia
    return [first(way) * rate for way in ways], [first(way) * acceleration + second(way) * rate**2 for way in ways]


@pytest.mark.parametrize("count", [200, pytest.param(10_000, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("name", CLOSED)
def test_loops_of_one_degree_of_freedom_move_as_their_closed_form(name: str, count: int) -> None:
    """To 30 digits on the manifold; and at the doubles that engines read, within what rounding them does."""
    mechanism = load(name)
    motion, parameters, states = ExactMotion(mechanism), values_of(mechanism), sample(mechanism, count, seed=1)
    expected = []
    with mpmath.workdps(DIGITS):
        for index in range(count):
            crank, rate = mpmath.mpf(states.q[index, 0]), mpmath.mpf(states.v[index, 0])
            rates, accelerations = closed_motion(
                lambda x: CLOSED[name](parameters, x), crank, rate, list(map(mpmath.mpf, states.tau[index]))
            )
            for values, right in zip(motion.on_the_manifold(states, index), (rates, accelerations), strict=True):
                size = max(map(abs, right)) + 1
                assert all(abs(x - y) <= SAME * size for x, y in zip(values, right, strict=True)), states.as_json(index)
            expected.append([float(value) for value in accelerations])
    compared = compare(ReferenceKernel(mechanism).evaluate(states), np.array(expected))
    # Rounding q and v moves the truth by a data roundoff at most, and rounding what is expected by another.
    assert compared.backward_error.max() <= 2


def with_fault(mechanism: Mechanism, parameter: str) -> Mechanism:
    """The mechanism with one parameter wrong by 1e-10 of it."""
    entries = [(name, value * (1 + 1e-10) if name == parameter else value, unit) for name, value, unit in mechanism.parameters]
    return replace(mechanism, parameters=tuple(entries))


@pytest.mark.parametrize("name", LOOPS)
def test_a_fault_of_any_parameter_is_felt(name: str) -> None:
    """One of 1e-10 relative moves accelerations by more than agrees, or the states in which the constraints are closed.

    The place of a pivot on the ground does the latter alone: no derivative of a row has it.
    """
    mechanism = load(name)
    states = sample(mechanism, 100, seed=2)
    truth = ReferenceKernel(mechanism).evaluate(states)
    not_felt = []
    for parameter, _, _ in mechanism.parameters:
        faulty = with_fault(mechanism, parameter)
        moved = compare(truth, ReferenceKernel(faulty).evaluate(states).high).backward_error.max()
        if moved <= AGREEMENT and closes(mechanism, sample(faulty, 100, seed=2)).all():
            not_felt.append((parameter, moved))
    assert not_felt == []


@pytest.mark.parametrize(
    ("name", "count"),
    [
        *((name, 2000 if name in MOST_USED else 1000) for name in LOOPS),
        *(pytest.param(name, 100_000, marks=pytest.mark.nightly) for name in MOST_USED),
    ],
)
def test_both_ways_enclose_each_other(name: str, count: int) -> None:
    mechanism = load(name)
    by_multipliers, reduced = by_both_ways(mechanism)
    for states in sample_in_blocks(mechanism, count, seed=3):
        assert closes(mechanism, states).all()
        first, second = by_multipliers.evaluate(states), reduced.evaluate(states)
        assert first.certified.all() and second.certified.all()
        assert enclose_each_other(first, second).all()


def test_a_row_that_is_not_redundant_any_more_leaves_the_state_undecided() -> None:
    """The middle crank of a parallelogram stands 1e-10 beside its place: no configuration closes all rows."""
    mechanism = load("parallelogram")
    states = sample(mechanism, 20, seed=4)
    for parameter in ("e", "e_0", "d", "d_0"):
        faulty = with_fault(mechanism, parameter)
        assert all(enclosed(faulty, q, v) is None for q, v in zip(states.q, states.v, strict=True))
        assert not closes(faulty, sample(faulty, 20, seed=4)).any()


def test_andrews_squeezer_starts_as_published() -> None:
    """Hairer, Wanner II, section VII.7: accelerations and multipliers at the initial angles, all of their digits.

    The parameters are the decimal numbers of the text, whose coordinates and rows are those here.
    """
    mechanism = load("andrews_squeezer")
    published = {
        "beta": "-0.0617138900142764496358948458001",
        "theta": "0",
        "gamma": "0.455279819163070380255912382449",
        "phi": "0.222668390165885884674473185609",
        "delta": "0.487364979543842550225598953530",
        "Omega": "-0.222668390165885884674473185609",
        "epsilon": "1.23054744454982119249735015568",
    }
    with flint.ctx.workprec(BITS):
        q = balls(published[joint] for joint in mechanism.joints)
        still, torque = balls([0.0] * 7), balls(["0.033", *[0.0] * 6])
        found, multipliers = ExactMotion(mechanism).of(q, still, torque, balls(repr(value) for _, value, _ in mechanism.parameters))
        expected = balls(["14222.4439199541138705911625887", "-10666.8329399655854029433719415", *[0.0] * 5])
        expected_multipliers = balls(["98.5668703962410896057654982170", "-6.12268834425566265503114393122", *[0.0] * 4])
        for given, right in zip([*found, *multipliers], [*expected, *expected_multipliers], strict=True):
            assert abs(given - right) < flint.arb(10) ** -23


@pytest.mark.parametrize("count", [100, pytest.param(10_000, marks=pytest.mark.nightly)])
def test_bricard_has_threefold_symmetry(count: int) -> None:
    """Chen, You, Tarnai 2005, equation 9 at twists of a quarter turn: cos a + cos b + cos a cos b = 0, angles a and b in turns.

    Measured from the cube, sin q1 - sin q2 - sin q1 sin q2 = 0. The rest is by signs of the axes.
    """
    mechanism = load("bricard")
    motion, states = ExactMotion(mechanism), sample(mechanism, count, seed=1)

    def joints(first: mpmath.mpf) -> list[mpmath.mpf]:
        second = mpmath.asin(mpmath.sin(first) / (1 + mpmath.sin(first)))
        return [first, second, first, -second, -first]

    with mpmath.workdps(DIGITS):
        for index in range(count):
            q, rate = mpmath.mpf(states.q[index, 0]), mpmath.mpf(states.v[index, 0])
            rates, accelerations = motion.on_the_manifold(states, index)
            behind, here, ahead = (joints(q + step) for step in (-STEP, 0, STEP))
            for place in range(5):
                assert abs(states.q[index, place] - here[place]) < 1e-15
                first, second = (ahead[place] - behind[place]) / (2 * STEP), (ahead[place] - 2 * here[place] + behind[place]) / STEP**2
                assert abs(rates[place] - first * rate) < SAME * (1 + abs(rate))
                expected = first * accelerations[0] + second * rate**2
                assert abs(accelerations[place] - expected) < SAME * (1 + abs(accelerations[0]) + rate**2)


def test_flyball_governor_starts_with_its_springs_at_rest() -> None:
    """IFToMM A05: arms at 30 degrees below the horizontal, slider at half height, 2 pi rad/s; by hand, since no spring pulls there.

    I a'' = Iz' omega^2 / 2 - V', with Iz the arm's moment of inertia about the shaft. The slider falls freely.
    """
    mechanism = load("flyball_governor")
    p = {name: value for name, value, _ in mechanism.parameters}
    angle, omega = np.pi / 3, 2 * np.pi
    sine, cosine = np.sin(angle), np.cos(angle)
    across, along = p["m_r"] * (p["L"] ** 2 + p["w"] ** 2) / 12, p["m_r"] * p["w"] ** 2 / 6
    about_hinge = p["m_r"] * p["L"] ** 2 / 4 + across + p["m_b"] * p["L"] ** 2
    middle, end = p["L"] / 2, p["L"]
    outwards = p["m_r"] * (p["e"] + middle * sine) * middle * cosine + p["m_b"] * (p["e"] + end * sine) * end * cosine
    outwards += (across - along) * sine * cosine
    swing = (outwards * omega**2 - p["g"] * (p["m_r"] * middle + p["m_b"] * end) * sine) / about_hinge
    start = States.at(np.array([[0.3, angle, angle, 0.5]]), np.array([[omega, 0.0, 0.0, 0.0]]), np.zeros((1, 4)))
    found = ReferenceKernel(mechanism).evaluate(start).high[0]
    # Half an ulp of an angle stretches a spring of 8e5 N/m.
    np.testing.assert_allclose(found, [0.0, swing, swing, -p["g"]], rtol=1e-9, atol=1e-9)
