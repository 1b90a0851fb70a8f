"""What names of quantities stand for."""

from __future__ import annotations

import pytest

from harness.errors import InvalidRequest
from harness.truth.quantities import find_quantities, select_quantities

BOTH = ["forward_dynamics_derivatives", "inverse_dynamics_derivatives"]


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        ([], ["accelerations"]),
        (["gravity", "bias", "gravity"], ["bias", "gravity"]),
        (["derivatives"], BOTH),
        ([BOTH[1], "derivatives", "accelerations"], ["accelerations", *BOTH]),
        (["all", "derivatives"], [*find_quantities()]),
    ],
)
def test_names_stand_for_quantities_in_a_fixed_order(names: list[str], expected: list[str]) -> None:
    assert select_quantities(names) == expected


@pytest.mark.parametrize(("name", "nearest"), [("derivative", "derivatives"), ("mass_matrx", "mass_matrix"), ("al", "all")])
def test_another_name_is_refused_with_the_nearest(name: str, nearest: str) -> None:
    with pytest.raises(InvalidRequest, match=rf"no quantity is called '{name}'; .*\b{nearest}\b"):
        select_quantities(["bias", name])
