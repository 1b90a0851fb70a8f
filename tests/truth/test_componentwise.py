"""The componentwise backward error: programs with known solutions, planted changes of the data, and what the norm cannot see."""

from __future__ import annotations

import math
import zlib

import numpy as np
import pytest
from catalogue import BUILT_IN

from harness.arrays import Array
from harness.engines import accelerations, load_engine
from harness.files.model_file import read_model
from harness.lagrange.derivation import load_mechanism
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.states import States
from harness.truth.compare import compare
from harness.truth.componentwise import componentwise_error, least_squares_bound, smallest_bound
from harness.truth.reference import Reference, ReferenceKernel
from harness.truth.sampling import sample
from harness.verdict import AGREEMENT

# What a linear program's tolerances leave.
SLACK = 1 + 1e-5


def test_one_row_is_the_error_over_the_sum_of_its_data() -> None:
    assert smallest_bound(np.array([[3.0, -4.0, 1.0]]), np.array([16.0])) == pytest.approx(2.0)


def test_the_worst_row_decides_where_rows_share_no_data() -> None:
    columns = np.array([[2.0, 0.0, 1.0, 0.0], [0.0, 1e-6, 0.0, 1e-6]])
    assert smallest_bound(columns, np.array([3.0, 1e-5])) == pytest.approx(5.0)


def test_data_that_rows_share_can_serve_both_only_in_one_direction() -> None:
    """y1 + y2 = 1 and y1 - y2 = 1 leave y1 = 1 alone; y1 + y2 = 1 alone takes a half of each."""
    columns = np.array([[1.0, 1.0], [1.0, -1.0]])
    assert smallest_bound(columns, np.array([1.0, 1.0])) == pytest.approx(1.0)
    assert smallest_bound(columns[:1], np.array([1.0])) == pytest.approx(0.5)


def test_the_cheap_bound_lies_between_the_smallest_and_its_root_of_k_fold() -> None:
    generator = np.random.default_rng(1)
    for _ in range(10):
        columns, error = generator.standard_normal((4, 25)), generator.standard_normal(4)
        smallest = smallest_bound(columns, error)
        assert smallest / SLACK <= least_squares_bound(columns, error) <= 5.0 * smallest * SLACK


def one_state(mechanism: Mechanism, seed: int) -> tuple[ReferenceKernel, States, Reference]:
    kernel, state = ReferenceKernel(mechanism), sample(mechanism, 1, seed)
    return kernel, state, kernel.evaluate(state)


def test_the_answer_at_moved_inputs_needs_no_larger_move(built_in_mechanism: Mechanism) -> None:
    """Every velocity, force and parameter goes to a neighbouring float64, at most two half ulps away; the answer is rounded besides."""
    mechanism = built_in_mechanism
    kernel, state, reference = one_state(mechanism, zlib.crc32(mechanism.name.encode()))
    signs = np.random.default_rng(3).choice([-1.0, 1.0], 2 * mechanism.nv + len(mechanism.parameters))
    v, tau = (np.nextafter(part[0], np.inf * signs[k * mechanism.nv :][: mechanism.nv]) for k, part in enumerate((state.v, state.tau)))
    parameters = np.nextafter(np.array(mechanism.parameter_values), np.inf * signs[2 * mechanism.nv :])[None]
    moved = kernel.evaluate(States(state.q, v[None], tau[None], state.time), parameters)
    found = componentwise_error(kernel, state, reference, moved.high[0])
    assert found <= 2.0 * SLACK
    # And the same answer, given exactly, needs no move at all but its rounding.
    assert componentwise_error(kernel, state, reference, reference.high[0]) <= 1.0 * SLACK


def test_the_norm_is_a_lower_bound(built_in_mechanism: Mechanism) -> None:
    """|a - a*|_M <= t u (sum_k |D_k|_M + sum_i |a_i| |e_i|_M), whatever the answer; the last sum is that of its own rounding."""
    kernel, state, reference = one_state(built_in_mechanism, 5)
    generator = np.random.default_rng(4)
    for size in (1e-16, 1e-12):
        answer = reference.high[0] * (1 + size * generator.standard_normal(built_in_mechanism.nv))
        found = componentwise_error(kernel, state, reference, answer)
        error = float(compare(reference, answer[None]).backward_error[0])
        rounding = float((np.abs(answer) * energy_norm_of_axes(reference)).sum() / reference.sensitivity[0])
        assert error <= found * (1 + rounding) * SLACK


def energy_norm_of_axes(reference: Reference) -> Array:
    """(nv,) |e_i|_M."""
    return np.linalg.norm(reference.norm_factor[0], axis=0)


def test_a_light_wrist_hides_behind_a_heavy_arm_from_the_norm_alone() -> None:
    """A PUMA 560 where MuJoCo is worst by the norm among 60 states: 5.2 by the norm and 100 componentwise. Pinocchio: 0.6 and 1."""
    mechanism = load_mechanism(BUILT_IN, "puma_560")
    kernel, states = ReferenceKernel(mechanism), sample(mechanism, 60, 0)
    reference = kernel.evaluate(states)

    def errors(engine: str, form: str) -> tuple[float, float]:
        """By the norm and componentwise, at the state that is worst by the norm."""
        model = read_model(BUILT_IN.model_path("puma_560", form), form)
        loaded = load_engine(BUILT_IN, engine).load(model, mechanism.joints, mechanism.gravity)
        answers = accelerations(loaded, states)
        comparison = compare(reference, answers)
        worst = slice(comparison.largest, comparison.largest + 1)
        return float(comparison.backward_error.max()), componentwise_error(
            kernel, states[worst], reference[worst], answers[comparison.largest]
        )

    by_norm, componentwise = errors("mujoco", "mjcf")
    assert 3 < by_norm < 10 and AGREEMENT < componentwise < 1000
    by_norm, componentwise = errors("pinocchio", "urdf")
    assert by_norm < 1 and componentwise < 2


def test_what_is_not_certified_or_no_number_has_none_and_what_is_small_is_not_solved(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel, state, reference = one_state(load_mechanism(BUILT_IN, "arm_2r"), 1)
    answer = reference.high[0] * (1 + 4 * UNIT_ROUNDOFF)
    assert math.isnan(componentwise_error(kernel, state, reference, np.array([math.nan, 0.0])))
    undecided = Reference(**{**vars(reference), "certified": np.array([False])})
    assert math.isnan(componentwise_error(kernel, state, undecided, answer))
    assert 0 < componentwise_error(kernel, state, reference, answer) < AGREEMENT
    monkeypatch.setattr("harness.truth.componentwise.smallest_bound", lambda *_: pytest.fail("solved"))
    assert math.isnan(componentwise_error(kernel, state, reference, answer, beyond=AGREEMENT))
