"""Which files of a folder are robots."""

from __future__ import annotations

from pathlib import Path

import pytest
from comparison.robots import FILES

from harness.comparison.collection import find_files
from harness.errors import InvalidInput


def test_models_are_told_by_their_root_element(tmp_path: Path) -> None:
    (tmp_path / "below").mkdir()
    wanted = [tmp_path / "below" / "arm.xml", tmp_path / "rod.urdf", tmp_path / "urdf_in.xml"]
    for path, source in zip(wanted, ("arm.xml", "impossible.urdf", "mimic.urdf"), strict=True):
        path.write_text("<!-- <world> -->\n" + (FILES / source).read_text())
    (tmp_path / "package.xml").write_text("<package><name>robots</name></package>")
    (tmp_path / "part.xml").write_text("<mujoco><asset/></mujoco>")
    (tmp_path / "broken.xml").write_text("<")
    (tmp_path / "notes.txt").write_text("<robot/>")
    assert sorted(find_files([str(tmp_path)])) == sorted(wanted)
    assert find_files([str(wanted[1]), str(tmp_path)])[0] == wanted[1]


@pytest.mark.parametrize("place", ["", "no-such-distribution"])
def test_a_place_without_robots_is_refused(place: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match=r"holds no model|no distribution"):
        find_files([place or str(tmp_path)])
