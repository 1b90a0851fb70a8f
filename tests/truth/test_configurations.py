"""Configurations by the compiled loops, against balls: bounds that hold, nothing taken that is not proved, and the same states."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import flint
import mpmath
import numpy as np
import pytest
import sympy as sp
from catalogue import BUILT_IN, is_tied
from exact import mechanism_of
from loops import CRANK_ROCKER, a, coupler, d, follower, four_bar

from harness.arrays import Array
from harness.lagrange.constraint import Constraint
from harness.lagrange.derivation import load_mechanism
from harness.programs.loops.double_double import sine_and_cosine_in_float64
from harness.programs.loops.interpreter import compiled
from harness.programs.loops.language import Writer
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.storage import Kept
from harness.truth import manifold
from harness.truth.enclosure import Configurations, Enclosed, Encloser
from harness.truth.manifold import Branch, closed, closes
from harness.truth.sampling import sample

TIED = [name for name in BUILT_IN.system_names() if is_tied(name)]
BITS = 400


def loops_of(mechanism: Mechanism) -> Configurations:
    found = Configurations.of(mechanism)
    assert found is not None
    return found


def within(mechanism: Mechanism, q: Array, v: Array, found: Enclosed) -> list[bool]:
    """Whether the exact positions and rates of each state are within the loop's bounds; True where nothing is proved."""
    encloser, results = Encloser(mechanism), []
    with flint.ctx.workprec(BITS):
        for index in range(len(q)):
            exact = encloser.enclose(q[index].tolist(), v[index].tolist())
            assert exact is not None
            numbers = zip(
                (*exact.positions, *exact.rates), *(part[index].tolist() for part in (found.high, found.low, found.bound)), strict=True
            )
            is_out = any(abs(ball - high - flint.arb(low)) > flint.arb(bound) for ball, high, low, bound in numbers)
            results.append(not found.proved[index] or not is_out)
    return results


def on_the_branch(mechanism: Mechanism, count: int) -> tuple[Array, Array]:
    """q and v, (n, nv), whose determined positions are those of float64, and rates are not closed."""
    states = sample(mechanism, count, seed=5)
    q = Branch(mechanism, loops_of(mechanism)).at(states.q)
    return q, np.random.default_rng(1).normal(size=states.v.shape)


@pytest.mark.parametrize("name", TIED)
def test_exact_configurations_are_within_their_bounds(name: str) -> None:
    mechanism = load_mechanism(BUILT_IN, name)
    q, v = on_the_branch(mechanism, 13)
    loops, off = loops_of(mechanism), q.copy()
    found = loops.enclose(q, v)
    assert found.rounded.all() and all(within(mechanism, q, v, found))
    # From positions that are not as good the same configuration is proved, if less sharply.
    off[:, loops.positions] += 1e-11
    blunt = loops.enclose(off, v)
    assert blunt.proved.all() and all(within(mechanism, off, v, blunt))
    assert not loops.positions or (blunt.bound > found.bound).any()


def test_a_parameter_that_is_off_by_an_ulp_is_seen() -> None:
    """The bounds are so sharp that they hold for no other mechanism."""
    mechanism = load_mechanism(BUILT_IN, "four_bar")
    q, v = on_the_branch(mechanism, 4)
    first, *others = mechanism.parameters
    moved = replace(mechanism, parameters=((first[0], math.nextafter(first[1], math.inf), first[2]), *others))
    assert not any(within(mechanism, q, v, loops_of(moved).enclose(q, v)))


@pytest.mark.parametrize("name", TIED)
def test_balls_find_the_same_states(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """To the last bit, from the branch as numpy follows it."""
    mechanism = load_mechanism(BUILT_IN, name)
    states = sample(mechanism, 9, seed=6)
    monkeypatch.setattr(manifold, "_CLOSURES", Kept(4))
    monkeypatch.setattr(Configurations, "of", classmethod(lambda cls, mechanism: None))
    again = closed(mechanism, states)
    np.testing.assert_array_equal(again.q, states.q)
    np.testing.assert_array_equal(again.v, states.v)


@pytest.mark.parametrize("name", ["four_bar", "bricard"])
def test_what_is_not_proved_goes_to_balls(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    mechanism = load_mechanism(BUILT_IN, name)
    states = sample(mechanism, 9, seed=6)
    asked = []

    def unproved(self: Configurations, q: Array, v: Array) -> Enclosed:
        found = enclose(self, q, v)
        # What is wrong must not be taken, however sharp it is.
        wrong = replace(found, high=found.high + 1.0, proved=np.arange(len(q)) % 2 == 0)
        return replace(wrong, high=np.where(wrong.proved[:, None], found.high, wrong.high))

    def noted(self: Encloser, q: Any, v: Any) -> Any:
        asked.append(list(q))
        return in_balls(self, q, v)

    enclose, in_balls = Configurations.enclose, Encloser.enclose
    monkeypatch.setattr(Configurations, "enclose", unproved)
    monkeypatch.setattr(Encloser, "enclose", noted)
    again = closed(mechanism, states)
    np.testing.assert_array_equal(again.q, states.q)
    np.testing.assert_array_equal(again.v, states.v)
    assert len(asked) == 4


@pytest.mark.parametrize("moved", [0.7, -1.5, math.nan])
def test_far_from_a_configuration_nothing_is_taken(moved: float) -> None:
    mechanism = mechanism_of(four_bar())
    loops, states = loops_of(mechanism), sample(mechanism, 5, seed=2)
    q = states.q.copy()
    q[1:4, 1] += moved
    found = loops.enclose(q, states.v)
    # A neighbour in the lanes of the processor changes nothing.
    assert found.rounded.tolist() == [True, False, False, False, True]


def test_two_configurations_that_meet_are_not_proved() -> None:
    """Coupler and follower in line, from which the four-bar could go on with either of them above."""
    mechanism = mechanism_of(four_bar(parameters={**CRANK_ROCKER, a: (0.5, "m"), d: (0.9, "m")}))
    angle = math.acos((0.5**2 + 0.9**2 - 1.4**2) / (2 * 0.5 * 0.9))
    direction = math.atan2(-0.5 * math.sin(angle), 0.9 - 0.5 * math.cos(angle))
    q = np.array([[angle, direction, direction + math.pi]])
    assert not loops_of(mechanism).enclose(q, np.zeros((1, 3))).proved.any()


def test_a_redundant_row_that_contradicts_the_others_is_not_proved() -> None:
    gap = four_bar().constraints["closure"].rows
    sound, wrong = (mechanism_of(four_bar(more=(gap[0] + gap[1] + more * a,))) for more in (0, sp.Rational(1, 10**20)))
    states = sample(sound, 4, seed=2)
    assert loops_of(sound).enclose(states.q, states.v).proved.all()
    assert not loops_of(wrong).enclose(states.q, states.v).proved.any()


def test_rows_that_do_not_determine_a_rate_prove_nothing() -> None:
    rows = four_bar().constraints["closure"].rows
    closure = Constraint(rows=(rows[0], 2 * rows[0]), determines=(coupler, follower))
    mechanism = mechanism_of(four_bar(constraints={"closure": closure}))
    states = sample(mechanism_of(four_bar()), 4, seed=2)
    assert not loops_of(mechanism).enclose(states.q, states.v).rounded.any()


def test_rows_with_a_function_that_has_no_code_are_closed_in_balls() -> None:
    gap = four_bar().constraints["closure"].rows
    mechanism = mechanism_of(four_bar(more=(sp.exp(gap[0]) - 1,)))
    plain = sample(mechanism_of(four_bar()), 4, seed=2)
    assert Configurations.of(mechanism) is None
    states = closed(mechanism, plain)
    assert closes(mechanism, states).all()
    np.testing.assert_array_equal(states.q, plain.q)


@pytest.mark.ci
def test_a_state_is_the_same_alone_and_among_others() -> None:
    mechanism = load_mechanism(BUILT_IN, "bricard")
    states = sample(mechanism, 7, seed=8)
    # One that no branch reaches stands between them.
    q = states.q.copy()
    q[3, 0] = math.nan
    together = closed(mechanism, States(q, states.v, states.tau, states.time))
    for index in (0, 1, 2, 4, 5, 6):
        alone = closed(mechanism, states[[index]])
        np.testing.assert_array_equal(alone.q[0], together.q[index])
        np.testing.assert_array_equal(alone.v[0], together.v[index])


def test_a_step_that_is_corrected_by_much_loses_the_branch() -> None:
    mechanism = mechanism_of(four_bar())
    loops = loops_of(mechanism)
    assert mechanism.constraints is not None
    begun = sample(mechanism, 1, seed=2).q[0]
    target = begun[0] + np.array([[0.0], [0.01], [0.5], [1.5], [3.0]])
    far, near = (loops.follow(begun, target, 1, 6, much, 1e-3)[0] for much in (1e9, 0.5))
    assert np.isfinite(far).all()
    assert np.isfinite(near).all(axis=1).tolist() == [True, True, True, False, False]
    np.testing.assert_array_equal(near[:3], far[:3])
    # As numpy follows it.
    plain, _ = Branch(mechanism, None)._followed(begun, target, 1, 6, 0.5, 1e-3)
    np.testing.assert_allclose(near, plain, rtol=1e-13)


@pytest.mark.parametrize(
    ("high", "low", "bound", "is_rounded"),
    [
        (1.0, 0.0, 2.0**-56, True),
        (1.0, -(2.0**-56), 2.0**-56, True),
        # Towards zero the gap is half as wide.
        (1.0, -(2.0**-54), 0.0, False),
        (1.0, 0.0, 2.0**-54, False),
        (3.0, 2.0**-52, 0.0, False),
        (3.0, 2.0**-53, 0.0, True),
        (0.0, 0.0, 0.0, True),
        (0.0, 0.0, 1e-300, False),
        (1e-310, 0.0, 0.0, True),
        (1e-310, 0.0, 1e-320, False),
        (1.0, 0.0, math.inf, False),
        (math.nan, 0.0, 0.0, False),
        (1.0, math.nan, 0.0, False),
    ],
)
def test_a_number_is_rounded_where_no_other_float64_is_as_near(high: float, low: float, bound: float, is_rounded: bool) -> None:
    numbers = (np.array([[part, 1.0]]) for part in (high, low, bound))
    one = Enclosed(*(np.where([[True, False]], part, 0.0) for part in numbers), np.array([True]))
    assert one.rounded.tolist() == [is_rounded]
    assert not replace(one, proved=np.array([False])).rounded.any()


def test_sines_in_float64_are_right_to_some_ulps() -> None:
    angles = np.concatenate([np.linspace(-7.0, 7.0, 1001), [0.0, 1e-300, -1e-9, 1e3, -1e6]])

    def write(code: Writer) -> None:
        given, found = code.array("given"), code.array("found", 2)
        for i in code.range(code.argument("n")):
            found[i, 0], found[i, 1] = sine_and_cosine_in_float64(code, given[i])

    lanes = np.repeat(angles[:, None], 4, axis=1)
    found = np.empty((len(angles), 2, 4))
    compiled(write, {"n": "integer", "given": "vectors", "found": "vectors"})(len(angles), lanes, found)
    for angle, (sines, cosines) in zip(angles.tolist(), found, strict=True):
        assert abs(sines[0] - float(mpmath.sin(angle))) <= 2.0**-51 and abs(cosines[2] - float(mpmath.cos(angle))) <= 2.0**-51
