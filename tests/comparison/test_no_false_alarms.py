"""A million states at which nothing is wrong: over mechanisms with actuators, dry friction and limits, and 30 robots with all of these on.

Contacts are off. An answer agrees, loses digits, or is explained by a reading, a departure or a solver that stops early; none is wrong.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from catalogue import BUILT_IN
from trees.test_robots_of_others import robots

from harness.comparison.robot_library import robot_at
from harness.comparison.switched_on import pose, with_verdict
from harness.crosscheck.assignment import Assignment
from harness.engines import Subject
from harness.explain.meant import meant
from harness.files.findings import CONTACTS
from harness.truth.sampling import sample
from harness.verdict import Verdict

pytestmark = [pytest.mark.nightly(nights=7), pytest.mark.robots]

MECHANISMS = ("dry_pendulum", "limited_pendulum", "geared_motor", "servo_arm", "tendon_finger")
# Of dm_control's suite, and of example-robot-data.
SUITE = (
    "acrobot", "ball_in_cup", "cartpole", "cheetah", "finger", "fish", "hopper", "humanoid", "manipulator", "pendulum", "point_mass",
    "quadruped", "reacher", "stacker", "walker",
)  # fmt: skip
URDFS = (
    "a1", "alexander_v1.lowerBodyOnly", "baxter", "bolt", "centauro", "hextilt_flying_arm_5", "kinova", "laikago", "panda", "solo12",
    "talos_left_arm", "talos_reduced", "ur5_robot", "xarm7", "z1",
)  # fmt: skip
# States of a batch, and batches of each.
STATES, BATCHES = 2048, 14
SOUND = {Verdict.AGREES.value, Verdict.EXPLAINED.value, Verdict.UNSTABLE.value}


def paths() -> Iterator[Path]:
    """The files of the robots by name; none where the extra is not installed, which each test then says."""
    known = {path.name: path for path in robots()}
    for name in (*(f"{stem}.xml" for stem in SUITE), *(f"{stem}.urdf" for stem in URDFS)):
        if known:
            yield known[name]


def test_they_are_a_million() -> None:
    assert len(MECHANISMS) == 5 and len(SUITE) + len(URDFS) == 30
    assert (len(MECHANISMS) + len(SUITE) + len(URDFS)) * STATES * BATCHES >= 1_000_000


@pytest.mark.parametrize("seed", range(BATCHES))
@pytest.mark.parametrize("name", MECHANISMS)
def test_a_sound_answer_about_a_mechanism_is_none_that_is_wrong(name: str, seed: int) -> None:
    for subject in (Subject("lagrange", "equations"), Subject("mujoco", "mjcf"), Subject("mujoco", "urdf"), Subject("pinocchio", "mjcf")):
        assignment = Assignment.of(BUILT_IN, name, subject)
        states = assignment.truth.asked_at(sample(assignment.mechanism, STATES, 1000 + seed))
        truth = assignment.truth.evaluate(states)
        assert truth.certified.all(), subject
        verdicts = assignment.judge(states, truth).verdicts
        assert set(verdicts.tolist()) <= SOUND, (str(subject), verdicts)


@pytest.mark.parametrize("seed", range(BATCHES))
@pytest.mark.parametrize("path", list(paths()) or [None], ids=lambda path: path.stem if path else "none")
def test_a_sound_answer_about_a_robot_is_none_that_is_wrong(path: Path | None, seed: int) -> None:
    assert path is not None, "no robots are installed; install the extra: pip install 'rigid-body-harness[robots]'"
    record, posed = pose(meant(robot_at(path), STATES, 1000 + seed), "mujoco", without=(CONTACTS,))
    assert posed is not None and len(posed.case.at.states) == STATES, record.message
    record = with_verdict(record, posed.case, posed.asked, posed.answers, names=False)
    assert record.explained, (record.backward_error, record.message)
