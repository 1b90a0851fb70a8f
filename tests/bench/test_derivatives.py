"""Ways of computing derivatives: how their errors follow the step, what they cost, and what cannot be done."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from studies import scene, silent

from harness.bench.costs import Effort
from harness.bench.further_costs import STATES, derivative_costs
from harness.bench.methods import DERIVATIVES, Method, find_methods
from harness.bench.parts import PARTS, BenchmarkSettings
from harness.bench.study import BenchmarkStudy, not_for
from harness.engines import installed_version, load_engine
from harness.errors import InvalidRequest
from harness.library import Library
from harness.results.benchmark import DerivativeCost

LIBRARY = Library.built_in()
# Those of engines that not everybody installs are tested in environments of these: tests/engines.
METHODS = {method.name: method for method in find_methods(DERIVATIVES) if not method.engine}
# Hinges, a spring between points, a ball joint, and a free one.
SYSTEMS = ("arm_2r", "collar", "heavy_top", "quadrotor")
# Of what truncates: one-sided differences and central ones.
ORDERS = {
    "mujoco mjd_transitionFD": 1,
    "mujoco mjd_inverseFD": 1,
    "mujoco mjd_transitionFD, centred": 2,
    "central differences of pinocchio aba": 2,
    "central differences of pinocchio rnea": 2,
}


def costs(name: str, *methods: Method) -> list[DerivativeCost]:
    return derivative_costs(scene(name), methods, Effort((1, 4), STATES, 3, 0.0), silent)


def is_installed(engine: str) -> bool:
    return installed_version(load_engine(LIBRARY, engine)) is not None


def test_every_difference_has_an_order() -> None:
    assert {name for name, method in METHODS.items() if method.steps} == set(ORDERS)


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("method", METHODS)
def test_errors_are_those_of_rounding_or_of_the_step(method: str, name: str) -> None:
    [cost] = costs(name, METHODS[method])
    assert not cost.note and cost.states == [1, 4] and min(cost.seconds_per_state) > 0
    if method not in ORDERS:
        assert cost.best_step is None and cost.error is not None and cost.error <= 1e-12
        return
    order, by_step = ORDERS[method], dict(zip(cost.steps, cost.errors, strict=True))
    # Truncation falls with the step to a power, and rounding grows with its inverse.
    falling = np.log10(by_step[cost.steps[1]] / by_step[cost.steps[2]])
    assert falling == pytest.approx(order, abs=0.1)
    assert np.log10(by_step[cost.steps[-1]] / by_step[cost.steps[-4]]) == pytest.approx(3, abs=1)
    assert cost.error == min(cost.errors) < 1e-5 and cost.best_step is not None and 1e-9 < cost.best_step < 1e-2


@pytest.mark.parametrize("method", ["mujoco mjd_inverseFD", "pinocchio computeABADerivatives"])
def test_a_transposed_answer_is_wrong_at_every_step(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    own = METHODS[method]

    def transposed(*arguments: Any) -> Any:
        compute = own.prepare(*arguments)
        return lambda: compute().transpose(0, 1, 3, 2)

    wrong = replace(own, name="wrong", prepare=transposed)
    right, spoiled = costs("arm_2r", own, wrong)
    assert right.error is not None and spoiled.error is not None
    assert right.error < 1e-6 and spoiled.error > 0.1 and spoiled.note == ""


def test_what_fails_costs_its_own_row_alone() -> None:
    def broken(*arguments: Any) -> Any:
        raise RuntimeError("no license")

    found = costs("arm_2r", Method("broken", "urdf", broken), METHODS["heyoka derivatives of qdd"])
    assert (found[0].failed, found[0].error) == (True, None) and "no license" in found[0].note
    assert not found[1].failed and found[1].error is not None


def test_methods_of_an_engine_that_is_installed_nowhere_are_measured_by_name_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HARNESS_CACHE", str(tmp_path))
    monkeypatch.setattr("harness.engines.files._DESCRIBED", {})
    missing = [method for method in find_methods(DERIVATIVES) if method.engine and not is_installed(method.engine)]
    assert missing, "one of the engines is not installed beside the harness"
    settings = BenchmarkSettings(library=LIBRARY, names=("arm_2r",), derivatives=True)
    assert not {method.name for method in missing} & set(BenchmarkStudy(settings).methods[DERIVATIVES])
    named = replace(settings, methods=(missing[0].name,))
    assert BenchmarkStudy(named).methods[DERIVATIVES] == [missing[0].name]
    # Each in a task of its own: one that takes too long, as MJX compiles for minutes, costs its own rows alone.
    names = ["heyoka derivatives of qdd", *(one.name for one in missing)]
    study = BenchmarkStudy(replace(settings, methods=tuple(names)))
    assert study.steps == 2 + len({one.engine for one in missing})
    found = costs("arm_2r", *missing)
    assert [one.note for one in found] == [f"{one.engine} is not installed: harness engines add {one.engine}" for one in missing]
    assert not any(one.failed for one in found)


def test_the_study_measures_them_where_they_are_asked_for() -> None:
    [part] = [part for part in PARTS if part.kind == DERIVATIVES]
    chosen = ("heyoka derivatives of qdd", "mujoco mjd_inverseFD")
    settings = BenchmarkSettings(library=LIBRARY, names=("arm_2r",), methods=chosen, derivatives=True)
    found = part.measure(settings, scene("arm_2r"), silent)
    assert {cost.method for cost in found.derivatives} == set(chosen) and not found.problems
    assert part.measure(settings, scene("four_bar"), silent).derivatives == []
    assert not_for(settings, scene("arm_2r")) == []
    with pytest.raises(InvalidRequest, match="'mujoco mjd_inverseFD' computes derivatives; ask for it with --derivatives"):
        BenchmarkStudy(BenchmarkSettings(library=LIBRARY, names=("arm_2r",), methods=["mujoco mjd_inverseFD"]))
