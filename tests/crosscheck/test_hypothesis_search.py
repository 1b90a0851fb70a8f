"""One search of a system serves all its subjects: same states, nobody's failure is another's, the simplest failing state is kept."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st

from harness.arrays import Array
from harness.crosscheck import hypothesis_search
from harness.crosscheck.assignment import Assignment, load_audited
from harness.crosscheck.hypothesis_search import BLOCK, Found, explore, search
from harness.crosscheck.stages import Answers
from harness.crosscheck.variation import Variation, quaternion_columns, row_ranges, rows_of, states_of
from harness.engines import Subject, Unsupported, select_subjects
from harness.engines.elsewhere.interpreter import Interpreter
from harness.errors import InvalidModel
from harness.lagrange.derivation import load_mechanism
from harness.library import Library
from harness.programs.states import States
from harness.truth.compare import Comparison
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import HUGE_ANGLES, sample
from harness.verdict import Verdict

BUILT_IN = Library.built_in()
EXAMPLES = 120


def assignments_of(name: str, *subjects: str) -> list[Assignment]:
    return [Assignment.of(BUILT_IN, name, subject) for subject in select_subjects(BUILT_IN, subjects)]


def quiet(text: str) -> None:
    """No note."""


def found(results: dict[str, Found | Answers], subject: str) -> Found:
    result = results[subject]
    assert isinstance(result, Found), result
    return result


def same(one: States, other: States) -> bool:
    return np.array_equal(rows_of(one), rows_of(other))


class Faulty:
    """An engine's model whose answers go through ``change(q, v, tau, answers)``."""

    def __init__(self, model: Any, change: Callable[[Array, Array, Array, Array], Array]) -> None:
        self.model, self.change = model, change

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        return self.change(q, v, tau, self.model.forward_dynamics(q, v, tau))


@pytest.fixture
def plant(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Plant a change of the answers of one subject."""

    def planting(subject: str, change: Callable[[Array, Array, Array, Array], Array]) -> None:
        def load(assignment: Assignment) -> Any:
            model = load_audited(assignment)
            return Faulty(model, change) if str(assignment.subject) == subject else model

        for module in ("assignment", "together"):
            monkeypatch.setattr(f"harness.crosscheck.{module}.load_audited", load)

    return planting


def fast_second_joint(q: Array, v: Array, tau: Array, answers: Array) -> Array:
    """Wrong by 1e-9 where the second joint is faster than 2.718."""
    return np.where(v[:, 1:2] > 2.718, answers * (1 + 1e-9), answers)


# The states.


@pytest.mark.parametrize(("name", "examples"), [("arm_2r", 250), ("heavy_top", 250), ("arm_2r", 2), ("arm_2r", BLOCK + 1)])
def test_every_subject_is_judged_at_every_state(name: str, examples: int) -> None:
    results = search(assignments_of(name), examples, 0, None, quiet)
    assert len(results) == 5
    states = found(results, "lagrange").states
    assert len(states) == examples
    assert len(np.unique(rows_of(states), axis=0)) >= 0.85 * examples
    assert all(same(found(results, subject).states, states) for subject in results)
    assert all(found(results, subject).simplest_failure is None for subject in results)


def test_a_seed_gives_the_same_search_and_the_global_generator_is_left_alone() -> None:
    np.random.seed(4)
    before = np.random.get_state()[1].copy()  # type: ignore[index, union-attr]
    assignments = assignments_of("cart_pendulum", "lagrange", "mujoco/mjcf")
    first, again, other = (found(search(assignments, EXAMPLES, seed, None, quiet), "lagrange").states for seed in (1, 1, 2))
    assert same(first, again)
    assert not same(first, other)
    assert np.array_equal(np.random.get_state()[1], before)  # type: ignore[index]


def test_exploring_is_the_search_of_one_subject() -> None:
    (assignment,) = assignments_of("arm_2r", "mujoco/mjcf")
    alone = found(search([assignment], EXAMPLES, 3, None, quiet), "mujoco/mjcf")
    assert same(explore(assignment, EXAMPLES, 3, quiet).states, alone.states)


def test_the_truth_is_certified_once_per_frame_and_block(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pinocchio takes the linear velocity of a free joint in the body's frame, MuJoCo and the equations in the world's."""
    evaluate, sizes = ReferenceKernel.evaluate, []

    def counted(kernel: ReferenceKernel, states: States) -> Any:
        sizes.append(len(states))
        return evaluate(kernel, states)

    monkeypatch.setattr(ReferenceKernel, "evaluate", counted)
    search(assignments_of("free_body"), 4 * BLOCK, 0, None, quiet)
    assert sizes == [BLOCK] * 8
    sizes.clear()
    search(assignments_of("arm_2r"), 4 * BLOCK, 0, None, quiet)
    assert sizes == [BLOCK] * 4


@pytest.mark.ci
@pytest.mark.parametrize("name", ["double_pendulum", "heavy_top"])
def test_the_search_beats_a_sample_of_as_many_states(name: str) -> None:
    """Over five seeds and the subjects of both engines; a search that does not climb does not."""
    assignments = assignments_of(name, "mujoco/mjcf", "pinocchio/urdf")
    gains = []
    for seed in range(5):
        results = search(assignments, 250, seed, None, quiet)
        panel = hypothesis_search._Panel(assignments, quiet)
        sampled = panel.judge(sample(assignments[0].mechanism, 250, seed))
        gains += [math.log(found(results, one).comparison.backward_error.max() / sampled[one].backward_error.max()) for one in sampled]
    assert np.exp(np.mean(gains)) > 1.25


def test_all_states_are_judged_where_hypothesis_ends_early(monkeypatch: pytest.MonkeyPatch) -> None:
    """As it does where it has drawn every state that there is."""
    monkeypatch.setattr(hypothesis_search, "strategy", lambda mechanism: st.just(States.at([0.5, 0.5], [0, 0], [0, 0])))
    assert len(found(search(assignments_of("arm_2r", "lagrange"), 4 * BLOCK, 0, None, quiet), "lagrange").states) == 4 * BLOCK


# Failures.


def test_the_simplest_failing_state_is_shown_and_the_others_go_on(plant: Callable[..., None]) -> None:
    plant("mujoco/mjcf", fast_second_joint)
    results = search(assignments_of("arm_2r", "mujoco/mjcf", "mujoco/urdf"), EXAMPLES, 0, None, quiet)
    wrong, right = found(results, "mujoco/mjcf"), found(results, "mujoco/urdf")
    assert wrong.simplest_failure == EXAMPLES == len(wrong.states) - 1
    assert (wrong.added, right.added) == (1, 0)
    assert wrong.comparison.verdicts[-1] == Verdict.DISAGREES
    simplest = wrong.states[EXAMPLES:]
    assert not (simplest.q.any() or simplest.v[0, 0])
    # Of one digit; a force keeps the answer from being zero, which no factor changes.
    assert 2.718 < simplest.v[0, 1] == round(simplest.v[0, 1])
    assert right.simplest_failure is None
    assert same(right.states, wrong.states[:EXAMPLES])


def test_an_answer_that_is_not_finite_is_shown(plant: Callable[..., None]) -> None:
    plant("lagrange", lambda q, v, tau, answers: np.where(tau[:, :1] < -1.5, np.nan, answers))
    result = found(search(assignments_of("arm_2r", "lagrange"), EXAMPLES, 0, None, quiet), "lagrange")
    assert result.comparison.verdicts[-1] == Verdict.ERROR
    shown = result.states[EXAMPLES:]
    assert not (shown.q.any() or shown.v.any() or shown.tau[0, 1])
    assert shown.tau[0, 0] == round(shown.tau[0, 0])


@pytest.mark.parametrize(
    ("error", "failure", "unsupported"),
    [
        (ZeroDivisionError("planted"), "ZeroDivisionError: planted", False),
        (Unsupported("no such joint"), "no such joint", True),
        (InvalidModel(Path("a.xml"), 3, "planted"), "a.xml:3: planted", False),
    ],
)
def test_a_subject_that_raises_leaves_and_the_others_go_on(
    plant: Callable[..., None], error: Exception, failure: str, unsupported: bool
) -> None:
    def refuse(q: Array, v: Array, tau: Array, answers: Array) -> Array:
        if np.any(v[:, 0] > 5):
            raise error
        return answers

    plant("mujoco/mjcf", refuse)
    results = search(assignments_of("arm_2r", "lagrange", "mujoco/mjcf"), EXAMPLES, 0, None, quiet)
    answers = results["mujoco/mjcf"]
    assert isinstance(answers, Answers)
    assert (answers.failure, answers.unsupported) == (failure, unsupported)
    assert len(found(results, "lagrange").states) == EXAMPLES
    with pytest.raises(type(error)):
        explore(assignments_of("arm_2r", "mujoco/mjcf")[0], EXAMPLES, 0, quiet)


def test_the_note_names_the_subject_and_the_states_that_are_asked(plant: Callable[..., None]) -> None:
    class Death(BaseException):
        """Stands for the end of the process."""

    def die(q: Array, v: Array, tau: Array, answers: Array) -> Array:
        if np.any(v[:, 0] > 5):
            asked.append((q, v, tau))
            raise Death
        return answers

    asked: list[tuple[Array, Array, Array]] = []
    notes: list[str] = []
    plant("mujoco/urdf", die)
    with pytest.raises(Death):
        search(assignments_of("arm_2r"), EXAMPLES, 0, None, notes.append)
    note = json.loads(notes[-1])
    assert note["subject"] == "mujoco/urdf"
    assert same(States.at(**note["states"]), States.at(*asked[0]))


# What is kept.


def test_the_simplest_failing_state_is_kept_and_tried_first_until_it_agrees(plant: Callable[..., None], tmp_path: Path) -> None:
    assignments, folder = assignments_of("arm_2r", "lagrange", "mujoco/mjcf"), tmp_path / "kept"
    search(assignments, EXAMPLES, 0, folder, quiet)
    assert not folder.exists()
    plant("mujoco/mjcf", fast_second_joint)
    simplest = found(search(assignments, EXAMPLES, 0, folder, quiet), "mujoco/mjcf").states[EXAMPLES:]
    results = search(assignments, 2, 1, folder, quiet)
    assert [len(found(results, subject).states) for subject in ("lagrange", "mujoco/mjcf")] == [3, 4]
    assert same(found(results, "mujoco/mjcf").states[:1], simplest)
    assert same(found(results, "mujoco/mjcf").states[3:], simplest)
    plant("mujoco/mjcf", lambda q, v, tau, answers: answers)
    assert len(found(search(assignments, 2, 1, folder, quiet), "mujoco/mjcf").states) == 3
    assert len(found(search(assignments, 2, 1, folder, quiet), "mujoco/mjcf").states) == 2


def test_states_of_another_mechanism_are_not_tried(plant: Callable[..., None], tmp_path: Path) -> None:
    """A system that got a further joint keeps its name, and with it its folder."""
    plant("mujoco/mjcf", fast_second_joint)
    search(assignments_of("arm_2r", "mujoco/mjcf"), EXAMPLES, 0, tmp_path, quiet)
    assert any(tmp_path.rglob("*"))
    result = search(assignments_of("arm_3r", "mujoco/mjcf"), BLOCK, 0, tmp_path, quiet)
    assert len(found(result, "mujoco/mjcf").states) >= BLOCK


# Rows of numbers.


@pytest.mark.parametrize("name", ["cart_pendulum", "collar", "heavy_top"])
def test_rows_stay_in_their_ranges_and_hold_what_matters(name: str) -> None:
    mechanism = load_mechanism(BUILT_IN, name)
    variation = Variation(mechanism, np.random.default_rng(0))
    fresh = variation.fresh(2000)
    near = variation.near(fresh)
    ranges, quaternions = row_ranges(mechanism), quaternion_columns(mechanism)
    turning = {column for columns in quaternions for column in range(columns.start, columns.stop)}
    for rows in (fresh, near):
        for column, bounds in enumerate(ranges):
            if column not in turning:
                low, high = bounds or (-math.inf, math.inf)
                assert np.all((low <= rows[:, column]) & (rows[:, column] <= high))
        for columns in quaternions:
            np.testing.assert_allclose(np.linalg.norm(rows[:, columns], axis=1), 1.0, rtol=1e-14)
    for column, bounds in enumerate(ranges):
        if column not in turning:
            wanted = {0.0, *HUGE_ANGLES, math.pi / 2, -math.pi} if bounds is None else {0.0, *bounds}
            assert {value for value in wanted if bounds is None or bounds[0] <= value <= bounds[1]} <= set(fresh[:, column].tolist())
    assert same(states_of(mechanism, fresh), States.at(*np.split(fresh, np.cumsum([mechanism.nq, mechanism.nv]), axis=1)))


def test_a_neighbour_differs_and_many_differ_in_one_number() -> None:
    mechanism = load_mechanism(BUILT_IN, "arm_3r")
    rows = rows_of(sample(mechanism, 400, 0))
    differing = (Variation(mechanism, np.random.default_rng(0)).near(rows) != rows).sum(axis=1)
    assert differing.min() >= 1
    assert (differing == 1).mean() > 0.1
    assert (differing == rows.shape[1]).mean() > 0.1


def test_a_range_that_holds_neither_zero_nor_tiny_numbers_keeps_to_itself() -> None:
    arm = load_mechanism(BUILT_IN, "arm_2r")
    bounds = (0.5, 1.5)
    narrow = dataclasses.replace(arm, position_ranges=(bounds, bounds), rate_ranges=(bounds, bounds))
    variation = Variation(narrow, np.random.default_rng(0))
    for rows in (variation.fresh(100), variation.near(variation.fresh(100))):
        assert np.all((rows[:, :4] >= 0.5) & (rows[:, :4] <= 1.5))


@pytest.mark.parametrize("error", [MemoryError("no room for the truth"), SystemExit(3)], ids=["exception", "exit"])
def test_what_fails_in_the_last_block_is_raised_as_it_is(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    """Hypothesis asks again where it sees an exception, and calls one flaky that does not come a second time."""
    blocks = 0

    def judge(panel: object, states: States) -> dict[str, Comparison]:
        nonlocal blocks
        blocks += 1
        if blocks == 2:
            raise error
        return {}

    monkeypatch.setattr(hypothesis_search._Panel, "judge", judge)
    monkeypatch.setattr(hypothesis_search, "FRESH_SHARE", 1.0)
    with pytest.raises(type(error)) as caught:
        explore(Assignment.of(BUILT_IN, "bar_pendulum", Subject("mujoco", "mjcf")), 2 * BLOCK, 1, lambda text: None)
    assert caught.value is error


@pytest.mark.ci
def test_models_of_one_engine_are_asked_in_one_request_and_answer_as_each_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    assignments = assignments_of("double_pendulum", "mujoco/mjcf", "mujoco/urdf", "pinocchio/urdf")
    notes, requests, ask = list[str](), list[str](), Interpreter.ask
    monkeypatch.setattr(Interpreter, "ask", lambda self, *request: requests.append(request[0]) or ask(self, *request))  # type: ignore[func-returns-value]
    together = search(assignments, EXAMPLES, 3, None, notes.append)
    asked, named = requests.count("answer_each"), [json.loads(note).get("together") for note in notes]
    assert ["mujoco/mjcf", "mujoco/urdf"] in named
    requests.clear()
    each = search(assignments, EXAMPLES, 3, None, quiet, each=True)
    # Of each block, two requests in place of three.
    assert requests.count("answer_each") - asked >= EXAMPLES // BLOCK
    for subject in together:
        one, other = found(together, subject), found(each, subject)
        assert same(one.states, other.states) and np.array_equal(one.comparison.backward_error, other.comparison.backward_error)


def test_a_model_that_fails_beside_another_of_its_engine_fails_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    assignments = assignments_of("double_pendulum", "mujoco/mjcf", "mujoco/urdf")
    models: list[Any] = [load_audited(assignment) for assignment in assignments]
    ask, together = Interpreter.ask, list[int]()

    def failing(self: Interpreter, *request: Any) -> Any:
        asked = [number for number, _ in request[1]] if request[0] == "answer_each" else []
        together.append(len(asked))
        if models[1]._number in asked:
            raise RuntimeError("planted")
        return ask(self, *request)

    monkeypatch.setattr(Interpreter, "ask", failing)
    results = search(assignments, EXAMPLES, 3, None, quiet)
    assert 2 in together and found(results, "mujoco/mjcf").comparison.are_all(Verdict.AGREES)
    failed = results["mujoco/urdf"]
    assert isinstance(failed, Answers) and "planted" in failed.failure
