"""Standard errors of numbers that are fitted to a log, by noise that is planted, and what is taken for noise."""

from __future__ import annotations

import numpy as np
import pytest

from harness.drifts.fits import beside, is_white, standard_errors, threshold

ROWS, JOINTS, LOGS = 100, 3, 400


def planted(shared: float) -> np.ndarray:
    """(logs, rows, joints) of noise of another size in each joint, ``shared`` the correlation of neighbouring rows."""
    white = np.random.default_rng(1).standard_normal((LOGS, ROWS, JOINTS)) * [3.0, 1.0, 0.1]
    found = white.copy()
    for row in range(1, ROWS):
        found[:, row] = shared * found[:, row - 1] + np.sqrt(1 - shared**2) * white[:, row]
    return found


@pytest.mark.parametrize(("shared", "within"), [(0.0, 0.1), (0.5, 0.25)])
def test_standard_errors_are_those_of_many_logs(shared: float, within: float) -> None:
    """Noise of one size for all joints would have the number of the first joint three times as certain as it is."""
    rows = np.linspace(0.0, 1.0, ROWS)
    effects = np.zeros((2, ROWS, JOINTS))
    effects[0, :, 0], effects[1, :, 2] = np.sin(7 * rows), 2.0 + rows
    columns = effects.reshape(2, -1)
    fitted, told = [], []
    for noise in planted(shared):
        change = np.linalg.lstsq(columns.T, noise.ravel())[0]
        fitted.append(change)
        told.append(standard_errors(columns, noise.ravel() - change @ columns, ROWS))
    assert np.sqrt(np.mean(np.square(told), axis=0)) == pytest.approx(np.std(fitted, axis=0), rel=within)


def test_what_many_numbers_reach_by_chance_is_no_change() -> None:
    """The threshold holds for all numbers together, and is larger where fewer rows tell of the noise."""
    assert threshold(1, 10**6, 0) == pytest.approx(3.2905, rel=1e-3)
    assert threshold(91, 200, 1) > threshold(1, 200, 1) > 3.29
    assert threshold(1, 4, 1) > 100


def test_noise_is_white_and_what_is_missing_is_not() -> None:
    white = planted(0.0)
    assert sum(is_white(noise.ravel(), ROWS) for noise in white) >= LOGS - 3
    slow = np.sin(np.linspace(0.0, 3.0, ROWS))[:, None] * [1.0, 0.3, 0.1]
    assert not any(is_white((noise + 9 * slow).ravel(), ROWS) for noise in white)
    assert is_white(np.zeros(ROWS * JOINTS), ROWS)


def test_vectors_beside_effects_that_depend_on_one_another() -> None:
    effects = np.random.default_rng(0).standard_normal((2, 30))
    others = beside(np.vstack([effects, effects[0] - effects[1], np.zeros(30), np.full(30, np.nan)]))
    left = others(np.ones(30))
    assert np.abs(effects @ left).max() < 1e-12 and np.linalg.norm(left) > 1
    assert np.array_equal(beside(np.empty((0, 30)))(np.ones(30)), np.ones(30))
