"""Parameters of a force that has a range."""

from __future__ import annotations

import math

import numpy as np
import pytest

from harness.programs.mechanisms.clamps import Clamp

LOW, HIGH = -2.0, 3.0


@pytest.mark.parametrize("lower", [(-1, -1), (4, 6), (4, -1)])
@pytest.mark.parametrize("upper", [(-1, -1), (5, 7), (5, -1)])
def test_a_force_is_put_in_its_own_parameters_and_found_there(lower: tuple[int, int], upper: tuple[int, int]) -> None:
    """Its bounds are parameters, or numbers; those of one without any that count are never those of a bound."""
    bounds = (lower[0], upper[0], lower[1], upper[1]) if (lower[0], upper[0]) != (-1, -1) else ()
    clamp = Clamp(1, 2, LOW if not bounds or lower[0] >= 0 else -math.inf, HIGH if not bounds or upper[0] >= 0 else math.inf, bounds)
    before = np.random.default_rng(0).uniform(10.0, 20.0, (3, 9))
    sides = np.array([side for side, bound in ((-1.0, lower), (0.0, None), (1.0, upper)) if not bounds or bound is None or bound[0] >= 0])
    before = before[: len(sides)]
    np.testing.assert_array_equal(clamp.least(before), before[:, lower[1]] if bounds and lower[1] >= 0 else clamp.low)
    np.testing.assert_array_equal(clamp.most(before), before[:, upper[1]] if bounds and upper[1] >= 0 else clamp.high)

    found = before.copy()
    clamp.put(found, sides, clamp.least(before), clamp.most(before))
    np.testing.assert_array_equal(clamp.side(found, clamp.most(found)), sides)
    changed = (found != before).any(axis=0)
    assert set(np.flatnonzero(changed)) == set(clamp.own)
    # The force is its share of what it would be, the constant, and the bounds that count.
    force = 7.0 * found[:, clamp.share] + found[:, clamp.constant]
    for column, bound in zip(bounds[:2], (clamp.least(found), clamp.most(found)), strict=False):
        force += found[:, column] * bound if column >= 0 else 0.0
    np.testing.assert_array_equal(force, np.select([sides < 0, sides > 0], [clamp.least(before), clamp.most(before)], 7.0))
