"""Inertias that no body can have, and the nearest that one can."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from harness.trees.bodies.inertias import nearest_inertia
from harness.trees.bodies.rigid import square
from harness.trees.robot import read_robot

TEXT = """<robot name="one">
  <link name="world"/>
  <link name="upper">
    <inertial>
      <mass value="2"/>
      <inertia ixx="0.3" iyy="0.4" izz="0.5" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <link name="lower"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="hinge" type="revolute"><parent link="world"/><child link="upper"/></joint>
  <joint name="weld" type="fixed"><parent link="upper"/><child link="lower"/></joint>
</robot>
"""


@pytest.mark.parametrize(
    ("changes", "what", "body", "line", "by_how_much"),
    [
        ({'izz="0.5"': 'izz="0.8"'}, "A + B < C", "upper", 4, 0.125),
        ({'ixx="0.3"': 'ixx="-0.1"'}, "indefinite inertia", "upper", 4, 0.2),
        ({'ixy="0" ixz="0" iyz="0"/>\n': 'ixy="0.5" ixz="0" iyz="0"/>\n'}, "indefinite inertia", "upper", 4, None),
        ({'<mass value="2"/>': '<mass value="-2"/>'}, "negative mass", "upper", 4, 1.0),
        ({'<mass value="2"/>': '<mass value="0"/>', '<mass value="1"/>': '<mass value="0"/>'}, "massless moving link", "upper", 3, 1.0),
    ],
)
def test_what_no_body_can_have_is_named(
    tmp_path: Path, changes: dict[str, str], what: str, body: str, line: int, by_how_much: float | None
) -> None:
    text = TEXT
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "one.urdf"
    path.write_text(text)
    (found,) = read_robot(path).impossible
    assert (found.what, found.body, found.line) == (what, body, line)
    assert found.by_how_much == pytest.approx(by_how_much) if by_how_much else found.by_how_much > 0


def test_sound_inertias_and_flat_ones_are_not_named(tmp_path: Path) -> None:
    path = tmp_path / "one.urdf"
    for moments in (("0.3", "0.4", "0.5"), ("0.1", "0.2", "0.3"), ("0.7", "0.1", "0.6"), ("0.2", "0.2", "0")):
        text = TEXT
        for old, new in zip(('ixx="0.3"', 'iyy="0.4"', 'izz="0.5"'), moments, strict=True):
            text = text.replace(old, f'{old[:5]}{new}"')
        path.write_text(text)
        assert read_robot(path).impossible == ()


def test_a_point_is_named_where_a_joint_moves_it_alone(tmp_path: Path) -> None:
    path = tmp_path / "one.urdf"
    path.write_text(TEXT.replace('ixx="0.1" iyy="0.1" izz="0.1"', 'ixx="0" iyy="0" izz="0"'))
    assert read_robot(path).impossible == ()
    path.write_text(TEXT.replace('type="fixed"', 'type="revolute"').replace('ixx="0.1" iyy="0.1" izz="0.1"', 'ixx="0" iyy="0" izz="0"'))
    assert [(one.what, one.body) for one in read_robot(path).impossible] == [("no inertia", "lower")]


def second(moments: np.ndarray) -> np.ndarray:
    matrix = np.array(square(moments))
    return np.trace(matrix) / 2 * np.eye(3) - matrix


@pytest.mark.ci
@given(st.lists(st.floats(-1, 1), min_size=6, max_size=6), st.lists(st.floats(-1, 1), min_size=9, max_size=9))
def test_the_nearest_inertia_is_one_of_a_body_and_none_is_nearer(moments: list[float], factor: list[float]) -> None:
    given_one, nearest = second(np.array(moments)), second(np.array(nearest_inertia(moments)))
    assert np.linalg.eigvalsh(nearest).min() > -1e-14
    # Any positive semidefinite matrix is F F'; between it and the nearest one all are, and their distance does not fall.
    other = np.reshape(factor, (3, 3)) @ np.reshape(factor, (3, 3)).T
    assume(np.abs(other - nearest).max() > 1e-6)
    assert np.sum((given_one - nearest) * (other - nearest)) <= 1e-12
