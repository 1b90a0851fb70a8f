"""Values that answers do not tell apart: parallel columns, and sets of columns of less rank than they have members."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from harness.explain.identifiable import ColumnSets, EffectColumn


def columns(*vectors: np.ndarray, noise: float = 1e-9) -> list[EffectColumn]:
    return [EffectColumn(vector.reshape(-1, 2), noise) for vector in vectors]


def anything(_: Mapping[int, float]) -> bool:
    return True


@pytest.fixture
def vectors() -> np.ndarray:
    return np.random.default_rng(0).standard_normal((5, 40))


def test_a_parallel_column_does_the_same_alone(vectors: np.ndarray) -> None:
    a, b, c, *_ = vectors
    assert list(ColumnSets(columns(a, b, -3 * a, c)).alternatives(0, 0.0, anything)) == [(2,)]


def test_three_columns_in_a_plane_are_a_group(vectors: np.ndarray) -> None:
    """No two of them are parallel: pairs alone would tell nothing."""
    a, b, c, d, _ = vectors
    found = columns(a, b, c, 2 * a - b, d)
    assert list(ColumnSets(found).alternatives(0, 0.0, anything)) == [(1, 3)]
    assert list(ColumnSets(found).alternatives(3, 0.0, anything)) == [(0, 1)]
    assert not list(ColumnSets(found).alternatives(2, 0.0, anything))


def test_four_dependent_columns_are_a_group_and_five_are_not_sought(vectors: np.ndarray) -> None:
    a, b, c, d, e = vectors
    assert list(ColumnSets(columns(a + b - c, a, b, c, d)).alternatives(0, 0.0, anything)) == [(1, 2, 3)]
    assert not list(ColumnSets(columns(a + b - c + d, a, b, c, d, e)).alternatives(0, 0.0, anything))


def test_a_group_is_no_larger_than_it_must_be(vectors: np.ndarray) -> None:
    """With a parallel column any other would make a set, which says nothing."""
    a, b, c, *_ = vectors
    assert list(ColumnSets(columns(a, 2 * a, b, a + b, c)).alternatives(0, 0.0, anything)) == [(1,), (2, 3)]


def test_noise_of_answers_hides_a_small_angle_and_that_of_columns_a_small_rest(vectors: np.ndarray) -> None:
    a, b, c, *_ = vectors
    nearly = a + 1e-3 * b
    assert not list(ColumnSets(columns(a, nearly, c)).alternatives(0, 0.0, anything))
    assert list(ColumnSets(columns(a, nearly, c)).alternatives(0, 1e-2, anything)) == [(1,)]
    assert list(ColumnSets(columns(a, nearly, c, noise=1e-3)).alternatives(0, 0.0, anything)) == [(1,)]


def test_members_that_all_but_cancel_make_no_group(vectors: np.ndarray) -> None:
    """The difference of two columns that are one but for their noise has any direction."""
    a, b, c, *_ = vectors
    found = columns(a, b, b + 1e-3 * a, c, noise=1e-5)
    assert not list(ColumnSets(found).alternatives(0, 0.0, anything))
    assert list(ColumnSets(columns(a, b, b + 1e-3 * a, c, noise=1e-9)).alternatives(0, 0.0, anything)) == [(1, 2)]


def test_a_change_that_cannot_be_is_no_alternative(vectors: np.ndarray) -> None:
    a, b, *_ = vectors
    factors: list[Mapping[int, float]] = []

    def never(found: Mapping[int, float]) -> bool:
        factors.append(found)
        return False

    assert not list(ColumnSets(columns(a, -2 * a, b)).alternatives(0, 0.0, never))
    assert factors == [{1: pytest.approx(-0.5)}]
