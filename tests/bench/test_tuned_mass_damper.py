"""The figures of the text's tuned mass damper, against the text's own program written out again."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from studies import silent

from harness.bench import tuned_mass_damper
from harness.bench.tuned_mass_damper import (
    EVERY,
    PRINTED,
    STEP,
    STEPS,
    Ride,
    amplitude,
    figures,
    mismatch,
    ride,
    rounds_to,
    true_ride,
    with_damping,
)
from harness.crosscheck.scene import Scene
from harness.errors import InvalidModel
from harness.library import Library
from harness.motion.integrators import integrators
from harness.results.motion_benchmark import Figure

LIBRARY = Library.built_in()


@cache
def printed_program(c: float) -> Ride:
    """The text's loop over its two printed equations, solved for the accelerations by hand, in plain Python floats."""
    M, m, L, k, g = 10.0, 1.0, 0.6, 270.0, 9.81
    states = np.zeros((STEPS + 1, 4))
    x, theta, v, w = states[0] = 0.03, 0.0, 0.0, 0.0
    for i in range(STEPS):
        sine, cosine = math.sin(theta), math.cos(theta)
        a, b, d = M + m, L * m * cosine / 2, L**2 * m / 3
        of_x, of_theta = L * w**2 * m * sine / 2 - k * x, -L * g * m * sine / 2 - c * w
        determinant = a * d - b * b
        v, w = v + STEP * (d * of_x - b * of_theta) / determinant, w + STEP * (a * of_theta - b * of_x) / determinant
        x, theta = x + STEP * v, theta + STEP * w
        states[i + 1] = x, theta, v, w
    x_, theta_, v_, w_ = states.T
    along, up = v_ + L / 2 * w_ * np.cos(theta_), L / 2 * w_ * np.sin(theta_)
    kinetic = M * v_**2 / 2 + m * (along**2 + up**2) / 2 + m * L**2 / 12 * w_**2 / 2
    energy = kinetic + k * x_**2 / 2 - m * g * L / 2 * np.cos(theta_)
    return Ride(np.arange(STEPS + 1) * STEP, x_, energy, np.concatenate([[0.0], np.cumsum(c * w_[1:] ** 2 * STEP)]))


# The engines' 200,000 steps for each damper take most of the time: they are taken at night.
BY_DAY = ("equations",)
WAYS = pytest.mark.parametrize(
    "ways",
    [pytest.param(BY_DAY, id="by day"), pytest.param(("equations", "mujoco", "pinocchio"), id="all", marks=pytest.mark.nightly)],
)


@cache
def computed_figures(ways: tuple[str, ...]) -> list[Figure]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tuned_mass_damper, "integrators", lambda: [way for way in integrators() if way.name.startswith(ways)])
        return figures(LIBRARY, silent)


def of_equations() -> list[Figure]:
    return [figure for figure in computed_figures(BY_DAY) if "equations" in figure.what]


@pytest.mark.ci
def test_the_equations_repeat_the_program_of_the_text() -> None:
    for figure, printed in zip(of_equations(), PRINTED, strict=True):
        assert figure.computed == pytest.approx(printed.measure(printed_program(printed.damping)), rel=1e-5)
        assert figure.printed == float(printed.figure)


@pytest.mark.ci
@WAYS
def test_every_way_agrees_on_what_the_print_says(ways: tuple[str, ...]) -> None:
    found = {figure.what.split(", ")[-1] for figure in computed_figures(ways)}
    assert {name.split()[0] for name in found} == set(ways) and len(computed_figures(ways)) == len(found) * len(PRINTED)
    for figure in computed_figures(ways):
        # The print of 0.01 cm is the one that no way of computing reproduces.
        assert figure.reproduced == (figure.printed != 0.01)
        assert bool(figure.remark) != figure.reproduced


@pytest.mark.ci
def test_the_figure_that_cannot_be_reproduced_is_told_with_both_numbers() -> None:
    [figure] = [figure for figure in of_equations() if not figure.reproduced]
    assert f"{figure.computed:.4f} {figure.truth:.4f}" == "0.0048 0.0048"
    for part in ("prints 0.01 cm", "gives 0.0048 cm", "motion 0.0048 cm", "0.005 cm", "17.98 s"):
        assert part in figure.remark


@pytest.mark.ci
@WAYS
def test_amplitudes_converge_to_the_reference(ways: tuple[str, ...]) -> None:
    for figure in computed_figures(ways):
        if figure.unit == "cm":
            assert figure.computed == pytest.approx(figure.truth, rel=5e-3)
            assert figure.computed != figure.truth


@pytest.mark.ci
def test_the_reference_loses_no_energy_but_to_the_damper() -> None:
    mechanism = with_damping(Scene.of(LIBRARY, "cart_pendulum"), 0.2).mechanism
    true = true_ride(mechanism)
    assert mismatch(true) < 1e-14
    # The damper takes nearly all that the spring held.
    assert true.dissipated[-1] == pytest.approx(270 * 0.03**2 / 2, rel=1e-4)
    assert amplitude(true) == pytest.approx(amplitude(printed_program(0.2)), rel=5e-3)


def test_models_hold_the_damper_they_are_given() -> None:
    scene = Scene.of(LIBRARY, "cart_pendulum")
    changed = with_damping(scene, 2.0)
    for model_format, model in changed.models.items():
        assert 'damping="2.0"' in model.text and 'damping="2.0"' not in scene.models[model_format].text
    assert {name: value for name, value, _ in changed.mechanism.parameters}["c"] == 2.0
    assert {name: value for name, value, _ in scene.mechanism.parameters}["c"] == 0.2


@pytest.mark.ci
def test_a_model_that_kept_its_old_damper_is_seen() -> None:
    scene = Scene.of(LIBRARY, "cart_pendulum")
    [mujoco] = [integrator for integrator in integrators() if integrator.name == "mujoco Euler"]
    forgotten = replace(with_damping(scene, 2.0), models=scene.models)
    assert abs(amplitude(ride(forgotten, mujoco, EVERY)) - amplitude(printed_program(2.0))) > 1.0


def test_negative_dampers_and_other_mechanisms_are_refused() -> None:
    with pytest.raises(InvalidModel):
        with_damping(Scene.of(LIBRARY, "cart_pendulum"), -1.0)
    with pytest.raises(ValueError, match="collar has no parameter 'c'"):
        with_damping(Scene.of(LIBRARY, "collar"), 0.2)
    with pytest.raises(ValueError, match=r"cart_pendulum\.xml has 0 dampers"):
        scene = Scene.of(LIBRARY, "cart_pendulum")
        without = replace(scene.models["mjcf"], text=scene.models["mjcf"].text.replace(' damping="0.2"', ""))
        with_damping(replace(scene, models={"mjcf": without}), 0.2)


def test_a_library_without_the_cart_has_no_figures(tmp_path) -> None:  # type: ignore[no-untyped-def]
    (tmp_path / "systems").mkdir()
    assert figures(Library.at(tmp_path), silent) == []


@pytest.mark.parametrize(
    ("computed", "printed", "rounds"),
    [
        (2.9849, "2.98", True),
        (2.9851, "2.98", False),
        (0.0048, "0.01", False),
        (0.0051, "0.01", True),
        (2.951e-5, "3.0e-5", True),
        (2.949e-5, "3.0e-5", False),
        (math.nan, "2.98", False),
        (math.inf, "2.98", False),
    ],
)
def test_rounding_to_a_print(computed: float, printed: str, rounds: bool) -> None:
    assert rounds_to(computed, printed) is rounds
