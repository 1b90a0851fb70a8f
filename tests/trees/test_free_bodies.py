"""Bodies kept free against the recursion, Lagrange's equations, and the engines' own reactions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import flint
import numpy as np
import pytest
from catalogue import BUILT_IN, MODELS, is_tied
from free_bodies import free_bodies
from robot_files import EVERYTHING, URDF_WITH_EVERYTHING

from harness.arrays import Array
from harness.engines import load_engine
from harness.files.model_file import ModelFile, parse_model, read_model
from harness.files.tree import Tree
from harness.lagrange.derivation import load_mechanism
from harness.programs import evaluation
from harness.programs.evaluation import mass_matrix
from harness.programs.program import right_hand_side
from harness.programs.states import States
from harness.trees.quantities import forces
from harness.trees.quantities.motion import computed, have_same_points, tree_motion
from harness.trees.recursion import recursion_program
from harness.trees.robot import read_robot, tree_of
from harness.truth.compare import compare
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import generic_sample

STATES = 5
BITS = 192
SEED = 11
# A file that closes loops or ties joints moves otherwise than its tree.
TREES = [(name, model_format) for name, model_format in MODELS if not is_tied(BUILT_IN.system_of(name))]
Balls = Mapping[str, list[Any]]


def given(states: States, row: int) -> list[float]:
    return [*states.q[row].tolist(), *states.v[row].tolist(), *states.tau[row].tolist(), float(states.time[row])]


def solved(tree: Tree, joints: Sequence[str], states: States, in_body: bool = False) -> list[Balls]:
    """What the free bodies say at each state, in balls."""
    with flint.ctx.workprec(BITS):
        bound = free_bodies(tree, joints, in_body).bind()
        return [bound.solve(given(states, row)) for row in range(len(states))]


def by_recursion(tree: Tree, joints: Sequence[str], states: States, in_body: bool = False) -> list[list[Any]]:
    """Accelerations at each state, in balls."""
    nv, found = states.v.shape[1], []
    with flint.ctx.workprec(BITS):
        evaluate = recursion_program(tree, joints, in_body).in_balls()
        for row in range(len(states)):
            outputs = evaluate(*given(states, row))
            force = right_hand_side(outputs, [flint.arb(applied) for applied in states.tau[row].tolist()])
            found.append(evaluation.solved(mass_matrix(outputs["mass"], nv), force))
    return found


def swept(tree: Tree, joints: Sequence[str], states: States, free: list[Balls], in_body: bool = False) -> tuple[list[str], list[Any]]:
    """The reactions by the sums over bodies, (2, joints, 3) with forces first, at the accelerations that the free bodies have."""
    names, found = forces.transmitting_joints(tree), []
    with flint.ctx.workprec(BITS):
        evaluate = computed(tree_motion(tree, joints, in_body), forces.reactions).in_balls()
        for row, one in enumerate(free):
            inputs = given(states, row)
            values = evaluate(*inputs[: -states.v.shape[1] - 1], *one["accelerations"], inputs[-1])["values"]
            found.append(np.array(values, dtype=object).reshape(2, len(names), 3))
    return names, found


def assert_enclose_each_other(tree: Tree, joints: Sequence[str], states: States, in_body: bool = False) -> None:
    """Accelerations with the recursion, and reactions with the sums over bodies."""
    free = solved(tree, joints, states, in_body)
    for one, other in zip(free, by_recursion(tree, joints, states, in_body), strict=True):
        for a, b in zip(one["accelerations"], other, strict=True):
            assert a.overlaps(b)
            assert a.rad() <= 1e-40 * (1 + abs(float(a))), "a ball that holds everything encloses anything"
    equations = free_bodies(tree, joints, in_body)
    names = [name for name in equations.joints if not {joint.name: joint for joint in tree.joints}[name].follows]
    if not names:
        return
    transmitting, sums = swept(tree, joints, states, free, in_body)
    assert sorted(transmitting) == sorted(names)
    for one, other in zip(free, sums, strict=True):
        for kind, vectors in zip(("forces", "moments"), other, strict=True):
            for name, vector in zip(transmitting, vectors, strict=True):
                first = 3 * equations.joints.index(name)
                pairs = zip(one[kind][first : first + 3], vector, strict=True)
                assert all(a.overlaps(b) for a, b in pairs), (kind, name)


@pytest.mark.parametrize(("name", "model_format"), TREES)
def test_bodies_kept_free_enclose_the_recursion_and_reactions_the_sums_over_bodies(name: str, model_format: str) -> None:
    mechanism = load_mechanism(BUILT_IN, name)
    tree = tree_of(read_model(BUILT_IN.model_path(name, model_format), model_format), mechanism.gravity)
    states = generic_sample(mechanism, STATES, SEED)
    assert_enclose_each_other(tree, mechanism.joints, states)
    if mechanism.charts_in_body:
        assert_enclose_each_other(tree, mechanism.joints, states, in_body=True)


@pytest.mark.parametrize(("name", "model_format"), TREES)
def test_bodies_kept_free_and_energies_agree_to_the_rounding_of_the_decimals(name: str, model_format: str) -> None:
    mechanism = load_mechanism(BUILT_IN, name)
    tree = tree_of(read_model(BUILT_IN.model_path(name, model_format), model_format), mechanism.gravity)
    states = generic_sample(mechanism, STATES, SEED)
    found = np.array([[float(ball) for ball in one["accelerations"]] for one in solved(tree, mechanism.joints, states)])
    assert compare(ReferenceKernel(mechanism).evaluate(states), found).backward_error.max() < 4


def everything(tmp_path: Path) -> tuple[ModelFile, Tree, tuple[str, ...], States]:
    """Two joints of one body, a ball joint, joints off the axes and the origins, bodies fixed to others, and a spring to the world."""
    model = parse_model(tmp_path / "everything.xml", EVERYTHING, "mjcf")
    random = np.random.default_rng(SEED)
    q, v, tau = random.normal(size=(STATES, 7)), random.normal(size=(STATES, 6)), random.normal(size=(STATES, 6))
    q[:, 2:6] /= np.linalg.norm(q[:, 2:6], axis=1, keepdims=True)
    return model, tree_of(model, 0.0), ("first", "second", "third", "third", "third", "fourth"), States.at(q, v, tau)


def test_every_kind_of_frame(tmp_path: Path) -> None:
    _, tree, joints, states = everything(tmp_path)
    assert_enclose_each_other(tree, joints, states)


@pytest.mark.ci
@pytest.mark.parametrize("kind", ["revolute", "prismatic", "planar", "floating"])
@pytest.mark.parametrize("in_body", [False, True])
def test_every_kind_of_joint_in_the_middle_of_a_robot(tmp_path: Path, kind: str, in_body: bool) -> None:
    size = {"planar": 3, "floating": 6}.get(kind, 1)
    (tmp_path / "robot.urdf").write_text(URDF_WITH_EVERYTHING.replace('name="second" type="prismatic"', f'name="second" type="{kind}"'))
    tree = read_robot(tmp_path / "robot.urdf").tree
    joints = ("first", *["second"] * size, "third")
    random = np.random.default_rng(SEED)
    q = random.normal(size=(STATES, 2 + size + (kind == "floating")))
    assert_enclose_each_other(tree, joints, States.at(q, *random.normal(size=(2, STATES, 2 + size))), in_body)


@pytest.mark.parametrize("followers", [("second",), ("third",), ("second", "third")])
def test_joints_that_follow_another(tmp_path: Path, followers: tuple[str, ...]) -> None:
    """What a joint that follows transmits is unknown in all six components; the one it follows bears the rest."""
    text = URDF_WITH_EVERYTHING
    for name, factor in zip(followers, (-0.5, 1.5), strict=False):
        place = text.index("</joint>", text.index(f'name="{name}"'))
        text = f'{text[:place]}<mimic joint="first" multiplier="{factor}" offset="0.25"/>{text[place:]}'
    model = parse_model(tmp_path / "mimic.urdf", text, "urdf")
    nv = 3 - len(followers)
    joints = tuple(name for name in ("first", "second", "third") if name not in followers)
    states = States.at(*np.random.default_rng(SEED).normal(size=(3, STATES, nv)))
    assert_enclose_each_other(tree_of(model, 9.81), joints, states)


@pytest.mark.ci
def test_a_tree_has_six_equations_a_body_and_one_a_reaction() -> None:
    for name, size, rows in (("arm_2r", 22, 10), ("free_body", 6, 0), ("heavy_top", 9, 3), ("satellite_wheel", 17, 5)):
        mechanism = load_mechanism(BUILT_IN, name)
        equations = free_bodies(tree_of(read_model(BUILT_IN.model_path(name, "mjcf"), "mjcf"), mechanism.gravity), mechanism.joints)
        assert (equations.size, equations.rows) == (size, rows)


def test_other_joints_than_those_of_the_tree_are_refused(tmp_path: Path) -> None:
    _, tree, _, _ = everything(tmp_path)
    with pytest.raises(ValueError, match=r"the tree has the joints .*'third'.*; expected .*'last'"):
        free_bodies(tree, ("first", "second", "last"))


def largest_difference(tree: Tree, joints: Sequence[str], states: States, answers: Array) -> float:
    """Of an engine's reactions from those of the free bodies, relative to the largest force and moment."""
    names = free_bodies(tree, joints).joints
    order = [list(dict.fromkeys(joints)).index(name) for name in names]
    free = solved(tree, joints, states)
    mine = np.array([[[float(ball) for ball in one[kind]] for kind in ("forces", "moments")] for one in free])
    mine = mine.reshape(len(states), 2, len(names), 3).transpose(0, 2, 1, 3).reshape(len(states), len(names), 6)
    return float(np.abs(answers[:, order] - mine).max() / np.abs(mine).max())


def test_reactions_of_mujoco_where_bodies_have_several_joints(tmp_path: Path) -> None:
    model, tree, joints, states = everything(tmp_path)
    loaded: Any = load_engine(BUILT_IN, "mujoco").load(model, joints, 0.0)
    answers = loaded.reactions(states.q, states.v, states.tau)
    assert largest_difference(tree, joints, states, answers) < 1e-13


def test_reactions_of_pinocchio_off_the_axes_and_beyond_fixed_joints(tmp_path: Path) -> None:
    model = parse_model(tmp_path / "everything.urdf", URDF_WITH_EVERYTHING, "urdf")
    states = States.at(*np.random.default_rng(SEED).normal(size=(3, STATES, 3)))
    joints = ("first", "second", "third")
    loaded: Any = load_engine(BUILT_IN, "pinocchio").load(model, joints, 9.81)
    answers = loaded.reactions(states.q, states.v, states.tau)
    assert largest_difference(tree_of(model, 9.81), joints, states, answers) < 1e-13


def test_points_are_the_same_wherever_the_files_write_the_same_numbers() -> None:
    mechanism = load_mechanism(BUILT_IN, "arm_7r")
    trees = [tree_of(read_model(BUILT_IN.model_path("arm_7r", one), one), mechanism.gravity) for one in ("mjcf", "urdf")]
    assert have_same_points(*trees, mechanism.joints)
    # Anchored elsewhere on its axis, which no motion feels.
    plain = read_model(BUILT_IN.model_path("arm_2r", "mjcf"), "mjcf")
    shifted = parse_model(plain.path, plain.text.replace('<joint name="elbow"', '<joint pos="0 0.25 0" name="elbow"'), "mjcf")
    joints = load_mechanism(BUILT_IN, "arm_2r").joints
    assert shifted.text != plain.text
    assert not have_same_points(tree_of(plain, 0.0), tree_of(shifted, 0.0), joints)
