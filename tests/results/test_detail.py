"""Rows that matter are told, and the others counted."""

from __future__ import annotations

import pytest

from harness.results.detail import Detail, telling

EFFECTS = [0.5, 4.9e-4, None, -0.3, 5e-4, 0.0]


@pytest.mark.parametrize(
    ("detail", "kept", "others"),
    [
        (Detail.BRIEF, [0.5, None, -0.3, 5e-4], "2 more below 0.001 of the largest (--all)"),
        (Detail.ALL, EFFECTS, ""),
        (Detail.VERBOSE, EFFECTS, ""),
    ],
)
def test_a_row_below_a_thousandth_of_the_largest_is_counted(detail: Detail, kept: list[float | None], others: str) -> None:
    assert telling(EFFECTS, lambda effect: effect, detail) == (kept, others)


@pytest.mark.parametrize("rows", [[], [0.0, 0.0], [None]])
def test_where_nothing_has_an_effect_every_row_is_told(rows: list[float | None]) -> None:
    assert telling(rows, lambda effect: effect) == (rows, "")
