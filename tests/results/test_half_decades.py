"""Half decades are compared with whole numbers: 10^(k/2) <= x where 10^k <= x^2."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest

from harness.results.quantiles import half_decade, half_decade_edges


@pytest.mark.parametrize(
    ("value", "key"),
    [
        (0.0, "exact"),
        (1.0, "0"),
        (3.2, "1"),
        (0.9, "-1"),
        (64.0, "3"),
        (1.7e308, "616"),
        (math.inf, "inf"),
        (math.nan, "inf"),
        (5e-324, "-647"),
    ],
)
def test_half_decades(value: float, key: str) -> None:
    assert half_decade(value) == key


def test_edges_are_the_nearest_float64() -> None:
    for k, edge in enumerate(half_decade_edges(), start=-647):
        below, above = (Fraction(edge) + Fraction(math.nextafter(edge, towards)) for towards in (0.0, math.inf))
        assert (below / 2) ** 2 <= Fraction(10) ** k <= (above / 2) ** 2


def test_an_error_on_the_edge_is_above_it() -> None:
    for k, edge in enumerate(half_decade_edges()[1:], start=-646):
        assert (half_decade(math.nextafter(edge, 0.0)), half_decade(edge)) == (str(k - 1), str(k))
