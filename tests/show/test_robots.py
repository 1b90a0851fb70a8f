"""Robots are drawn where an engine places them, by their files alone."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from support import BUILT_IN, InThisProcess, completed

from harness.comparison.robot_library import RobotLibrary, robot_at
from harness.engines import load_model, select_subjects
from harness.files.model_file import read_model
from harness.lagrange.derivation import load_mechanism
from harness.library import robots_folder
from harness.report.markup import picture, thumbnail
from harness.show.gallery import Gallery
from harness.show.placement import Pose
from harness.show.robots import draw_robot, middle, pose_of

FOLDER = robots_folder(BUILT_IN)


@pytest.mark.parametrize("name", ["arm.urdf", "quadruped.urdf"])
def test_every_joint_and_centre_of_mass_is_where_mujoco_has_it(name: str) -> None:
    path = FOLDER / name
    mechanism = load_mechanism(RobotLibrary.of([str(path)]), str(path))
    [subject] = select_subjects(BUILT_IN, ["mujoco/urdf"])
    model = load_model(BUILT_IN, subject, mechanism, read_model(path, "urdf"))
    tree = robot_at(path).tree
    positions = {joint.name: Fraction(number + 1, 16) for number, joint in enumerate(tree.joints) if joint.kind.is_single}
    drawn = pose_of(tree, {joint.name: positions.get(joint.name, Fraction(0)) for joint in tree.joints})
    held = Pose.of(model.held({joint: float(position) for joint, position in positions.items()}, {}))  # type: ignore[attr-defined]
    assert drawn.joints.keys() == held.joints.keys()
    for joint in drawn.joints:
        for part in ("anchor", "moved", "axis"):
            np.testing.assert_allclose(getattr(drawn.joints[joint], part), getattr(held.joints[joint], part), atol=1e-12)
        ours, theirs = (pose.bodies[pose.body_of[joint]] for pose in (drawn, held))
        assert ours.mass == theirs.mass
        np.testing.assert_allclose(ours.centre, theirs.centre, atol=1e-12)


@pytest.mark.parametrize("path", sorted(FOLDER.iterdir()), ids=lambda path: path.name)
def test_every_robot_has_a_picture_and_a_thumbnail(path: Path) -> None:
    [found] = completed(Gallery(BUILT_IN, [], robots=[path]), InThisProcess()).pictures
    drawn, small = picture(found.svg), thumbnail(found.svg)
    assert found.system == str(path) and drawn is not None and all(joint.name in drawn for joint in robot_at(path).tree.joints)
    assert "thumbnail" in small and "<text" not in small and len(small) < len(drawn)


def test_a_finger_that_mimics_another_is_drawn_where_that_leads_it_and_joints_begin_within_their_limits() -> None:
    tree = robot_at(FOLDER / "gripper.urdf").tree
    still, moved = (pose_of(tree, {joint.name: Fraction(step) for joint in tree.joints}) for step in (0, 0.03))
    left, right = (moved.joints[f"{side}_slide"].moved - moved.joints[f"{side}_slide"].anchor for side in ("left", "right"))
    np.testing.assert_allclose(left, -right, atol=1e-15)
    assert np.linalg.norm(left) == pytest.approx(0.03) and np.linalg.norm(still.bodies[-1].centre) > 0
    knees = [joint for joint in robot_at(FOLDER / "quadruped.urdf").tree.joints if "knee" in joint.name]
    assert {float(middle(joint)) for joint in knees} == {-1.6}


def test_a_file_in_which_nothing_moves_has_no_picture(tmp_path: Path) -> None:
    (tmp_path / "still.urdf").write_text('<robot name="still"><link name="base"/></robot>')
    assert draw_robot(tmp_path / "still.urdf", print) == ""
