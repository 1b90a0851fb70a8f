"""Energies along a motion, the truth and its error, and rotations on the way."""

from __future__ import annotations

import math
from dataclasses import replace

import flint
import numpy as np
import pytest

from harness.crosscheck.scene import Scene
from harness.lagrange.derivation import load_mechanism
from harness.library import Library
from harness.motion.integrators.equations import EULER_CROMER
from harness.motion.taylor import FirstOrderSystem, Path, Taylor, displacement, linear_velocities_turned
from harness.motion.trajectories import TRUSTED_ERROR, Metric, Start, TrueMotion, reference_motion
from harness.programs.kernels import BallKernel
from harness.programs.mechanisms.kernel import EnergyKernel
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.program import StraightLineProgram
from harness.programs.states import States
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import generic_sample

LIBRARY = Library.built_in()
# Systems of the text that the harness began with; none of them is chaotic from its start. The bead on the cycloid passes where the
# mass matrix of its tree is singular, which no series in time of that tree does: its period is measured in tests/systems.
NOT_CHAOTIC = ("collar", "bar_pendulum", "spring_damper", "cart_pendulum", "arm_2r")
BITS = 256
# Central differences with a step of 2^-80 leave half of the bits, and are exact to 2^-160 themselves.
DIFFERENCE_STEP = flint.arb(2) ** -80
ALLOWED = flint.arb(2) ** -64


def mechanism_named(name: str) -> Mechanism:
    return load_mechanism(LIBRARY, name)


def energy_balance(mechanism: Mechanism, program: StraightLineProgram, states: States) -> list[tuple[flint.arb, flint.arb]]:
    """(residual, size) of dh/dt - power - tau v + dL/dt at each state, along the certified accelerations."""
    reference = ReferenceKernel(mechanism).evaluate(states)
    assert reference.certified.all()
    evaluate = BallKernel(program, len(mechanism.parameters)).bind(mechanism.parameter_values)
    names = [name for name, indices in program.outputs.items() for _ in indices]
    found = []
    zero = flint.arb(0)
    for index in range(len(states)):
        q, v, tau = ([flint.arb(float(x)) for x in part[index]] for part in (states.q, states.v, states.tau))
        time = flint.arb(float(states.time[index]))
        pairs = zip(reference.high[index], reference.low[index], strict=True)
        accelerations = [flint.arb(float(high)) + flint.arb(float(low)) for high, low in pairs]
        rates = FirstOrderSystem(mechanism).position_rates(q, v)
        # The state moved along the motion, and the clock by itself.
        places = [(s, s) for s in (zero, DIFFERENCE_STEP, -DIFFERENCE_STEP)] + [(zero, DIFFERENCE_STEP), (zero, -DIFFERENCE_STEP)]
        here, ahead, behind, later, earlier = (
            dict(zip(names, evaluate(*moved(q, rates, motion), *moved(v, accelerations, motion), *tau, time + clock), strict=True))
            for motion, clock in places
        )
        applied = sum((force * rate for force, rate in zip(tau, v, strict=True)), zero)
        applied += power_of_constraints(mechanism, [*states.q[index], *states.v[index], *states.tau[index], states.time[index]])
        growth = (ahead["energy"] - behind["energy"]) / (2 * DIFFERENCE_STEP)
        explicit = (later["lagrangian"] - earlier["lagrangian"]) / (2 * DIFFERENCE_STEP)
        size = 1 + abs(growth) + abs(applied) + abs(here["power"]) + abs(here["kinetic"])
        size *= 1 + max((abs(x) for x in [*accelerations, *v]), key=float)
        found.append((growth - here["power"] - applied + explicit, size))
    return found


def power_of_constraints(mechanism: Mechanism, state: list[float]) -> flint.arb:
    """The power of the forces that hold constraints: none but for the last bit of the velocities, which they see."""
    if mechanism.constraints is None:
        return flint.arb(0)
    passive = []
    for program in (mechanism.program, mechanism.constraints.tree):
        alone = replace(program, outputs={"passive": program.outputs["passive"]})
        passive.append(BallKernel(alone, len(mechanism.parameters)).bind(mechanism.parameter_values)(*map(float, state)))
    v = state[mechanism.nq : mechanism.nq + mechanism.nv]
    return sum(((held - free) * flint.arb(float(rate)) for held, free, rate in zip(*passive, v, strict=True)), flint.arb(0))


def moved(values: list[flint.arb], rates: list[flint.arb], by: flint.arb) -> list[flint.arb]:
    return [value + by * rate for value, rate in zip(values, rates, strict=True)]


def test_energy_changes_by_the_power_of_forces_in_every_chart(built_in_mechanism: Mechanism) -> None:
    states = generic_sample(built_in_mechanism, 2, seed=7)
    states = States(states.q, states.v, states.tau, np.array([0.0, 0.75]))
    with flint.ctx.workprec(BITS):
        for program in built_in_mechanism.energy_programs:
            for residual, size in energy_balance(built_in_mechanism, program, states):
                assert abs(residual) <= ALLOWED * size


@pytest.mark.parametrize(("name", "wrong"), [("cart_pendulum", "energy"), ("cart_pendulum", "power"), ("heavy_top", "energy")])
def test_a_wrong_energy_program_is_caught(name: str, wrong: str) -> None:
    """The energy of 1.000001 times the kinetic energy, or a power without its damper."""
    mechanism = mechanism_named(name)
    program = mechanism.energy_programs[0]
    last = len(program.instructions)
    if wrong == "energy":
        added = (("rational", "1000001", "1000000"), ("mul", last, program.outputs["energy"][0]))
    else:
        added = (("rational", "0", "1"), ("mul", last, program.outputs["power"][0]))
    planted = replace(program, instructions=(*program.instructions, *added), outputs={**program.outputs, wrong: (last + 1,)})
    with flint.ctx.workprec(BITS):
        assert any(
            abs(residual) > ALLOWED * size for residual, size in energy_balance(mechanism, planted, generic_sample(mechanism, 2, seed=7))
        )


def test_energies_of_charts_agree_and_forces_do_the_power(built_in_mechanism: Mechanism) -> None:
    mechanism = built_in_mechanism
    states = generic_sample(mechanism, 4, seed=3)
    found = EnergyKernel(mechanism).evaluate(states)
    with flint.ctx.workprec(BITS):
        for program in mechanism.energy_programs:
            evaluate = BallKernel(program, len(mechanism.parameters)).bind(mechanism.parameter_values)
            names = [name for name, indices in program.outputs.items() for _ in indices]
            for index in range(len(states)):
                outputs = evaluate(*(float(x) for x in (*states.q[index], *states.v[index], *states.tau[index], 0.0)))
                at = dict(zip(names, outputs, strict=True))
                for name in ("energy", "lagrangian", "kinetic", "power"):
                    size = abs(float(at["kinetic"])) + abs(float(at["energy"])) + abs(float(at["power"]))
                    assert getattr(found, name)[index] == pytest.approx(float(at[name]), abs=1e-11 * size)
                forces = [value for name, value in zip(names, outputs, strict=True) if name == "forces"]
                work = sum((force * float(rate) for force, rate in zip(forces, states.v[index], strict=True)), flint.arb(0))
                assert abs(work - at["power"]) <= ALLOWED * (1 + abs(at["power"]))


@pytest.mark.ci
@pytest.mark.parametrize("name", NOT_CHAOTIC)
def test_truth_is_known_to_the_bar_over_twenty_seconds(name: str) -> None:
    mechanism = mechanism_named(name)
    reference = reference_motion(mechanism, Start.of(mechanism))
    assert reference.trusted == 20.0
    assert reference.error <= 1e-13
    energies = EnergyKernel(mechanism).along(reference.path.q, reference.path.v)
    balance = energies.energy - energies.energy[0] - reference.path.work
    # The states are rounded to float64, and the energy again.
    assert np.abs(balance).max() <= 64 * 2.0**-53 * (
        np.abs(energies.energy).max() + energies.kinetic.max() + abs(energies.lagrangian).max()
    )


@pytest.mark.ci
def test_float64_alone_would_miss_the_bar_on_the_collar() -> None:
    """It passes near the top of its guide, where it nearly stops, and each pass multiplies the roundings of the ones before."""
    mechanism = mechanism_named("collar")
    start = Start.of(mechanism)
    reference = reference_motion(mechanism, start)
    found = Taylor(mechanism).solve(start.q, start.v, reference.path.times)
    assert 1e-13 < Metric(mechanism).errors(reference.path, found.q, found.v).max() < 1e-11


def test_spring_and_damper_moves_as_the_closed_form_does() -> None:
    mechanism = mechanism_named("spring_damper")
    m, k, c = mechanism.parameter_values
    path = reference_motion(mechanism, Start(np.array([0.3]), np.array([-1.0]), 5.0), 50).path
    decay, frequency = c / (2 * m), math.sqrt(k / m - (c / (2 * m)) ** 2)
    sine = (-1.0 + decay * 0.3) / frequency
    expected = np.exp(-decay * path.times) * (0.3 * np.cos(frequency * path.times) + sine * np.sin(frequency * path.times))
    np.testing.assert_allclose(path.q[:, 0], expected, atol=1e-14)
    assert path.work is not None
    assert path.work[-1] == pytest.approx((m * path.v[-1, 0] ** 2 + k * path.q[-1, 0] ** 2 - m - k * 0.09) / 2, rel=1e-13)


@pytest.mark.ci
def test_chaos_ends_the_horizon() -> None:
    mechanism = mechanism_named("arm_2r")
    reference = reference_motion(mechanism, Start(np.array([3.0, 2.5]), np.array([4.0, -3.0]), 40.0), 160)
    assert reference.trusted < 40.0
    beyond = reference.path.times > reference.trusted
    assert reference.error <= TRUSTED_ERROR < reference.errors[beyond].max()


@pytest.mark.ci
def test_free_body_keeps_its_angular_momentum_across_charts() -> None:
    """Thrown with a spin about its middle axis it tumbles through the singularities of both charts."""
    mechanism = mechanism_named("free_body")
    start = Start(np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), np.array([1.0, 0.0, 2.0, 0.01, 4.0, 0.02]), 3.0)
    times = np.linspace(0.0, 3.0, 31)
    found = Taylor(mechanism).solve(start.q, start.v, times)
    assert np.isfinite(found.q).all()
    moments = np.array([0.25, 0.375, 0.5])
    momentum = linear_velocities_turned(
        mechanism, found.q, np.concatenate([found.v[:, 3:] * moments, found.v[:, 3:]], axis=1), into_body=False
    )[:, :3]
    np.testing.assert_allclose(momentum, np.broadcast_to(momentum[0], momentum.shape), atol=1e-13)
    np.testing.assert_allclose(found.q[:, 2], 2 * times - 9.81 * times**2 / 2, atol=1e-13)
    assert not np.allclose(found.q[:, 3], 1.0)


def test_what_no_force_moves_has_no_parameter_and_goes_on_as_it_began() -> None:
    """Between impacts the masses of Newton's cradle stand in no acceleration; heyoka refuses parameters that do not occur."""
    times, q, v = np.linspace(0.0, 2.0, 5), np.array([0.5, 0.1, 0.2]), np.array([-1.0, 0.25, 2.0])
    found = Taylor(mechanism_named("newtons_cradle")).solve(q, v, times)
    np.testing.assert_allclose(found.q, q + times[:, None] * v, rtol=1e-15)
    np.testing.assert_array_equal(found.v, np.tile(v, (5, 1)))


def test_displacements_turn_back_and_do_not_see_the_sign_of_a_quaternion() -> None:
    mechanism = mechanism_named("free_body")
    states = generic_sample(mechanism, 64, seed=11)
    start, end = states.q[:32], states.q[32:]
    moved = displacement(mechanism, start, end)
    np.testing.assert_allclose(moved[:, 3:], -displacement(mechanism, end, start)[:, 3:], atol=1e-13)
    flipped = end.copy()
    flipped[:, 3:] *= -2.0
    np.testing.assert_allclose(displacement(mechanism, start, flipped), moved, atol=1e-13)
    assert (np.linalg.norm(moved[:, 3:], axis=1) <= math.pi + 1e-12).all()


def test_linear_velocities_turn_there_and_back() -> None:
    mechanism = mechanism_named("free_body")
    states = generic_sample(mechanism, 16, seed=2)
    inside = linear_velocities_turned(mechanism, states.q, states.v, into_body=True)
    assert not np.allclose(inside, states.v)
    np.testing.assert_allclose(linear_velocities_turned(mechanism, states.q, inside, into_body=False), states.v, rtol=1e-13, atol=1e-13)


def test_error_does_not_depend_on_units_and_sees_a_planted_fault() -> None:
    """A state 1 + 1e-6 times as far from the start is wrong by 1e-6 of the motion, whatever a metre is called."""
    mechanism = mechanism_named("spring_damper")
    path = reference_motion(mechanism, Start(np.array([0.3]), np.array([0.0]), 2.0), 40).path
    metric = Metric(mechanism)
    farthest = int(np.argmax(np.abs(path.q - path.q[0])))
    off = path.q.copy()
    off[farthest] += 1e-6 * (path.q[farthest] - path.q[0])
    errors = metric.errors(path, off, path.v)
    assert errors[farthest] == pytest.approx(1e-6, rel=1e-6)
    assert np.delete(errors, farthest).max() == 0
    heavier = replace(mechanism, parameters=tuple((name, value * 1e6, unit) for name, value, unit in mechanism.parameters))
    np.testing.assert_allclose(Metric(heavier).errors(path, off, path.v), errors, rtol=1e-12)
    assert np.isinf(metric.errors(path, np.full_like(off, np.nan), path.v)).all()


def test_start_is_declared_or_moves_everything(built_in_mechanism: Mechanism) -> None:
    start = Start.of(built_in_mechanism)
    assert start.q.shape == (built_in_mechanism.nq,) and start.v.shape == (built_in_mechanism.nv,)
    for bounds, place in zip(built_in_mechanism.rate_ranges, start.v, strict=True):
        assert bounds[0] <= place <= bounds[1]
    if not built_in_mechanism.start:
        assert (start.v != 0).all()


def test_the_text_releases_the_cart_three_centimetres_off() -> None:
    start = Start.of(mechanism_named("cart_pendulum"))
    assert start.q.tolist() == [0.03, 0.0] and start.v.tolist() == [0.0, 0.0]


@pytest.mark.ci
def test_a_scene_holds_both_models_of_a_system_and_of_a_familys_member() -> None:
    for name in ("arm_2r", "chain_3"):
        scene = Scene.of(LIBRARY, name)
        assert set(scene.models) == {"mjcf", "urdf"} and scene.mechanism.name == name
        assert isinstance(EULER_CROMER.prepare(scene)(Start.of(scene.mechanism), 1e-3, 8, 4), Path)


def test_reference_error_counts_only_what_is_trusted() -> None:
    path = Path(np.arange(3.0), np.zeros((3, 1)), np.zeros((3, 1)), None, 0, 0.0)
    assert TrueMotion(path, 1.0, np.array([0.0, 1e-10, 1e-3]), "").error == 1e-10


def test_the_error_of_a_true_motion_holds_what_float64_loses_of_it() -> None:
    """Far from zero a small motion loses most digits where it is kept."""
    mechanism = load_mechanism(LIBRARY, "bar_pendulum")
    start = Start(np.array([1000 * np.pi]), np.array([1e-3]), 2.0)
    reference = reference_motion(mechanism, start, 20)
    exact = Taylor(mechanism, np.longdouble).solve(start.q, start.v, reference.path.times)
    lost = Metric(mechanism).errors(Path(exact.times, exact.q, exact.v), reference.path.q, reference.path.v)
    assert lost.max() > 1e-11
    assert (reference.errors >= lost * (1 - 1e-6)).all()
