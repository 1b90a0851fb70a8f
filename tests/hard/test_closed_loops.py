"""Families on closed loops: states close at each point's own parameters, models follow the knob, and slopes are those of theory."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from catalogue import BUILT_IN, is_tied
from studies import silent
from support import where

from harness.crosscheck.assignment import Assignment, truth_of
from harness.engines import Subject, accelerations, load_engine
from harness.explain.pattern import subject_named
from harness.files.model_file import ModelFile, read_model, with_attributes
from harness.hard import truths
from harness.hard.atlas import AtlasStudy, judged, load_hard_expectations
from harness.hard.cases import HardCase, hard_cases
from harness.hard.measurement import measure
from harness.hard.truths import plain_point, plain_points
from harness.lagrange.derivation import load_mechanism
from harness.library import Library
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.results.records import ACCELERATIONS
from harness.truth.compare import Comparison, compare
from harness.truth.declared import DeclaredMechanism
from harness.truth.manifold import closed, closes, rows_left

CASES = [case for case in hard_cases().values() if is_tied(case.system_at(case.values[0]), case.library)]
MUJOCO, PINOCCHIO = Subject("mujoco", "mjcf"), Subject("pinocchio", "urdf")
FOUR_BAR = read_model(BUILT_IN.model_path("four_bar", "mjcf"), "mjcf")


def answers_at(case: HardCase, place: int, file: ModelFile | None = None) -> Comparison:
    """MuJoCo's answers at one point, with the case's model or a file, against the problem that the model at this point declares."""
    point, declared = plain_point(case, place), case.model_at(case.values[place], "mjcf")
    truth = truth_of(Assignment(BUILT_IN, MUJOCO, point.mechanism, declared))
    loaded = load_engine(BUILT_IN, "mujoco").load(file or declared, point.mechanism.joints, point.mechanism.gravity)
    return compare(truth.kernel.evaluate(point.states), accelerations(loaded, point.states))


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_states_close_at_the_points_own_parameters_unless_the_case_opens_them(case: HardCase) -> None:
    for place in (0, len(case.values) // 2):
        point = plain_point(case, place)
        assert closes(point.mechanism, point.states).all() == (case.opened is None)


@pytest.mark.parametrize("angle", [2e-4, 1e-3, 3e-3])
def test_bars_nearly_in_line_close(angle: float) -> None:
    """There a row is less than what float64 rounds in its terms, and balls decide."""
    mechanism = load_mechanism(BUILT_IN, "four_bar_chain_2")
    states = closed(mechanism, hard_cases()["four_bars_in_line"].states(mechanism, angle, 0))
    assert closes(mechanism, states).all()
    off = states.q.copy()
    off[:, 2] += 64 * np.spacing(off[:, 2])
    assert not closes(mechanism, States.at(off, states.v, states.tau)).any()


def test_a_drift_is_as_far_as_its_knob_says() -> None:
    case = replace(hard_cases()["loop_drift"], values=(1e-9, 1e-4, 1e-1))
    for value, point in zip(case.values, plain_points(case), strict=True):
        away = np.linalg.norm(rows_left(point.mechanism, point.states)[0][:, :2], axis=1)
        assert ((0.4 * value < away) & (away < 1.1 * value)).all()


def test_a_law_that_does_not_follow_the_distance_is_condemned(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the impedance of a closed loop, what MuJoCo answers half a millimetre away is another problem's."""
    case = replace(hard_cases()["loop_drift"], values=(1e-9, 5e-4))
    monkeypatch.setattr("harness.hard.truths.hard_cases", lambda: {case.name: case})
    loaded = load_engine(BUILT_IN, "mujoco").load(FOUR_BAR, ("crank", "coupler", "follower"), 9.81)

    def worst() -> list[float]:
        points = truths.true_points(case.name, MUJOCO, BUILT_IN)
        return [float(compare(one.reference, accelerations(loaded, one.states)).backward_error.max()) for one in points]  # type: ignore[arg-type]

    assert max(worst()) < 64
    monkeypatch.setattr(DeclaredMechanism, "parameters_at", Mechanism.parameters_at)
    near, far = worst()
    assert far > 1e6 > near


@pytest.mark.parametrize(("name", "attribute"), [("loop_impedance", "equality/connect"), ("unequal_impedance", "equality/connect[2]")])
def test_an_attribute_that_is_forgotten_is_seen(name: str, attribute: str) -> None:
    case = hard_cases()[name]
    assert (answers_at(case, 20).verdicts == "agrees").all()
    file = read_model(BUILT_IN.model_path(case.system_at(0.0), "mjcf"), "mjcf")
    solimp = f"{_impedance(name, case.values[20])!r} {_impedance(name, case.values[20])!r}"
    assert case.model_at(case.values[20], "mjcf").text == with_attributes(file, {attribute: {"solimp": solimp}}).text
    assert (answers_at(case, 20, file).verdicts == "disagrees").any()


def _impedance(name: str, value: float) -> float:
    return 1 - value if name == "loop_impedance" else value


@pytest.mark.parametrize("name", ["grashof_limit", "loop_light_follower"])
def test_the_model_follows_the_knob(name: str) -> None:
    """At an easy point MuJoCo agrees with what the changed file declares, and not with that of the file as it is written."""
    case = hard_cases()[name]
    place = len(case.values) - 1 if name == "grashof_limit" else 10
    assert (answers_at(case, place).verdicts == "agrees").all()
    assert (answers_at(replace(case, changes={}), place).verdicts == "disagrees").any()


@pytest.mark.ci
@pytest.mark.parametrize(("name", "growth"), [("proximal_once", 1.0), ("lcaba_mu", -1.0), ("proximal_limit", None)])
def test_the_error_grows_with_mu_as_theory_has_it(name: str, growth: float | None) -> None:
    row = measure(name, PINOCCHIO, ACCELERATIONS, BUILT_IN, silent)
    expected = load_hard_expectations(["lagrange", "mujoco/mjcf", "pinocchio/urdf"])
    assert judged(row, expected).problems == []
    assert row.theory_growth == growth
    assert row.growth == (None if growth is None else pytest.approx(growth, abs=0.05))


def test_a_case_is_asked_of_the_subjects_it_is_about() -> None:
    study = AtlasStudy(Library.built_in(), cases=["proximal_once", "dead_point"])
    asked = {(name, str(subject)) for name, subject, *_ in map(where, study.tasks())}
    assert asked == {("proximal_once", "pinocchio/urdf"), *(("dead_point", one) for one in ("lagrange", "mujoco/mjcf", "pinocchio/urdf"))}
    assert hard_cases()["proximal_once"].subjects == ("pinocchio/urdf",) and subject_named("pinocchio/urdf") == PINOCCHIO


def test_a_path_that_finds_no_element_is_refused() -> None:
    with pytest.raises(ValueError, match=r"no element at \"equality/connect\[@name='nothing'\]\""):
        with_attributes(FOUR_BAR, {"equality/connect[@name='nothing']": {"solimp": "0.5 0.5"}})
