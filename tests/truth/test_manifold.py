"""States under constraints: on the branch of the assembly, certified, and never made up."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import mpmath
import numpy as np
import pytest
from exact import mechanism_of
from loops import CRANK_ROCKER, a, coupler, crank, d, follower, four_bar, upright_disc

from harness.crosscheck.variation import Variation, states_of
from harness.lagrange.constraint import Constraint
from harness.lagrange.derivation import load_mechanism
from harness.lagrange.system import System
from harness.library import Library
from harness.programs.evaluation import values
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.program import right_hand_side, upper_triangle
from harness.programs.states import States
from harness.truth.manifold import closed, closes, enclosed, free_size, rank_condition
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import sample

ABOVE, BELOW = {coupler: 0.82, follower: 1.77}, {coupler: -0.82, follower: -1.77}


@pytest.fixture(scope="module")
def mechanism() -> Mechanism:
    return mechanism_of(four_bar())


def at(*angles: float, rate: float = 1.0) -> States:
    q = np.zeros((len(angles), 3))
    q[:, 0] = angles
    v = np.zeros_like(q)
    v[:, 0] = rate
    return States.at(q, v, np.zeros_like(q))


def by_circles(angle: float, sign: int) -> tuple[Any, Any]:
    """Coupler and follower of the crank rocker at 40 digits: two circles meet; ``sign`` says on which side of the diagonal."""
    with mpmath.workdps(40):
        lengths = [mpmath.mpf(value) for value, _ in CRANK_ROCKER.values()]
        tip = lengths[0] * mpmath.expj(mpmath.mpf(angle))
        diagonal = lengths[3] - tip
        size = abs(diagonal)
        along = (lengths[1] ** 2 - lengths[2] ** 2 + size**2) / (2 * size)
        height = mpmath.sqrt(lengths[1] ** 2 - along**2)
        bar = (along + sign * 1j * height) * diagonal / size
        return mpmath.arg(bar), mpmath.arg(tip + bar - lengths[3])


ANGLES = [0.0, 0.3, -1.2, math.pi / 2, 2.5, math.pi, -math.pi, 3.7, -9.0, 1e3, 1e15]


@pytest.mark.parametrize("assembly, sign", [(ABOVE, 1), (BELOW, -1)], ids=["above", "below"])
def test_the_branch_is_that_of_the_assembly_to_the_last_bit(assembly: dict[Any, float], sign: int) -> None:
    mechanism = mechanism_of(four_bar(assembly=assembly))
    states = closed(mechanism, at(*ANGLES))
    assert closes(mechanism, states).all()
    for row, angle in zip(states.q, ANGLES, strict=True):
        for found, expected in zip(row[1:], by_circles(angle, sign), strict=True):
            turns = mpmath.nint((found - expected) / (2 * mpmath.pi))
            with mpmath.workdps(40):
                assert found == float(expected + turns * 2 * mpmath.pi)
        assert row[0] == angle


@pytest.mark.parametrize("size", [1e3, 1e8, 1e15])
def test_large_angles_close_where_angles_are_added(size: float) -> None:
    mechanism = mechanism_of(four_bar(measured_from={coupler: crank}))
    states = closed(mechanism, at(size, -size))
    assert closes(mechanism, states).all() and ReferenceKernel(mechanism).evaluate(states).certified.all()


def test_rates_are_those_of_the_closed_loop(mechanism: Mechanism) -> None:
    step = 1e-6
    before, here, after = closed(mechanism, at(0.7 - step, 0.7, 0.7 + step)).q
    np.testing.assert_allclose(closed(mechanism, at(0.7)).v[0], (after - before) / (2 * step), rtol=1e-8)
    assert here[0] == 0.7


def test_what_is_not_determined_stays_as_it_is(mechanism: Mechanism) -> None:
    drawn = Variation(mechanism, np.random.default_rng(1)).fresh(100)
    states = states_of(mechanism, drawn)
    np.testing.assert_array_equal(states.q[:, 0], drawn[:, 0])
    np.testing.assert_array_equal(states.v[:, 0], drawn[:, 3])
    np.testing.assert_array_equal(states.tau, drawn[:, 6:])
    assert closes(mechanism, states).all()
    # What a search keeps as a row is found again from it.
    again = closed(mechanism, states)
    np.testing.assert_array_equal(again.q, states.q)
    np.testing.assert_array_equal(again.v, states.v)


def test_samples_are_closed(mechanism: Mechanism) -> None:
    states = sample(mechanism, 64, seed=3)
    assert closes(mechanism, states).all() and ReferenceKernel(mechanism).evaluate(states).certified.all()
    assert (np.ptp(states.q, axis=0) > 0.5).all()


# A crank that is too long cannot turn: beyond some angle the other bars do not reach it.
LONG = four_bar(parameters={**CRANK_ROCKER, a: (0.9, "m"), d: (1.0, "m")}, assembly={crank: 0.6, coupler: 1.0, follower: 1.9})


def test_a_state_that_the_branch_does_not_reach_is_undecided_and_not_made_up() -> None:
    mechanism = mechanism_of(LONG)
    states = closed(mechanism, at(0.6, 2.6))
    assert closes(mechanism, states).tolist() == [True, False]
    reference = ReferenceKernel(mechanism).evaluate(states)
    assert reference.certified.tolist() == [True, False]
    assert mechanism.constraints is not None
    np.testing.assert_array_equal(states.q[1, 1:], mechanism.constraints.assembly[1:])


def test_a_wrong_assembly_closes_nothing() -> None:
    mechanism = mechanism_of(four_bar(assembly={coupler: math.pi, follower: 0.0}, parameters={**CRANK_ROCKER, d: (9.0, "m")}))
    assert not closes(mechanism, closed(mechanism, at(0.1, 2.0))).any()


@pytest.mark.parametrize("moved", [1e-3, 1e-9, 1e-14])
def test_a_state_that_is_off_by_more_than_rounding_does_not_close(mechanism: Mechanism, moved: float) -> None:
    states = closed(mechanism, at(0.7, 2.0))
    for name in ("q", "v"):
        opened = getattr(states, name).copy()
        opened[:, 1] += moved
        assert not closes(mechanism, replace(states, **{name: opened})).any()


def test_a_redundant_row_that_contradicts_the_others_closes_nothing() -> None:
    gap = four_bar().constraints["closure"].rows
    sound, wrong = (mechanism_of(four_bar(more=(gap[0] + gap[1] + more * a,))) for more in (0, 1))
    assert closes(sound, closed(sound, at(0.7))).all()
    assert enclosed(wrong, *(part[0] for part in (closed(sound, at(0.7)).q, at(0.7).v))) is None
    assert not closes(wrong, closed(wrong, at(0.7))).any()


def test_two_configurations_that_meet_are_not_enclosed() -> None:
    """At its dead centre a slider on a crank of its own length could leave on either side."""
    system = four_bar(parameters={**CRANK_ROCKER, a: (0.5, "m"), d: (0.9, "m")})
    mechanism = mechanism_of(system)
    # Coupler and follower in line: crank and ground make a triangle with their sum.
    angle = math.acos((0.5**2 + 0.9**2 - 1.4**2) / (2 * 0.5 * 0.9))
    direction = math.atan2(-0.5 * math.sin(angle), 0.9 - 0.5 * math.cos(angle))
    q = np.array([angle, direction, direction + math.pi])
    assert enclosed(mechanism, q, np.zeros(3)) is None


def test_a_ball_holds_the_configuration_and_is_small(mechanism: Mechanism) -> None:
    state = closed(mechanism, at(0.7))
    found = enclosed(mechanism, state.q[0] + 1e-9, state.v[0])
    assert found is not None
    for ball, value in zip([*found.positions, *found.rates], [*state.q[0, 1:], *state.v[0, 1:]], strict=True):
        assert abs(float(ball) - value) <= 1.01e-8 and float(ball.rad()) < 1e-28


@pytest.mark.parametrize("rate", [0.0, 5e-324, 1e-310, 1e-160, 1e8])
def test_rates_of_any_size_close(mechanism: Mechanism, rate: float) -> None:
    assert closes(mechanism, closed(mechanism, at(0.0, 0.7, rate=rate))).all()


def test_rolling_determines_rates_alone() -> None:
    mechanism = mechanism_of(upright_disc())
    states = sample(mechanism, 32, seed=1)
    x_rate, y_rate, _, spin = states.v.T
    np.testing.assert_allclose(x_rate, 0.5 * spin * np.cos(states.q[:, 2]), rtol=1e-15, atol=1e-15)
    np.testing.assert_allclose(y_rate, 0.5 * spin * np.sin(states.q[:, 2]), rtol=1e-15, atol=1e-15)
    assert closes(mechanism, states).all()
    slipping = replace(states, v=states.v + np.array([1e-6, 0.0, 0.0, 0.0]))
    assert not closes(mechanism, slipping).any()


def test_a_tree_is_left_alone() -> None:
    mechanism = mechanism_of(upright_disc(constraints={}))
    states = States.at(*np.random.default_rng(0).normal(size=(3, 4, 4)))
    assert closed(mechanism, states) is states and closes(mechanism, states).all()


def test_a_constraint_that_determines_nothing_regularly_closes_nothing() -> None:
    rows = four_bar().constraints["closure"].rows
    # The second row is the first: two rows, and one of them determines nothing.
    closure = Constraint(rows=(rows[0], 2 * rows[0]), determines=(coupler, follower))
    mechanism = mechanism_of(four_bar(constraints={"closure": closure}))
    states = closed(mechanism, at(0.2))
    assert not closes(mechanism, states).any() and not ReferenceKernel(mechanism).evaluate(states).certified.any()


@pytest.mark.ci
def test_lengths_that_cancel_in_a_row_do_not_open_it() -> None:
    """Near zero angles one unit roundoff of them is less than what float64 rounds in the lengths."""
    mechanism = load_mechanism(Library.built_in(), "bricard")
    states = sample(mechanism, 400, seed=1)
    states.q[:100, 0] *= 1e-6
    states.q[100, 0] = 1e-160
    states = closed(mechanism, states)
    assert closes(mechanism, states).all()


@pytest.mark.parametrize("system", [four_bar(), upright_disc()], ids=["four bar", "upright disc"])
def test_instability_counts_the_rank_of_the_rows_and_the_free_tree(system: System) -> None:
    mechanism = mechanism_of(system)
    constraints, states = mechanism.constraints, sample(mechanism, 24, seed=2)
    assert constraints is not None
    inputs, nv = mechanism.inputs(states), mechanism.nv
    reference = ReferenceKernel(mechanism).evaluate(states)
    tree = values(constraints.tree, inputs)
    jacobian = values(constraints.program, inputs)["jacobian"].reshape(len(constraints.rows), nv, -1)
    force = np.array(right_hand_side({name: list(rows) for name, rows in tree.items()}, list(states.tau.T)))
    conditions, sizes = [], []
    for index in range(len(states)):
        mass = np.empty((nv, nv))
        for entry, (i, j) in zip(tree["mass"][:, index], upper_triangle(nv), strict=True):
            mass[i, j] = mass[j, i] = entry
        compliance = jacobian[:, :, index] @ np.linalg.solve(mass, jacobian[:, :, index].T)
        scale = 1 / np.sqrt(np.diag(compliance))
        conditions.append(np.linalg.cond(compliance * scale * scale[:, None]))
        sizes.append(np.sqrt(force[:, index] @ np.linalg.solve(mass, force[:, index])))
    np.testing.assert_allclose(rank_condition(constraints, inputs, reference.norm_factor), conditions, rtol=1e-9)
    np.testing.assert_allclose(free_size(constraints, inputs, states.tau, reference.norm_factor), sizes, rtol=1e-9, atol=1e-12)
    plain = ReferenceKernel(replace(mechanism, constraints=None)).evaluate(states)
    expected = (plain.instability + 16 * nv * plain.condition * np.array(sizes)) * np.array(conditions)
    np.testing.assert_allclose(reference.instability, expected, rtol=1e-8)


def test_no_states_have_no_conditions() -> None:
    mechanism = mechanism_of(four_bar())
    assert len(ReferenceKernel(mechanism).evaluate(sample(mechanism, 1, seed=0)[:0])) == 0
