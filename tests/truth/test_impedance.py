"""Impedances around many distances at once against the documented law in balls, one by one."""

from __future__ import annotations

from typing import Any

import flint
import numpy as np
import pytest

from harness.arrays import Array
from harness.files.rules import Impedance
from harness.programs.program import StraightLineProgram
from harness.programs.terms import Builder
from harness.truth.impedance import linear, nearest

BITS, CASES = 192, 150


def documented(law: Impedance, distance: Any) -> tuple[Any, Any]:
    """d and its derivative at a distance, by the text of MuJoCo's documentation."""
    least, most, width, midpoint, power = map(flint.arb, (law.least, law.most, law.width, law.midpoint, law.power))
    if law.is_constant:
        return (least + most) / 2, flint.arb(0)
    x = distance / width
    if x > 1:
        return most, flint.arb(0)
    # a x^p with a midpoint^p = midpoint, and 1 - b (1 - x)^p.
    if x <= midpoint:
        factor = midpoint ** (1 - power)
        y, slope = factor * x**power, power * (factor * x ** (power - 1) if x > 0 else flint.arb(power == 1))
    else:
        factor = (1 - midpoint) ** (1 - power)
        y, slope = 1 - factor * (1 - x) ** power, power * (factor * (1 - x) ** (power - 1) if x < 1 else flint.arb(power == 1))
    return least + y * (most - least), slope * (most - least) / width


def drawn(random: np.random.Generator, power: float, rows: int) -> tuple[Impedance, Array]:
    law = Impedance(*(float(random.choice(of)) for of in ([0.9, 1e-4, 0.3], [0.95, 0.9999, 0.9], [1e-3, 0.1, 1.0], [0.5, 0.1, 0.9])), power)
    ends = [0.0, law.width, law.width * law.midpoint, np.nextafter(law.width, 0), np.nextafter(law.width, 2), 1e-20]
    distance = float(random.choice([*ends, *law.width * random.uniform(-1.3, 1.3, 6)]))
    along = random.normal(size=rows) if rows > 1 and random.random() < 0.5 else np.eye(rows)[random.integers(rows)]
    return law, distance * along / np.linalg.norm(along)


@pytest.mark.parametrize("rows", [1, 3])
@pytest.mark.parametrize("power", [1.0, 2.0, 5.0, 2.5])
def test_impedances_and_slopes_are_those_of_the_documented_law(power: float, rows: int) -> None:
    random = np.random.default_rng([int(2 * power), rows])
    laws, residuals = zip(*(drawn(random, power, rows) for _ in range(CASES)), strict=True)
    found = linear(laws, [1] * CASES, np.array(residuals))
    with flint.ctx.workprec(BITS):
        for case, (law, left) in enumerate(zip(laws, residuals, strict=True)):
            distance = sum((flint.arb(one) ** 2 for one in left), flint.arb(0)).sqrt()
            impedance, slope = documented(law, distance)
            assert abs((impedance - found.value[case]) - found.rest[case]) <= 2.0**-100 * impedance
            for row, one in enumerate(left):
                share = flint.arb(one) / distance if distance != 0 else flint.arb(row == 0)
                assert abs(slope * share - found.slopes[case, row]) <= 2.0**-52 * abs(slope * share)


def test_one_law_counts_for_many_states() -> None:
    law, other = Impedance(0.9, 0.95, 0.1, 0.5, 2.0), Impedance(0.5, 0.5, 0.1, 0.5, 2.0)
    found = linear([law, other], [2, 1], np.array([[0.05], [0.2], [0.05]]))
    assert found.value == pytest.approx([0.925, 0.95, 0.5], rel=1e-15)
    assert found.slopes.tolist()[1:] == [[0.0], [0.0]] and found.slopes[0, 0] == pytest.approx(1.0, rel=1e-15)


def _of_two(sign: int) -> StraightLineProgram:
    """x + y, or x - y."""
    builder = Builder(("x", "y"))
    x, y = builder.inputs
    return builder.program({"found": [x + sign * y]})


def test_nearest_numbers_are_kept_for_the_same_program_and_numbers_alone() -> None:
    plus, minus, given = _of_two(1), _of_two(-1), np.array([[1.0, 2.0, 3.0], [0.5, 0.25, 0.125]])
    first = nearest(plus, given)
    assert first.tolist() == [[1.5], [2.25], [3.125]] and nearest(_of_two(1), np.asfortranarray(given)) is first
    assert nearest(minus, given).tolist() == [[0.5], [1.75], [2.875]]
    given[0, 0] = 2.0
    assert nearest(plus, given).tolist() == [[2.5], [2.25], [3.125]]
    assert nearest(plus, given[:, ::-1]).tolist() == [[3.125], [2.25], [2.5]]
    with pytest.raises(ValueError, match="read-only"):
        first[0, 0] = 0.0
