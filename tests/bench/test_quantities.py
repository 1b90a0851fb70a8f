"""Cost and error of quantities beyond accelerations: every number of states, the errors of the cross-check, and who is left out and why."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from studies import silent

from harness.arrays import Array
from harness.bench.costs import Effort
from harness.bench.further_costs import calls_at, quantity_costs
from harness.bench.parts import QUANTITIES, THOROUGHNESS, BenchmarkSettings, parts_of
from harness.bench.study import BenchmarkStudy
from harness.crosscheck.assignment import Assignment, load_audited
from harness.crosscheck.scene import Scene
from harness.crosscheck.stages import compare_all
from harness.engines import Call, Calls, Subject
from harness.errors import InvalidRequest
from harness.library import Library
from harness.report import benchmarks
from harness.results.benchmark import QuantityCost
from harness.truth.quantities import find_quantities
from harness.truth.sampling import generic_sample
from harness.verdict import AGREEMENT

LIBRARY = Library.built_in()
NAME = "arm_2r"
SUBJECTS = [Subject("lagrange", "equations"), Subject("mujoco", "mjcf"), Subject("pinocchio", "urdf")]
QUANTITIES_TESTED = ("mass_matrix", "inverse_dynamics")
# The middle one neither divides the states whose errors are measured nor holds them all.
COUNTS, JUDGED, SEED = (1, 3, 20), 8, 5


@functools.cache
def scene() -> Scene:
    return Scene.of(LIBRARY, NAME)


def costs(quantity: str, asked: Sequence[Subject] = SUBJECTS) -> list[QuantityCost]:
    return quantity_costs(scene(), find_quantities()[quantity], asked, Effort(COUNTS, JUDGED, SEED, 0.0), silent)


@pytest.mark.parametrize("quantity", QUANTITIES_TESTED)
def test_each_number_of_states_has_a_cost_and_the_errors_of_the_cross_check(quantity: str) -> None:
    found = [cost for cost in costs(quantity) if cost.seconds_per_state is not None]
    asked = [replace(Assignment.of(LIBRARY, NAME, subject), quantity=quantity) for subject in SUBJECTS]
    states = generic_sample(scene().mechanism, max(COUNTS), SEED)[:JUDGED]
    _, _, answers = compare_all(asked, states, silent)
    checked = {key.removesuffix(f" {quantity}"): one.comparison for key, one in answers.items() if one.comparison is not None}
    assert [(cost.method, cost.states) for cost in found] == [(key, count) for key in checked for count in COUNTS]
    for cost in found:
        errors, relative = (checked[cost.method].known(name) for name in ("backward_error", "relative_error"))
        assert cost.quantity == quantity and not cost.failed and cost.repetitions >= 1
        assert cost.fastest is not None and cost.slowest is not None and cost.seconds_per_state is not None
        assert 0 < cost.fastest <= cost.seconds_per_state <= cost.slowest
        assert cost.backward_error == errors.max() and cost.median_backward_error == np.median(errors)
        assert cost.relative_error == relative.max()


def test_who_offers_nothing_is_left_out_with_the_reason() -> None:
    [missing] = costs("regressor", [Subject("mujoco", "mjcf")])
    assert (missing.states, missing.seconds_per_state, missing.backward_error, missing.failed) == (0, None, None, False)
    assert (missing.quantity, missing.method, missing.note) == ("regressor", "mujoco/mjcf", "the engine offers no regressor")


def test_times_are_of_calls_and_costs_of_states(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("harness.bench.further_costs.measure", lambda *arguments: [12.0, 3.0, 6.0])
    for cost in costs("mass_matrix", SUBJECTS[2:]):
        expected = 6.0 / cost.states, 3.0 / cost.states, 12.0 / cost.states, 3
        assert (cost.seconds_per_state, cost.fastest, cost.slowest, cost.repetitions) == expected


class _Wrong:
    """A model whose mass matrix grows with the number of states that are asked for."""

    def mass_matrix(self, q: Array) -> Array:
        return np.array([1e6 * len(q) * np.eye(scene().mechanism.nv)] * len(q))


def test_an_answer_that_depends_on_how_many_states_are_asked_for_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("harness.bench.further_costs.load_audited", lambda assignment: _Wrong())
    single, few, many = costs("mass_matrix", [Subject("mujoco", "mjcf")])
    assert single.backward_error and few.backward_error and many.backward_error
    assert AGREEMENT < single.backward_error < few.backward_error < many.backward_error


def test_what_fails_costs_its_own_row_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    class Broken:
        def mass_matrix(self, q: Array) -> Array:
            raise RuntimeError("no license")

    def load(assignment: Assignment) -> Any:
        return Broken() if assignment.subject.engine == "mujoco" else load_audited(assignment)

    monkeypatch.setattr("harness.bench.further_costs.load_audited", load)
    broken, *others = costs("mass_matrix", SUBJECTS[1:])
    assert broken.failed and "no license" in broken.note and broken.seconds_per_state is None
    assert [cost.method for cost in others] == ["pinocchio/urdf"] * len(COUNTS)


def test_what_is_timed_is_what_the_engine_computes_at_the_states_alone() -> None:
    asked: list[int] = []

    class Model:
        def positions(self, q: Array) -> Array:
            asked.append(len(q))
            return np.zeros((len(q), 1, 12))

    # As a quantity asks for positions: at the states, and for its own convention at zero.
    q = np.ones((3, 2))
    calls = tuple(Call("positions", (positions,), (len(positions), 1, 12)) for positions in (q, np.zeros((1, 2))))
    calls_at(Calls(calls), q)(cast("Any", Model()))
    assert asked == [3]


def test_the_study_measures_the_quantities_that_are_named_and_no_accelerations() -> None:
    settings = BenchmarkSettings(library=LIBRARY, names=(NAME,), quantities=QUANTITIES_TESTED, methods=("pinocchio/urdf",))
    study = BenchmarkStudy(settings)
    assert study.methods[QUANTITIES] == ["pinocchio/urdf"] and not study.methods["accelerations"]
    # The scene, and a task for each quantity.
    assert study.steps == 1 + len(QUANTITIES_TESTED)
    both = BenchmarkStudy(BenchmarkSettings(library=LIBRARY, names=(NAME,), quantities=("all",)))
    assert both.methods["accelerations"] and both.steps == 1 + len(find_quantities())
    assert not BenchmarkStudy(BenchmarkSettings(library=LIBRARY, names=(NAME,))).methods[QUANTITIES]


def test_a_part_of_the_study_is_a_quantity(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("harness.bench.parts.SIZES", (1, 2))
    monkeypatch.setitem(THOROUGHNESS, "quick", replace(THOROUGHNESS["quick"], states=4, minimum_seconds=0.0))
    settings = BenchmarkSettings(library=LIBRARY, names=(NAME,), quantities=("bias",), methods=("mujoco/mjcf", "pinocchio/urdf"))
    [part] = [part for part in parts_of(settings) if part.kind == QUANTITIES]
    found = part.measure(settings, scene(), silent)
    assert part.name == "bias" and part.timed and not found.problems
    assert [(cost.method, cost.states) for cost in found.quantities] == [
        (name, count) for name in ("mujoco/mjcf", "pinocchio/urdf") for count in (1, 2)
    ]
    table = benchmarks.quantities(found.quantities)
    assert [row[:4] for row in table.rows] == [[NAME, "bias", cost.method, cost.states] for cost in found.quantities]


@pytest.mark.parametrize(
    ("chosen", "message"),
    [
        ({"quantities": ("mass_matrx",)}, "no quantity is called 'mass_matrx'; .*mass_matrix"),
        ({"methods": ("pinocchio/urdf",)}, "'pinocchio/urdf' computes quantities; ask for it with --quantity"),
        (
            {"quantities": ("bias",), "methods": ("pinocchio aba",)},
            "'pinocchio aba' computes accelerations; ask for it with --quantity accelerations",
        ),
    ],
)
def test_what_cannot_be_measured_is_refused(chosen: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidRequest, match=message):
        BenchmarkStudy(BenchmarkSettings(library=LIBRARY, names=(NAME,), **chosen))
