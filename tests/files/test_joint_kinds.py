"""What is declared of a kind of joint fits together."""

from __future__ import annotations

import pickle

import pytest

from harness.files.joint_kinds import JointKind


@pytest.mark.parametrize("kind", JointKind)
def test_a_kind_has_a_position_for_each_velocity_and_one_more_for_an_attitude(kind: JointKind) -> None:
    assert kind.positions == kind.velocities + kind.has_attitude
    assert kind.has_axis != kind.has_attitude
    assert kind.is_single == (kind.sizes == (1, 1))


@pytest.mark.parametrize("kind", JointKind)
def test_linear_velocities_stand_before_angular_ones_of_which_an_attitude_has_three(kind: JointKind) -> None:
    assert kind.turning == tuple(sorted(kind.turning))
    assert kind.turning.count(False) == kind.linear
    assert kind.turning.count(True) == 3 or not kind.has_attitude


@pytest.mark.parametrize("kind", JointKind)
def test_a_kind_is_its_word_and_crosses_to_another_process(kind: JointKind) -> None:
    assert JointKind(str(kind)) is pickle.loads(pickle.dumps(kind)) is kind
