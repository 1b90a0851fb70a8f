"""Inertias of tendons that run straight from one site to another: armature of the rate of their length."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import mujoco
import numpy as np
import pytest
from comparison.robots import record_of
from support_robots import by_mujoco

from harness.explain.changes.readings import find_readings
from harness.programs.evaluation import values as evaluated
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.states import States
from harness.trees.mechanism import mechanism_of
from harness.trees.quantities.forces import bias, inverse_dynamics, mass_matrix, reactions
from harness.trees.quantities.motion import computed, energy, tree_motion
from harness.trees.recursion import recursion_program
from harness.trees.robot import read_robot
from harness.truth.compare import compare
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import generic_sample
from harness.verdict import AGREEMENT

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
INERTIA = '<inertial pos="0.2 0 0.1" mass="2" diaginertia="0.2 0.3 0.4"/>'


def body(name: str, joint: str, inside: str = "", pos: str = "0.3 0.1 0") -> str:
    return (
        f'<body name="{name}" pos="{pos}"><joint name="{name}" {joint}/>{INERTIA}<site name="at_{name}" pos="0.1 0.4 -0.2"/>{inside}</body>'
    )


HINGE, SLIDE = 'type="hinge" axis="0.6 0 0.8"', 'type="slide" axis="0 0.6 0.8"'
WORLD_SITE = '<site name="hook" pos="1 0.5 2"/>'
# The bodies, and the two sites of the tendon.
FILES = {
    "slide on the world": (body("a", SLIDE), "hook", "at_a"),
    "chain": (body("a", HINGE, body("b", SLIDE, body("c", HINGE))), "hook", "at_c"),
    "behind what moves both": (body("a", HINGE, body("b", SLIDE, body("c", HINGE))), "at_a", "at_c"),
}
ACROSS = {
    "two branches": (body("a", 'type="ball"', body("b", HINGE, pos="1 0 0") + body("c", 'type="ball"', pos="0 1 0")), "at_b", "at_c"),
    "two floating bodies": (body("a", 'type="free"', body("c", HINGE)) + body("b", 'type="free"', pos="0 0 2"), "at_c", "at_b"),
}


def written(folder: Path, name: str, attributes: str = 'armature="3"') -> Path:
    bodies, first, second = (FILES | ACROSS)[name]
    path = folder / "cord.xml"
    path.write_text(
        f'<mujoco model="cord"><compiler angle="radian"/>\n<worldbody>{WORLD_SITE}{bodies}</worldbody>\n'
        f'<tendon><spatial {attributes}><site site="{first}"/><site site="{second}"/></spatial></tendon></mujoco>'
    )
    return path


@pytest.mark.parametrize("name", FILES)
def test_mujoco_has_the_law(name: str, tmp_path: Path) -> None:
    path = written(tmp_path, name, 'armature="3" stiffness="50" springlength="0.7" damping="2"')
    mechanism, model = mechanism_of(read_robot(path)), mujoco.MjModel.from_xml_path(str(path))
    states = generic_sample(mechanism, 32, 3)
    reference = ReferenceKernel(mechanism).evaluate(states)
    assert reference.certified.all()
    assert compare(reference, by_mujoco(model, states)).backward_error.max() < AGREEMENT
    model.tendon_armature *= 1 + 1e-9
    assert compare(reference, by_mujoco(model, states)).backward_error.max() > AGREEMENT


def test_the_inertia_is_that_of_a_pendulum_on_a_cord(tmp_path: Path) -> None:
    """A mass on a slide past a hook at the distance d: M = m + J (x / l)^2, and the bias J (x / l) (d^2 / l^3) v^2."""
    path = tmp_path / "past.xml"
    path.write_text(
        '<mujoco><option gravity="0 0 0"/><worldbody><site name="hook" pos="0 0 3"/><body><joint name="x" type="slide" axis="1 0 0"/>'
        '<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/><site name="eye"/></body></worldbody>'
        '<tendon><spatial armature="5"><site site="hook"/><site site="eye"/></spatial></tendon></mujoco>'
    )
    mechanism = mechanism_of(read_robot(path))
    found = ReferenceKernel(mechanism).evaluate(States.at(np.array([[4.0]]), np.array([[7.0]]), np.array([[1.0]])))
    slope, curvature = 4 / 5, 9 / 125
    np.testing.assert_allclose(found.high[0, 0], (1 - 5 * slope * curvature * 49) / (2 + 5 * slope**2), rtol=1e-15)


@pytest.mark.parametrize("name", FILES | ACROSS)
def test_every_quantity_has_its_share(name: str, tmp_path: Path) -> None:
    """Each value is MuJoCo's within roundings of its parts, which a share of the armature is beyond."""
    path = written(tmp_path, name)
    robot, model = read_robot(path), mujoco.MjModel.from_xml_path(str(path))
    data, mass = mujoco.MjData(model), np.empty((model.nv, model.nv))
    (reading,) = [one for one in find_readings("mujoco", "mjcf") if one.name == "inertias of tendons across branches"]
    tree, (q, v, qdd) = reading.read(robot).tree, np.random.default_rng(5).normal(size=(3, 20))
    assert (tree is robot.tree) == (name in FILES)
    data.qpos[:], data.qvel[:] = q[: model.nq], v[: model.nv]
    mujoco.mj_normalizeQuat(model, data.qpos)
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, mass)
    forces = mass @ qdd[: model.nv] + data.qfrc_bias
    kinetic = data.qvel @ mass @ data.qvel / 2
    for blocks, expected in (
        (mass_matrix, mass.ravel()),
        (bias, data.qfrc_bias),
        (inverse_dynamics, forces),
        (energy, [kinetic]),
    ):
        own = computed(tree_motion(tree, robot.joints, False), blocks)
        inputs = np.array([*data.qpos, *data.qvel, *qdd[: model.nv], 0.0, *own.numbers])[:, None]
        found, sizes = (evaluated(program, inputs)[name][:, 0] for program, name in ((own.program, "values"), (own.sizes, "sizes")))
        error = np.abs(found[: len(expected)] - expected) / sizes[: len(expected)]
        assert error.max() < AGREEMENT * UNIT_ROUNDOFF, blocks
        assert (sizes >= np.abs(found) * (1 - 1e-12)).all()


def test_a_joint_transmits_what_the_tendon_needs_of_its_bodies(tmp_path: Path) -> None:
    """Along the axis of a slide, what the body needs beside its weight is the applied force."""
    path = written(tmp_path, "slide on the world")
    robot, state = read_robot(path), [0.3, 0.7, -0.4, 0.0]
    transmitted, applied = (
        evaluated(own.program, np.array([*state, *own.numbers])[:, None])["values"][:, 0]
        for own in (computed(tree_motion(robot.tree, robot.joints, False), blocks) for blocks in (reactions, inverse_dynamics))
    )
    assert transmitted[:3] @ (0, 0.6, 0.8) == pytest.approx(applied[0], rel=1e-14)


def test_the_armature_is_a_number_of_the_file(tmp_path: Path) -> None:
    robot = read_robot(written(tmp_path, "chain"))
    found = [one for one in recursion_program(robot.tree, robot.joints).parameters if one.attribute == "armature"]
    assert [(float(one), one.place.line, one.place.tag) for one in found] == [(3.0, 3, "spatial")]


def test_a_tendon_of_mujocos_schema_of_usd_has_it() -> None:
    (spring,) = read_robot(EXAMPLES / "tendons-with-armature.usda").tree.springs
    assert (spring.armature, spring.stiffness, spring.damping) == (Fraction(0.8), 0, 0)


def test_engines_without_tendons_are_explained(tmp_path: Path) -> None:
    path = written(tmp_path, "chain")
    assert record_of(path, "mujoco").verdict == "agrees"
    for aided in (False, True):
        record = record_of(path, "pinocchio", aided)
        assert record.explained and "tendons with armature" in [one.name for one in record.readings]


@pytest.mark.ci
@pytest.mark.parametrize("name", ACROSS)
def test_mujoco_leaves_out_what_joints_of_two_branches_have_in_common(name: str, tmp_path: Path) -> None:
    record = record_of(written(tmp_path, name), "mujoco")
    assert record.explained and [one.name for one in record.readings] == ["inertias of tendons across branches"]
    assert record.readings[0].lines == (3,)
    assert record.left is not None and record.left <= AGREEMENT < (record.backward_error or 0.0)


@pytest.mark.parametrize(("second", "readings"), [("b", []), ("c", ["inertias of tendons across branches"])])
@pytest.mark.parametrize("where", ["tendon", "actuator"])
def test_a_sum_of_joint_positions_has_the_same_law(second: str, readings: list[str], where: str, tmp_path: Path) -> None:
    path = tmp_path / "sum.xml"
    bodies = body("a", HINGE, body("b", SLIDE)) + body("c", HINGE)
    own, driven = (' armature="3"', "") if where == "tendon" else ("", '<motor tendon="sum" armature="3" gear="2"/>')
    joints = f'<joint joint="a" coef="1"/><joint joint="{second}" coef="-2"/>'
    path.write_text(
        f'<mujoco model="sum"><compiler angle="radian"/><worldbody>{bodies}</worldbody>'
        f'<tendon><fixed name="sum"{own}>{joints}</fixed></tendon><actuator>{driven}</actuator></mujoco>'
    )
    record = record_of(path, "mujoco")
    assert [one.name for one in record.readings] == readings
    assert record.explained if readings else record.verdict == "agrees"
