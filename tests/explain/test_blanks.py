"""A number of a URDF with blanks behind it, which urdfdom takes for none."""

from __future__ import annotations

from pathlib import Path

import pytest
from comparison.robots import record_of

ARM = (Path(__file__).parents[2] / "docs" / "examples" / "blanks-after-a-number.urdf").read_text()


@pytest.mark.parametrize("text", ['iyy="0.06 "', 'iyy="0.06\n"'])
def test_moments_are_none_where_one_has_blanks_behind_it(text: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(ARM.replace('iyy="0.06 "', text))
    record = record_of(path, "pinocchio", aided=False)
    assert record.explained and [one.name for one in record.readings] == ["blanks after a number"]


def test_blanks_before_a_number_are_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(ARM.replace('iyy="0.06 "', 'iyy=" 0.06"'))
    record = record_of(path, "pinocchio", aided=False)
    assert record.verdict == "agrees" and not record.readings
