"""Every robot's file of this repository, by the engines that are installed with the harness."""

from __future__ import annotations

from pathlib import Path

import pytest
from catalogue import ROBOTS
from comparison.robots import record_of

# Moments of inertia that no body can have are refused by MuJoCo, and what Pinocchio's reader does not find by itself.
REFUSED = {("impossible.urdf", "mujoco"), ("humanoid.xml", "pinocchio")}


@pytest.mark.parametrize("engine", ["mujoco", "pinocchio"])
@pytest.mark.parametrize("path", ROBOTS, ids=lambda path: f"{path.parent.parent.name}-{path.name}")
def test_a_plain_answer_agrees_or_is_explained_or_refused(path: Path, engine: str) -> None:
    record, case = record_of(path, engine), (path.name, engine)
    assert (record.verdict == "unsupported") == (case in REFUSED)
    assert record.explained, record
