"""Several files of one robot: what is the same stays the same in other words, and a wrong number is named with file and line."""

from __future__ import annotations

from pathlib import Path

import pytest
from comparison.robots import FILES, edited, line_of, meant_by

from harness.comparison.matching import match
from harness.comparison.sameness import hold_against
from harness.results.comparison import PairRecord
from harness.robots.robot import read_robot

URDF, MJCF = FILES / "arm.urdf", FILES / "arm.xml"


def pair(first: Path, second: Path, **renamed: str) -> PairRecord:
    return hold_against(meant_by(first), read_robot(second), renamed)


def test_two_formats_of_one_robot_are_one_robot() -> None:
    """The MJCF fuses nothing and holds one inertia in a turned frame of its own."""
    found = pair(URDF, MJCF)
    assert found.same and not found.problem and found.backward_error is not None and found.backward_error < 4


# What stands in both files, the text in the URDF and its number, and how the difference begins.
PLANTED = {
    "mass": ('<mass value="1"/>', 1.0, '<mass value="{}"/>', "mass of link fore"),
    "com": ('xyz="0 0 -0.1875"', -0.1875, 'xyz="0 0 {}"', "origin of link fore"),
    "inertia": ('ixx="0.015625"', 0.015625, 'ixx="{}"', "moments of inertia of link fore"),
    "origin": ('xyz="0 0.0625 -0.5"', -0.5, 'xyz="0 0.0625 {}"', "origin of link fore"),
    "orientation": ('rpy="0.25 0 0"', 0.25, 'rpy="{} 0 0"', "origin of link upper"),
    "axis": ('<axis xyz="1 0 0"/>', 0.0, '<axis xyz="1 {} 0"/>', "axis of joint elbow"),
    "damping": ('damping="0.5"', 0.5, 'damping="{}"', "damping of joint shoulder"),
}
SIZES = [1e-9, 1e-5, 1e-1]


def _planted(kind: str, size: float, folder: Path) -> tuple[Path, str, str]:
    """The URDF with one number wrong by ``size``, the text that stands there then, and what is to be said of it."""
    text, value, form, what = PLANTED[kind]
    wrong = form.format(repr(value * (1 + size) if value else size))
    return edited(URDF, folder, (text, wrong)), wrong, what


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("kind", PLANTED)
def test_a_wrong_number_of_a_copy_is_named_with_its_line(kind: str, size: float, tmp_path: Path) -> None:
    copy, wrong, what = _planted(kind, size, tmp_path)
    found = pair(URDF, copy)
    assert not found.same
    (difference,) = found.differences
    assert (difference.what, difference.second_place) == (what, f"arm.urdf:{line_of(copy, wrong)}")
    assert difference.alone is not None and difference.alone == pytest.approx(found.relative_error, rel=0.5)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("kind", PLANTED)
def test_a_wrong_number_is_named_beside_another_format(kind: str, size: float, tmp_path: Path) -> None:
    copy, wrong, _ = _planted(kind, size, tmp_path)
    found = pair(copy, MJCF)
    assert not found.same
    # Of a link in parts there is a mass for each.
    places = [difference.first_place for difference in found.differences[:3]]
    assert f"arm.urdf:{line_of(copy, wrong)}" in places


def test_nothing_differs_between_a_file_and_its_copy(tmp_path: Path) -> None:
    found = pair(URDF, edited(URDF, tmp_path))
    assert found.same and found.differences == [] and found.backward_error == pytest.approx(0.0, abs=1e-3)


def test_mass_that_moves_without_being_felt_is_told(tmp_path: Path) -> None:
    """Twice the mass at half the arm has the same weight about the pin, and here the same inertia."""
    first = edited(FILES / "impossible.urdf", tmp_path, ('iyy="0.25"', 'iyy="0.125"'))
    (tmp_path / "other").mkdir()
    # 1 kg at 0.5 m with 0.125, and 2 kg at 0.25 m with 0.25: 0.375 kg m^2 about the pin in both.
    changes = (('xyz="0 0 -0.5"', 'xyz="0 0 -0.25"'), ('mass value="1"', 'mass value="2"'))
    second = edited(FILES / "impossible.urdf", tmp_path / "other", *changes)
    found = pair(first, second)
    assert found.same and found.equivalent and {one.what for one in found.differences} >= {"mass of link rod"}


def test_joints_are_matched_by_name_then_by_word_then_by_place(tmp_path: Path) -> None:
    text = URDF.read_text().replace('"shoulder"', '"joint1"').replace('"elbow"', '"joint2"')
    other = tmp_path / "renamed.urdf"
    other.write_text(text)
    one, two = read_robot(URDF), read_robot(other)
    assert match(one, two, {}).by_place == ("shoulder", "elbow")
    assert match(one, two, {"elbow": "joint2"}).by_place == ("shoulder",)
    assert match(one, one, {}).by_place == ()
    found = pair(URDF, other)
    assert found.same and len(found.remarks) == 2


def test_another_kind_or_number_of_joints_is_another_robot(tmp_path: Path) -> None:
    slide = edited(URDF, tmp_path, ('<joint name="elbow" type="revolute">', '<joint name="elbow" type="prismatic">'))
    assert "elbow" in pair(URDF, slide).problem
    fixed = edited(URDF, tmp_path, ('<joint name="elbow" type="revolute">', '<joint name="elbow" type="fixed">'))
    assert "only the first has joint elbow" in pair(URDF, fixed).problem


def test_a_joint_that_mimics_in_one_file_only_is_a_difference(tmp_path: Path) -> None:
    mimic = '<mimic joint="left" multiplier="0.75" offset="0.125"/>'
    found = pair(FILES / "mimic.urdf", edited(FILES / "mimic.urdf", tmp_path, (mimic, "")))
    assert not found.same
    assert (found.differences[0].first, found.differences[0].second) == ("mimics left", "moves by itself")
