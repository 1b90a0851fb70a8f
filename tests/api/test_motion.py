"""Motions that scripts and notebooks compute."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from scipy.special import ellipk
from sympy.physics.mechanics import dynamicsymbols

import harness
from harness.errors import InvalidRequest
from harness.motion.trajectories import Metric, Start, reference_motion

ARM = Path(__file__).parents[1] / "comparison" / "files" / "arm.urdf"


def test_a_pendulum_returns_after_the_period_of_its_elliptic_integral() -> None:
    """Landau, Lifshitz, Mechanics, section 11, problem 1."""
    pendulum, angle = harness.load("simple_pendulum"), 2.0
    length, gravity = (pendulum.parameters[name].value for name in ("L", "g"))
    period = 4 * np.sqrt(length / gravity) * ellipk(np.sin(angle / 2) ** 2)
    motion = pendulum.simulate(q=[angle], v=[0.0], seconds=float(period), steps=64)
    assert motion.times.shape == (65,) and motion.q.shape == motion.v.shape == (65, 1)
    assert abs(motion.q[-1, 0] - angle) < 1e-13 and abs(motion.q[32, 0] + angle) < 1e-13
    assert np.abs(motion.energy_drift).max() < 1e-14


@pytest.mark.ci
@pytest.mark.parametrize("name", ["cart_pendulum", "four_bar", "heavy_top"])
def test_a_motion_is_the_true_one(name: str) -> None:
    """Dampers, a loop and a ball joint; against Taylor's method in the longest floating-point types."""
    loaded = harness.load(name)
    start = Start.of(loaded.mechanism, 2.0)
    truth = reference_motion(loaded.mechanism, start, intervals=20)
    motion = loaded.simulate(start.q, start.v, 2.0, steps=20)
    assert Metric(loaded.mechanism).errors(truth.path, motion.q, motion.v).max() < 1e-12
    assert motion.energy_drift is not None and np.abs(motion.energy_drift).max() < 1e-12


def test_coordinates_that_constraints_determine_are_closed() -> None:
    linkage = harness.load("four_bar")
    start = Start.of(linkage.mechanism, 1.0)
    nearby = start.q.copy()
    nearby[list(linkage.mechanism.constraints.positions)] += 0.01
    assert np.array_equal(linkage.simulate(nearby, start.v, 1.0).q[0], start.q)


def test_what_is_no_start_of_a_motion_is_refused() -> None:
    pendulum = harness.load("double_pendulum")
    with pytest.raises(ValueError, match=r"double_pendulum has \(2, 2, 2\)"):
        pendulum.simulate([0.0], [0.0], 1.0)
    with pytest.raises(ValueError, match="q and v have 2 rows; a motion starts from one state"):
        pendulum.simulate(np.zeros((2, 2)), np.zeros((2, 2)), 1.0)
    for seconds, steps in ((0.0, 10), (-1.0, 10), (float("inf"), 10), (1.0, 0)):
        with pytest.raises(ValueError, match="expected a positive time and at least one step"):
            pendulum.simulate([0.0, 0.0], [0.0, 0.0], seconds, steps)
    with pytest.raises(ValueError, match=r"q and v are \[nan, 0.0\] and .*; expected finite numbers"):
        pendulum.simulate([float("nan"), 0.0], [0.0, 0.0], 1.0)
    linkage = harness.load("four_bar").with_parameters(d=20.0)
    with pytest.raises(InvalidRequest, match="four_bar: its constraints do not close at q = "):
        linkage.simulate([0.0] * 3, [0.0] * 3, 1.0)


def test_a_motion_that_escapes_in_finite_time_is_followed_no_further() -> None:
    """x'' = 4 x^3 from x = 1 at rest is at infinity after 1/sqrt(2) times the integral of 1/sqrt(u^4 - 1) over u > 1."""
    x, m = dynamicsymbols("x"), sp.Symbol("m", positive=True)
    runaway = harness.System(
        coordinates={x: "slide"}, kinetic=m * x.diff(harness.TIME) ** 2 / 2, potential=-m * x**4, parameters={m: (1.0, "kg")}, total_mass=m
    )
    with pytest.raises(InvalidRequest, match=r"SYSTEM: the motion cannot be followed beyond 0\.9\d* s, where"):
        harness.load(runaway).simulate([1.0], [0.0], 2.0)


def test_a_motion_says_its_drift_and_draws_an_axis_for_each_unit() -> None:
    motion = harness.load("cart_pendulum").simulate([0.0, 0.5], [0.0, 0.0], 2.0, steps=100)
    assert repr(motion).startswith("cart_pendulum: 2 s of motion at 101 times; energy drift at most ")
    page = motion._repr_html_()
    assert page.count("<polyline") == 2 and "angle [rad]" in page and "position [m]" in page and "of the largest kinetic energy" in page
    ball = harness.load("free_body").simulate([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 2.0, 0.1, 3.0, 0.0], 1.0, steps=10)
    assert ball._repr_html_().count("<polyline") == 7


@pytest.mark.ci
def test_a_robot_moves_without_energies() -> None:
    robot = harness.load(ARM)
    motion = robot.simulate(np.full(robot.mechanism.nq, 0.1), np.zeros(robot.mechanism.nv), 0.5, steps=50)
    assert motion.energy_drift is None and np.isfinite(motion.q).all() and "drift" not in repr(motion)
    assert motion.q[-1].tolist() != motion.q[0].tolist()
