"""The recursion over a model file against Lagrange's equations of the energies that somebody wrote."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import flint
import numpy as np
import pinocchio
import pytest
from catalogue import BUILT_IN, MODELS, is_tied
from robot_files import EVERYTHING, URDF_WITH_EVERYTHING

from harness.arrays import Array
from harness.engines import load_engine
from harness.files.model_file import ModelFile, parse_model, read_model
from harness.lagrange.derivation import load_mechanism
from harness.programs.kernels import BallKernel
from harness.programs.program import upper_triangle
from harness.programs.states import States
from harness.trees.mechanism import accelerations as by_recursion
from harness.trees.mechanism import accelerations_of
from harness.trees.recursion import recursion_program
from harness.trees.robot import read_robot, tree_of
from harness.truth.compare import compare
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import generic_sample

STATES = 10
BITS = 192
SEED = 7


def largest_error(name: str, text: Callable[[str], str], model_format: str) -> float:
    """Between the recursion over a model, whose text is changed first, and the energies [data roundoffs]."""
    mechanism = load_mechanism(BUILT_IN, name)
    path = BUILT_IN.model_path(name, model_format)
    model = parse_model(path, text(read_model(path, model_format).text), model_format)
    states = generic_sample(mechanism, STATES, SEED)
    found = by_recursion(model, mechanism.joints, mechanism.gravity, states)
    return float(compare(ReferenceKernel(mechanism).evaluate(states), found).backward_error.max())


@pytest.mark.parametrize(("name", "model_format"), [(name, form) for name, form in MODELS if not is_tied(BUILT_IN.system_of(name))])
def test_recursion_and_energies_agree_to_the_rounding_of_the_decimals(name: str, model_format: str) -> None:
    """An inertia such as m L^2 / 12 is rounded once where it is written, and half an ulp of every number is one data roundoff."""
    assert largest_error(name, lambda text: text, model_format) < 4


@pytest.mark.parametrize(
    ("name", "model_format", "old", "new"),
    [
        ("arm_2r", "mjcf", 'mass="3"', 'mass="3.0000000001"'),
        ("cart_pendulum", "mjcf", 'damping="0.2"', 'damping="0.19999999999"'),
        ("collar", "mjcf", 'springlength="2.5"', 'springlength="2.50000000001"'),
        (
            "collar",
            "urdf",
            '<drake:linear_spring_damper_free_length value="2.5"',
            '<drake:linear_spring_damper_free_length value="2.50000000001"',
        ),
        ("free_body", "urdf", 'ixx="0.25"', 'ixx="0.25000000001"'),
    ],
)
def test_a_number_that_is_not_that_of_the_energies_is_seen(name: str, model_format: str, old: str, new: str) -> None:
    assert old in read_model(BUILT_IN.model_path(name, model_format), model_format).text
    assert largest_error(name, lambda text: text.replace(old, new, 1), model_format) > 50


def accelerations(model: ModelFile, joints: tuple[str, ...], gravity: float, states: States) -> tuple[Array, Array]:
    """By recursion, and by the engine whose format it is."""
    engine = load_engine(BUILT_IN, {"mjcf": "mujoco", "urdf": "pinocchio"}[model.format])
    answers = engine.load(model, joints, gravity).forward_dynamics(states.q, states.v, states.tau)
    return by_recursion(model, joints, gravity, states), answers


def test_every_way_of_placing_a_frame_is_that_of_mujoco(tmp_path: Path) -> None:
    model = parse_model(tmp_path / "everything.xml", EVERYTHING, "mjcf")
    random = np.random.default_rng(SEED)
    q, v, tau = random.normal(size=(STATES, 7)), random.normal(size=(STATES, 6)), random.normal(size=(STATES, 6))
    q[:, 2:6] /= np.linalg.norm(q[:, 2:6], axis=1, keepdims=True)
    mine, theirs = accelerations(model, ("first", "second", "third", "third", "third", "fourth"), 0.0, States.at(q, v, tau))
    np.testing.assert_allclose(theirs, mine, rtol=0, atol=1e-13 * np.abs(mine).max())


def test_every_way_of_placing_a_link_is_that_of_pinocchio(tmp_path: Path) -> None:
    model = parse_model(tmp_path / "everything.urdf", URDF_WITH_EVERYTHING, "urdf")
    states = States.at(*np.random.default_rng(SEED).normal(size=(3, STATES, 3)))
    mine, theirs = accelerations(model, ("first", "second", "third"), 9.81, states)
    np.testing.assert_allclose(theirs, mine, rtol=0, atol=1e-13 * np.abs(mine).max())


def test_joints_that_mimic_another_are_those_of_pinocchio(tmp_path: Path) -> None:
    """Mass matrix and forces of inverse dynamics, for which Pinocchio knows such joints; aba does not."""
    follow = '<mimic joint="first" multiplier="{}" offset="{}"/></joint>'
    text = URDF_WITH_EVERYTHING.replace('<dynamics damping="0.3"/>', "")
    for name, follower in (("second", follow.format(-0.5, 0.25)), ("third", follow.format(1.5, -0.75))):
        place = text.index("</joint>", text.index(f'name="{name}"'))
        text = text[:place] + follower + text[place + len("</joint>") :]
    for name in ("second", "third"):
        # One that follows, in either place; below, two of one leader.
        free = text.replace(
            text[text.index("<mimic", text.index(f'name="{name}"')) : text.index("</joint>", text.index(f'name="{name}"'))], ""
        )
        _agrees_with_inverse_dynamics(parse_model(tmp_path / "mimic.urdf", free, "urdf"))
    _agrees_with_inverse_dynamics(parse_model(tmp_path / "mimic.urdf", text, "urdf"))


def _agrees_with_inverse_dynamics(file: ModelFile) -> None:
    theirs = pinocchio.buildModelFromXML(file.text, mimic=True)
    theirs.gravity.linear = np.array([0.0, 0.0, -9.81])
    joints = tuple(file.joint_lines)
    recursion = recursion_program(tree_of(file, 9.81), joints)
    program, numbers = recursion.program, [float(value) for value in recursion.parameters]
    nv = len(joints)
    assert (theirs.nv, len(file.mimics)) == (nv, 3 - nv)
    q, v = np.random.default_rng(SEED).normal(size=(2, nv))
    with flint.ctx.workprec(BITS):
        values = iter(map(float, BallKernel(program, len(numbers)).bind(numbers)(*q.tolist(), *v.tolist(), *[0.0] * (nv + 1))))
    outputs = {name: np.array([next(values) for _ in places]) for name, places in program.outputs.items()}
    mass = np.triu(pinocchio.crba(theirs, theirs.createData(), q))
    np.testing.assert_allclose([mass[entry] for entry in upper_triangle(nv)], outputs["mass"], rtol=1e-13)
    bias = pinocchio.rnea(theirs, theirs.createData(), q, v, np.zeros(nv))
    np.testing.assert_allclose(bias, outputs["velocity"] + outputs["gravity"], rtol=0, atol=1e-13 * np.abs(bias).max())


def test_other_joints_than_those_of_the_tree_are_refused(tmp_path: Path) -> None:
    tree = tree_of(parse_model(tmp_path / "everything.xml", EVERYTHING, "mjcf"), 0.0)
    with pytest.raises(ValueError, match=r"the tree has the joints .*'third'.*; expected .*'last'"):
        recursion_program(tree, ("first", "second", "last"))


def test_a_planar_joint_is_two_prismatic_joints_and_a_revolute_one_in_its_place(tmp_path: Path) -> None:
    """About an axis between the axes of coordinates; the directions in its plane are those of the least rotation that gives it."""
    text = URDF_WITH_EVERYTHING.replace('name="second" type="prismatic"', 'name="second" type="planar"').replace(
        'xyz="0.28 0 0.96"', 'xyz="0 0.6 0.8"'
    )
    link = '<link name="{}"><inertial><mass value="0"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    joint = '<joint name="{}" type="{}">{}<parent link="{}"/><child link="{}"/><axis xyz="{}"/><limit effort="0" velocity="0"/></joint>'
    start = text.index('<joint name="second"')
    old = text[start : text.index("</joint>", start) + len("</joint>")]
    origin = '<origin xyz="0.1 0 0" rpy="0 0.7 0"/>'
    # The least rotation from z to (0, 0.6, 0.8) is one about x.
    parts = (
        ("x", "prismatic", origin, "bracket", "one", "1 0 0"),
        ("y", "prismatic", "", "one", "two", "0 0.8 -0.6"),
        ("turn", "revolute", "", "two", "slider", "0 0.6 0.8"),
    )
    new = "".join([link.format("one"), link.format("two"), *(joint.format(*part) for part in parts)])
    states = States.at(*np.random.default_rng(SEED).normal(size=(3, STATES, 5)))
    found = []
    for changed, joints in (
        (text, ("first", "second", "second", "second", "third")),
        (text.replace(old, new), ("first", "x", "y", "turn", "third")),
    ):
        path = tmp_path / "planar.urdf"
        path.write_text(changed)
        robot = read_robot(path)
        assert robot.degrees_of_freedom == 5
        found.append(accelerations_of(recursion_program(robot.tree, joints), states))
    np.testing.assert_allclose(found[0], found[1], rtol=1e-15)
