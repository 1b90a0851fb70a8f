"""Samples and strategies of states: reproducible, within their ranges, and full of the values that matter."""

from __future__ import annotations

import dataclasses
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, find, given, settings
from hypothesis import strategies as st
from hypothesis.errors import NoSuchExample

from harness.lagrange.derivation import load_mechanism
from harness.library import Library
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.truth import sampling
from harness.truth.reference import ReferenceKernel, energy_norm
from harness.truth.sampling import HUGE_ANGLES, TINY, Kind, generic_sample, kinds, sample, sample_in_blocks, sine_and_cosine, strategy

FIELDS = ("q", "v", "tau", "time")


@pytest.fixture(scope="module")
def arm() -> Mechanism:
    return load_mechanism(Library.built_in(), "arm_2r")


@pytest.fixture(scope="module")
def cart() -> Mechanism:
    return load_mechanism(Library.built_in(), "cart_pendulum")


def within(values: Any, bounds: tuple[float, float]) -> bool:
    return bool(np.all((bounds[0] <= values) & (values <= bounds[1])))


@pytest.mark.parametrize("count", [0, 1, 2, 3, 64, 100, 1000])
def test_samples_have_the_count_asked_for(cart: Mechanism, count: int) -> None:
    states = sample(cart, count, 1)
    assert len(states) == count
    assert [getattr(states, name).shape for name in FIELDS] == [(count, 2), (count, 2), (count, 2), (count,)]
    assert all(getattr(states, name).dtype == np.float64 for name in FIELDS)


def test_a_seed_gives_the_same_states_and_another_seed_others(cart: Mechanism) -> None:
    first, again, other = sample(cart, 33, 7), sample(cart, 33, 7), sample(cart, 33, 8)
    for name in ("q", "v", "tau"):
        assert np.array_equal(getattr(first, name), getattr(again, name))
        drawn = getattr(first, name)[getattr(first, name).any(axis=1)]
        assert len(drawn) > 20 and not np.isin(drawn, getattr(other, name)).any()


@pytest.mark.parametrize("count", [10, 64, 2047, 2048, 2049, 32_776, 40_000])
def test_a_larger_sample_begins_with_the_smaller_one(cart: Mechanism, count: int) -> None:
    """Both where all blocks are kept and where a long sample is drawn block by block."""
    blocks = sample_in_blocks(cart, 70_000, 3)
    larger = States.concatenate([next(blocks) for _ in range(-(-count // sampling.BLOCK))])[:count]
    smaller = sample(cart, count, 3)
    assert len(smaller) == count
    for name in FIELDS:
        assert getattr(larger, name).tobytes() == getattr(smaller, name).tobytes()


def test_every_kind_of_state_is_in_every_sample(built_in_mechanism: Mechanism) -> None:
    """A quarter at rest, a quarter without applied force, half of either both, and a quarter under forces of a real size."""
    mechanism, count = built_in_mechanism, 64
    states, kind = sample(mechanism, count, 5), kinds(count)
    slowest = np.array([min(max(0.0, low), high) for low, high in mechanism.rate_ranges])
    at_rest, unloaded = (states.v == slowest).all(axis=1), ~states.tau.any(axis=1)
    assert at_rest.sum() == unloaded.sum() == count // 4
    assert (at_rest & unloaded).sum() == count // 8
    assert np.array_equal(at_rest, np.isin(kind, (Kind.STATIC, Kind.RELEASED)))
    assert np.array_equal(unloaded, np.isin(kind, (Kind.FREE, Kind.RELEASED)))
    assert np.array_equal(states[kind == Kind.GENERIC].q, generic_sample(mechanism, count // 2, 5).q)
    for of_kind, loads in ((Kind.STATIC, mechanism.static_loads), (Kind.LOADED, mechanism.moving_loads)):
        assert len(loads) == mechanism.nv and np.isfinite(loads).all()
        felt = np.array(loads) > 0
        assert (np.abs(states.tau[kind == of_kind]) <= np.array(loads))[:, felt].all()


def test_forces_that_hold_a_mechanism_are_those_of_its_equations() -> None:
    """A pendulum of 2 kg, 0.75 m from its pin, bears up to 2 * 9.81 * 0.75 N m at rest, and its damper besides."""
    mechanism = load_mechanism(Library.built_in(), "bar_pendulum")
    weight, damping = 2 * 9.81 * 0.75, 0.3 * 10
    assert 0.5 * weight < mechanism.static_loads[0] <= weight
    assert 0.5 * weight < mechanism.moving_loads[0] <= weight + damping


def test_states_that_are_not_generic_show_an_error_of_gravity_at_the_first_joint_of_a_chain() -> None:
    """Gravity there is wrong by a relative 1e-9; generic torques give the joint a hundred times the acceleration that it causes."""
    mechanism = load_mechanism(Library.built_in(), "chain_6")

    def shown(states: States) -> float:
        """The largest error that the mistake causes [data roundoffs]."""
        reference = ReferenceKernel(mechanism).evaluate(states)
        terms = mechanism.float64().terms(states.q, states.v, states.tau)
        mistake = np.zeros_like(states.tau)
        mistake[:, 0] = 1e-9 * terms["gravity"][:, 0]
        moved = np.linalg.solve(terms["mass"], mistake[:, :, None])[:, :, 0]
        return float((energy_norm(reference.norm_factor, moved) / reference.roundoff_with_share).max())

    assert shown(sample(mechanism, 64, 0)) > 3 * shown(generic_sample(mechanism, 64, 0))


def test_sines_of_turns_are_those_of_numpy_to_an_ulp() -> None:
    turns = np.concatenate([np.arange(9) / 8, np.random.default_rng(1).random(2000)])
    for found, expected in zip(sine_and_cosine(turns), (np.sin(2 * np.pi * turns), np.cos(2 * np.pi * turns)), strict=True):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-15)
    assert [part.tolist() for part in sine_and_cosine(np.array([0.0, 0.25, 0.5, 0.75]))] == [[0, 1, 0, -1], [1, 0, -1, 0]]


@given(st.integers(0, 2**32 - 1), st.integers(1, 70))
@settings(max_examples=30)
def test_samples_stay_in_their_ranges(seed: int, count: int) -> None:
    mechanism = load_mechanism(Library.built_in(), "cart_pendulum")
    check_ranges(sample(mechanism, count, seed), mechanism)


def check_ranges(states: States, mechanism: Mechanism) -> None:
    ranges, positions = without_rotations(states, mechanism)
    following = determined(mechanism)
    for column, bounds in enumerate(ranges):
        assert column in following or within(positions[:, column], bounds or (-math.pi, math.pi))
    for column, bounds in enumerate(mechanism.rate_ranges):
        assert mechanism.nv + column in following or within(states.v[:, column], bounds)
    for column, bounds in enumerate(mechanism.force_ranges):
        assert within(states.tau[:, column], bounds)


def without_rotations(states: States, mechanism: Mechanism) -> tuple[list[tuple[float, float] | None], Any]:
    """Ranges and columns of the positions that are not quaternions, whose length is checked to be 1."""
    ranges, positions = list(mechanism.position_ranges), states.q
    for place in reversed(mechanism.attitudes):
        del ranges[place : place + 3]
    for order, place in reversed(list(enumerate(mechanism.attitudes))):
        columns = slice(place + order, place + order + 4)
        np.testing.assert_allclose(np.linalg.norm(positions[:, columns], axis=1), 1.0, rtol=1e-15)
        positions = np.delete(positions, columns, axis=1)
    return ranges, positions


def determined(mechanism: Mechanism) -> set[int]:
    """The columns of positions and rates that follow from the others by constraints."""
    constraints = mechanism.constraints
    return set() if constraints is None else {*constraints.positions, *(mechanism.nv + place for place in constraints.rates)}


def test_samples_of_every_system_fill_their_ranges(built_in_mechanism: Mechanism) -> None:
    """256 points of a Sobol sequence put one into each of 256 equal slices of every single axis (Owen 1998)."""
    states = generic_sample(built_in_mechanism, 256, 11)
    check_ranges(states, built_in_mechanism)
    ranges, positions = without_rotations(states, built_in_mechanism)
    bounds = [bounds or (-math.pi, math.pi) for bounds in ranges]
    bounds += [*built_in_mechanism.rate_ranges, *built_in_mechanism.force_ranges]
    for column, (values, (low, high)) in enumerate(zip(np.hstack([positions, states.v, states.tau]).T, bounds, strict=True)):
        if column in determined(built_in_mechanism):
            continue
        slices = np.histogram(values, bins=16, range=(low, high))[0]
        assert slices.min() >= 15
        assert slices.max() <= 17


@given(st.data())
@settings(max_examples=25)
def test_draws_stay_in_their_ranges(built_in_mechanism: Mechanism, data: st.DataObject) -> None:
    mechanism = built_in_mechanism
    states = data.draw(strategy(mechanism))
    assert len(states) == 1
    ranges, positions = without_rotations(states, mechanism)
    for value, bounds in zip(positions[0], ranges, strict=True):
        assert within(value, bounds or (-max(HUGE_ANGLES), max(HUGE_ANGLES)))
    for value, bounds in zip(states.v[0], mechanism.rate_ranges, strict=True):
        assert within(value, bounds)
    for force, bounds in zip(states.tau[0], mechanism.force_ranges, strict=True):
        assert within(force, bounds)
    assert states.time.tolist() == [0.0]


SEARCH = settings(max_examples=3000, database=None, derandomize=True, phases=[Phase.generate, Phase.shrink])

FEW = settings(SEARCH, max_examples=500)
SPECIAL = {
    "rest at zero": lambda s: not s.q.any() and not s.v.any() and not s.tau.any(),
    "quarter turn": lambda s: s.q[0, 0] == math.pi / 2,
    "half turn back": lambda s: s.q[0, 1] == -math.pi,
    "two turns": lambda s: s.q[0, 0] == 4 * math.pi,
    "huge angle": lambda s: abs(s.q[0, 0]) == 1e15,
    "subnormal angle": lambda s: abs(s.q[0, 1]) == 5e-324,
    "ordinary angle": lambda s: 0.1 < abs(s.q[0, 0] % (math.pi / 2) - math.pi / 4) < 0.7 and abs(s.q[0, 0]) < 4,
    "subnormal rate": lambda s: abs(s.v[0, 0]) == 5e-324,
    "highest rate": lambda s: s.v[0, 1] == 10.0,
    "lowest rate": lambda s: s.v[0, 1] == -10.0,
    "tiny force": lambda s: abs(s.tau[0, 1]) == 1e-160,
}


@pytest.fixture(scope="module")
def drawn(arm: Mechanism) -> list[States]:
    """What a search sees that finds nothing."""
    states: list[States] = []
    with pytest.raises(NoSuchExample):
        find(strategy(arm), lambda state: bool(states.append(state)), settings=FEW)  # type: ignore[func-returns-value]
    return states


@pytest.mark.parametrize("name", SPECIAL)
def test_special_values_are_drawn(drawn: list[States], name: str) -> None:
    assert any(map(SPECIAL[name], drawn))


@pytest.mark.parametrize("end", [0, 1])
def test_both_ends_of_a_range_are_drawn(cart: Mechanism, end: int) -> None:
    bound = cart.position_ranges[0][end]
    assert find(strategy(cart), lambda s: s.q[0, 0] == bound, settings=SEARCH).q[0, 0] == bound


@pytest.mark.ci
def test_no_huge_value_is_drawn_for_a_bounded_coordinate(cart: Mechanism) -> None:
    def is_huge(state: States) -> bool:
        return bool(abs(state.q[0, 0]) > 0.1 or np.abs(state.v).max() > 10)

    with pytest.raises(NoSuchExample):
        find(strategy(cart), is_huge, settings=FEW)
    # As many draws find what no bound forbids.
    for unbounded in ({"position_ranges": (None, None)}, {"rate_ranges": ((-11.0, 11.0),) * 2}):
        find(strategy(dataclasses.replace(cart, **unbounded)), is_huge, settings=FEW)


def test_draws_shrink_to_zero(arm: Mechanism, cart: Mechanism) -> None:
    for mechanism in (arm, cart):
        simplest = find(strategy(mechanism), lambda s: True, settings=SEARCH)
        assert not (simplest.q.any() or simplest.v.any() or simplest.tau.any())


def test_what_does_not_matter_shrinks_away(arm: Mechanism) -> None:
    """Only the second rate is to blame: it becomes a round number and everything else becomes zero."""
    found = find(strategy(arm), lambda s: s.v[0, 1] > 2.5, settings=SEARCH)
    assert not (found.q.any() or found.tau.any() or found.v[0, 0])
    assert found.v[0, 1] in (3.0, 10.0)


@pytest.mark.parametrize("bounds", [(0.5, 1.5), (-3.0, -2.0), (0.0, 1.0), (-1e-9, 1e-9)])
def test_ranges_that_hold_no_special_value_waste_no_draws(bounds: tuple[float, float]) -> None:
    """Hypothesis stops a test that discards most draws; many lengths that never come near zero must not bring it there."""
    valid = load_mechanism(Library.built_in(), "arm_2r")
    many = 9
    mechanism = dataclasses.replace(
        valid, coordinates=("q",) * many, joints=("j",) * many, position_ranges=(bounds,) * many, rate_ranges=(bounds,) * many
    )

    @settings(max_examples=60, database=None, suppress_health_check=[HealthCheck.too_slow])
    @given(strategy(mechanism))
    def draw(states: States) -> None:
        assert within(states.q, bounds)
        assert within(states.v, bounds)

    draw()


def test_one_state_may_be_given_flat() -> None:
    states = States.at([0.1, 0.2], [0, 1], [2, 3])
    assert [getattr(states, name).tolist() for name in FIELDS] == [[[0.1, 0.2]], [[0.0, 1.0]], [[2.0, 3.0]], [0.0]]
    assert States.at([0.1], [0], [2], 1.5).time.tolist() == [1.5]


def test_parts_are_selected_joined_and_printed_exactly() -> None:
    states = States.at(np.arange(6.0).reshape(3, 2), np.ones((3, 2)) / 3, np.zeros((3, 2)), [1.0, 2.0, 3.0])
    again = States.concatenate([states[:1], states[1:]])
    assert all(np.array_equal(getattr(again, name), getattr(states, name)) for name in FIELDS)
    assert states[np.array([2, 0])].time.tolist() == [3.0, 1.0]
    assert states.as_json(1) == {"q": [2.0, 3.0], "v": [1 / 3, 1 / 3], "tau": [0.0, 0.0], "time": [2.0]}


def test_tiny_values_reach_the_smallest_number() -> None:
    assert min(TINY) == math.nextafter(0.0, 1.0)


def test_kept_points_are_the_same_to_the_last_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from scipy.stats import qmc

    monkeypatch.setenv("HARNESS_CACHE", str(tmp_path))
    expected = qmc.Sobol(5, rng=np.random.default_rng(3)).random_base2(6)
    made = sampling.sobol_points(5, 6, seed=3)
    (entry,) = (tmp_path / "sobol").iterdir()
    monkeypatch.setattr(qmc, "Sobol", None)
    for points in (made, sampling.sobol_points(5, 6, seed=3)):
        assert points.tobytes() == expected.tobytes()
    entry.write_text(entry.read_text()[:-4] + "AAAA")
    with pytest.raises(TypeError, match="not callable"):
        sampling.sobol_points(5, 6, seed=3)


@pytest.mark.parametrize("count", [1, 100, 500])
def test_points_that_are_kept_are_all_that_a_sample_takes(count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mechanism = load_mechanism(Library.built_in(), "cart_pendulum")
    monkeypatch.setenv("HARNESS_CACHE", str(tmp_path))
    sampling.keep_points(mechanism, count, 3)
    monkeypatch.setattr(sampling, "_sobol", None)
    assert len(sampling.sample(mechanism, count, 3)) == count


@pytest.mark.ci
def test_a_kept_sample_needs_no_scipy(tmp_path: Path) -> None:
    code = (
        "import sys; from harness.truth.sampling import sample; from harness.lagrange.derivation import load_mechanism\n"
        "from harness.library import Library; sample(load_mechanism(Library.built_in(), 'cart_pendulum'), 100, 0)\n"
        "print(sorted({name.partition('.')[0] for name in sys.modules} & {'scipy', 'sympy'}))"
    )
    environment = {**os.environ, "HARNESS_CACHE": str(tmp_path)}
    runs = [subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True) for _ in range(2)]
    assert [run.stdout.strip() for run in runs] == ["['scipy', 'sympy']", "[]"]
