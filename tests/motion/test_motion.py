"""Speed against error of motions: errors, orders of convergence and drifts that can be told from planted ones."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from studies import silent, with_factors

from harness.bench.energy_drift import drifts, growth_of, verdict_of, without_dampers
from harness.bench.motion_cost import MotionJudge, measured_order, motion_costs, work_along
from harness.crosscheck.scene import Scene
from harness.files.model_file import parse_model
from harness.files.text.scan import find_numbers, with_values
from harness.library import Library
from harness.motion.integrators import integrators, select_integrators
from harness.motion.integrators.equations import EULER_CROMER, RUNGE_KUTTA, TAYLOR
from harness.motion.integrators.mujoco import RUNGE_KUTTA as MUJOCO_RUNGE_KUTTA
from harness.motion.integrators.pinocchio import RUNGE_KUTTA as PINOCCHIO_RUNGE_KUTTA
from harness.motion.integrators.variational import MIDPOINT
from harness.results.motion_benchmark import Drift, MotionCost, MotionTruth, Order
from harness.truth.compare import compare
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import generic_sample

LIBRARY = Library.built_in()
Measured = tuple[MotionTruth, list[MotionCost], list[Order]]


@pytest.fixture(scope="module")
def cart() -> Scene:
    return Scene.of(LIBRARY, "cart_pendulum")


@pytest.fixture(scope="module")
def judge(cart: Scene) -> MotionJudge:
    return MotionJudge(cart, 2.0)


@pytest.fixture(scope="module")
def measured(cart: Scene) -> Measured:
    return motion_costs(cart, integrators(), [1e-1, 1e-2, 1e-3], 2.0, 2.0, silent)


@pytest.mark.ci
def test_orders_on_the_cart_are_those_of_theory(measured: Measured) -> None:
    _, _, orders = measured
    assert [order.integrator for order in orders] == [found.name for found in integrators() if found.order is not None]
    for order in orders:
        assert order.verdict == "as expected" and order.measured is not None and order.expected is not None
        assert abs(order.measured - order.expected) <= 0.1
        assert len(order.steps) == 3 and order.steps == sorted(order.steps, reverse=True)
    [euler] = [order for order in orders if order.integrator == "mujoco Euler"]
    assert "eulerdamp" in euler.explanation


@pytest.mark.ci
def test_costs_of_the_cart_fall_with_the_step(measured: Measured) -> None:
    truth, costs, _ = measured
    assert truth.trusted == 20.0 and truth.error <= 1e-13 and truth.start == {"q": [0.03, 0.0], "v": [0.0, 0.0]}
    assert {cost.integrator for cost in costs} == {integrator.name for integrator in integrators()}
    for integrator in integrators():
        rows = [cost for cost in costs if cost.integrator == integrator.name]
        assert all((row.step is None) == integrator.adaptive == (row.tolerance is not None) for row in rows)
        assert all(row.seconds > 0 and row.note == "" and row.energy_error is not None for row in rows)
        errors = [row.state_error or 0.0 for row in rows if (row.state_error or 0.0) > 1e-12]
        assert errors == sorted(errors, reverse=True) and len(errors) >= 2
        assert (rows[2].energy_error or 1.0) < (rows[0].energy_error or 0.0) / 10


@pytest.mark.ci
def test_a_wrong_claim_of_an_order_is_seen(cart: Scene, judge: MotionJudge) -> None:
    sweep = [cost for cost in _costs(cart, RUNGE_KUTTA.name) if cost.step]
    order = measured_order(replace(RUNGE_KUTTA, order=3), RUNGE_KUTTA.prepare(cart), judge, sweep, 2.0)
    assert order.verdict == "differs" and order.measured == pytest.approx(4.0, abs=0.1)
    assert order.explanation == ""


@pytest.mark.ci
def test_a_wrong_model_has_no_order(cart: Scene) -> None:
    """One number of the MJCF off by 1e-5: the error stops falling, and the slopes never settle at 4."""
    model = cart.models["mjcf"]
    [mass] = [number for number in find_numbers(model.text, "mjcf") if number.attribute == "mass" and number.value == 10]
    wrong = parse_model(model.path, with_values(model.text, {mass: 10 * (1 + 1e-5)}), "mjcf")
    planted = replace(cart, models={**cart.models, "mjcf": wrong})
    _, costs, [order] = motion_costs(planted, [MUJOCO_RUNGE_KUTTA], [1e-1, 1e-2, 1e-3], 2.0, 2.0, silent)
    assert order.verdict != "as expected"
    assert 1e-6 < (costs[-1].state_error or 0.0) < 1e-4


@pytest.mark.ci
def test_a_damper_that_takes_too_much_breaks_the_energy_balance(cart: Scene, judge: MotionJudge) -> None:
    wrong = replace(cart, mechanism=with_factors(cart.mechanism, c=1.01))
    paths = [RUNGE_KUTTA.prepare(scene)(judge.start, 1e-3, 2000, 2) for scene in (cart, wrong)]
    right, off = (judge.energy_error(path) for path in paths)
    assert right is not None and off is not None and right < 1e-10 and off > 1e-4


def test_work_along_a_path_is_that_of_the_truth(judge: MotionJudge) -> None:
    from harness.programs.mechanisms.kernel import EnergyKernel

    path = judge.reference.path
    power = EnergyKernel(judge.scene.mechanism).along(path.q, path.v).power
    assert path.work is not None and path.work[-1] < -0.1
    np.testing.assert_allclose(work_along(replace(path, work=None), power), path.work, atol=1e-8)
    assert work_along(path, power) is path.work
    assert not work_along(replace(path, work=None), 0 * power).any()


def test_a_motion_that_ends_elsewhere_is_refused(cart: Scene, judge: MotionJudge) -> None:
    with pytest.raises(ValueError, match=r"ends at 1.0 s; expected 2.0 s"):
        judge.state_error(EULER_CROMER.prepare(cart)(judge.start, 1e-2, 100, 100))


def test_what_takes_too_long_is_left_out_and_says_so(cart: Scene) -> None:
    costs = _costs(cart, "equations RK4", seconds=1e-6)
    assert costs[0].note == "" and [cost.steps for cost in costs[1:]] == [0, 0]
    assert all("left out" in cost.note and cost.state_error is None for cost in costs[1:])


def without_times(found: Sequence[MotionCost | Drift]) -> list[MotionCost | Drift]:
    return [replace(one, seconds=0.0) for one in found]


@pytest.mark.ci
def test_budgets_count_evaluations_whatever_the_clock_says(cart: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside a load that makes each look at the clock ten minutes later than the one before, the same is measured."""
    chosen = [RUNGE_KUTTA, MUJOCO_RUNGE_KUTTA, PINOCCHIO_RUNGE_KUTTA, TAYLOR]

    def measured() -> tuple[list[MotionCost | Drift], list[Order], list[MotionCost | Drift]]:
        _, costs, orders = motion_costs(cart, chosen, [1e-1, 1e-2, 1e-3], 2.0, 0.02, silent)
        return without_times(costs), orders, without_times(drifts(cart, chosen, 10**6, silent, seconds=0.05))

    quiet, now = measured(), itertools.count(step=600.0)
    monkeypatch.setattr("time.perf_counter", lambda: next(now))
    assert measured() == quiet
    costs, _, long = quiet
    left_out = [(cost.integrator, cost.note.partition(";")[0]) for cost in costs if isinstance(cost, MotionCost) and cost.note]
    assert left_out == [(PINOCCHIO_RUNGE_KUTTA.name, "left out: about 8,000 evaluations")]
    assert all(2048 <= drift.steps < 10**5 for drift in long if drift.integrator != TAYLOR.name)


def test_what_cannot_be_expressed_says_why() -> None:
    scene = Scene.of(LIBRARY, "spring_damper")
    _, costs, orders = motion_costs(replace(scene, models={}), [MUJOCO_RUNGE_KUTTA], [1e-2], 1.0, 1.0, silent)
    assert [cost.note for cost in costs] == ["unsupported: spring_damper has no MJCF model"] and orders == []


def _costs(scene: Scene, name: str, seconds: float = 2.0) -> list[MotionCost]:
    return motion_costs(scene, select_integrators([name]), [1e-1, 1e-2, 1e-3], 2.0, seconds, silent)[1]


@pytest.mark.parametrize(
    ("errors", "verdict"),
    [
        (lambda t: 1e-3 * np.abs(np.sin(7 * t)), "bounded"),
        (lambda t: 1e-3 * np.abs(np.sin(7 * t)) * np.sqrt(t), "random walk"),
        (lambda t: 1e-6 * t * (1 + 0.3 * np.sin(7 * t)), "secular"),
        # All of the energy is gone long before the end, and nothing is left to grow.
        (lambda t: 1 - np.exp(-t / 20), "secular"),
        (lambda t: np.where(t > 1, 1.0, 0.0), "secular"),
        (lambda t: 0 * t, "bounded"),
    ],
)
def test_growth_of_energy_errors_has_a_name(errors: object, verdict: str) -> None:
    times = np.linspace(0.0, 1000.0, 2049)
    found = errors(times)  # type: ignore[operator]
    assert verdict_of(growth_of(times, found), found) == verdict


@pytest.mark.ci
def test_symplectic_energy_is_bounded_and_that_of_runge_kutta_drifts(cart: Scene) -> None:
    names = ["equations variational midpoint", "equations RK4", "mujoco RK4", "mujoco discrete"]
    found = {drift.integrator: drift for drift in drifts(cart, select_integrators(names), 40000, silent, step=5e-3)}
    assert [found[name].verdict for name in names] == ["bounded", "secular", "secular", "secular"]
    assert [found[name].expected for name in names] == ["bounded", "secular", "secular", ""]
    assert found["equations RK4"].largest == pytest.approx(found["mujoco RK4"].largest, rel=0.01)
    assert found["mujoco discrete"].largest > 0.3


@pytest.mark.ci
def test_theory_issilent_where_all_error_is_rounding() -> None:
    """On a linear system the midpoint rule keeps the energy exactly, so that what is left walks at random."""
    scene = Scene.of(LIBRARY, "spring_damper")
    midpoint, runge_kutta = drifts(scene, [MIDPOINT, RUNGE_KUTTA], 20000, silent)
    assert midpoint.largest < 1e-12
    assert (midpoint.expected, runge_kutta.expected) == ("", "secular")


@pytest.mark.parametrize("name", ["cart_pendulum", "bar_pendulum", "spring_damper", "quarter_car"])
def test_dampers_go_from_equations_and_models_alike(name: str) -> None:
    scene = Scene.of(LIBRARY, name)
    undamped = without_dampers(scene)
    mechanism = undamped.mechanism
    assert mechanism.parameters != scene.mechanism.parameters
    states = generic_sample(mechanism, 16, seed=3)
    reference = ReferenceKernel(mechanism).evaluate(states)
    for engine, model_format in (("mujoco", "mjcf"), ("pinocchio", "urdf")):
        loaded = undamped.load(engine, model_format)
        verdicts = compare(reference, loaded.forward_dynamics(states.q, states.v, states.tau)).verdicts
        assert set(verdicts) == {"agrees"}


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["collar", "arm_2r", "cart_pendulum"])
def test_energy_over_a_million_steps(name: str) -> None:
    scene = Scene.of(LIBRARY, name)
    for drift in drifts(scene, integrators(), 10**6, silent):
        assert drift.expected in ("", drift.verdict), drift
