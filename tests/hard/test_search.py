"""The search finds hard states that random ones do not show, shrinks them, and says which term loses the digits."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from studies import assignment_of
from support import InThisProcess, completed, make_library

from harness.arrays import Array
from harness.crosscheck.assignment import Assignment, reference_kernel_of
from harness.crosscheck.variation import KEPT, shrink
from harness.errors import InvalidRequest
from harness.hard import evolution, worst_cases
from harness.hard.evolution import POPULATIONS, StateSpace, evolve, hunt, hunts
from harness.hard.search import DEFAULT_BUDGET, SearchSettings, StateSearch
from harness.lagrange.derivation import load_mechanism
from harness.library import Library
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.results.hard_states import as_lines, load_found, path_of
from harness.study import run_study
from harness.truth.balls import condition_number, scaled_cholesky
from harness.truth.compare import Comparison
from harness.truth.sampling import HUGE_ANGLES, generic_sample
from harness.truth.terms import certify_terms
from harness.verdict import Verdict
from harness.workers import Workers


def worst_of_hunts(assignment: Assignment, budget: int, seed: int) -> float:
    return max(hunt(assignment, states, population, seed).backward_error for states, population in hunts(budget))


def best_of_random(assignment: Assignment, count: int, seed: int) -> float:
    return float(assignment.judge(generic_sample(assignment.mechanism, count, seed)).backward_error.max())


# The bars.


@pytest.mark.ci
@pytest.mark.parametrize("seed", [0, 1])
def test_a_tenth_of_the_budget_finds_where_mujoco_loses_digits_on_ten_links(seed: int) -> None:
    assert worst_of_hunts(assignment_of("chain_10"), DEFAULT_BUDGET // 10, seed) >= 100


@pytest.mark.ci
@pytest.mark.parametrize("name", ["double_pendulum", "arm_2r"])
def test_a_quarter_of_the_budget_beats_the_best_of_ten_thousand_random_states(name: str) -> None:
    assignment = assignment_of(name)
    for seed in (0, 1):
        assert worst_of_hunts(assignment, DEFAULT_BUDGET // 4, seed) > best_of_random(assignment, 10_000, seed)


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["double_pendulum", "arm_2r"])
def test_the_search_is_not_lucky_on_two_links(name: str) -> None:
    assignment = assignment_of(name)
    found = [worst_of_hunts(assignment, DEFAULT_BUDGET, seed) for seed in range(10)]
    random = [best_of_random(assignment, 10_000, seed) for seed in range(10)]
    assert min(found) > np.median(random) and all(one > other for one, other in zip(found, random, strict=True))


@pytest.mark.nightly
def test_the_search_is_not_lucky_on_ten_links() -> None:
    assert min(worst_of_hunts(assignment_of("chain_10"), DEFAULT_BUDGET, seed) for seed in range(8)) >= 100


# Other quantities than accelerations.

SLIPPING_ENGINE = """
from harness.engines.adapters.mujoco import MujocoEngine


class Engine(MujocoEngine):
    formats = ("mjcf",)

    def load(self, source, joints, gravity):
        loaded = super().load(source, joints, gravity)
        bias = loaded.bias
        loaded.bias = lambda q, v: bias(q, v) * (1 + 1e-11 * (v[:, :1] > 4))
        return loaded


ENGINE = Engine()
"""


@pytest.mark.ci
def test_a_search_finds_where_a_quantity_is_wrong(tmp_path: Path) -> None:
    """The planted fault is felt above a speed, by the bias alone."""
    library = Library.at(make_library(tmp_path / "library", ["double_pendulum"], {"slipping": SLIPPING_ENGINE}))
    settings = SearchSettings(library=library, name="double_pendulum", subjects=["slipping/mjcf"], budget=400, quantity="bias")
    result = completed(StateSearch(settings), InThisProcess())
    worst = result.cases[0]
    assert not worst.as_expected and worst.found.verdict == "disagrees" and worst.found.quantity == "bias"
    assert worst.found.state["v"][0] > 4 and worst.found.term.startswith("bias force on joint")
    assert "--quantity bias --state" in worst.replay and worst.reproducer == ""
    assert {one.quantity for one in load_found(library, "double_pendulum")} == {"bias"}


def test_a_search_for_what_nobody_offers_is_refused() -> None:
    for name, quantity, reason in (("four_bar", "inverse_dynamics", "not determined"), ("arm_2r", "bia", "did you mean 'bias'")):
        with pytest.raises(InvalidRequest, match=reason):
            completed(
                StateSearch(SearchSettings(library=Library.built_in(), name=name, budget=8, quantity=quantity, keep=False)), InThisProcess()
            )


# Hunts and their space.


@pytest.mark.parametrize("budget", [1, 10, 100, 1000, DEFAULT_BUDGET])
def test_hunts_spend_the_budget(budget: int) -> None:
    shares = hunts(budget)
    assert sum(states for states, _ in shares) <= budget
    assert shares[0][1] == 0
    if budget >= 1000:
        assert [population for _, population in shares[1:]] == list(POPULATIONS)
        assert sum(states for states, _ in shares) >= 0.99 * budget


@pytest.mark.parametrize("name", ["cart_pendulum", "heavy_top"])
def test_the_box_holds_every_range_and_nothing_else(name: str) -> None:
    mechanism = load_mechanism(Library.built_in(), name)
    space = StateSpace(mechanism)
    points = np.random.default_rng(1).uniform(-space.bound, space.bound, (400, len(space.bound)))
    points[0], points[1], points[2] = space.bound, -space.bound, 0.0
    states = space.decode(points)
    quaternions = [place + order for order, place in enumerate(mechanism.attitudes)]
    for first in quaternions:
        np.testing.assert_allclose(np.linalg.norm(states.q[:, first : first + 4], axis=1), 1.0, rtol=1e-14)
    for values, ranges in ((states.v, mechanism.rate_ranges), (states.tau, mechanism.force_ranges)):
        low, high = np.array(ranges).T
        assert np.all((low <= values) & (values <= high))
        np.testing.assert_allclose(values[0], high, rtol=1e-12)
        np.testing.assert_allclose(values[1], low, rtol=1e-12)
    if not quaternions:
        for column, bounds in zip(states.q.T, mechanism.position_ranges, strict=True):
            low, high = bounds or (-max(HUGE_ANGLES), max(HUGE_ANGLES))
            assert np.all((low <= column) & (column <= high))
            np.testing.assert_allclose(column[:2], [high, low], rtol=1e-9)
            assert column[2] == 0


def test_a_range_without_zero_is_searched_about_its_middle() -> None:
    arm = load_mechanism(Library.built_in(), "arm_2r")
    space = StateSpace(dataclasses.replace(arm, position_ranges=((0.5, 1.5), None)))
    states = space.decode(np.array([[0.0] * 6, [1.0] * 6, [-1.0] * 6]))
    np.testing.assert_allclose(states.q[:, 0], [1.0, 1.5, 0.5], rtol=1e-12)
    np.testing.assert_allclose(states.q[:, 1], [0.0, math.pi, -math.pi], rtol=1e-12)


def test_a_seed_gives_the_same_hunt_and_the_global_generator_is_left_alone() -> None:
    assignment = assignment_of("arm_2r")
    np.random.seed(4)
    before = np.random.get_state()[1].copy()  # type: ignore[index, union-attr]
    first, again, other = (evolve(assignment, 200, 20, seed) for seed in (1, 1, 2))
    assert np.array_equal(first.worst.q, again.worst.q)
    assert first.backward_error == again.backward_error != other.backward_error
    assert first.states == 200
    assert np.array_equal(np.random.get_state()[1], before)  # type: ignore[index]


def test_what_is_not_finite_is_worst_and_what_is_not_certified_least() -> None:
    errors = np.array([3.0, np.nan, np.nan, np.inf, 0.0])
    verdicts = np.array([Verdict.AGREES, Verdict.ERROR, Verdict.UNDECIDED, Verdict.DISAGREES, Verdict.AGREES])
    comparison = Comparison(errors, errors, np.zeros(5, dtype=bool), verdicts, np.zeros(5, dtype=bool), np.zeros(5))
    assert np.argsort(evolution.objective(comparison), kind="stable").tolist() == [2, 4, 0, 1, 3]
    assert evolution.worst_index(comparison) == 1


# Shrinking.


def planted(blame: Callable[[States], Array]) -> Callable[[States], Comparison]:
    """A judge that finds the backward errors ``blame`` says."""

    def judge(states: States) -> Comparison:
        error = blame(states)
        none = np.zeros(len(error), dtype=bool)
        return Comparison(
            error, error, none, np.where(error > 64, Verdict.UNSTABLE.value, Verdict.AGREES.value), none, np.zeros(len(error))
        )

    return judge


def test_what_does_not_matter_shrinks_away() -> None:
    mechanism = load_mechanism(Library.built_in(), "arm_3r")
    state = generic_sample(mechanism, 1, 3)
    judge = planted(lambda states: np.where((np.abs(states.v[:, 1]) > 2.718) & (np.abs(states.q[:, 2]) > 0.1234), 1000.0, 1.0))
    state.v[0, 1], state.q[0, 2] = -3.14159265, 0.123456789
    shrunk, error = shrink(judge, mechanism, state)
    assert error == 1000
    assert not shrunk.tau.any()
    assert shrunk.v.tolist() == [[0.0, -3.0, 0.0]]
    assert shrunk.q.tolist() == [[0.0, 0.0, 0.1235]]


def test_a_shrunk_state_stays_as_hard_and_in_its_ranges() -> None:
    """The error falls with every digit that is taken away: shrinking stops where it would be too little."""
    mechanism = load_mechanism(Library.built_in(), "cart_pendulum")
    state = generic_sample(mechanism, 1, 4)
    start = np.hstack([state.q, state.v, state.tau])

    def blame(states: States) -> Array:
        return np.asarray(1000 - 3000 * np.abs(np.hstack([states.q, states.v, states.tau]) / start - 1).sum(axis=1))

    shrunk, error = shrink(planted(blame), mechanism, state)
    assert KEPT * 1000 <= error < 1000
    assert not np.array_equal(shrunk.q, state.q)
    for values, ranges in ((shrunk.q, mechanism.position_ranges), (shrunk.v, mechanism.rate_ranges), (shrunk.tau, mechanism.force_ranges)):
        assert all(bounds is None or bounds[0] <= value <= bounds[1] for value, bounds in zip(values[0], ranges, strict=True))


def test_a_quaternion_keeps_its_length() -> None:
    mechanism = load_mechanism(Library.built_in(), "heavy_top")
    state = generic_sample(mechanism, 1, 4)
    turned, _ = shrink(planted(lambda states: np.where(states.q[:, 1] == state.q[0, 1], 100.0, 1.0)), mechanism, state)
    assert np.array_equal(turned.q, state.q)
    assert not (turned.v.any() or turned.tau.any())
    free, _ = shrink(planted(lambda states: np.full(len(states), 100.0)), mechanism, state)
    assert free.q.tolist() == [[1.0, 0.0, 0.0, 0.0]]


# Which term loses the digits.


class Planted:
    """The equations in float64 with a relative error in one term: the ``Model`` of no file."""

    def __init__(self, mechanism: Mechanism, term: str, error: float) -> None:
        from harness.programs.kernels import Float64Kernel

        self.mechanism, self.term, self.error = mechanism, term, error
        self.kernel = Float64Kernel(mechanism.program)

    def loaded(self) -> None:
        return None

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        terms = self.kernel.terms(self.mechanism.inputs(States.at(q, v, tau)))
        shape = terms[self.term].shape[1:]
        # Every other entry goes the other way, symmetrically in a matrix.
        signs = np.where(sum(np.indices(shape)) % 2, 1.0, -1.0)
        terms[self.term] = terms[self.term] * (1 + self.error * signs)
        force = tau + terms["passive"] - terms["velocity"] - terms["gravity"]
        return np.linalg.solve(terms["mass"], force[:, :, None])[:, :, 0]


@pytest.mark.parametrize(
    ("name", "term", "error", "said"),
    [
        ("chain_6", "mass", 2.0**-50, "mass matrix"),
        ("arm_2r", "velocity", 2.0**-49, "velocity"),
        ("arm_2r", "velocity", 1e-6, "velocity"),
        ("arm_2r", "gravity", 2.0**-49, "gravity"),
        ("cart_pendulum", "passive", 2.0**-49, "passive"),
        ("arm_2r", "gravity", 1e-6, "gravity"),
        ("arm_2r", "mass", 1e-6, "mass matrix"),
    ],
)
def test_the_planted_term_is_named(name: str, term: str, error: float, said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """States in which the term matters: straight chain at rest; fast; still and loaded by gravity or a spring alone."""
    assignment = assignment_of(name, "lagrange")
    mechanism = assignment.mechanism
    monkeypatch.setattr("harness.crosscheck.assignment.load_audited", lambda _: Planted(mechanism, term, error))
    fast = term == "velocity"
    small = 0.05 if name == "cart_pendulum" else 1e-3
    q = np.full(mechanism.nq, 0.7 if mechanism.nq == 2 and name == "arm_2r" else small)
    if name == "cart_pendulum":
        q[1] = 0.0
    state = States.at(q, np.full(mechanism.nv, 8.0 if fast else 0.0), np.zeros(mechanism.nv))
    loss = worst_cases.locate(assignment, state)
    assert loss.term == said, loss
    if said == "velocity":
        assert loss.at_rest is not None
        assert loss.at_rest < 16
    if error == 1e-6:
        assert "the model or an algorithm is wrong" in loss.statement


def test_the_condition_of_a_scaled_matrix_does_not_depend_on_units() -> None:
    mass, units = np.array([[4.0, 1.9], [1.9, 1.0]]), np.array([1e6, 1e-3])
    _, factor = scaled_cholesky(np.array([mass, mass * np.outer(units, units)]))
    assert condition_number(factor) == pytest.approx((1 + 1.9 / 2) / (1 - 1.9 / 2))


def test_shares_are_what_rounding_really_does() -> None:
    """Perturb the terms at random by one unit roundoff, solve in long double: no sample exceeds the share, the worst comes near."""
    assignment = assignment_of("arm_3r", "lagrange")
    state = generic_sample(assignment.mechanism, 1, 9)
    reference = reference_kernel_of(assignment).evaluate(state)
    terms = certify_terms(reference_kernel_of(assignment), state).high
    shares = worst_cases.rounding_shares(reference, terms)
    random = np.random.default_rng(2)
    mass, roundoff, signs = terms.mass[0], 2.0**-30, random.choice([-1.0, 1.0], (2000, 3))
    for name in ("velocity", "gravity"):
        moved = np.linalg.solve(mass, (signs * roundoff * getattr(terms, name)[0]).T)
        sizes = np.sqrt(np.einsum("in,ij,jn->n", moved, mass, moved)) / roundoff / reference.sensitivity[0]
        assert shares[name] / 3 < sizes.max() <= shares[name] * (1 + 1e-9)


# The whole.

ENGINE = """
import os
import numpy as np
from harness.engines.adapters.mujoco import MujocoEngine
from harness.engines.adapters.mujoco.model import MujocoModel

class Model(MujocoModel):
    def forward_dynamics(self, q, v, tau):
        answer = super().forward_dynamics(q, v, tau)
        {body}
        return answer

class Engine(MujocoEngine):
    def load(self, source, joints, gravity):
        return Model(super().load(source, joints, gravity).model, joints)

ENGINE = Engine()
"""
FAULTS = {
    "nan": "answer[np.abs(v) > 9.5] = np.nan",
    "wrong": "answer = np.where((v > 3) & (v < 4.5), answer * (1 + 1e-9), answer)",
    "abort": "(v != 0).any() and os.abort()",
}


@pytest.fixture
def library(tmp_path: Path) -> Library:
    engines = {name: ENGINE.format(body=body) for name, body in FAULTS.items()}
    root = make_library(tmp_path / "mine", ["bar_pendulum"], engines)
    return Library.at(root)


@pytest.fixture(scope="module")
def workers() -> Iterator[Workers]:
    with Workers(1) as pool:
        yield pool


def searched(library: Library, workers: Workers, subject: str, budget: int = 1600, **settings: Any) -> Any:
    chosen = SearchSettings(library=library, name="bar_pendulum", subjects=[subject], budget=budget, **settings)
    return completed(StateSearch(chosen), workers)


@pytest.mark.ci
def test_a_search_finds_explains_and_stores(library: Library, workers: Workers) -> None:
    settings = SearchSettings(library=library, name="bar_pendulum", subjects=["wrong/mjcf"], budget=1600, replay_options=["--library", "x"])
    study = StateSearch(settings)
    steps = list(run_study(study, workers))
    result = study.result()
    worst = result.cases[0]
    assert (result.status, worst.found.verdict, worst.expected, worst.as_expected) == (1, "disagrees", "agrees", False)
    # The shortest numbers between 3 and 4.5 are 4 and, near 3, those of two digits.
    assert 3 < worst.found.state["v"][0] < 4.5
    assert len(repr(worst.found.state["v"][0])) == 3
    assert worst.found.digits_lost == pytest.approx(math.log10(worst.found.backward_error or 0))
    assert worst.replay.startswith("harness check bar_pendulum --subject wrong/mjcf --library x --state ")
    assert worst.reproducer.startswith("import mujoco")
    assert load_found(library, "bar_pendulum") == [case.found for case in result.cases if case.found.verdict != "agrees"]
    assert result.states["wrong/mjcf"] <= 1600
    assert len(steps) == study.steps == 2 + len(hunts(1600))
    text = "\n".join(as_lines(result))
    assert worst.found.statement in text
    assert f"stored in {path_of(library, 'bar_pendulum')}" in text


@pytest.mark.ci
def test_an_engine_that_agrees_leaves_nothing_behind(library: Library, workers: Workers) -> None:
    result = searched(library, workers, "mujoco/mjcf")
    assert (result.status, result.not_stored, result.cases[0].found.verdict) == (0, "every state agrees", "agrees")
    assert not path_of(library, "bar_pendulum").exists()


@pytest.mark.ci
def test_an_answer_that_is_not_finite_is_worst(library: Library, workers: Workers) -> None:
    result = searched(library, workers, "nan/mjcf", keep=False)
    assert (result.status, result.cases[0].found.verdict, result.cases[0].found.backward_error) == (1, "error", None)
    assert abs(result.cases[0].found.state["v"][0]) > 9.5
    assert result.worst == {"nan/mjcf": math.inf}
    assert not path_of(library, "bar_pendulum").exists()


@pytest.mark.ci
def test_a_crash_names_its_state(library: Library, workers: Workers) -> None:
    result = searched(library, workers, "abort/mjcf", budget=12, keep=False)
    assert result.status == 3
    assert result.cases[0].found.verdict == "error"
    assert result.cases[0].found.state["v"] != [0.0]
    assert result.cases[0].reproducer.startswith("import mujoco")
    assert "SIGABRT" in result.cases[0].found.statement


@pytest.mark.ci
def test_a_library_that_cannot_be_written_is_told_and_searched(library: Library, workers: Workers) -> None:
    path_of(library, "bar_pendulum").parent.write_text("a file where the folder should be")
    result = searched(library, workers, "wrong/mjcf")
    assert result.status == 1
    assert "cannot be written" in result.not_stored
    assert str(result.place) in as_lines(result)[-1]


@pytest.mark.ci
def test_what_is_expected_does_not_fail(library: Library, workers: Workers) -> None:
    entry = 'system = "bar_pendulum"\nsubject = "wrong/mjcf"\nverdict = "disagrees"\nreason = "planted"\nlink = "here"\n'
    for most, status in ((1e12, 0), (100.0, 1)):
        library.expected_verdicts.write_text(f"[[expected]]\n{entry}backward_error = {most}\nmedian_backward_error = inf\nshare = 1.0\n")
        assert searched(library, workers, "wrong/mjcf", keep=False).status == status


@pytest.mark.ci
def test_an_unknown_name_is_refused(library: Library, workers: Workers) -> None:
    with pytest.raises(InvalidRequest, match="did you mean"):
        StateSearch(SearchSettings(library=library, name="bar_pendulun"))
    with pytest.raises(InvalidRequest):
        searched(library, workers, "nothing/mjcf")


def test_a_found_state_repeats(library: Library) -> None:
    """Its backward error is that of the state as stored, not of the one it was shrunk from."""
    assignment = assignment_of("arm_2r")
    judge = assignment.judge
    shrunk, error = shrink(judge, assignment.mechanism, evolve(assignment, 400, 20, 0).worst)
    again = States.at(**shrunk.as_json(0))
    assert judge(again).backward_error[0] == error == judge(replace(shrunk)).backward_error[0]
