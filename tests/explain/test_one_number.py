"""One number that explains the errors of all states is told from rounding, whatever the size of either."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from catalogue import BUILT_IN, STATES

from harness.arrays import Array
from harness.explain.columns import Whitening, parameter_derivatives
from harness.explain.fit import NumberDirection, Projection, explaining_directions
from harness.lagrange.derivation import load_mechanism
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.truth.reference import Reference, ReferenceKernel
from harness.truth.sampling import generic_sample
from harness.verdict import AGREEMENT

N, NV = 60, 3


def reference_with(instability: Array) -> Reference:
    """References whose norms differ by a hair and whose data roundoff is 1; a factorisation may lose up to ``instability`` of them."""
    return Reference(
        high=np.ones((N, NV)),
        low=np.zeros((N, NV)),
        radius=np.zeros(N),
        norm_factor=np.eye(NV) * (1 + 1e-9 * np.arange(N)[:, None, None]),
        sensitivity=np.full(N, 1 / UNIT_ROUNDOFF),
        share=np.zeros(N),
        instability=instability / UNIT_ROUNDOFF,
        condition=np.ones(N),
        certified=np.ones(N, dtype=bool),
        bits=np.full(N, 128),
    )


def directions(reference: Reference, errors: Array, columns: list[Array]) -> list[NumberDirection]:
    return explaining_directions([Projection.of(reference, errors, columns)])


@pytest.fixture
def random() -> np.random.Generator:
    return np.random.default_rng(5)


@pytest.mark.ci
@pytest.mark.parametrize("largest", [1.0, 1e4, 1e9])
def test_rounding_has_no_direction(random: np.random.Generator, largest: float) -> None:
    """Of 5,000 numbers none explains errors that are as large as their states' conditioning lets them be, at some states or at all."""
    columns = list(random.normal(size=(5_000, N, NV)))
    everywhere = np.full(N, largest)
    assert directions(reference_with(everywhere), random.normal(size=(N, NV)) * largest, columns) == []
    may_lose = np.geomspace(1, largest, N)
    errors = random.normal(size=(N, NV)) * may_lose[:, None]
    assert directions(reference_with(may_lose), errors, columns) == []


@pytest.mark.parametrize("largest", [1.0, 1e4, 1e9])
def test_a_wrong_number_is_found_with_its_change(random: np.random.Generator, largest: float) -> None:
    """The best half of the states has no conditioning to blame; what the other half loses does not hide it."""
    may_lose = np.concatenate([np.ones(N // 2), np.geomspace(1, largest, N - N // 2)])
    columns = list(random.normal(size=(20, N, NV)))
    errors = random.normal(size=(N, NV)) * may_lose[:, None] + 300 * columns[7]
    [found] = directions(reference_with(may_lose), errors, columns)
    assert found.index == 7
    assert found.change == pytest.approx(300, rel=0.02)
    assert found.effect == pytest.approx(300 * np.linalg.norm(columns[7], axis=1).max(), rel=0.02)


def test_a_change_that_would_itself_agree_is_no_fault(random: np.random.Generator) -> None:
    column = random.normal(size=(N, NV))
    column /= np.linalg.norm(column, axis=1).max()
    assert directions(reference_with(np.ones(N)), 0.9 * AGREEMENT * column, [column]) == []
    assert directions(reference_with(np.ones(N)), 1.1 * AGREEMENT * column, [column])


def test_what_one_state_alone_feels_explains_nothing(random: np.random.Generator) -> None:
    """One column always explains the one state that feels it."""
    column, errors = np.zeros((N, NV)), random.normal(size=(N, NV))
    errors[4] = column[4] = 1e6
    assert directions(reference_with(np.full(N, 1e7)), errors, [column]) == []


def test_states_that_share_a_mass_matrix_are_one_observation(random: np.random.Generator) -> None:
    """The rounding of one M moves all answers that are solved with it alike."""
    columns = random.normal(size=(N, NV))
    well_conditioned = replace(reference_with(np.ones(N)), norm_factor=np.broadcast_to(np.eye(NV), (N, NV, NV)))
    assert directions(well_conditioned, 300 * columns, [columns])
    shared = replace(well_conditioned, high=np.full((N, NV), 4 / UNIT_ROUNDOFF))
    assert directions(replace(reference_with(np.ones(N)), high=shared.high), 300 * columns, [columns])
    assert directions(shared, 300 * columns, [columns]) == []
    ten = [shared, *(replace(shared, norm_factor=np.full((N, NV, NV), 1.0 + k)) for k in range(19))]
    assert explaining_directions([Projection.of(one, 300 * columns, [columns]) for one in ten])


def test_a_projection_counts_each_state_by_what_it_may_lose(random: np.random.Generator) -> None:
    """Sums of errors times columns and of squares of columns, each over the square of what rounding does there."""
    may_lose = np.geomspace(1, 100, N)
    columns, errors = random.normal(size=(3, N, NV)), random.normal(size=(N, NV))
    found = Projection.of(reference_with(may_lose), errors, list(columns))
    weights = 1 / (1 + may_lose[:, None]) ** 2
    np.testing.assert_allclose(found.products, (columns * errors * weights).sum(axis=2), rtol=1e-14)
    np.testing.assert_allclose(found.squares, (columns**2 * weights).sum(axis=2), rtol=1e-14)
    np.testing.assert_allclose(found.largest, np.linalg.norm(columns, axis=2).max(axis=1), rtol=1e-14)


def test_states_that_do_not_count_are_left_out(random: np.random.Generator) -> None:
    column = random.normal(size=(N, NV))
    errors = 300 * column
    errors[3] = np.nan
    errors[8] = 1e9
    reference = reference_with(np.ones(N))
    undecided = replace(reference, certified=np.arange(N) != 8)
    [found] = directions(undecided, errors, [column])
    assert found.change == pytest.approx(300)


@pytest.mark.parametrize("name", BUILT_IN.system_names())
def test_derivatives_by_parameters_are_those_of_the_certified_accelerations(name: str) -> None:
    mechanism = load_mechanism(BUILT_IN, name)
    kernel, states = ReferenceKernel(mechanism), generic_sample(mechanism, STATES, 2)[:4]
    values = np.array(mechanism.parameter_values)
    reference = kernel.evaluate(states)
    found = parameter_derivatives(kernel, states, reference, values.tolist())
    whitening = Whitening(reference)
    for number, value in enumerate(values):
        step = 2.0**-20 * (abs(value) or 1.0)
        ends = [kernel.evaluate(states, np.tile(values + sign * step * np.eye(len(values))[number], (4, 1))) for sign in (1, -1)]
        slope = ((ends[0].high - ends[1].high) + (ends[0].low - ends[1].low)) / (2 * step)
        error = np.linalg.norm(whitening.change(found[number] - slope), axis=1)
        # Of second order in the step, beside all that the parameter does.
        assert (error <= 1e-9 * np.linalg.norm(whitening.change(slope), axis=1) + 1e-3 / step).all()
