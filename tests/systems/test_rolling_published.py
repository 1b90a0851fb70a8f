"""Rolling, ropes, linkages and robots with loops: what texts print of them, held against certified states and accelerations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import mpmath
import numpy as np
import pytest
from support_constraints import by_reduction

from harness.lagrange.derivation import load_mechanism
from harness.library import Library
from harness.programs.mechanisms.constraint_forces import constrained_program
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.states import States
from harness.truth.manifold import closed, closes
from harness.truth.reference import Reference, ReferenceKernel, energy_norm
from harness.truth.sampling import sample

BUILT_IN = Library.built_in()
SEED = 23
DIGITS = 50
# Of the numbers that ``sample`` draws; by night of the bead, which the project began with.
FEW, COUNT, MANY = 50, 1000, 100_000

Named = Mapping[str, Any]


def mechanism_named(name: str) -> Mechanism:
    return load_mechanism(BUILT_IN, name)


def open_between(one: Reference, other: Reference) -> np.ndarray:
    """(n,) what the radii of two enclosures leave open between them, with the rounding of the low parts [sqrt(J)/s]."""
    return np.asarray(one.radius + other.radius + 2.0**-104 * one.size)


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("rolling_disc_on_incline", COUNT),
        ("atwood", COUNT),
        ("rolling_disc", COUNT),
        ("watt_linkage", COUNT),
        ("two_fingers_bar", COUNT),
        ("cycloid_bead", 2 * COUNT),
        # What takes balls at many states has most of them by night.
        ("delta_robot", FEW),
        ("whipple_bicycle", FEW),
        *(pytest.param(name, COUNT, marks=pytest.mark.nightly) for name in ("delta_robot", "whipple_bicycle")),
        pytest.param("cycloid_bead", MANY, marks=pytest.mark.nightly),
    ],
)
def test_multipliers_and_reduction_enclose_the_same_accelerations(name: str, count: int) -> None:
    mechanism = mechanism_named(name)
    assert mechanism.constraints is not None
    states = sample(mechanism, count, SEED)
    assert closes(mechanism, states).all()
    reduced = replace(mechanism, program=constrained_program(mechanism.constraints, by_reduction))
    one, other = (ReferenceKernel(way).evaluate(states) for way in (mechanism, reduced))
    assert one.certified.all() and other.certified.all()
    apart = energy_norm(one.norm_factor, (one.high - other.high) + (one.low - other.low))
    assert (apart <= open_between(one, other)).all()


def disc_on_incline(q: Any, v: Any, tau: Any, p: Named) -> list[Any]:
    """Goldstein, section 2.4, for a disc: two thirds of what it would have without rolling; tau are forces along the joints."""
    pull = p["g"] * mpmath.sin(p["alpha"]) + tau[0] / p["m"] + tau[1] / (p["m"] * p["R"])
    return [2 * pull / 3, 2 * pull / (3 * p["R"])]


def atwood(q: Any, v: Any, tau: Any, p: Named) -> list[Any]:
    """Taylor, problem 7.8, with a pulley that turns: a = (m_right - m_left) g / (m_left + m_right + I/R^2)."""
    pull = (p["m_right"] - p["m_left"]) * p["g"] + tau[0] / p["R"] + tau[1] - tau[2]
    rise = pull / (p["m_left"] + p["m_right"] + p["I"] / p["R"] ** 2)
    return [rise / p["R"], rise, -rise]


def cycloid(q: Any, v: Any, tau: Any, p: Named) -> list[Any]:
    """Taylor, problem 6.25: 2 m R^2 (1 - cos phi) phi'' + m R^2 sin phi phi'^2 - m g R sin phi = tau."""
    phi, rate = q[1] + mpmath.pi / 2, v[1]
    pull = p["m"] * p["R"] * mpmath.sin(phi) * (p["g"] - p["R"] * rate**2) + tau[1] + p["R"] * tau[0]
    turn = pull / (2 * p["m"] * p["R"] ** 2 * (1 - mpmath.cos(phi)))
    return [p["R"] * turn, turn]


def disc_by_newton_euler(q: Any, v: Any, tau: Any, p: Named) -> list[Any]:
    """McDonald, The rolling motion of a disk on a horizontal plane (2000), section 2.1, with applied forces besides.

    Vectors are along the heading, the axle, and from the contact to the centre. The contact is at rest: the centre's velocity is
    w x R e_3. Forces on the centre and the moment about it grow momentum m v and angular momentum H = (A, C, A) w.
    """
    (_, _, yaw, lean, _), (_, _, yaw_rate, lean_rate, spin_rate) = q, v
    m, R, sine, cosine = p["m"], p["R"], mpmath.sin(lean), mpmath.cos(lean)
    A, C = m * R**2 / 4, m * R**2 / 2
    frame = mpmath.matrix([lean_rate, yaw_rate * sine, yaw_rate * cosine])
    w = frame + mpmath.matrix([0, spin_rate, 0])
    ahead, left = (tau[0] * mpmath.cos(yaw) + tau[1] * mpmath.sin(yaw), tau[1] * mpmath.cos(yaw) - tau[0] * mpmath.sin(yaw))
    # The applied forces push the centre in the plane; the moment has the applied torques as components along the joints' axes.
    push = mpmath.matrix([ahead, left * cosine - m * p["g"] * sine, -left * sine - m * p["g"] * cosine])
    moment = mpmath.matrix([tau[3], tau[4], (tau[2] - tau[4] * sine) / cosine])
    drift = cross(frame, R * mpmath.matrix([w[1], -w[0], 0]))
    turning = cross(frame, mpmath.matrix([A * w[0], C * w[1], A * w[2]]))
    # The plane's force is m a - push, at -R e_3.
    free = moment - cross(mpmath.matrix([0, 0, -R]), push - m * drift) - turning
    grown = [free[0] / (A + m * R**2), free[1] / (C + m * R**2), free[2] / A]
    yaw_growth = (grown[2] + yaw_rate * lean_rate * sine) / cosine
    spin_growth = grown[1] - yaw_growth * sine - yaw_rate * lean_rate * cosine
    along = drift + R * mpmath.matrix([grown[1], -grown[0], 0])
    level = along[1] * cosine - along[2] * sine
    x = along[0] * mpmath.cos(yaw) - level * mpmath.sin(yaw)
    y = along[0] * mpmath.sin(yaw) + level * mpmath.cos(yaw)
    return [x, y, yaw_growth, grown[0], spin_growth]


def cross(a: Any, b: Any) -> Any:
    return mpmath.matrix([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@pytest.mark.ci
@pytest.mark.parametrize(
    ("name", "closed_form"),
    [
        ("rolling_disc_on_incline", disc_on_incline),
        ("atwood", atwood),
        ("cycloid_bead", cycloid),
        ("rolling_disc", disc_by_newton_euler),
    ],
)
@mpmath.workdps(DIGITS)
def test_accelerations_are_those_of_the_closed_form(name: str, closed_form: Callable[..., list[Any]]) -> None:
    """Nothing is rounded on the way: the closed form has the very numbers of the states and the parameters."""
    mechanism = mechanism_named(name)
    states = sample(mechanism, COUNT, SEED)
    reference = ReferenceKernel(mechanism).evaluate(states)
    parameters = {name: mpmath.mpf(value) for name, value, _ in mechanism.parameters}
    apart = np.empty_like(reference.high)
    for index in range(len(states)):
        state = ([mpmath.mpf(value) for value in part[index].tolist()] for part in (states.q, states.v, states.tau))
        pairs = zip(reference.high[index].tolist(), reference.low[index].tolist(), strict=True)
        found = [mpmath.mpf(high) + mpmath.mpf(low) for high, low in pairs]
        apart[index] = [float(a - b) for a, b in zip(found, closed_form(*state, parameters), strict=True)]
    assert (energy_norm(reference.norm_factor, apart) <= open_between(reference, reference)).all()


def disc_states(**given: Any) -> States:
    """Free states of the rolling disc from columns of "lean" and of rates; what is left out is 0."""
    columns = dict(zip(given, np.broadcast_arrays(*map(np.asarray, given.values())), strict=True))
    count = len(next(iter(columns.values())))
    names = ("x", "y", "yaw", "lean", "spin")
    q, v = (np.array([columns.get(name + ending, np.zeros(count)) for name in names]).T for ending in ("", "_rate"))
    return closed(mechanism_named("rolling_disc"), States(q, v, np.zeros_like(q), np.zeros(count)))


def test_disc_keeps_its_lean_on_the_circles_of_the_text() -> None:
    """Routh, article 244: k W^2 sin(lean) - (2 k + 1) W w = (g/R) tan(lean), k = 1/4, with the yaw rate W and w about the axle."""
    lean, yaw_rate = np.array([0.1, 0.4, 0.8, 1.1]), np.array([0.7, 1.5, -2.0, -3.0])
    _, R, g = mechanism_named("rolling_disc").parameter_values
    # A disc that leans to the right and rolls forward turns to the right, against the sense of yaw.
    about_axle = (yaw_rate**2 * np.sin(lean) / 4 - g / R * np.tan(lean)) / (1.5 * yaw_rate)
    states = disc_states(lean=lean, yaw_rate=yaw_rate, spin_rate=about_axle - yaw_rate * np.sin(lean))
    reference = ReferenceKernel(mechanism_named("rolling_disc")).evaluate(states)
    # Nothing but the centre accelerates, to the roundings of the rates.
    assert (np.abs(reference.high[:, 2:]) <= 8 * UNIT_ROUNDOFF * (g / R + yaw_rate**2 + about_axle**2)[:, None]).all()
    np.testing.assert_allclose(np.hypot(*reference.high[:, :2].T), np.abs(yaw_rate) * np.hypot(*states.v[:, :2].T), rtol=1e-14)


def test_disc_stays_upright_above_the_speed_of_the_text() -> None:
    """Routh, article 244: rolling straight on is stable where v^2 > g R/3.

    About it lean'' = a lean + b yaw' and yaw'' = c lean', so that lean oscillates with -(a + b c).
    """
    _, R, g = mechanism_named("rolling_disc").parameter_values
    small = 2.0**-30
    speed = np.sqrt(g * R / 3) * np.array([0.9, 1.0, 1.1])
    found = []
    for changed in ({"lean": small}, {"yaw_rate": small}, {"lean_rate": small}):
        states = disc_states(**changed, spin_rate=speed / R)
        found.append(ReferenceKernel(mechanism_named("rolling_disc")).evaluate(states).high / small)
    a, b, c = found[0][:, 3], found[1][:, 3], found[2][:, 2]
    stiffness = -(a + b * c) * R / g
    assert stiffness[0] < -0.1 and stiffness[2] > 0.1
    assert abs(stiffness[1]) <= 1e-15


def joint_positions(name: str) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """Positions of the joints at sampled states, (n,) each, and the parameters' values."""
    mechanism = mechanism_named(name)
    q = sample(mechanism, COUNT, SEED).q
    return dict(zip(mechanism.joints, q.T, strict=True)), {name: value for name, value, _ in mechanism.parameters}


def test_watts_linkage_draws_watts_curve() -> None:
    """Lockwood: r^2 = b^2 - (a sin t +- sqrt(c^2 - a^2 cos^2 t))^2 about the middle between the pivots, t from the line through them.

    The pivots are 2 a apart, b is a rocker and 2 c the coupler. Without its root and times r^4 the equation is one of x = r cos t and
    y = r sin t, whose terms are no larger than ``size``. Near its middle the curve is nearly straight.
    """
    at, p = joint_positions("watt_linkage")
    hanging = at["left"] + at["coupler"]
    point = np.array([-p["r"] + p["r"] * np.cos(at["left"]), p["c"] / 2 + p["r"] * np.sin(at["left"])])
    point += p["c"] / 2 * np.array([np.cos(hanging), np.sin(hanging)])
    a, b, c = np.hypot(p["r"], p["c"] / 2), p["r"], p["c"] / 2
    x = (point[0] * p["r"] - point[1] * p["c"] / 2) / a
    y = (point[0] * p["c"] / 2 + point[1] * p["r"]) / a
    squared = x**2 + y**2
    left = (squared * (b**2 - squared - c**2) - a**2 * (y**2 - x**2)) ** 2
    right = 4 * a**2 * y**2 * (c**2 * squared - a**2 * x**2)
    size = squared**2 * (a**2 + b**2 + c**2) ** 2
    # The point is the difference of a metre and a metre.
    assert (np.abs(left - right) <= 64 * UNIT_ROUNDOFF * size * (1 + a / np.sqrt(squared))).all()
    near = np.abs(at["left"]) < 0.1
    assert near.sum() > 100 and np.abs(point[0][near]).max() < 1e-4 < np.abs(point[1][near]).max()


def test_fingers_bend_by_the_law_of_cosines() -> None:
    """Murray, Li, Sastry, section 3.3 (subproblem 3): the distance from base to tip gives the elbow's angle."""
    at, p = joint_positions("two_fingers_bar")
    for side, name in ((-1, "left"), (1, "right")):
        tip = at["bar_x"] + side * p["L"] / 2 * np.cos(at["bar_tilt"]), at["bar_z"] + side * p["L"] / 2 * np.sin(at["bar_tilt"])
        squared = (tip[0] - side * p["b"]) ** 2 + tip[1] ** 2
        bend = np.arccos((squared - p["L1"] ** 2 - p["L2"] ** 2) / (2 * p["L1"] * p["L2"]))
        np.testing.assert_allclose(at[f"{name}2"], side * bend, rtol=1e-13)


def test_shoulders_of_the_delta_robot_are_those_of_inverse_kinematics() -> None:
    """Merlet, section 3.1.2.2: the elbow is a forearm away from the platform's point, E cos + F sin = G, of which the outer root."""
    at, p = joint_positions("delta_robot")
    for name, azimuth in (("a", 0.0), ("b", p["beta"]), ("c", -p["beta"])):
        outward = at["x"] * np.cos(azimuth) + at["y"] * np.sin(azimuth) + p["r_p"] - p["r_b"]
        across = at["y"] * np.cos(azimuth) - at["x"] * np.sin(azimuth)
        first, second = 2 * p["L_u"] * outward, 2 * p["L_u"] * at["z"]
        known = outward**2 + across**2 + at["z"] ** 2 + p["L_u"] ** 2 - p["L_f"] ** 2
        expected = np.arctan2(second, first) + np.arccos(known / np.hypot(first, second))
        np.testing.assert_allclose(at[f"shoulder_{name}"], expected, rtol=0, atol=1e-14)
