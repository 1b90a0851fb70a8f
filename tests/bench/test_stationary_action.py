"""Hamilton's principle: true paths pass, paths of wrong models do not, and the measures are what they claim."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from catalogue import PLAIN, is_tied
from scipy.integrate import quad
from studies import mechanism_named, silent, with_factors
from sympy.physics.mechanics import dynamicsymbols

from harness.arrays import Array
from harness.bench.stationary_action import SIZES, residual, stationarity, stationarity_of, vary
from harness.crosscheck.scene import Scene
from harness.files.model_file import parse_model
from harness.files.text.scan import find_numbers, scaled
from harness.lagrange.system import TIME, System
from harness.library import Library
from harness.motion.integrators import integrators
from harness.motion.taylor import Taylor
from harness.motion.trajectories import Start
from harness.programs.mechanisms.kernel import LagrangianKernel
from harness.programs.mechanisms.mechanism import Mechanism
from harness.results.motion_benchmark import Stationarity

HORIZON = 2.0
SYSTEMS = ["collar", "bar_pendulum", "spring_damper", "cart_pendulum", "arm_2r", "furuta_pendulum", "quarter_car"]
WITH_GRAVITY = ["collar", "bar_pendulum", "cart_pendulum", "arm_2r", "furuta_pendulum"]
DAMPED = ["bar_pendulum", "spring_damper", "cart_pendulum", "furuta_pendulum", "quarter_car"]


def true_path(of: Mechanism, intervals: int = 2000, horizon: float = HORIZON) -> tuple[Array, Array]:
    times = np.linspace(0.0, horizon, intervals + 1)
    start = Start.of(of, horizon)
    return times, Taylor(of).solve(start.q, start.v, times).q


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_action_of_a_true_path_is_stationary(name: str) -> None:
    kernel = LagrangianKernel(mechanism_named(name))
    found = stationarity_of(kernel, "true", *true_path(kernel.mechanism))
    assert found.slope == pytest.approx(2.0, abs=0.01)
    assert found.first_variation < 1e-12
    assert (found.system, found.path, found.step) == (name, "true", pytest.approx(1e-3))


# A path under constraints is stationary among those that keep them alone.
@pytest.mark.nightly(nights=4)
@pytest.mark.parametrize("name", [name for name in PLAIN if not is_tied(name)])
def test_the_action_of_every_true_path_is_stationary(name: str) -> None:
    right = mechanism_named(name)
    # The spherical pendulum turns its azimuth at 376 rad/s near a pole.
    _, slope, first = vary(LagrangianKernel(right), *true_path(right, 8000))
    assert slope == pytest.approx(2.0, abs=0.01)
    assert first < 1e-10


def is_seen(right: Mechanism, times: Array, q: Array) -> bool:
    """Whether a path is told from a true one by its slope and by its first variation."""
    _, slope, first = vary(LagrangianKernel(right), times, q)
    return slope is not None and slope < 1.2 and first > 1e-3


@pytest.mark.parametrize("name", WITH_GRAVITY)
def test_a_path_under_another_gravity_is_seen(name: str) -> None:
    right = mechanism_named(name)
    assert is_seen(right, *true_path(with_factors(right, g=1.01)))


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_path_in_another_time_is_seen(name: str) -> None:
    times, q = true_path(mechanism_named(name))
    assert is_seen(mechanism_named(name), 1.01 * times, q)


@pytest.mark.parametrize("name", DAMPED)
def test_dampers_that_a_path_did_not_feel_are_seen(name: str) -> None:
    right = mechanism_named(name)
    # Dampers are told by their unit.
    undamped = with_factors(right, **{name: 0.0 for name, _, unit in right.parameters if unit in ("N s/m", "N m s")})
    times, q = true_path(undamped)
    assert vary(LagrangianKernel(undamped), times, q)[2] < 1e-12
    _, slope, _ = vary(LagrangianKernel(right), times, q)
    assert slope is not None and slope < 1.2


def test_virtual_work_is_that_of_the_dampers() -> None:
    kernel = LagrangianKernel(mechanism_named("cart_pendulum"))
    q, v = np.array([[0.01, 0.3], [-0.02, 1.0]]), np.array([[0.4, -2.0], [0.1, 3.0]])
    np.testing.assert_allclose(kernel.terms(q, v, np.zeros(2)).forces, [[0.0, 0.4], [0.0, -0.6]], rtol=1e-14)


def damped_oscillation(of: Mechanism, times: Array) -> Array:
    """The closed form of a mass on a spring and a damper, released from rest at 0.2 m."""
    m, k, c = of.parameter_values
    decay, frequency = c / (2 * m), math.sqrt(k / m - (c / (2 * m)) ** 2)
    motion = np.exp(-decay * times) * (np.cos(frequency * times) + decay / frequency * np.sin(frequency * times))
    return np.asarray(0.2 * motion[:, None])


def test_the_closed_form_of_the_damped_oscillator_passes() -> None:
    kernel = LagrangianKernel(mechanism_named("spring_damper"))
    times = np.linspace(0.0, HORIZON, 2001)
    _, slope, first = vary(kernel, times, damped_oscillation(kernel.mechanism, times))
    # L is quadratic, so nothing is left beside the second variation.
    assert slope == pytest.approx(2.0, abs=1e-8)
    assert first < 1e-12


def test_the_changes_of_the_action_are_their_integrals() -> None:
    """For a mass that moves evenly although its spring pulls, by adaptive quadrature."""
    kernel = LagrangianKernel(with_factors(mechanism_named("spring_damper"), c=0.0))
    m, k, _ = kernel.mechanism.parameter_values
    speed, place = 0.05, 0.2
    times = np.linspace(0.0, HORIZON, 2001)

    def bump(t: float) -> float:
        s = t / HORIZON
        return math.exp(1 - 1 / (4 * s * (1 - s))) if 1e-3 < s < 1 - 1e-3 else 0.0

    def bump_rate(t: float) -> float:
        s = t / HORIZON
        return bump(t) * (1 - 2 * s) / (4 * s**2 * (1 - s) ** 2) / HORIZON if 1e-3 < s < 1 - 1e-3 else 0.0

    def away(t: float) -> float:
        return speed * (t - HORIZON / 2)

    extent = max(bump(t) * abs(away(t)) for t in times)
    swings: list[tuple[Callable[[float], float], float]] = [(lambda t: extent, 0.0), (away, speed), (lambda t: extent, 0.0)]
    expected = []
    for size in SIZES:

        def difference(t: float, swing: Callable[[float], float], rate: float, size: float = size) -> float:
            eta = size * bump(t) * swing(t)
            eta_rate = size * (bump_rate(t) * swing(t) + bump(t) * rate)
            return m * (speed * eta_rate + eta_rate**2 / 2) - k * ((place + speed * t) * eta + eta**2 / 2)

        changes = [quad(difference, 0.0, HORIZON, args=swing, epsabs=1e-15, epsrel=1e-12, limit=200)[0] for swing in swings]
        expected.append(math.sqrt(sum(change**2 for change in changes) / 3))
    np.testing.assert_allclose(vary(kernel, times, (place + speed * times)[:, None])[0], expected, rtol=1e-9)


@pytest.mark.parametrize("name", ["cart_pendulum", "spring_damper"])
def test_the_residual_of_a_true_path_is_of_second_order(name: str) -> None:
    kernel = LagrangianKernel(mechanism_named(name))
    coarse, fine = (residual(kernel, *true_path(kernel.mechanism, intervals)) for intervals in (500, 1000))
    assert coarse / fine == pytest.approx(4.0, rel=0.02)


def test_the_residual_of_a_variational_integrator_is_roundoff() -> None:
    """The midpoint rule, whose steps make the discrete action stationary, solved for a linear system."""
    kernel = LagrangianKernel(mechanism_named("spring_damper"))
    m, k, c = kernel.mechanism.parameter_values
    step = 1e-2
    q = [0.2, 0.2]
    for _ in range(200):
        rest = m * (2 * q[-1] - q[-2]) / step**2 - k * (2 * q[-1] + q[-2]) / 4 + c * q[-2] / (2 * step)
        q.append(rest / (m / step**2 + k / 4 + c / (2 * step)))
    times = step * np.arange(len(q))
    assert residual(kernel, times, np.array(q)[:, None]) < 1e-11
    assert residual(kernel, times, damped_oscillation(kernel.mechanism, times)) > 1e-4


@pytest.mark.parametrize("name", ["cart_pendulum", "collar"])
def test_the_residual_of_a_wrong_path_does_not_fall_with_the_step(name: str) -> None:
    right = mechanism_named(name)
    kernel = LagrangianKernel(right)
    for intervals in (1000, 4000):
        times, q = true_path(with_factors(right, g=1.01), intervals)
        assert 1e-3 < residual(kernel, times, q) < 1e-2


def test_a_body_at_rest_has_no_slope() -> None:
    kernel = LagrangianKernel(mechanism_named("spring_damper"))
    found = stationarity_of(kernel, "at rest", np.linspace(0.0, 1.0, 101), np.zeros((101, 1)))
    assert (found.slope, found.residual, found.first_variation) == (None, 0.0, 0.0)


@pytest.fixture(scope="module")
def measured() -> dict[tuple[str, float], Stationarity]:
    """The seed's cart along every integrator's path, with a MuJoCo model under a gravity that is 1 % too strong."""
    scene = Scene.of(Library.built_in(), "cart_pendulum")
    model = scene.models["mjcf"]
    [gravity] = [number for number in find_numbers(model.text, "mjcf") if number.value == -9.81]
    wrong = parse_model(model.path, scaled(model.text, [gravity], 1.01), "mjcf")
    models = {"mjcf": wrong, "urdf": scene.models["urdf"]}
    rows = stationarity(replace(scene, models=models), silent)
    assert {row.system for row in rows} == {"cart_pendulum"}
    return {(row.path, row.step): row for row in rows}


def of_order(measured: dict[tuple[str, float], Stationarity], order: int) -> list[str]:
    """Names of the integrators of one order whose models are right."""
    paths = {path for path, _ in measured}
    return [found.name for found in integrators() if found.order == order and found.name in paths and found.format != "mjcf"]


@pytest.mark.ci
def test_paths_of_high_order_are_stationary(measured: dict[tuple[str, float], Stationarity]) -> None:
    assert len(of_order(measured, 4)) >= 2
    for path in of_order(measured, 4):
        [row] = [row for (name, _), row in measured.items() if name == path]
        assert row.slope == pytest.approx(2.0, abs=0.01)
        assert row.first_variation < 1e-9


@pytest.mark.ci
def test_the_first_variation_of_first_order_paths_falls_with_the_step(measured: dict[tuple[str, float], Stationarity]) -> None:
    assert len(of_order(measured, 1)) >= 2
    for path in of_order(measured, 1):
        coarse, fine = sorted((row for (name, _), row in measured.items() if name == path), key=lambda row: -row.step)
        assert coarse.step == pytest.approx(10 * fine.step)
        assert coarse.first_variation / fine.first_variation == pytest.approx(10.0, rel=0.05)


@pytest.mark.ci
def test_other_models_and_another_time_are_seen_and_the_reference_passes(measured: dict[tuple[str, float], Stationarity]) -> None:
    wrong = [row for (path, _), row in measured.items() if path.startswith("mujoco") or path.endswith("slower")]
    assert len(wrong) >= 3
    for row in wrong:
        # Nothing that a smaller step would mend.
        assert row.slope is not None and row.slope < 1.2
        assert row.first_variation > 1e-3
    [reference] = [row for (path, _), row in measured.items() if path == "reference motion"]
    assert reference.slope == pytest.approx(2.0, abs=0.01)


@pytest.mark.ci
def test_only_the_variational_integrator_makes_the_discrete_action_stationary(measured: dict[tuple[str, float], Stationarity]) -> None:
    residuals = sorted((row.residual, path) for (path, _), row in measured.items())
    assert residuals[0][1] == "equations variational midpoint"
    assert residuals[0][0] < 1e-8 < 1e-6 < residuals[1][0]


def test_a_motion_that_broke_down_has_no_slope() -> None:
    kernel = LagrangianKernel(mechanism_named("cart_pendulum"))
    times, q = true_path(kernel.mechanism, 100)
    q[60:] = math.nan
    found = stationarity_of(kernel, "broken", times, q)
    assert found.slope is None
    assert math.isnan(found.residual) and math.isnan(found.first_variation)


def test_ball_and_free_joints_are_left_out() -> None:
    turning = replace(mechanism_named("spring_damper"), attitudes=(0,))
    assert stationarity(Scene(Library.built_in(), turning, {}), silent) == []
    with pytest.raises(ValueError, match="spring_damper has a ball or free joint"):
        LagrangianKernel(turning)


def test_forces_of_any_form_do_virtual_work(mechanism_of: Callable[[System], Mechanism]) -> None:
    """A mass that a drag of the third power slows down, in closed form: v = v0 / sqrt(1 + 2 b v0^2 t / m)."""
    x = dynamicsymbols("x")
    m, b = sp.symbols("m b", positive=True)
    drag = System(
        coordinates={x: "slide"},
        kinetic=m * x.diff(TIME) ** 2 / 2,
        potential=sp.S.Zero,
        generalised_forces={x: -b * x.diff(TIME) ** 3},
        parameters={m: (1.0, "kg"), b: (0.3, "N s^3/m^3")},
        total_mass=m,
        ranges={x: (-1.0, 1.0)},
    )
    kernel = LagrangianKernel(mechanism_of(drag))
    times = np.linspace(0.0, HORIZON, 2001)
    fastest = 2.0
    growth = 2 * 0.3 * fastest**2
    q = 2 * fastest / growth * (np.sqrt(1 + growth * times) - 1)[:, None]
    _, slope, first = vary(kernel, times, q)
    assert slope == pytest.approx(2.0, abs=1e-8)
    assert first < 1e-12
    slicker = LagrangianKernel(with_factors(kernel.mechanism, b=0.99))
    assert vary(slicker, times, q)[2] > 1e-4


def test_times_that_are_not_equally_spaced_are_refused() -> None:
    kernel = LagrangianKernel(mechanism_named("spring_damper"))
    times = np.linspace(0.0, 1.0, 101) ** 2
    for measure in (residual, vary):
        with pytest.raises(ValueError, match="equally spaced"):
            measure(kernel, times, np.zeros((101, 1)))
