"""Derivatives by a number of a text that some values of it make invalid, and what counts as next to no change."""

from __future__ import annotations

import numpy as np
import pytest

from harness.explain.changes import NUMBER, PARAMETER, Change
from harness.explain.columns import derivative
from harness.explain.result import TriedChange
from harness.explain.search import ALL_BUT_ZERO, Tried
from harness.files.text.scan import TextPlace, tag


@pytest.mark.parametrize("lowest", [-9.0, 2.0, 1.5], ids=["both sides", "one side", "both sides again"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_derivative_is_of_second_order_also_where_one_side_is_refused(lowest: float, sign: float) -> None:
    """Of a polynomial of the second degree it is exact."""

    def answer(text: str) -> np.ndarray | None:
        value = float(text)
        return np.array([3 * value**2 - value + 5, value]) if sign * value >= lowest else None

    found = derivative(answer, repr, sign * 2.0, 0.5)
    assert found is not None
    np.testing.assert_allclose(found, [6 * sign * 2.0 - 1, 1.0], rtol=1e-13)


def test_a_derivative_with_one_further_point_is_of_first_order_and_without_any_there_is_none() -> None:
    square = {1.0: 1.0, 1.5: 2.25}

    def answer(text: str) -> np.ndarray | None:
        return np.array([square[float(text)]]) if float(text) in square else None

    assert derivative(answer, repr, 1.0, 0.5) == pytest.approx(2.5)
    assert derivative(answer, repr, 1.5, 0.5) == pytest.approx(2.5)
    assert derivative(answer, repr, 2.5, 0.5) is None


@pytest.mark.parametrize(
    ("kind", "start", "value", "is_slight"),
    [
        # A structural mistake of next to no size.
        ("damping", 0.0, 1e-9, True),
        ("damping", 0.0, 0.5, False),
        ("offset", 3.0, 3.0 + 1e-9, True),
        ("offset", 3.0, -3.0, False),
        # A zero that should be next to nothing, and a number that is wrong by its last digits.
        (NUMBER, 0.0, 1e-9, True),
        (NUMBER, 0.0, 0.5, False),
        (NUMBER, 3.0, 3.0 + 1e-9, False),
        (PARAMETER, 3.0, 3.0 + 1e-9, False),
        ("axis", None, None, False),
        ("axis", None, 1e-9, True),
    ],
)
def test_next_to_no_change_is_slight_but_of_a_number_that_is_written(
    kind: str, start: float | None, value: float | None, is_slight: bool
) -> None:
    scale = 2.0
    assert ALL_BUT_ZERO * scale > 1e-9
    change = Change(kind, "", (), str, start, scale)
    assert Tried(change, value, 0.0, True).is_slight is is_slight


def test_a_place_is_told_as_it_stands_in_a_file() -> None:
    attribute, text = (TextPlace(3, "mass", name, None, "2") for name in ("value", ""))
    assert tag(attribute, "2") == '<mass value="2">' and tag(attribute, "") == "<mass value>"
    assert tag(text, "1 2") == "<mass>1 2</mass>" and tag(text, "") == "<mass>"


def test_a_change_as_plain_data_has_its_place_beside_what_it_is() -> None:
    place = TextPlace(3, "mass", "value", 0, "2")
    change = TriedChange("number", "too heavy", place, 1.5, '<mass value="2">', "1.5", 0.7, True)
    assert change.as_json() == {
        "line": 3, "element": "mass", "attribute": "value", "index": 0, "found": "2", "hypothesis": "number", "statement": "too heavy",
        "value": 1.5, "tag": '<mass value="2">', "shown": "1.5", "residual": 0.7, "explains": True,
    }  # fmt: skip
