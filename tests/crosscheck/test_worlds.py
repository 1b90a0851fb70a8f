"""Equal worlds: whether a batch of one state gets the same bits in every row, in every run, and by itself."""

from __future__ import annotations

from pathlib import Path

import pytest
from studies import assignment_of
from support import InThisProcess, completed, harness, make_library

from harness.crosscheck.run import CrossCheck
from harness.crosscheck.settings import Settings
from harness.crosscheck.worlds import equal_worlds
from harness.library import Library
from harness.results.cross_check import CrossCheckResult

ENGINE = """
import numpy as np

from harness.engines.adapters.mujoco import MujocoEngine


class Engine(MujocoEngine):
    formats = ("mjcf",)

    def load(self, source, joints, gravity):
        loaded = super().load(source, joints, gravity)
        answer, asked = loaded.forward_dynamics, []

        def changed(q, v, tau, *driving):
            asked.append(len(q))
            found = answer(q, v, tau, *driving)
            return found * (1 + 2.0**-50 * ({where}))

        loaded.forward_dynamics = changed
        return loaded


ENGINE = Engine()
"""
# Where an answer is another by four ulps, and what is said of it.
UNEQUAL = {
    "a world": ("(np.arange(len(q)) == 17)[:, None]", "world 17 from world 0 of 64 by"),
    "a run": ("asked.count(64) % 2 * (len(q) == 64)", "a second run from the first in world"),
    "a batch": ("len(q) == 64", "a world by itself from world 0 of 64 by"),
}


def checked(library: Library, subject: str) -> CrossCheckResult:
    settings = Settings(library=library, names=["double_pendulum"], subjects=[subject], states=8, worlds=64, examples=None)
    return completed(CrossCheck(settings), InThisProcess())


@pytest.mark.ci
@pytest.mark.parametrize("fault", UNEQUAL)
def test_unequal_worlds_are_named_with_their_difference(fault: str, tmp_path: Path) -> None:
    where, said = UNEQUAL[fault]
    library = Library.at(make_library(tmp_path / "library", ["double_pendulum"], {"uneven": ENGINE.replace("{where}", where)}))
    found = checked(library, "uneven/mjcf")
    (record,) = found.records
    assert record.verdict == "agrees" and "Equal worlds differ: " in record.message and said in record.message
    assert record.unequal_worlds is not None and 2.0**-52 <= record.unequal_worlds <= 2.0**-49
    assert "equal worlds differ in 1 of 1: " in found.conclusion()


def test_worlds_of_our_engines_are_equal_to_the_last_bit() -> None:
    for subject in ("lagrange", "mujoco/mjcf", "pinocchio/urdf"):
        size, said = equal_worlds(assignment_of("double_pendulum", subject), 1000, seed=0)
        assert size == 0.0 and said.startswith("1,000 equal worlds answer with the same bits")


def test_the_first_line_says_it() -> None:
    done = harness("check", "double_pendulum", "--subject", "lagrange", "--states", "4", "--quantity", "accelerations", "--worlds", "8")
    assert done.stdout.splitlines()[0] == "double_pendulum: lagrange agrees; equal worlds answer with the same bits."


def test_nobody_is_asked_who_was_not_to_be() -> None:
    settings = Settings(library=Library.built_in(), names=["double_pendulum"], subjects=["mujoco/mjcf"], states=8, examples=None)
    found = completed(CrossCheck(settings), InThisProcess())
    assert found.records[0].unequal_worlds is None and "worlds" not in found.conclusion()
