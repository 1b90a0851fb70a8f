"""The rows of equalities: held rigid, joints that mimic another move as those that share a velocity with it do."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from harness.arrays import Array
from harness.programs.mechanisms.constraint_forces import Tied, by_multipliers, by_reduction, constrained_program
from harness.programs.states import States
from harness.programs.terms import Vector
from harness.trees.bodies.spatial import FileProgram
from harness.trees.mechanism import accelerations_of, tied_tree
from harness.trees.recursion import recursion_program
from harness.trees.robot import read_robot
from harness.trees.rows import untied

FILES = Path(__file__).parents[1] / "comparison" / "files"
STATES = 8


def short(size: tuple[int, int], rng: np.random.Generator) -> Array:
    """Numbers of few bits, so that multiples of them are exact."""
    return np.round(rng.uniform(-1, 1, size) * 64) / 64


@pytest.mark.parametrize("way", [by_multipliers, by_reduction])
@pytest.mark.parametrize("name", ["four_bar.urdf", "mimic.urdf"])
def test_followers_held_by_forces_move_as_those_that_share_a_velocity(name: str, way: Callable[[Tied], tuple[Vector, Vector]]) -> None:
    robot = read_robot(FILES / name)
    joints = robot.tree.joints
    names = [joint.name for joint in joints]
    rng = np.random.default_rng(7)
    own = {leader: place for place, leader in enumerate(robot.joints)}
    q, v, tau = (short((STATES, len(own)), rng) for _ in range(3))
    shared = accelerations_of(recursion_program(robot.tree, robot.joints), States.at(q, v, tau))

    leaders = [own[joint.follows or joint.name] for joint in joints]
    multiples, offsets = (np.array([float(getattr(joint, key)) for joint in joints]) for key in ("multiplier", "offset"))
    loaded = np.where([not joint.follows for joint in joints], tau[:, leaders], 0.0)
    states = States.at(multiples * q[:, leaders] + offsets, multiples * v[:, leaders], loaded)
    equalities = {f"mimic {number}": one.rows for number, one in enumerate(robot.equalities)}
    followers = [names.index(one.rows.joint) for one in robot.equalities]  # type: ignore[union-attr]
    tied = tied_tree(untied(robot.tree, names), names, equalities, followers)
    tied.constraints.checked(len(names))
    held = accelerations_of(FileProgram(constrained_program(tied.constraints, way), tied.parameters), states)

    np.testing.assert_allclose(held, multiples * shared[:, leaders], rtol=1e-15)
    # Without the forces they move otherwise.
    free = accelerations_of(FileProgram(tied.constraints.tree, tied.parameters), states)
    assert abs(free - held).max() > 1e-2
