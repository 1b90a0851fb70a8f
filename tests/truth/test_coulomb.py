"""Rigid contact under Coulomb's law: all consistent accelerations against closed forms, and the declarations against the model files."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import flint
import mujoco
import numpy as np
import pytest
import sympy as sp
from catalogue import BUILT_IN
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Contact, System
from harness.crosscheck.scene import with_parameters
from harness.files.shapes import numbers_of_contact
from harness.hard.cases.rigid import CIRCLE, EULER, TOP, WHEEL
from harness.hard.rigid_case import RecordedMotion
from harness.hard.touching import rigid_contacts
from harness.lagrange.derivation import load_mechanism, load_system, mechanism_of_charts
from harness.trees.robot import Robot, read_robot
from harness.trees.shapes import ShapesInWorld
from harness.truth.coulomb import Manner, RigidAnswer, RigidContacts
from harness.truth.nearest import nearest
from harness.truth.sliding import BeginningSlide

G, SINE, COSINE = 9.81, 0.6, 0.8
EDGES = ("lower edge", "upper edge")


def of(name: str, **parameters: float) -> RigidContacts:
    system, _ = load_system(BUILT_IN.system_path(name))
    return rigid_contacts(system, with_parameters(load_mechanism(BUILT_IN, name), parameters))


def parameters_of(name: str) -> dict[str, float]:
    return {name: value for name, value, _ in load_mechanism(BUILT_IN, name).parameters}


def only(found: Sequence[RigidAnswer]) -> RigidAnswer:
    assert len({tuple(np.round(one.accelerations, 9)) for one in found}) == 1
    return found[0]


@pytest.mark.parametrize("mu", [0.1, 0.5, 0.7499, 0.7501, 2.0])
def test_a_block_sticks_from_the_tangent_of_the_slope_on(mu: float) -> None:
    found = only(of("block_on_incline", mu=mu).answers([0.0, 0.2, 0.0], [0.0] * 3, EDGES))
    assert found.accelerations[0] == pytest.approx(max(0.0, G * (SINE - mu * COSINE)), abs=1e-12)
    assert np.abs(found.accelerations[1:]).max() <= 1e-12
    assert (Manner.STICKS in found.manners.values()) == (mu > 0.75)
    # Moments about the centre: the lower edge carries what friction tips towards it.
    share = 0.2 * min(mu, 0.75) / 0.4
    assert found.normal["lower edge"] == pytest.approx(3 * G * COSINE * (1 + share) / 2)


@pytest.mark.parametrize(("v", "sign"), [(1.0, 1.0), (-1.0, -1.0)])
def test_a_block_that_slides_is_slowed_against_its_slip(v: float, sign: float) -> None:
    found = only(of("block_on_incline", mu=0.9).answers([0.0, 0.2, 0.0], [v, 0.0, 0.0], EDGES))
    assert found.accelerations[0] == pytest.approx(G * (SINE - sign * 0.9 * COSINE))


def test_a_block_that_is_high_enough_tips() -> None:
    """With h > b / tan(alpha) nothing holds the upper edge down, and with enough friction the lower one does not slide."""
    height = 0.8
    found = only(of("block_on_incline", mu=2.0, h=height).answers([0.0, height, 0.0], [0.0] * 3, EDGES))
    assert found.manners == {"lower edge": Manner.STICKS, "upper edge": Manner.PARTS}
    tipping = 3 * G * (SINE * height - COSINE * 0.4) / (3 * (0.4**2 + height**2) * 4 / 3)
    assert found.accelerations[2] == pytest.approx(tipping)


@pytest.mark.parametrize("mu", [0.05, 0.2, 0.2142, 0.2144, 1.0])
def test_a_sphere_rolls_from_two_sevenths_of_the_tangent_on(mu: float) -> None:
    found = only(of("sphere_on_incline", mu=mu).answers([0.0, 0.2, 0.0], [0.0] * 3, ["incline"]))
    rolls = mu >= 2 / 7 * SINE / COSINE
    assert found.accelerations[0] == pytest.approx(5 / 7 * G * SINE if rolls else G * (SINE - mu * COSINE))
    assert found.accelerations[2] == pytest.approx(5 / 7 * G * SINE / 0.2 if rolls else 5 / 2 * mu * G * COSINE / 0.2)
    assert found.manners["incline"] is (Manner.STICKS if rolls else Manner.SLIDES)


def test_a_sphere_that_slides_comes_to_roll() -> None:
    contacts, mu = of("sliding_to_rolling"), 0.3
    sliding = only(contacts.answers([0.0, 0.2, 0.0], [2.0, 0.0, 0.0], ["floor"]))
    assert sliding.accelerations == pytest.approx([-mu * G, 0.0, 5 / 2 * mu * G / 0.2], abs=1e-12)
    # At 5/7 of its speed, which is when both meet; then nothing is left to change.
    time = 2 * 2.0 / (7 * mu * G)
    assert 2.0 - mu * G * time == pytest.approx(5 / 7 * 2.0)
    rolling = only(contacts.answers([0.0, 0.2, 0.0], [10 / 7, 0.0, 10 / 7 / 0.2], ["floor"]))
    assert np.abs(rolling.accelerations).max() <= 1e-12


def test_a_disc_slows_by_its_friction_about_the_normal() -> None:
    found = only(of("spinning_disc").answers([0.05, 0.0], [0.0, 3.0], ["floor"]))
    assert found.accelerations == pytest.approx([0.0, -0.02 * 2 * G / 0.01], abs=1e-12)
    at_rest = only(of("spinning_disc").answers([0.05, 0.0], [0.0, 0.0], ["floor"]))
    assert np.abs(at_rest.accelerations).max() <= 1e-12


@pytest.mark.ci
def test_a_stack_has_one_motion_and_no_unique_forces() -> None:
    contacts = of("box_stack")
    names = list(load_system(BUILT_IN.system_path("box_stack"))[0].contacts)
    found = only(contacts.answers([0.0] * 3, [0.0] * 3, names))
    assert np.abs(found.accelerations).max() <= 1e-12
    assert found.forces == pytest.approx([7 * G, 6 * G, 4 * G])
    assert sum(found.normal[name] for name in found.normal if name.endswith("first")) == pytest.approx(7 * G)
    # An edge less, and the other carries all: what the contacts do to the coordinates is the same.
    assert only(contacts.answers([0.0] * 3, [0.0] * 3, names[1:])).forces == pytest.approx(found.forces)


def test_boxes_that_fall_together_do_not_press() -> None:
    contacts = of("box_stack")
    found = contacts.answers([1.0, 0.0, 0.0], [0.0] * 3, ["left edge of the second", "left edge of the third"])
    assert only(found).accelerations == pytest.approx([-G, 0.0, 0.0])


def rod(mu: float, turning: float) -> list[RigidAnswer]:
    """Leaning by the angle whose tangent is 2, the end sliding to the left."""
    contacts, lean = of("painleve_rod", mu=mu, r=1e-9), math.atan(2.0)
    height, width = 0.5 * math.sin(lean) + 1e-9, 0.5 * math.cos(lean)
    return contacts.answers([0.0, height, lean], [-1.0 - height * turning, width * turning, turning], ["end"])


@pytest.mark.parametrize(("mu", "turning", "answers"), [(1.3333, 0.0, 1), (1.3334, 0.0, 0), (1.3333, 6.0, 1), (1.3334, 6.0, 2)])
def test_painleves_rod_has_no_acceleration_or_two_from_four_thirds_on(mu: float, turning: float, answers: int) -> None:
    found = rod(mu, turning)
    assert len(found) == answers
    manners = {one.manners["end"] for one in found}
    assert manners <= {Manner.PARTS, Manner.SLIDES_BACK} and len(manners) == answers


@pytest.mark.parametrize("mu", [0.5, 1.6])
def test_painleves_rod_presses_by_its_closed_form(mu: float) -> None:
    lean, turning = math.atan(2.0), 0.0 if mu < 4 / 3 else 6.0
    [pressed] = [one for one in rod(mu, turning) if one.manners["end"] is Manner.SLIDES_BACK]
    slope = (1 + 3 * math.cos(lean) * (math.cos(lean) - mu * math.sin(lean))) / 3.0
    assert pressed.normal["end"] == pytest.approx((G - 0.5 * math.sin(lean) * turning**2) / slope, rel=1e-6)


@pytest.mark.parametrize("inertia", WHEEL.values)
def test_a_rimless_wheel_comes_back_to_the_speed_of_its_limit_cycle(inertia: float) -> None:
    """A stride of the declared contacts alone: a foot that sticks, an impact that stops the next one, and that foot up to its normal."""
    contacts, own = of("rimless_wheel", J=inertia), parameters_of("rimless_wheel") | {"J": inertia}
    speed = WHEEL.start(own)[1][2]
    before = turned(contacts, own, 0, speed, (0.0, math.pi / 8))
    _, at_impact = standing(own, 0, math.pi / 8, before)
    place, _ = standing(own, 1, math.pi / 8, 0.0)
    assert abs(contacts.gaps(place)["foot 1"]) <= 1e-15
    after = stopped("rimless_wheel", "foot 1", place, at_impact, [own["m"], own["m"], inertia])
    # The foot that stood leaves.
    assert after[1] + own["l"] * math.sin(math.pi / 8) * after[2] > 0
    assert turned(contacts, own, 1, after[2], (math.pi / 8, math.pi / 4)) == pytest.approx(speed, rel=1e-7)


def standing(own: Mapping[str, float], foot: int, angle: float, speed: float) -> tuple[list[float], list[float]]:
    """A wheel that rolls on one foot."""
    lean = angle - foot * math.pi / 4
    height, along = own["l"] * math.cos(lean) + own["r"], own["l"] * math.sin(lean)
    return [own["r"] * lean + along, height, angle], [height * speed, -along * speed, speed]


def turned(contacts: RigidContacts, own: Mapping[str, float], foot: int, speed: float, angles: tuple[float, float]) -> float:
    """Speed of the wheel at the second angle, by Runge and Kutta's steps of the square of its speed along the angle."""

    def slope(angle: float, square: float) -> float:
        found = only(contacts.answers(*standing(own, foot, angle, math.sqrt(square)), [f"foot {foot}"]))
        assert found.manners == {f"foot {foot}": Manner.STICKS}
        return float(2 * found.accelerations[2])

    square, step = speed**2, (angles[1] - angles[0]) / 8
    for angle in np.arange(8) * step + angles[0]:
        first = slope(angle, square)
        second = slope(angle + step / 2, square + step / 2 * first)
        third = slope(angle + step / 2, square + step / 2 * second)
        square += step / 6 * (first + 2 * second + 2 * third + slope(angle + step, square + step * third))
    return math.sqrt(square)


def stopped(name: str, contact: str, q: Sequence[float], v: Sequence[float], masses: Sequence[float]) -> list[float]:
    """Velocities after an impact that stops both rows of a contact, of a mechanism with a constant mass matrix."""
    system, _ = load_system(BUILT_IN.system_path(name))
    declared, rates = system.contacts[contact], [one.diff(TIME) for one in system.coordinates]
    rows = sp.Matrix([declared.gap.diff(TIME), *declared.slips]).jacobian(rates)
    values = {symbol: parameters_of(name)[symbol.name] for symbol in system.parameters}
    jacobian = np.array(rows.subs(values).subs(dict(zip(system.coordinates, q, strict=True))).evalf(), dtype=np.float64)
    weighed = jacobian / np.array(masses)
    return [*(np.array(v) - weighed.T @ np.linalg.solve(weighed @ jacobian.T, jacobian @ np.array(v)))]


@pytest.mark.ci
def test_a_tippe_top_that_touches_moves_as_its_point_may() -> None:
    """It presses along the normal alone, and the derivatives of its gap are those of the motion of its quaternion."""
    contacts, own, random = of("tippe_top"), parameters_of("tippe_top"), np.random.default_rng(3)
    manners = set()
    for _ in range(5):
        p = random.normal(size=4)
        p /= np.linalg.norm(p)
        turn = random.normal(size=3) * 3
        axis, rate = axis_of(p), axis_of(p, turn)
        q = [0.3, -0.2, own["R"] - own["a"] * axis, *p]
        v = [0.1, 0.4, -own["a"] * rate, *turn]
        assert abs(contacts.gaps(q)["floor"]) <= 1e-15
        found = contacts.answers(q, v, ["floor"])
        assert len(found) == 1
        # The gap stays closed to the second order of the time where it presses, and opens where it parts.
        step = 1e-4
        later = [*np.array(q[:3]) + step * np.array(v[:3]) + step**2 / 2 * found[0].accelerations[:3]]
        later += [*turned_by(p, np.array(turn) * step + step**2 / 2 * found[0].accelerations[3:])]
        gap = contacts.gaps(later)["floor"]
        assert abs(gap) <= 1e-10 if found[0].manners["floor"] is Manner.STAYS else gap > 1e-9
        assert not np.any(found[0].forces[:2])
        manners.add(found[0].manners["floor"])
    assert Manner.STAYS in manners


def axis_of(p: np.ndarray, turn: np.ndarray | None = None) -> float:
    """Height of the end of the body's z axis, or its rate at an angular velocity in the body's frame."""
    w, x, y, z = p
    along = np.array([2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z])
    return float(along[2] if turn is None else np.cross(turn, [0.0, 0.0, 1.0]) @ along)


def turned_by(p: np.ndarray, way: np.ndarray) -> np.ndarray:
    """A quaternion after a turn by a vector of angles [rad] in the body's frame."""
    angle = float(np.linalg.norm(way))
    b = np.sin(angle / 2) / angle * way
    w, u, c = p[0], p[1:], np.cos(angle / 2)
    return np.array([w * c - u @ b, *(w * b + c * u + np.cross(u, b))])


def test_jellett_s_integral_is_kept_by_any_force_at_the_point() -> None:
    """By Euler's equations: central differences of the integral that a case measures, along the turn that they give."""
    own, random = parameters_of("tippe_top"), np.random.default_rng(4)
    moments = np.array([own["I1"], own["I1"], own["I3"]])
    for _ in range(20):
        p = random.normal(size=4)
        p /= np.linalg.norm(p)
        turn, step = random.normal(size=3) * 9, 1e-6
        force = random.normal(size=3)
        w, x, y, z = p
        rows = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        point = own["a"] * np.array([0.0, 0.0, 1.0]) - own["R"] * rows[2]
        torque = np.cross(point, rows.T @ force)
        found = (torque - np.cross(turn, moments * turn)) / moments
        ends = [
            TOP.measure(
                RecordedMotion(
                    np.array([step]),
                    np.array([[0.0, 0.0, 0.0, *turned_by(p, side * step * turn)]]),
                    np.array([[0.0, 0.0, 0.0, *(turn + side * step * found)]]),
                    (np.array([0.0, 0.0, 0.0, *p]), np.array([0.0, 0.0, 0.0, *turn])),
                ),
                own,
            )
            for side in (1, -1)
        ]
        assert abs(ends[0] - ends[1]) / (2 * step) <= 1e-6


@pytest.mark.parametrize("lean", EULER.values)
@pytest.mark.parametrize("mu", [0.0, 0.5])
def test_euler_s_disc_whose_centre_rests_goes_on_as_it_does(lean: float, mu: float) -> None:
    q, v = EULER.start(parameters_of("euler_disc") | {"lean": lean})
    found = only(of("euler_disc", mu=mu).answers(q, v, ["rim"]))
    assert np.abs(found.accelerations).max() <= 1e-12 * v[3] ** 2
    assert found.normal["rim"] == pytest.approx(80 * G)


@pytest.mark.parametrize("share", [0.0, 0.5, 0.999, 1.001, 2.0])
def test_euler_s_disc_stays_on_its_circle_while_it_does_not_slide(share: float) -> None:
    q, v = CIRCLE.start(parameters_of("euler_disc"))
    needed = abs(v[0]) * v[3] / G
    (found,) = of("euler_disc", mu=share * needed).answers(q, v, ["rim"])
    force, normal = np.hypot(*found.forces[:2]), found.normal["rim"]
    if share > 1:
        assert found.manners == {"rim": Manner.STICKS}
        assert found.accelerations == pytest.approx([0.0, v[3] * v[0], 0.0, 0.0, 0.0, 0.0], abs=1e-12)
        return
    assert found.manners == {"rim": Manner.SLIDES}
    assert force == pytest.approx(share * needed * normal)
    # The gap stays closed, and the rim's point leaves its circle outwards, against its friction.
    lean, slip = found.accelerations[4], found.accelerations[1] - v[3] * v[0]
    assert found.accelerations[2] == pytest.approx(-0.5 * math.sin(q[4]) * lean)
    assert slip + 0.5 * math.cos(q[4]) * lean > 0 >= found.forces[1]


def test_euler_s_disc_that_slides_rubs_against_its_slip_in_both_directions() -> None:
    """By Euler's equations of its heading, axle and upward axes; the friction of a rim whose slip has both components."""
    mu, lean, random = 0.3, 0.7, np.random.default_rng(5)
    for _ in range(3):
        v = random.normal(size=6)
        v[2] = -0.5 * math.sin(lean) * v[4]
        q = [0.1, -0.2, 0.5 * math.cos(lean), 0.4, lean, 0.3]
        (found,) = of("euler_disc", mu=mu).answers(q, v.tolist(), ["rim"])
        heading, level = np.array([math.cos(0.4), math.sin(0.4), 0]), np.array([-math.sin(0.4), math.cos(0.4), 0])
        upward = math.cos(lean) * np.array([0, 0, 1]) - math.sin(lean) * level
        axle = np.cross(upward, heading)
        turn = v[4] * heading + v[3] * np.array([0, 0, 1]) + v[5] * axle
        slip = v[:3] + np.cross(turn, -0.5 * upward)
        assert abs(slip[2]) < 1e-12 and found.manners == {"rim": Manner.SLIDES}
        assert found.forces[:2] == pytest.approx(-mu * found.normal["rim"] * slip[:2] / np.linalg.norm(slip))
        # The moment about each joint's axis of the force at the rim.
        moment = np.cross(-0.5 * upward, [*found.forces[:2], found.normal["rim"]])
        assert found.forces[3:] == pytest.approx([moment[2], moment @ heading, moment @ axle], abs=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_all_directions_of_a_beginning_slide_are_found(seed: int) -> None:
    """Those by a change of sign on a fine grid in float64."""
    random, several = np.random.default_rng(seed), set[int]()
    for _ in range(10):
        shares, slip, root = random.normal(size=2), random.normal(size=2), random.normal(size=(2, 2))
        mu, free, yields = random.uniform(0.1, 2), random.uniform(-0.2, 1), root @ root.T
        balls = [[flint.arb(float(one)) for one in row] for row in (shares, slip, *yields)]
        slide = BeginningSlide(flint.arb(mu), flint.arb(free), balls[0], balls[1], balls[2:])
        found = [(float(c), float(s)) for c, s in slide.directions()]
        angles = np.linspace(-np.pi, np.pi, 20001) + 1e-5
        d = np.array([np.cos(angles), np.sin(angles)])
        lessened = 1 + mu * shares @ d
        ways = slip[:, None] - mu * free / lessened * (yields @ d)
        across, along = d[0] * ways[1] - d[1] * ways[0], (d * ways).sum(axis=0)
        # A pole changes the sign too.
        turns = (across[1:] * across[:-1] < 0) & (lessened[1:] * lessened[:-1] > 0) & (free / lessened[1:] > 0) & (along[1:] > 0)
        expected = d[:, 1:][:, turns].T
        assert all(min(math.dist(one, other) for other in found) < 1e-3 for one in expected)
        assert all(min(math.dist(one, other) for other in expected) < 1e-3 for one in found)
        several.add(len(expected))
    assert len(several) > 1


def test_directions_that_no_state_tells_apart_are_refused() -> None:
    """A force without a slip of its own pushes in all directions alike where what it pushes yields to no push."""
    zero, one = flint.arb(0), flint.arb(1)
    slide = BeginningSlide(one, one, [zero, zero], [zero, zero], [[-one, zero], [zero, -one]])
    with pytest.raises(ValueError, match="are not isolated"):
        slide.directions()


def on_a_point(count: int, slips: int, **further: float) -> RigidContacts:
    """A mass that moves in space and touches the floor by ``count`` contacts, each with so many slips."""
    x, y, z = dynamicsymbols("x y z")
    m, mu, g = sp.symbols("m mu g", positive=True)
    given = (x.diff(TIME), y.diff(TIME))
    system = System(
        coordinates={x: "x", y: "y", z: "z"},
        kinetic=m * sum(q.diff(TIME) ** 2 for q in (x, y, z)) / 2,
        potential=m * g * (z * sp.Rational("0.8") - x * sp.Rational("0.36") - y * sp.Rational("0.48")),
        parameters={m: (1.0, "kg"), mu: (0.5, "1"), g: (G, "m/s^2")},
        total_mass=m,
        contacts={f"c{number}": Contact(gap=z, slip=given[:slips] if slips > 1 else given[0], friction=mu) for number in range(count)},
    )
    return rigid_contacts(system, with_parameters(mechanism_of_charts([system], "mass"), further))


@pytest.mark.parametrize("mu", [0.0, 0.5, 0.7499, 0.7501])
def test_a_mass_on_an_incline_begins_to_slide_down_the_steepest_way(mu: float) -> None:
    found = only(on_a_point(1, 2, mu=mu).answers([0.0] * 3, [0.0] * 3, ["c0"]))
    down = max(0.0, G * (SINE - mu * COSINE))
    assert found.accelerations == pytest.approx([0.6 * down, 0.8 * down, 0.0], abs=1e-12)
    assert found.manners["c0"] is (Manner.STICKS if mu > 0.75 else Manner.SLIDES)


@pytest.mark.parametrize(
    ("count", "slips", "why"),
    [(9, 1, "9 closed contacts have too many manners"), (2, 2, "sticks in two directions|may slide in two directions each")],
)
def test_contacts_whose_answers_are_not_all_found_are_refused(count: int, slips: int, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        on_a_point(count, slips).answers([0.0] * 3, [0.0] * 3, [f"c{number}" for number in range(count)])


# What the model files say of it.


def test_a_slip_of_a_free_joint_is_refused() -> None:
    system, _ = load_system(BUILT_IN.system_path("tippe_top"))
    gap, x, m = system.contacts["floor"].gap, next(iter(system.coordinates)), next(iter(system.parameters))
    with pytest.raises(ValueError, match="a slip beside ball and free joints"):
        replace(system, contacts={"floor": Contact(gap=gap, slip=x.diff(TIME), friction=m)})


def robot_of(name: str) -> Robot:
    return read_robot(BUILT_IN.model_path(name, "mjcf"))


def distances(robot: Robot, q: Sequence[float]) -> list[float]:
    """Of all pairs of shapes with a closed form that may touch."""
    assert robot.shapes is not None and not robot.shapes.why_not
    with flint.ctx.workprec(192):
        placed = {one.shape.name: one for one in ShapesInWorld(robot.tree, robot.joints, robot.shapes.shapes).at(q)}
        pairs = [nearest(placed[one.name], placed[other.name]) for one, other, _ in robot.shapes.pairs(robot.tree)]
        return [float(point.distance.mid()) for found in pairs for point in found or ()]


def differs(gaps: Sequence[float], found: Sequence[float]) -> bool:
    """Whether a distance of the file is no gap of the text, or none of the gaps is one of the file."""
    return not found or any(min(abs(one - gap) for gap in gaps) > 1e-12 for one in found)


NAMES = ["block_on_incline", "sphere_on_incline", "sliding_to_rolling", "spinning_disc", "bouncing_ball", "newtons_cradle", "box_stack"]
NAMES += ["painleve_rod", "rimless_wheel", "tippe_top", "woodpecker"]


@pytest.mark.parametrize("name", NAMES)
def test_gaps_are_the_distances_of_the_shapes_of_the_model(name: str) -> None:
    contacts, robot, random = of(name), robot_of(name), np.random.default_rng(0)
    mechanism = load_mechanism(BUILT_IN, name)
    # A free joint is alone.
    order = range(mechanism.nq) if mechanism.nq > mechanism.nv else [mechanism.joints.index(joint) for joint in robot.joints]
    for _ in range(5):
        # Balls and boxes stay in their order, and the lower edges of a block are the lower ones.
        q = random.uniform(0.1, 0.4, len(order))
        gaps = [*contacts.gaps(q).values()]
        # Bodies that are no neighbours may touch too, in the file alone.
        found = sorted(distances(robot, q[[*order]].tolist()))[: {"newtons_cradle": 2, "box_stack": 4}.get(name)]
        assert not differs(gaps, found)


@pytest.mark.parametrize(("old", "new", "is_right"), [("", "", True), ('pos="0 0.01 0"', 'pos="0 0 0"', False)])
def test_the_gap_of_euler_s_disc_is_what_mujoco_finds(old: str, new: str, is_right: bool) -> None:
    """Of a cylinder, whose distance to a plane is not among the harness's own."""
    text = BUILT_IN.model_path("euler_disc", "mjcf").read_text().replace(old, new)
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.disableflags, model.geom_margin[:] = 0, 9.0
    data, contacts, random = mujoco.MjData(model), of("euler_disc"), np.random.default_rng(0)
    for _ in range(5):
        data.qpos[:] = [*random.uniform(0.6, 2.0, 3), random.uniform(-3, 3), random.uniform(0.2, 1.3), random.uniform(-3, 3)]
        mujoco.mj_forward(model, data)
        assert (abs(contacts.gaps(data.qpos.tolist())["rim"] - data.contact.dist.min()) < 1e-12) == is_right


@pytest.mark.parametrize(
    "name", [*(one for one in NAMES if one not in ("bouncing_ball", "newtons_cradle", "box_stack", "tippe_top")), "euler_disc"]
)
def test_shapes_rub_as_the_text_says(name: str) -> None:
    robot = robot_of(name)
    assert robot.shapes is not None
    friction = [numbers_of_contact(one, other).friction for one, other, _ in robot.shapes.pairs(robot.tree)]
    # A box is one shape with all of its edges.
    assert len(friction) == (1 if name == "block_on_incline" else len(load_system(BUILT_IN.system_path(name))[0].contacts))
    assert {one[2 if name == "spinning_disc" else 0] for one in friction} == {parameters_of(name)["mu"]}


@pytest.mark.parametrize(
    ("old", "new"),
    [('size="0.2"', 'size="0.201"'), ('zaxis="0.6 0 0.8"', 'zaxis="0.61 0 0.8"'), ('type="slide" axis="0.6', 'type="slide" axis="-0.6')],
)
def test_a_model_whose_shapes_are_others_is_seen(old: str, new: str, tmp_path: Path) -> None:
    text = BUILT_IN.model_path("sphere_on_incline", "mjcf").read_text()
    assert old in text
    path = tmp_path / "sphere_on_incline.xml"
    path.write_text(text.replace(old, new, 1))
    q = [0.3, 0.5, 0.1]
    assert differs([*of("sphere_on_incline").gaps(q).values()], distances(read_robot(path), q))


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"gap": lambda x, v, mu: x + v}, "has the gap"),
        ({"slip": lambda x, v, mu: v**2}, "has the slip"),
        ({"slip": lambda x, v, mu: x}, "has the slip"),
        ({"value": -0.5}, "expected a parameter whose value is not negative"),
        ({"slip": lambda x, v, mu: None}, "expected both, or neither"),
        ({"slip": lambda x, v, mu: (v, v**2)}, "has the slip"),
        ({"slip": lambda x, v, mu: (v, v, v)}, "has 3 slips; expected one, or a pair"),
    ],
)
def test_a_contact_that_contradicts_itself_is_refused(changed: Mapping[str, Any], why: str) -> None:
    x, (m, mu) = dynamicsymbols("x"), sp.symbols("m mu", real=True)
    value = changed.get("value", 0.5)
    own: dict[str, Any] = {"gap": x, "slip": x.diff(TIME), "friction": mu}
    own |= {name: make(x, x.diff(TIME), mu) for name, make in changed.items() if callable(make)}
    with pytest.raises(ValueError, match=why):
        System(
            coordinates={x: "x"},
            kinetic=m * x.diff(TIME) ** 2 / 2,
            potential=0,
            parameters={m: (1.0, "kg"), mu: (value, "1")},
            total_mass=m,
            contacts={"floor": Contact(**own)},
        )
