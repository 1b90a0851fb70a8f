"""Parameters of a force that has a range, or lies in a cone."""

from __future__ import annotations

import math

import flint
import numpy as np
import pytest

from harness.programs.loops.interpreter import Bounded
from harness.programs.mechanisms.clamps import Clamp
from harness.programs.mechanisms.cones import Cone, Zone
from harness.programs.numbers import length_of_balls

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


@pytest.mark.parametrize(
    ("normal", "fits"), [(-1.0, Zone.SLIDES), (-2.0, None), (-2.0 - 1e-9, Zone.STICKS), (0.5, None), (0.5 + 1e-9, Zone.PARTS)]
)
def test_a_contact_is_shown_to_do_what_no_rounding_changes(normal: float, fits: Zone | None) -> None:
    """On an edge, where mu N = -T or N = mu T, nothing is shown."""
    cone, numbers = Cone(0, 1, (2, 3, 4), (5, 6, 7), friction=(8, 9), ratio=10), np.zeros((3, 11))
    numbers[:, 8:] = 0.5, 0.5, 1.0
    y = np.tile([normal, 0.6, 0.8], (3, 1))
    zones = np.array([Zone.PARTS, Zone.STICKS, Zone.SLIDES], dtype=np.float64)

    def shown(bound: float, moved: float) -> list[Zone]:
        known = Bounded(y, np.zeros_like(y), np.full_like(y, bound))
        return [Zone(int(zone)) for zone in zones[cone.are_shown(numbers, zones, known, np.full_like(y, moved))]]

    assert shown(1e-25, 0.0) == ([] if fits is None else [fits])
    assert shown(1.0, 0.0) == []
    # Weights that are taken elsewhere are those of where y slides alone.
    assert shown(1e-25, 1e-18) == ([] if fits in (None, Zone.SLIDES) else [fits])


@pytest.mark.parametrize(("normal", "zone"), [(-1.0, Zone.STICKS), (1.0, Zone.PARTS), (0.0, None)])
def test_balls_around_the_axis_of_a_cone_decide_its_zone(normal: float, zone: Zone | None) -> None:
    """A contact without any force along its tangents, as of a body that rests on level ground."""
    cone, numbers = Cone(0, 1, (2, 3, 4), (5, 6, 7), friction=(8, 9), ratio=10), np.zeros(11)
    numbers[8:] = 0.5, 0.5, 1.0
    y = [flint.arb(normal, 1e-20), flint.arb(0, 1e-20), flint.arb(0, 1e-20)]
    assert cone.zone_in_balls(numbers, y) is zone


def test_the_length_of_balls_encloses_every_length() -> None:
    found = length_of_balls([flint.arb(3, 1e-9), flint.arb(-4, 1e-9)])
    assert found.contains(5) and found.rad() < 1e-8
    around = length_of_balls([flint.arb(0, 1e-9), flint.arb(0, 1e-9)])
    assert around.contains(0) and around.contains(math.sqrt(2) * 1e-9) and around.abs_upper() < 1e-8
