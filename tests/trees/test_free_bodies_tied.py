"""Bodies kept free under the constraints of a file: against the certified rigid equations, and by what each kind of row says."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import flint
import numpy as np
import pytest
from catalogue import BUILT_IN, MODELS, is_tied
from free_bodies import FreeBodies, free_bodies
from support_constraints import by_reduction

from harness.arrays import Array
from harness.files.model_file import parse_model, read_model
from harness.lagrange.derivation import load_mechanism
from harness.programs.mechanisms.constraint_forces import Tied, by_multipliers, constrained_program
from harness.programs.states import States
from harness.programs.terms import Vector
from harness.trees.bodies.spatial import FileProgram
from harness.trees.mechanism import accelerations_of, independent_rows, tied_tree
from harness.trees.recursion import recursion_program
from harness.trees.robot import read_robot, tree_of
from harness.trees.rows import untied
from harness.truth.compare import compare
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import sample

STATES = 5
BITS = 192
SEED = 11
TIED = [(name, model_format) for name, model_format in MODELS if is_tied(BUILT_IN.system_of(name))]
# A crank that a second bar follows by a parabola, and a weld that holds a third to the world.
TWO_BARS = """<mujoco>
  <worldbody>
    <body name="leader"><joint name="leader" axis="0 -1 0"/><inertial pos="0.3 0 0.1" mass="2" diaginertia="0.1 0.2 0.25"/>
      <body name="other" pos="0.5 0 0"><joint name="other" axis="0 0 1"/><inertial pos="0.2 0 0" mass="1" diaginertia="0.1 0.1 0.15"/>
        <site name="tip" pos="0.4 0 0"/>
      </body>
    </body>
    <site name="nail" pos="0.9 0 0"/>
  </worldbody>
  <equality>{}</equality>
</mujoco>
"""
WELD = '<weld name="held" site1="tip" site2="nail" torquescale="0.5"/>'
PARABOLA = '<joint name="cam" joint1="other" joint2="leader" polycoef="0.1 0.5 0.25 0.125 0"/>'


def solved(equations: FreeBodies, states: States) -> list[Mapping[str, list[Any]]]:
    with flint.ctx.workprec(BITS):
        bound = equations.bind()
        rows = (np.concatenate([states.q[row], states.v[row], states.tau[row], [0.0]]).tolist() for row in range(len(states)))
        return [bound.solve(row) for row in rows]


def equations_of(name: str, model_format: str) -> FreeBodies:
    mechanism = load_mechanism(BUILT_IN, name)
    model = read_model(BUILT_IN.model_path(name, model_format), model_format)
    return free_bodies(tree_of(model, mechanism.gravity), mechanism.joints, constraints=model.constraints)


def assert_accelerations_are_the_certified_ones(name: str, model_format: str) -> None:
    """To the rounding of the decimals in the file, with balls that are far smaller."""
    mechanism = load_mechanism(BUILT_IN, name)
    states = sample(mechanism, STATES, SEED)
    free = solved(equations_of(name, model_format), states)
    comparison = compare(ReferenceKernel(mechanism).evaluate(states), np.array([[float(a) for a in one["accelerations"]] for one in free]))
    assert set(comparison.verdicts.tolist()) == {"agrees"} and comparison.backward_error.max() < 4
    assert all(a.rad() <= 1e-30 * (1 + abs(float(a))) for one in free for a in one["accelerations"])


@pytest.mark.parametrize("name", ["four_bar", "cycloid_bead"])
@pytest.mark.parametrize("model_format", ["mjcf", "urdf"])
def test_a_loop_and_a_coupling_move_as_their_energies_say(name: str, model_format: str) -> None:
    assert_accelerations_are_the_certified_ones(name, model_format)


@pytest.mark.parametrize(("name", "model_format"), TIED)
def test_every_mechanism_with_constraints_moves_as_its_energies_say(name: str, model_format: str) -> None:
    assert_accelerations_are_the_certified_ones(name, model_format)


def test_redundant_rows_leave_reactions_open_and_a_row_without_motion_bears_nothing() -> None:
    for name, is_determined in (("four_bar", True), ("parallelogram", False)):
        mechanism = load_mechanism(BUILT_IN, name)
        assert mechanism.constraints is not None
        equations = equations_of(name, "mjcf")
        [found] = solved(equations, sample(mechanism, 1, SEED))
        assert ("forces" in found, "moments" in found) == (is_determined, is_determined)
        # The forces of constraints are determined either way, and hold what the tree's own would do.
        assert all(force.is_finite() for force in found["constraint forces"])


def test_constraint_forces_are_what_the_tree_lacks() -> None:
    mechanism = load_mechanism(BUILT_IN, "parallelogram")
    states = sample(mechanism, STATES, SEED)
    model = read_model(BUILT_IN.model_path("parallelogram", "mjcf"), "mjcf")
    tied = solved(equations_of("parallelogram", "mjcf"), states)
    forces = np.array([[float(force) for force in one["constraint forces"]] for one in tied])
    # Applied to the tree from outside, they give the same accelerations.
    moved = States.at(states.q, states.v, states.tau + forces)
    tree = solved(free_bodies(tree_of(model, mechanism.gravity), mechanism.joints), moved)
    mine, others = (np.array([[float(a) for a in one["accelerations"]] for one in found]) for found in (tied, tree))
    np.testing.assert_allclose(mine, others, rtol=1e-12, atol=1e-12 * np.abs(mine).max())


def held(equality: str, q: list[float], v: list[float]) -> tuple[FreeBodies, Mapping[str, list[Any]]]:
    model = parse_model(Path("two_bars.xml"), TWO_BARS.format(equality), "mjcf")
    equations = free_bodies(tree_of(model, 0.0), ("leader", "other"), constraints=model.constraints)
    [found] = solved(equations, States.at(np.array([q]), np.array([v]), np.array([[3.0, -2.0]])))
    return equations, found


def test_a_weld_to_the_world_holds_every_direction_that_moves() -> None:
    equations, found = held(WELD, [0.0, 0.0], [0.0, 0.0])
    assert len(equations.constraints) == 6
    assert all(abs(float(a)) < 1e-30 for a in found["accelerations"])
    # Applied forces and the weight (MuJoCo's default, 9.81) are borne by the weld.
    weight = 9.81 * (2 * 0.3 + 1 * 0.7)
    np.testing.assert_allclose([float(force) for force in found["constraint forces"]], [-3.0 + weight, 2.0], rtol=1e-14)


def test_a_coupling_by_a_polynomial_has_its_slope_and_its_curvature() -> None:
    x, rate = 0.75, 1.5
    slope, curvature = 0.5 + 0.5 * x + 0.375 * x**2, 0.5 + 0.75 * x
    position = 0.1 + 0.5 * x + 0.25 * x**2 + 0.125 * x**3
    _, found = held(PARABOLA, [x, position], [rate, slope * rate])
    leader, other = (float(a) for a in found["accelerations"])
    assert other == pytest.approx(slope * leader + curvature * rate**2, rel=1e-14)
    first, second = (float(force) for force in found["constraint forces"])
    assert first == pytest.approx(-slope * second, rel=1e-14)


def test_tendons_have_no_rows() -> None:
    tendon = TWO_BARS.format('<tendon name="tied" tendon1="both"/>')
    text = tendon.replace("<equality>", '<tendon><fixed name="both"><joint joint="leader" coef="1"/></fixed></tendon><equality>')
    model = parse_model(Path("two_bars.xml"), text, "mjcf")
    with pytest.raises(ValueError, match=r"line \d+: constraint 'tied' couples tendons"):
        free_bodies(tree_of(model, 0.0), ("leader", "other"), constraints=model.constraints)


def test_rows_are_chosen_independent_and_as_many_as_there_are() -> None:
    rows = np.array([[1.0, 2.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1e-6, 1e-6], [1.0, 3.0, 1.0], [0.0, 0.0, 1e-30]])
    moving, chosen = independent_rows(rows)
    assert moving == [0, 2, 3] and len(chosen) == 2 and set(chosen) < set(moving)
    assert np.linalg.matrix_rank(rows[chosen]) == 2
    assert independent_rows(np.empty((0, 3))) == ([], [])


FILES = Path(__file__).parents[1] / "comparison" / "files"
MIMIC_STATES = 8


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
    q, v, tau = (short((MIMIC_STATES, len(own)), rng) for _ in range(3))
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
