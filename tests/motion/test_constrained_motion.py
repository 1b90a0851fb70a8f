"""Motions under constraints start on the manifold, and how far each integrator drifts off it is measured, not assumed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from studies import silent

from harness.bench.energy_drift import drifts
from harness.bench.motion_cost import motion_costs
from harness.bench.parts import BenchmarkSettings, _motion, vary_action
from harness.crosscheck.scene import Scene
from harness.lagrange.derivation import load_mechanism
from harness.library import CONSTRAINED, MECHANISMS, Library
from harness.motion.integrators import integrators, select_integrators
from harness.motion.integrators.equations import RUNGE_KUTTA
from harness.motion.integrators.mujoco import EULER, explain_softness
from harness.motion.integrators.pinocchio import RUNGE_KUTTA as PINOCCHIO_RUNGE_KUTTA
from harness.motion.integrators.variational import MIDPOINT
from harness.motion.taylor import Taylor
from harness.motion.trajectories import Start, drift
from harness.programs.mechanisms.kernel import EnergyKernel
from harness.programs.states import States
from harness.results.motion_benchmark import MotionCost, MotionTruth, Order
from harness.truth.manifold import closes

LIBRARY = Library.built_in()
HORIZON = 0.5
ASKED = ("equations RK4", "equations Taylor", "mujoco RK4", "pinocchio RK4")
Measured = tuple[MotionTruth, dict[str, list[MotionCost]], dict[str, Order]]


@pytest.fixture(scope="module")
def four_bar() -> Scene:
    return Scene.of(LIBRARY, "four_bar")


@pytest.fixture(scope="module")
def measured(four_bar: Scene) -> Measured:
    truth, costs, orders = motion_costs(four_bar, select_integrators(ASKED, CONSTRAINED), (1e-2, 5e-3, 2.5e-3), HORIZON, 5.0, silent)
    by_integrator = {name: [cost for cost in costs if cost.integrator == name] for name in ASKED}
    return truth, by_integrator, {order.integrator: order for order in orders}


@pytest.mark.parametrize("name", ["four_bar", "slider_crank", "parallelogram"])
def test_motions_start_on_the_manifold(name: str) -> None:
    mechanism = Scene.of(LIBRARY, name).mechanism
    start = Start.of(mechanism)
    assert closes(mechanism, States.at(start.q[None], start.v[None], np.zeros((1, mechanism.nv)))).all()
    assert start.v.any()


def test_a_start_that_no_configuration_has_is_refused(four_bar: Scene) -> None:
    """A coupler of 0.1 m reaches the follower nowhere."""
    short = tuple((name, 0.1 if name == "b" else value, unit) for name, value, unit in four_bar.mechanism.parameters)
    with pytest.raises(ValueError, match="four_bar: its constraints do not close"):
        Start.of(replace(four_bar.mechanism, parameters=short))


def test_a_drift_is_what_the_constraint_leaves(four_bar: Scene) -> None:
    start = Start.of(four_bar.mechanism, HORIZON)
    path = RUNGE_KUTTA.prepare(four_bar)(start, 1e-3, 4, 1)
    assert (drift(four_bar.mechanism, path) or 0.0) < 1e-9
    off = path.q.copy()
    off[2, 2] += 1e-5
    found = drift(four_bar.mechanism, replace(path, q=off))
    # The follower of 1.3 m moves its end by as much, of which the larger component is at least 0.7.
    assert found is not None and 0.7 * 1.3e-5 < found < 1.3e-5
    assert drift(Scene.of(LIBRARY, "arm_2r").mechanism, path) is None
    off[3, 0] = np.nan
    assert drift(four_bar.mechanism, replace(path, q=off)) is None


@pytest.mark.ci
def test_rigid_integrators_converge_to_the_truth_and_stay_near_the_manifold(measured: Measured) -> None:
    truth, costs, orders = measured
    assert truth.error < 1e-12 and truth.trusted == truth.horizon
    for name in ("equations RK4", "pinocchio RK4"):
        errors = [cost.state_error for cost in costs[name]]
        gaps = [cost.gap for cost in costs[name]]
        assert all(error is not None for error in errors) and all(gap is not None for gap in gaps)
        assert errors[-1] < errors[0] and gaps[-1] < gaps[0]  # type: ignore[operator]
        # Half the step, a sixteenth of the drift.
        assert gaps[0] / gaps[1] == pytest.approx(16, rel=0.5)  # type: ignore[operator]
        assert orders[name].verdict == "as expected" and orders[name].measured == pytest.approx(4.0, abs=0.1)
    finest = costs["equations Taylor"][-1]
    assert finest.state_error is not None and finest.state_error < 1e-12 and finest.gap is not None and finest.gap < 1e-12


@pytest.mark.ci
def test_mujoco_converges_to_the_motion_of_what_the_file_declares(measured: Measured) -> None:
    _, costs, orders = measured
    errors = [cost.state_error or 0.0 for cost in costs["mujoco RK4"]]
    assert all(error > 1e-4 for error in errors) and orders["mujoco RK4"].verdict != "as expected"
    assert "not to the rigid one" in orders["mujoco RK4"].explanation and orders["mujoco RK4"].as_expected


def test_softness_explains_nothing_of_a_tree() -> None:
    scene = Scene.of(LIBRARY, "arm_2r")
    assert explain_softness(scene, Start.of(scene.mechanism, HORIZON), 1e-3) == ""


def test_an_integrator_of_trees_is_not_asked_of_constraints() -> None:
    trees, tied = ({one.name for one in integrators(kind)} for kind in (MECHANISMS, CONSTRAINED))
    assert trees - tied == {"equations variational midpoint"} and tied <= trees
    settings = BenchmarkSettings(library=LIBRARY, methods=["equations variational midpoint"], motion=True)
    assert [settings.chosen(integrators(kind)) for kind in (MECHANISMS, CONSTRAINED)] == [[MIDPOINT], []]


def test_what_has_no_variations_is_left_out(four_bar: Scene) -> None:
    settings = BenchmarkSettings(library=LIBRARY, methods=["equations variational midpoint"], motion=True)
    assert vary_action(settings, four_bar, silent).stationarity == []
    assert _motion(settings, four_bar, silent).motion == []


@pytest.mark.ci
def test_energy_and_constraint_drift_over_a_long_run(four_bar: Scene) -> None:
    rigid, soft = drifts(four_bar, [PINOCCHIO_RUNGE_KUTTA, EULER], 4096, silent, seconds=0.5)
    by_name = {one.integrator: one for one in (rigid, soft)}
    own, of_mujoco = by_name[PINOCCHIO_RUNGE_KUTTA.name], by_name[EULER.name]
    assert own.gap is not None and 0 < own.gap < 1e-6 and own.largest < 1e-6
    assert of_mujoco.gap is not None and of_mujoco.gap > 1e-5 and of_mujoco.largest > 1e-5


@pytest.mark.parametrize("name", ["four_bar_chain_2", "bricard"])
def test_energy_is_constant_along_the_motions_of_the_benchmark_library(name: str) -> None:
    """Problems A02 and A04 of the IFToMM library are judged by their energy, which no force but gravity changes."""
    mechanism = load_mechanism(LIBRARY, name)
    start = Start.of(mechanism, 1.0)
    path = Taylor(mechanism).solve(start.q, start.v, np.linspace(0.0, 1.0, 21))
    energies = EnergyKernel(mechanism).along(path.q, path.v)
    assert np.ptp(energies.kinetic) > 0.01
    assert np.ptp(energies.energy) < 1e-13 * np.abs(energies.energy).max()
    assert (drift(mechanism, path) or 0.0) < 1e-13
