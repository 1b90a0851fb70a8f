"""PhysX and Newton on robots in USD: the layer by which PhysX is aided, and answers in environments of their own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from engines.test_optional_engines import found_by
from pxr import Usd, UsdPhysics
from stages import random_stage

from harness.comparison.judgement import judge
from harness.comparison.robot_library import ask_engine
from harness.engines import load_engine
from harness.engines.adapters.physx.anchors import write_anchored
from harness.explain.meant import columns_of, for_engine, meant, question_of, read_as, request_of
from harness.files.joint_kinds import JointKind
from harness.library import Library, Stance
from harness.results.comparison import SubjectRecord
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import Robot, read_robot
from harness.truth.quantities import TruthBasis, find_quantities
from harness.truth.sampling import random_sample

EXAMPLES = sorted((Path(__file__).parents[2] / "docs" / "examples").glob("*.usda"))
SINGLE_PRECISION = 2.0**-24
# What is read there has no states of the file, or is Newton's alone.
NOT_PLAIN = {"roots-on-bodies", "sequence-of-joints-of-a-body"}


def written(folder: Path, text: str) -> Path:
    path = folder / "robot.usda"
    path.write_text(text)
    return path


@pytest.mark.parametrize("seed", range(12))
def test_the_layer_over_a_stage_is_the_same_robot(seed: int, tmp_path: Path) -> None:
    """Where bodies stand on the world, between the joints of one, or float: the accelerations of the file are those of the layer."""
    path, over = written(tmp_path, random_stage(seed)), tmp_path / "over.usda"
    robot = read_robot(path)
    floating = [joint.tag for joint in request_of(robot, Stance.AIDED).joints if joint.kind == JointKind.FREE]
    write_anchored(path, over, floating, has_gravity=True)
    one = meant(robot, 8, 0)
    other = read_as(one, read_robot(over))
    found = other.truth.high[:, columns_of(other.joints, robot.joints)]
    np.testing.assert_allclose(found, one.truth.high, rtol=1e-5, atol=1e-5 * np.abs(one.truth.high).max())
    stage = Usd.Stage.Open(str(over))
    roots = [prim for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.ArticulationRootAPI)]
    assert [prim.IsA(UsdPhysics.FixedJoint) for prim in roots] == [not floating]
    joints = [UsdPhysics.Joint(prim) for prim in stage.Traverse() if prim.IsA(UsdPhysics.Joint)]
    inbound = [str(target) for joint in joints for target in joint.GetBody1Rel().GetTargets()]
    assert len(inbound) == len(set(inbound)), "a link hangs by one joint"
    tying = [joint for joint in joints if joint.GetPrim() not in roots]
    assert all(joint.GetBody0Rel().GetTargets() for joint in tying), "what moves hangs on a base, and not on the world"


def test_gravity_that_a_file_switches_off_is_off_in_the_layer(tmp_path: Path) -> None:
    text = random_stage(1).replace("float physics:gravityMagnitude", "bool newton:gravityEnabled = 0; float physics:gravityMagnitude")
    path, over = written(tmp_path, text.replace('"scene"', '"scene" (apiSchemas = ["NewtonSceneAPI"])')), tmp_path / "over.usda"
    write_anchored(path, over, [], has_gravity=False)
    stage = Usd.Stage.Open(str(over))
    scene = UsdPhysics.Scene(stage.GetPrimAtPath("/scene"))
    assert scene.GetGravityMagnitudeAttr().Get() == 0.0 and not scene.GetPrim().GetMetadata("apiSchemas").ApplyOperations([])


def judged(engine: str, robot: Robot, asked: Path, states: int) -> SubjectRecord:
    """The record of an engine, aided, that answers on the file ``asked`` at sampled states of ``robot``."""
    question = question_of(for_engine(meant(robot, states, 0), SINGLE_PRECISION), Stance.AIDED)
    answers = ask_engine(engine, replace(question, request=replace(question.request, path=asked)))
    return judge(meant(robot, states, 0), answers, engine, Stance.AIDED)


@pytest.fixture
def engine(request: pytest.FixtureRequest, environment: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch) -> str:
    name: str = request.param
    monkeypatch.setenv("HARNESS_CACHE", str(environment(name)))
    return name


BOTH = pytest.mark.parametrize("engine", ["physx", "newton"], indirect=True)


@pytest.mark.nightly
@pytest.mark.parametrize("example", [path for path in EXAMPLES if path.stem not in NOT_PLAIN], ids=lambda path: path.stem)
def test_an_example_is_what_physx_makes_of_it(example: Path, environment: Callable[[str], Path], tmp_path: Path) -> None:
    found = found_by(environment("physx"), tmp_path, "compare", str(example), "--subject", "physx/usd")
    plain, aided = found["subjects"]
    readings = [*plain["readings"], *(reading for one in found["switched_on"] for reading in one["readings"])]
    assert plain["explained"] and aided["explained"] and f"physx-{example.stem}" in [reading["page"] for reading in readings]
    assert plain["left"] is None or plain["left"] < 64


@pytest.mark.nightly
@BOTH
@pytest.mark.parametrize("seed", range(25))
def test_random_trees_agree(engine: str, seed: int, tmp_path: Path) -> None:
    """At 4,000 states of each."""
    robot = read_robot(written(tmp_path, random_stage(seed)))
    record = judged(engine, robot, robot.path, 4000)
    assert record.verdict == "agrees", (record.backward_error, record.message, record.rest)


@pytest.mark.nightly
@BOTH
@pytest.mark.parametrize("factor", [1.0, 1.0001])
def test_an_inertia_that_is_off_by_a_ten_thousandth_is_felt(engine: str, factor: float, tmp_path: Path) -> None:
    text = EXAMPLES[0].with_name("joints-to-the-world.usda").read_text()
    robot = read_robot(written(tmp_path, text))
    other = tmp_path / "other.usda"
    other.write_text(text.replace("0.01, 0.06, 0.06", f"0.01, {0.06 * factor!r}, 0.06"))
    record = judged(engine, robot, other, 400)
    assert (record.verdict == "agrees") == (factor == 1.0), record.backward_error


@pytest.mark.nightly
@BOTH
@pytest.mark.parametrize("factor", [1.0, 1.0001])
def test_the_mass_matrix_and_forces_of_a_stage_are_judged(engine: str, factor: float, tmp_path: Path) -> None:
    """In float32; of a stage of which a mass is off by a ten-thousandth, all are red."""
    text = EXAMPLES[0].with_name("joints-to-the-world.usda").read_text()
    assert "physics:mass = 2;" in text
    robot = read_robot(written(tmp_path, text))
    mechanism = mechanism_of(robot)
    states = random_sample(mechanism, 200, 0)
    other = read_robot(written(tmp_path, text.replace("physics:mass = 2;", f"physics:mass = {2 * factor!r};")))
    model = load_engine(Library.built_in(), engine).load(request_of(other, Stance.AIDED), robot.joints, 0.0)
    for name in ("mass_matrix", "gravity", "bias"):
        truth = find_quantities()[name].truth_of(TruthBasis(mechanism, None, None, False, unit_roundoff=SINGLE_PRECISION))
        found = truth.asked_and_judged(truth.evaluate(states), states, model)
        assert found.are_all("agrees") == (factor == 1.0), (name, found)


@pytest.mark.nightly
@pytest.mark.parametrize("engine", ["newton"], indirect=True)
@pytest.mark.parametrize("is_first", [True, False])
def test_a_body_by_itself_is_asked_where_newton_numbers_it_as_its_joint(engine: str, is_first: bool, tmp_path: Path) -> None:
    """SolverFeatherstone takes the inertia of body n for joint n, which the importer sees to in articulations alone."""
    body = (
        'def Xform "{}" (apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]) {{ float physics:mass = {}; float3 physics:diagonalInertia'
    )
    bodies = [
        body.format("rod", 2) + " = (1, 1, 1); point3f physics:centerOfMass = (1, 0, 0); }",
        body.format("post", 9) + " = (2, 2, 2); }",
    ]
    joints = [
        'def PhysicsRevoluteJoint "pin" { rel physics:body1 = </rod>; uniform token physics:axis = "Y"; }',
        'def PhysicsFixedJoint "bolt" { rel physics:body1 = </post>; }',
    ]
    text = "\n".join(['#usda 1.0\n( metersPerUnit = 1; upAxis = "Z" )', *(bodies if is_first else reversed(bodies)), *joints, ""])
    robot = read_robot(written(tmp_path, text))
    record = judged(engine, robot, robot.path, 20)
    assert (record.verdict == "agrees") != is_first and ("takes the inertia of the body" in record.message) == is_first, record


@pytest.mark.nightly
@pytest.mark.parametrize("engine", ["newton"], indirect=True)
@pytest.mark.parametrize("is_alone", [True, False])
def test_newton_takes_joints_by_name_but_those_of_a_body_by_itself(engine: str, is_alone: bool, tmp_path: Path) -> None:
    text = EXAMPLES[0].with_name("sequence-of-joints-of-a-body.usda").read_text()
    if is_alone:
        lines = [line for line in text.splitlines(keepends=True) if '"torso"' not in line]
        text = "".join(lines).replace("rel physics:body0 = </robot/torso>; ", "")
    robot = read_robot(written(tmp_path, text))
    record = judged(engine, robot, robot.path, 40)
    assert record.explained and record.verdict == ("agrees" if is_alone else "disagrees") and len(record.readings) == (not is_alone), record
