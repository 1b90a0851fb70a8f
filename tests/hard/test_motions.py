"""Motions that diverge do so at the rate of theory, steps are stable up to theory's limit, and planted faults show."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from studies import silent

from harness.crosscheck.scene import Scene
from harness.hard import motions as hard_motion
from harness.hard.cases import hard_cases
from harness.hard.motions import (
    CHAOS,
    MIDDLE_AXIS,
    OSCILLATOR,
    STABILITY_LIMITS,
    growth_rate,
    hard_motions,
    nudged,
    parting_time,
    partings,
    stable_steps,
)
from harness.library import Library
from harness.motion.integrators import Advance, Integrator, integrators, select_integrators
from harness.motion.taylor import Path
from harness.motion.trajectories import Start
from harness.results.atlas import Parting


def test_families_have_thirty_points() -> None:
    assert set(hard_motions()) == {"chaos", "middle_axis"}
    assert all(len(motion.values) == 30 for motion in hard_motions().values())


def test_every_integrator_of_a_fixed_order_has_a_limit_or_is_left_out_by_name() -> None:
    # MuJoCo's manual gives no stability domain for "discrete".
    assert {integrator.name for integrator in integrators() if integrator.order is not None} - set(STABILITY_LIMITS) == {"mujoco discrete"}


@pytest.mark.ci
@pytest.mark.parametrize("name", STABILITY_LIMITS)
def test_the_largest_stable_step_is_that_of_theory_however_stiff_the_spring(name: str) -> None:
    """2 over the frequency for the symplectic Euler methods, the root of 8 for RK4, none for the implicit midpoint."""
    found = stable_steps(name, (1.0, 1e12), silent)
    assert [step.verdict for step in found] == ["agrees", "agrees"]
    assert found[1].frequency == pytest.approx(1e6 * found[0].frequency)


def test_a_wrong_limit_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(STABILITY_LIMITS, "equations RK4", 2.785)
    [found] = stable_steps("equations RK4", (100.0,), silent)
    assert found.verdict == "disagrees"
    assert found.measured == pytest.approx(math.sqrt(8), rel=5e-3)


@pytest.fixture(scope="module")
def chaos() -> list[Parting]:
    patch = pytest.MonkeyPatch()
    patch.setattr(hard_motion, "CHAOS", dataclasses.replace(CHAOS, values=(0.5, 2.4)))
    found = partings("chaos", Library.built_in(), silent)
    patch.undo()
    return found


@pytest.mark.ci
def test_gentle_motions_never_part(chaos: list[Parting]) -> None:
    gentle = [parting for parting in chaos if parting.knob == 0.5]
    assert len(gentle) == 3
    assert all(parting.parted is None and parting.largest < 1e-12 and parting.verdict == "agrees" for parting in gentle)


@pytest.mark.ci
def test_chaotic_motions_part_at_the_rate_of_a_nudged_start(chaos: list[Parting]) -> None:
    engines = [parting for parting in chaos if parting.knob == 2.4 and parting.integrator != "equations RK4"]
    assert len(engines) == 2
    for parting in engines:
        assert parting.parted is not None and parting.earliest is not None and parting.rate is not None
        assert parting.parted >= parting.earliest
        assert parting.rate == pytest.approx(parting.expected_rate, rel=0.1)
        assert parting.verdict == "agrees"


@pytest.mark.ci
def test_an_engine_with_a_fault_far_below_plotting_accuracy_parts_too_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """A relative error of 1e-11 in where it starts is no rounding: it shows as parting sooner than 64 roundoffs explain."""
    [sound] = select_integrators(["equations RK4"])

    def prepare(scene: Scene) -> Advance:
        advance = sound.prepare(scene)

        def faulty(start: Start, step: float, steps: int, every: int) -> Path:
            return advance(nudged(start, 1e-11), step, steps, every)

        return faulty

    planted: list[Integrator] = [sound, dataclasses.replace(sound, name="planted RK4", prepare=prepare)]
    monkeypatch.setattr("harness.hard.motions.select_integrators", lambda names: planted)
    monkeypatch.setattr(
        hard_motion, "CHAOS", dataclasses.replace(CHAOS, values=(2.4,), integrators=tuple(integrator.name for integrator in planted))
    )
    verdicts = {parting.integrator: parting.verdict for parting in partings("chaos", Library.built_in(), silent)}
    assert verdicts == {"equations RK4": "agrees", "planted RK4": "disagrees"}


@pytest.mark.nightly
def test_a_spin_about_the_middle_axis_leaves_it_at_the_rate_of_theory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hard_motion, "MIDDLE_AXIS", dataclasses.replace(MIDDLE_AXIS, values=(1e-16, 1e-10, 1e-7)))
    found = partings("middle_axis", Library.built_in(), silent)
    assert len(found) == 9
    for parting in found:
        assert parting.rate == pytest.approx(parting.expected_rate, rel=0.05)


@pytest.mark.nightly
@pytest.mark.parametrize("name", MIDDLE_AXIS.integrators)
def test_a_spin_exactly_about_the_middle_axis_stays_there(name: str) -> None:
    """Exactly: no product of the two vanishing rates is anything but zero."""
    scene = Scene.of(Library.built_in(), MIDDLE_AXIS.system)
    [integrator] = select_integrators([name])
    path = integrator.prepare(scene)(MIDDLE_AXIS.start(scene.mechanism, 0.0), 5e-3, 2000, 20)
    assert not path.v[:, [3, 5]].any()


@pytest.mark.nightly
@pytest.mark.parametrize("name", hard_motions())
def test_no_engine_parts_too_soon(name: str) -> None:
    assert {parting.verdict for parting in partings(name, Library.built_in(), silent)} == {"agrees"}


def test_rates_and_times_of_an_exponential() -> None:
    times = np.linspace(0.0, 40.0, 401)
    distances = 1e-15 * np.exp(0.9 * times)
    assert growth_rate(times, distances) == pytest.approx(0.9)
    assert parting_time(times, distances) == pytest.approx(math.log(0.1 / 1e-15) / 0.9, abs=0.1)
    assert growth_rate(times, np.full(401, 1e-14)) is None
    assert growth_rate(times, np.full(401, 1e-6)) is None
    assert parting_time(times, np.full(401, 1e-6)) is None


def test_the_scene_of_a_hard_case_has_its_models_changed() -> None:
    scene = hard_cases()[OSCILLATOR].scene_at(1e6)
    assert {name: value for name, value, _ in scene.mechanism.parameters} == {"m": 1.5, "k": 1e6, "c": 0.0}
    assert 'stiffness="1000000.0" damping="0.0"' in scene.models["mjcf"].text
