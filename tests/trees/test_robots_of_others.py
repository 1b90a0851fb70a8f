"""Every robot of ``example-robot-data`` and of ``dm_control``'s suite is read, or refused by name. Needs the extra ``robots``."""

from __future__ import annotations

import importlib.util
from importlib.metadata import distribution
from pathlib import Path

import mujoco
import numpy as np
import pytest
from support_robots import by_mujoco, by_pinocchio, only_single_axes
from trees.test_actuators import judged, worst
from trees.test_friction_and_limits import shares_of_a_file

from harness.comparison.robot_library import robot_at
from harness.comparison.switched_on import judge_switched_on
from harness.errors import InvalidModel
from harness.explain.meant import meant
from harness.explain.switches import has_switches
from harness.trees.mechanism import mechanism_of
from harness.truth.compare import compare
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import sample
from harness.verdict import AGREEMENT

pytestmark = [pytest.mark.nightly, pytest.mark.robots]

STATES = 8
SEED = 3
# Data roundoffs. What a verdict allows is 64; readers round the inertias of several geoms as they join them, which costs more.
ALLOWED = {"urdf": 64.0, "mjcf": 128.0}
# Mimics a joint that the file does not have; has no link at all.
REFUSED = {"alex_psyonic_hands.urdf": "names nothing in this file", "ur3.urdf": "has no link"}


def robots() -> list[Path]:
    """The files of both collections; none where the extra is not installed, which each test then says."""
    found: list[Path] = []
    if importlib.util.find_spec("dm_control"):
        suite = Path(str(importlib.util.find_spec("dm_control").submodule_search_locations[0])) / "suite"  # type: ignore[union-attr, index]
        found += sorted(suite.glob("*.xml"))
    try:
        files = distribution("example-robot-data").files or []
    except ImportError:
        files = []
    return [*found, *sorted(Path(str(file.locate())) for file in files if file.suffix == ".urdf")]


@pytest.mark.parametrize("path", robots() or [None], ids=lambda path: path.name if path else "none")
def test_a_robot_is_read_as_its_engine_compiles_it_or_refused_by_name(path: Path | None) -> None:
    assert path is not None, "no robots are installed; install the extra: pip install 'rigid-body-harness[robots]'"
    try:
        robot = robot_at(path)
    except InvalidModel as error:
        assert error.path == path and error.line is not None
        assert path.name in REFUSED and REFUSED[path.name] in error.problem, error
        return
    if not robot.joints or (robot.format == "urdf" and not only_single_axes(robot)):
        return
    reference = ReferenceKernel(mechanism_of(robot))
    states = sample(reference.mechanism, STATES, SEED)
    if robot.format == "mjcf":
        model = mujoco.MjModel.from_xml_path(str(path))
        np.testing.assert_allclose(robot.total_mass, mujoco.mj_getTotalmass(model), rtol=1e-14)
        answers = by_mujoco(model, states)
    else:
        answers = by_pinocchio(path, robot, states)
    truth = reference.evaluate(states)
    if any(one.what == "indefinite inertia" for one in robot.impossible):
        # M need not be positive definite, so that nothing measures an error in it.
        return
    assert truth.certified.all()
    assert compare(truth, answers).backward_error.max() < ALLOWED[robot.format]


@pytest.mark.parametrize(
    "path", [path for path in robots() if path.suffix == ".xml"] or [None], ids=lambda path: path.name if path else "none"
)
def test_mujoco_agrees_with_the_actuators_of_a_robot_that_are_read(path: Path | None) -> None:
    assert path is not None, "no robots are installed; install the extra: pip install 'rigid-body-harness[robots]'"
    robot = robot_at(path)
    # One has no joint: its task adds them.
    if robot.joints:
        assert all(one.why_not or one.gain for one in robot.actuators)
        assert worst(judged(path, robot)) <= AGREEMENT


@pytest.mark.parametrize("path", robots() or [None], ids=lambda path: path.name if path else "none")
def test_mujoco_with_all_on_that_is_judged_is_explained(path: Path | None) -> None:
    """What a file's user has, but for contacts and what is refused by name: it agrees, or is a departure or a solver that stops early."""
    assert path is not None, "no robots are installed; install the extra: pip install 'rigid-body-harness[robots]'"
    if path.name in REFUSED:
        return
    found = meant(robot_at(path), STATES, SEED)
    if found.certified is None or not has_switches(found.robot):
        return
    record = judge_switched_on(found, "mujoco")
    assert record.explained, (record.message, record.rest)


@pytest.mark.parametrize("name", ["humanoid", "cheetah", "walker", "hopper", "finger", "manipulator", "quadruped"])
def test_friction_and_limits_of_joints_are_those_of_active_sets(name: str) -> None:
    """By the certified optimum, at 50 digits; the humanoid has 27 velocities."""
    [path] = [path for path in robots() if path.name == f"{name}.xml"]
    assert shares_of_a_file(path, 50).max() <= 1
