"""Integrators: the same method is the same motion in every program, and each is what its name says."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from studies import with_factors

from harness.arrays import Array
from harness.crosscheck.scene import Scene
from harness.engines import Unsupported
from harness.errors import InvalidRequest
from harness.library import Library
from harness.motion.integrators import Integrator, equations, integrators, mujoco, pinocchio, select_integrators, variational
from harness.motion.taylor import FirstOrderSystem, Path
from harness.motion.trajectories import Metric, Start, reference_motion
from harness.truth.sampling import generic_sample

LIBRARY = Library.built_in()
# Largest difference of two motions of 200 steps, relative to the motion, that rounding explains.
ROUNDING = 1e-11
NAMES = [integrator.name for integrator in integrators()]


@pytest.fixture(scope="module")
def scenes() -> dict[str, Scene]:
    return {name: Scene.of(LIBRARY, name) for name in ("cart_pendulum", "arm_2r", "collar", "spring_damper", "heavy_top", "free_body")}


def motion(integrator: Integrator, scene: Scene, step: float = 1e-3, steps: int = 200, every: int = 50) -> Path:
    return integrator.prepare(scene)(Start.of(scene.mechanism, step * steps), step, steps, every)


def difference(scene: Scene, one: Path, other: Path) -> float:
    return float(Metric(scene.mechanism).errors(one, other.q, other.v).max())


class Convergence:
    """Errors at the end of half a second of motion."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.start = scene, Start.of(scene.mechanism, 0.5)
        truth = reference_motion(scene.mechanism, self.start, 50).path
        self.metric = Metric(scene.mechanism)
        self.scales = self.metric.scales(truth)
        self.end = Path(truth.times[-1:], truth.q[-1:], truth.v[-1:], None, 0, 0.0)

    def ratio(self, integrator: Integrator, step: float) -> float:
        """By how much the error falls when the step is halved."""
        advance = integrator.prepare(self.scene)
        coarse, fine = (self._error(advance(self.start, size, round(0.5 / size), 10**6)) for size in (step, step / 2))
        return coarse / fine

    def _error(self, path: Path) -> float:
        return float(self.metric.errors(self.end, path.q[-1:], path.v[-1:], self.scales)[0])


def test_names_are_unique_and_begin_with_what_is_integrated() -> None:
    assert len(NAMES) == len(set(NAMES)) == 12
    formats = {"equations": "equations", "mujoco": "mjcf", "pinocchio": "urdf"}
    for integrator in integrators():
        assert integrator.format == formats[integrator.name.split()[0]]
        assert (integrator.order is None) == integrator.adaptive


def test_an_unknown_integrator_is_refused_with_the_nearest_name() -> None:
    assert [integrator.name for integrator in select_integrators(["mujoco RK4"])] == ["mujoco RK4"]
    assert len(select_integrators([])) == len(NAMES)
    with pytest.raises(InvalidRequest, match="did you mean 'mujoco RK4'"):
        select_integrators(["mujoco RK5"])


@pytest.mark.parametrize("name", ["cart_pendulum", "arm_2r", "collar", "spring_damper"])
def test_one_method_is_one_motion_in_every_program(scenes: dict[str, Scene], name: str) -> None:
    """RK4 of the equations, of MuJoCo and of Pinocchio; Euler-Cromer of the equations and of Pinocchio."""
    scene = scenes[name]
    fourth = motion(equations.RUNGE_KUTTA, scene)
    assert difference(scene, fourth, motion(mujoco.RUNGE_KUTTA, scene)) <= ROUNDING
    assert difference(scene, fourth, motion(pinocchio.RUNGE_KUTTA, scene)) <= ROUNDING
    first = motion(equations.EULER_CROMER, scene)
    assert difference(scene, first, motion(pinocchio.SEMI_IMPLICIT_EULER, scene)) <= ROUNDING
    assert difference(scene, first, fourth) > 1e-6


@pytest.mark.ci
def test_mujocos_euler_takes_joint_dampers_implicitly(scenes: dict[str, Scene]) -> None:
    """With eulerdamp disabled it is Euler-Cromer; without dampers it always is; and the explanation says which."""
    explicit = replace(mujoco.EULER, prepare=partial(mujoco.prepare, "EULER", disable="EULERDAMP"))
    for name in ("cart_pendulum", "spring_damper"):
        scene = scenes[name]
        expected = motion(equations.EULER_CROMER, scene)
        assert difference(scene, expected, motion(explicit, scene)) <= ROUNDING
        assert difference(scene, expected, motion(mujoco.EULER, scene)) > 1e-6
        said = mujoco.explain_euler(scene, Start.of(scene.mechanism), 1e-3)
        assert "eulerdamp" in said and "is not the reason" not in said
    arm = scenes["arm_2r"]
    assert difference(arm, motion(equations.EULER_CROMER, arm), motion(mujoco.EULER, arm)) <= ROUNDING
    assert mujoco.explain_euler(arm, Start.of(arm.mechanism), 1e-3) == ""


def test_damping_is_not_blamed_for_a_wrong_mass(scenes: dict[str, Scene]) -> None:
    scene = scenes["cart_pendulum"]
    wrong = replace(scene, mechanism=with_factors(scene.mechanism, M=1.01))
    assert "joint damping is not the reason" in mujoco.explain_euler(wrong, Start.of(wrong.mechanism), 1e-3)


def test_mujocos_discrete_is_the_linearly_implicit_euler_method(scenes: dict[str, Scene]) -> None:
    """(m + h c + h^2 k) (v1 - v0) = -h (c v0 + k q0 + h k v0), and q1 = q0 + h v1."""
    scene = scenes["spring_damper"]
    m, k, c = scene.mechanism.parameter_values
    step = 1e-2
    found = motion(mujoco.DISCRETE, scene, step, 100, 1)
    q, v = found.q[0, 0], found.v[0, 0]
    for row in range(1, 101):
        v += -step * (c * v + k * q + step * k * v) / (m + step * c + step**2 * k)
        q += step * v
        assert found.q[row, 0] == pytest.approx(q, abs=1e-13) and found.v[row, 0] == pytest.approx(v, abs=1e-12)


@pytest.mark.ci
@pytest.mark.parametrize("name", ["heavy_top", "free_body"])
def test_quaternions_leave_no_order_behind(scenes: dict[str, Scene], name: str) -> None:
    """RK4 of all three: half the step, a sixteenth of the error."""
    convergence = Convergence(scenes[name])
    for integrator in (equations.RUNGE_KUTTA, mujoco.RUNGE_KUTTA, pinocchio.RUNGE_KUTTA):
        assert 2**3.7 < convergence.ratio(integrator, 0.02) < 2**4.4, integrator.name
    for integrator in (equations.EULER_CROMER, mujoco.EULER, mujoco.IMPLICIT, pinocchio.SEMI_IMPLICIT_EULER):
        assert 2**0.9 < convergence.ratio(integrator, 2e-3) < 2**1.1, integrator.name


def test_runge_kutta_without_the_manifolds_derivative_is_caught(scenes: dict[str, Scene], monkeypatch: pytest.MonkeyPatch) -> None:
    import pinocchio as engine

    monkeypatch.setattr(engine, "dDifference", lambda model, q, at: (None, np.eye(model.nv)))
    assert Convergence(scenes["heavy_top"]).ratio(pinocchio.RUNGE_KUTTA, 0.02) < 2**3.2


def test_a_free_bodys_linear_velocity_is_that_of_the_joint_frame(scenes: dict[str, Scene]) -> None:
    scene = scenes["free_body"]
    one, other = motion(mujoco.RUNGE_KUTTA, scene), motion(pinocchio.RUNGE_KUTTA, scene)
    np.testing.assert_allclose(one.v, other.v, atol=1e-10)
    np.testing.assert_allclose(one.q, other.q, atol=1e-10)


@pytest.mark.ci
def test_kept_states_do_not_change_the_motion(scenes: dict[str, Scene]) -> None:
    """Steps compiled together give what they give one by one; the last state is kept even where it is not due."""
    for integrator in integrators():
        if integrator.adaptive:
            continue
        scene = scenes["cart_pendulum"]
        every, some, last = (motion(integrator, scene, 1e-3, 103, kept) for kept in (1, 25, 103))
        assert len(every.times) == 104 and some.times.tolist() == pytest.approx([0, 0.025, 0.05, 0.075, 0.1, 0.103])
        assert last.times.tolist() == pytest.approx([0, 0.103])
        for fewer, rows in ((some, [0, 25, 50, 75, 100, 103]), (last, [0, 103])):
            np.testing.assert_allclose(fewer.q, every.q[rows], rtol=1e-12, atol=1e-15)
            np.testing.assert_allclose(fewer.v, every.v[rows], rtol=1e-12, atol=1e-14)
        assert every.evaluations >= 103


@pytest.mark.parametrize("name", ["cart_pendulum", "heavy_top"])
def test_separate_stages_are_the_compiled_step(scenes: dict[str, Scene], name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scenes[name]
    compiled = [motion(integrator, scene, 1e-2, 20, 5) for integrator in (equations.EULER_CROMER, equations.RUNGE_KUTTA)]
    monkeypatch.setattr(equations, "MOST_INSTRUCTIONS", 0)
    for expected, integrator in zip(compiled, (equations.EULER_CROMER, equations.RUNGE_KUTTA), strict=True):
        assert difference(scene, expected, motion(integrator, scene, 1e-2, 20, 5)) <= 1e-13


def test_a_motion_that_breaks_down_ends_in_no_numbers(scenes: dict[str, Scene]) -> None:
    for name in ("equations Euler-Cromer", "mujoco Euler", "pinocchio RK4"):
        [integrator] = select_integrators([name])
        path = motion(integrator, scenes["spring_damper"], 10.0, 200, 10)
        assert len(path.times) == 21
        assert not (np.isfinite(path.q[-1]).all() and np.abs(path.q[-1]).max() < 1e12)


@pytest.mark.ci
@pytest.mark.parametrize("integrator", [equations.DORMAND_PRINCE, equations.TAYLOR], ids=lambda integrator: integrator.name)
def test_adaptive_integrators_keep_their_tolerance(scenes: dict[str, Scene], integrator: Integrator) -> None:
    for name in ("cart_pendulum", "heavy_top"):
        scene = scenes[name]
        start = Start.of(scene.mechanism, 1.0)
        truth = reference_motion(scene.mechanism, start, 20).path
        advance = integrator.prepare(scene)
        paths = [advance(start, tolerance, 20, 1) for tolerance in (1e-4, 1e-8, 1e-12)]
        errors = [Metric(scene.mechanism).errors(truth, path.q, path.v).max() for path in paths]
        assert errors[0] > errors[1] > errors[2] and errors[2] < 1e-10
        assert paths[0].evaluations < paths[2].evaluations


def test_midpoint_keeps_the_energy_of_an_oscillator_and_returns(scenes: dict[str, Scene]) -> None:
    """The midpoint rule keeps every quadratic invariant, and is its own inverse."""
    scene = scenes["spring_damper"]
    free = replace(scene, mechanism=with_factors(scene.mechanism, c=0.0))
    m, k, _ = free.mechanism.parameter_values
    advance = variational.MIDPOINT.prepare(free)
    start = Start.of(free.mechanism, 20.0)
    path = advance(start, 0.05, 400, 1)
    energy = (m * path.v[:, 0] ** 2 + k * path.q[:, 0] ** 2) / 2
    np.testing.assert_allclose(energy, energy[0], rtol=1e-13)
    back = advance(Start(path.q[-1], path.v[-1], 20.0), -0.05, 400, 400)
    np.testing.assert_allclose(back.q[-1], start.q, atol=1e-13)


@pytest.mark.ci
def test_midpoint_is_the_midpoint_rule_of_hamiltons_equations(scenes: dict[str, Scene]) -> None:
    """One step from the Lagrangian solves q1 - q0 = h v, p1 - p0 = h (dL/dq + Q) at the midpoint, p = M v."""
    scene = scenes["cart_pendulum"]
    step = 0.02
    path = motion(variational.MIDPOINT, scene, step, 1, 1)
    mechanism, system = scene.mechanism, FirstOrderSystem(scene.mechanism)
    q, v = system.variables()
    import heyoka

    energies = system.energies(q, v, heyoka.expression(0.0))
    ([lagrangian], forces) = energies["lagrangian"], energies["forces"]
    momenta = system.compiled([heyoka.diff(lagrangian, rate) for rate in v], [*q, *v])
    impulse = system.compiled([heyoka.diff(lagrangian, x) + force for x, force in zip(q, forces, strict=True)], [*q, *v])

    def at(function: object, positions: Array, velocities: Array) -> Array:
        return np.asarray(function(np.array([*positions, *velocities])))  # type: ignore[operator]

    middle, velocity = (path.q[0] + path.q[1]) / 2, (path.q[1] - path.q[0]) / step
    p0, p1 = at(momenta, path.q[0], path.v[0]), at(momenta, path.q[1], path.v[1])
    np.testing.assert_allclose(p1 - p0, step * at(impulse, middle, velocity), atol=1e-13)
    np.testing.assert_allclose((p0 + p1) / 2, at(momenta, middle, velocity), atol=1e-13)
    assert mechanism.nv == 2


def test_midpoint_leaves_quaternions_to_others(scenes: dict[str, Scene]) -> None:
    with pytest.raises(Unsupported, match="quaternions"):
        variational.MIDPOINT.prepare(scenes["heavy_top"])


@pytest.mark.parametrize("name", ["cart_pendulum", "collar", "spring_damper", "quarter_car", "tora"])
def test_springs_and_dampers_at_one_state_are_those_of_the_batch(name: str) -> None:
    scene = Scene.of(LIBRARY, name)
    loaded = scene.load("pinocchio", "urdf")
    states = generic_sample(scene.mechanism, 2, seed=4)
    configuration, velocity, _ = loaded.columns(states.q, states.v, states.tau)
    elements = loaded.force_elements
    batch = elements.generalised_forces(configuration, velocity)
    for index in range(len(states)):
        np.testing.assert_array_equal(elements.at(configuration[:, index], velocity[:, index]), batch[:, index])
