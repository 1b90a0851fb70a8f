"""Dry friction and limits of a file: the certified optimum against MuJoCo's answers and against an evaluation of its own."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import flint
import mujoco
import numpy as np
import pytest
from documented_optimum import DIGITS, Row
from documented_optimum import optimum as documented_optimum
from flint import arb, arb_mat

from harness.arrays import Array
from harness.comparison.robot_library import ask_engine, engine_of
from harness.engines.request import Held, SolverSettings
from harness.explain.as_read import read_by
from harness.explain.changes.departures import Departure, departed, departures_of
from harness.explain.changes.readings import element_at
from harness.explain.meant import Meant, question_of
from harness.files.equalities import frictions_of, limits_of
from harness.files.tree import Body
from harness.library import Stance
from harness.programs.evaluation import mass_matrix
from harness.programs.kernels import BallKernel
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.program import right_hand_side
from harness.programs.states import States
from harness.trees.mechanism import RobotMechanism, mechanism_of
from harness.trees.robot import Robot, read_robot
from harness.truth.compare import Comparison, compare
from harness.truth.declared import DeclaredMechanism
from harness.truth.displaced import pressed
from harness.truth.optimum import optimum
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import sample
from harness.verdict import AGREEMENT

SEED, STATES = 7, 24
BODIES = """
<body><joint name="a" axis="0 1 0" {a}/><inertial pos=".5 0 0" mass="1" diaginertia=".1 .1 .1"/>
<body pos="1 0 0"><joint name="b" type="slide" axis="0 .6 .8" {b}/><inertial pos=".3 .1 0" mass="2" diaginertia=".1 .12 .1"/>
<site name="s" pos=".1 .2 .3"/>
<body pos="0 0 1"><joint name="c" type="ball" {c}/><site name="t" pos="0 .2 .3"/>
<inertial pos=".3 .1 0" mass="2" diaginertia=".1 .12 .1"/></body></body></body>
<body><joint name="f" type="free" {f}/><site name="u" pos=".3 .1 -.2"/><inertial pos=".3 .1 0" mass="2" diaginertia=".1 .12 .1"/></body>"""


def written(folder: Path, /, option: str = "", tendons: str = "", **joints: str) -> Path:
    path = folder / "model.xml"
    bodies = BODIES.format(**{name: joints.get(name, "") for name in "abcf"})
    path.write_text(f"<mujoco>\n{option}\n<worldbody>{bodies}</worldbody>\n<tendon>{tendons}</tendon>\n</mujoco>")
    return path


def documented(robot: Robot, departures: Sequence[Departure] = ()) -> Mechanism:
    """The robot with its dry friction and limits, by the laws that MuJoCo documents, or with departures from them."""
    engine, root = engine_of("mujoco"), element_at(robot.tree.place)
    bounds = (*frictions_of(robot.tree), *limits_of(robot.tree), *limits_of(robot.tree, of_tendons=True))
    chosen = [one for one in bounds if not one.why_not]
    laws = departed(departures, robot.tree, chosen, engine.laws(root, robot.format, chosen))
    return optimum(mechanism_of(robot), robot, chosen, laws, engine.fuses(root, robot.format))


def answered(path: Path, states: States) -> Array:
    """MuJoCo's accelerations with these alone, solved to the end."""
    model, off = mujoco.MjModel.from_xml_path(str(path)), mujoco.mjtDisableBit
    model.opt.disableflags |= int(off.mjDSBL_EQUALITY | off.mjDSBL_CONTACT | off.mjDSBL_AUTORESET | off.mjDSBL_ACTUATION)
    model.opt.density = model.opt.viscosity = 0.0
    model.opt.iterations, model.opt.tolerance = 100, 0.0
    data, found = mujoco.MjData(model), np.empty_like(states.v)
    for state in range(len(states)):
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = states.q[state], states.v[state], states.tau[state]
        data.qacc_warmstart[:] = 0
        mujoco.mj_forward(model, data)
        found[state] = data.qacc
    return found


def states_of(robot: Robot, mechanism: Mechanism, count: int = STATES) -> States:
    """Sampled states, in which joints with limits reach beyond either by half of their range."""
    states, random, first = sample(mechanism, count, SEED), np.random.default_rng(SEED), 0
    q = states.q.copy()
    for name in robot.joints:
        joint = robot.joint(name)
        if joint.limits is not None and joint.kind.is_single:
            low, high = (math.radians(bound) if joint.in_degrees else float(bound) for bound in joint.limits)
            q[:, first] = random.uniform(low - (high - low) / 2, high + (high - low) / 2, count)
        first += joint.kind.positions
    return replace(states, q=q)


def judged(path: Path, robot: Robot | None = None) -> tuple[Mechanism, States, Comparison]:
    robot = robot or read_robot(path)
    mechanism = documented(robot)
    states = states_of(robot, mechanism)
    return mechanism, states, compare(ReferenceKernel(mechanism).evaluate(states), answered(path, states), factorises=True)


def worst(compared: Comparison) -> float:
    assert not np.isnan(compared.backward_error).any()
    return float(compared.backward_error.max())


RUBBING = {
    "hinge": {"a": 'frictionloss="3"'},
    "slide": {"b": 'frictionloss="3"'},
    "ball": {"c": 'frictionloss="0.5"'},
    "free": {"f": 'frictionloss="2"'},
    "all": dict.fromkeys("abcf", 'frictionloss="3"'),
    "soft": {"a": 'frictionloss="3" solimpfriction="0.3 0.6 0.001" solreffriction="0.5 1"'},
    "direct": {"a": 'frictionloss="3" solimpfriction="0.97 0.8 0.02 0.3 3" solreffriction="-100 -4"', "b": 'frictionloss="0.01"'},
    "refsafe": {"a": 'frictionloss="3" solreffriction="0.0001 1"'},
}


@pytest.mark.parametrize("name", RUBBING)
def test_mujoco_rubs_as_it_documents(name: str, tmp_path: Path) -> None:
    _, _, compared = judged(written(tmp_path, **RUBBING[name]))
    assert worst(compared) <= AGREEMENT


LIMITED = {
    "hinge": {"a": 'range="-40 30"'},
    "slide": {"b": 'range="-0.2 0.3"'},
    "margin": {"a": 'range="-40 30" margin="0.2"', "b": 'range="-0.2 0.3" margin="-0.05"'},
    "both at once": {"a": 'range="-4 3" margin="0.5"'},
    "soft": {"a": 'range="-40 30" solimplimit="0.3 0.6 0.5" solreflimit="0.5 0.7"'},
    "power": {"a": 'range="-40 30" solimplimit="0.1 0.9 0.9 0.3 3.3" solreflimit="-100 -4"', "b": 'range="-.2 .3" solimplimit="0 0 0"'},
    "with friction": {"a": 'range="-40 30" frictionloss="2"', "b": 'range="-0.2 0.3" frictionloss="5"', "c": 'frictionloss=".3"'},
}


@pytest.mark.parametrize("name", LIMITED)
def test_mujoco_limits_as_it_documents(name: str, tmp_path: Path) -> None:
    _, _, compared = judged(written(tmp_path, **LIMITED[name]))
    assert worst(compared) <= AGREEMENT


@pytest.mark.parametrize("kind", ['frictionloss="{0}" solimpfriction="0.3 0.6 0.001"', 'limited="true" range="-20 20"'])
@pytest.mark.parametrize("mass", [1e14, 1e17])
def test_what_is_heavy_is_no_stiffer_than_mujocos_least_regularisation(kind: str, mass: float, tmp_path: Path) -> None:
    path, inertia = tmp_path / "heavy.xml", f'<inertial pos=".5 0 0" mass="{mass}" diaginertia="{mass} {mass} {mass}"/>'
    body = f'<body><joint name="a" axis="0 1 0" {kind.format(mass)}/>{inertia}</body>'
    path.write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    _, _, compared = judged(path)
    assert worst(compared) <= AGREEMENT


@pytest.mark.parametrize("name", ["hinge", "both at once", "power"])
def test_a_state_that_is_pressed_is_beyond_a_limit(name: str, tmp_path: Path) -> None:
    """Whatever its own joints are at; of states that are not there nothing would ever be asked of limits."""
    robot = read_robot(written(tmp_path, **LIMITED[name]))
    mechanism = documented(robot)
    assert isinstance(mechanism, DeclaredMechanism)
    states = sample(mechanism, STATES, SEED)
    within = replace(states, q=np.where(np.arange(states.q.shape[1]) < 2, 0.0, states.q))
    assert mechanism.reaches_limits(pressed(mechanism, within)).all()


@dataclass(frozen=True)
class Drawn:
    """A model with joints a, b and c of random numbers, and the same numbers as rows."""

    path: Path
    rows: list[Row]


def drawn(folder: Path, seed: int) -> Drawn:
    """A hinge, a slide and a ball joint with friction and limits of any numbers."""
    random = np.random.default_rng(seed)
    attributes: dict[str, str] = {}
    numbers: dict[str, list[dict[str, Any]]] = {name: [] for name in "abc"}
    for name in "abc":
        for of in ("friction", "limit") if name != "c" else ("friction",):
            if random.random() < 0.2:
                continue
            own: dict[str, Any] = {}
            if random.random() < 0.5:
                own["solref"] = (round(random.uniform(0.001, 0.3), 4), round(random.uniform(0.3, 2), 3))
            elif random.random() < 0.5:
                own["solref"] = (-round(random.uniform(0, 300), 2), -round(random.uniform(0, 20), 2))
            if random.random() < 0.6:
                shape = round(random.uniform(0, 1), 3), round(random.uniform(0.1, 1), 2), round(random.uniform(1, 4), 2)
                own["solimp"] = (round(random.uniform(0, 1), 3), round(random.uniform(0.3, 1), 3), *shape)
            texts = [f'{key}{of}="{" ".join(map(repr, value))}"' for key, value in own.items()]
            if of == "friction":
                own["loss"] = round(10 ** random.uniform(-2, 1.2), 4)
                texts.append(f'frictionloss="{own["loss"]}"')
            else:
                own["range"] = round(random.uniform(-1, -0.1), 3), round(random.uniform(0.1, 1), 3)
                own["margin"] = round(random.choice([0.0, random.uniform(-0.1, 0.9)]), 3)
                texts.append(f'range="{own["range"][0]} {own["range"][1]}" margin="{own["margin"]}"')
            attributes[name] = f"{attributes.get(name, '')} {' '.join(texts)}"
            numbers[name].append(own)
    path = written(folder, '<compiler angle="radian"/>', **attributes)
    with flint.ctx.workprec(5 * DIGITS):
        inverse = terms_at(mechanism_of(read_robot(path)), [0, 0, 1, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0], [0] * 11, [0] * 11)[0].inv()
    rows: list[Row] = []
    for first, count, name in ((0, 1, "a"), (1, 1, "b"), (2, 3, "c")):
        with flint.ctx.workprec(5 * DIGITS):
            weight = sum((inverse[i, i] for i in range(first, first + count)), arb(0)) / count
        for own in numbers[name]:
            if "loss" in own:
                rows += [Row(column, weight, **own) for column in range(first, first + count)]
            else:
                bounds, rest = own["range"], {key: value for key, value in own.items() if key != "range"}
                rows += [Row(first, weight, sign, first, bound, **rest) for sign, bound in zip((1, -1), bounds, strict=True)]
    return Drawn(path, rows)


def terms_at(mechanism: RobotMechanism, *state: Sequence[float]) -> tuple[Any, Any]:
    """M and f of a tree at q, v and tau, as matrices of balls."""
    evaluate = BallKernel(mechanism.program, len(mechanism.parameters)).bind(mechanism.parameter_values)
    flat = list(evaluate(*map(float, itertools.chain(*state)), 0.0))
    found = {}
    for name, places in mechanism.program.outputs.items():
        found[name], flat = flat[: len(places)], flat[len(places) :]
    return mass_matrix(found["mass"], mechanism.nv), arb_mat([[one] for one in right_hand_side(found, list(map(arb, state[2])))])


def holds_against_the_documentation(folder: Path, seed: int, count: int) -> None:
    model = drawn(folder, seed)
    robot = read_robot(model.path)
    mechanism = documented(robot)
    states = states_of(robot, mechanism, count)
    truth = ReferenceKernel(mechanism).evaluate(states)
    assert truth.certified.all()
    plain = mechanism_of(robot)
    for state in range(count):
        at = [values[state].tolist() for values in (states.q, states.v, states.tau)]
        with flint.ctx.workprec(5 * DIGITS):
            mass, force = terms_at(plain, *at)
            found = documented_optimum(mass, force, model.rows, *([*map(arb, one)] for one in at[:2]))
            known = [arb(high) + arb(low) for high, low in zip(truth.high[state].tolist(), truth.low[state].tolist(), strict=True)]
            off = arb_mat([[one - other] for one, other in zip(found, known, strict=True)])
            distance = float((off.transpose() * mass * off)[0, 0].mid()) ** 0.5
        # Numbers that each state has of its own are two float64 numbers each.
        assert distance <= truth.radius[state] + 16 * UNIT_ROUNDOFF**2 * truth.sensitivity[state], (seed, state)


def test_the_optimum_is_that_of_the_documentation(tmp_path: Path) -> None:
    for seed in range(12):
        holds_against_the_documentation(tmp_path, seed, 12)


@pytest.mark.nightly
@pytest.mark.parametrize("part", range(10))
def test_the_optimum_is_that_of_the_documentation_at_ten_thousand_states(part: int, tmp_path: Path) -> None:
    for seed in range(100 + 25 * part, 125 + 25 * part):
        holds_against_the_documentation(tmp_path, seed, 40)


FAULTS = {
    "friction": ({"a": 'frictionloss="3"'}, 'frictionloss="3"', 'frictionloss="3.00001"'),
    "half of the bound": ({"a": 'frictionloss="3"'}, 'frictionloss="3"', 'frictionloss="1.5"'),
    "impedance of friction": ({"a": 'frictionloss="30" solimpfriction="0.3"'}, '"0.3"', '"0.30001"'),
    "damping of friction": ({"a": 'frictionloss="300" solreffriction="0.3 1"'}, '"0.3 1"', '"0.30001 1"'),
    "range": ({"a": 'range="-40 30"'}, "-40 30", "-40 30.0001"),
    "sign of the margin": ({"a": 'range="-40 30" margin="0.01"'}, '"0.01"', '"-0.01"'),
    "impedance of a limit": ({"a": 'range="-40 30" solimplimit=".3 .9 2"'}, ".3 .9 2", ".3 .9 2.0001"),
    "time constant of a limit": ({"a": 'range="-40 30" solreflimit="0.3 1"'}, '"0.3 1"', '"0.30001 1"'),
    "friction of a limit": ({"a": 'range="-40 30" solimplimit=".3 .9 2"'}, "solimplimit", "solimpfriction"),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_a_planted_fault_is_seen(name: str, tmp_path: Path) -> None:
    attributes, old, new = FAULTS[name]
    right = written(tmp_path, **attributes)
    robot, text = read_robot(right), right.read_text()
    assert text.count(old) == 1
    right.write_text(text.replace(old, new))
    assert worst(judged(right, robot)[2]) > 10 * AGREEMENT


def test_a_force_at_its_bound_counts_as_inside(tmp_path: Path) -> None:
    """Half an ulp leads across, so that data roundoff is the larger of both sides; the force is the bound."""
    path = tmp_path / "one.xml"
    path.write_text(
        '<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="j" axis="0 0 1" frictionloss="1"/>'
        '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>'
    )
    mechanism = documented(read_robot(path))
    # Within the range the row gives 0.9 of tau, as R is a ninth of A.
    at = 1 / 0.9
    states = States.at([[0.0]] * 5, [[0.0]] * 5, [[at], [np.nextafter(at, 2)], [np.nextafter(at, 0)], [0.9 * at], [1.1 * at]])
    truth = ReferenceKernel(mechanism).evaluate(states)
    assert truth.certified.all()
    assert truth.high[:3, 0] == pytest.approx(states.tau[:3, 0] - 1.0, abs=1e-15)
    # A row that slides resists no rounding of tau.
    assert min(truth.sensitivity[:3]) > 1.5 * truth.sensitivity[3] and truth.sensitivity[4] > 1.5 * truth.sensitivity[3]


def test_a_limit_that_rounding_reaches_is_undecided(tmp_path: Path) -> None:
    """Its damping sets in at once; where it would push nothing, either way is the same."""
    path = tmp_path / "one.xml"
    path.write_text(
        '<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody><body><joint name="j" axis="0 0 1" range="-1 0.3"/>'
        '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>'
    )
    mechanism = documented(read_robot(path))
    truth = ReferenceKernel(mechanism).evaluate(States.at([[0.3]] * 2, [[1.0], [-1.0]], [[0.0]] * 2))
    assert truth.certified.tolist() == [False, True] and truth.high[1, 0] == 0.0
    assert "on which side" in next(truth.why_undecided())


def test_the_mean_impedance_of_friction_without_width_is_a_departure(tmp_path: Path) -> None:
    """As documented it is the first number; MuJoCo takes the mean, for a width of 0 alone."""
    (departure,) = [one for one in departures_of("mujoco", "") if one.name == "impedance of friction without width"]
    for width, departs in (("0", True), ("0.1", False)):
        (folder := tmp_path / width).mkdir()
        path = written(folder, a=f'frictionloss="3" solimpfriction="0.3 0.6 {width}"')
        robot = read_robot(path)
        _, states, compared = judged(path, robot)
        assert (worst(compared) > 10 * AGREEMENT) == departs
        truth = ReferenceKernel(documented(robot, [departure])).evaluate(states)
        assert worst(compare(truth, answered(path, states), factorises=True)) <= AGREEMENT


def test_what_mixes_signs_is_no_law(tmp_path: Path) -> None:
    (found,) = frictions_of(read_robot(written(tmp_path, a='frictionloss="3" solreffriction="0.3 -1"')).tree)
    assert found.why_not == "has solref 0.3 -1, which mixes signs; expected both positive, or none" and found.line == 4


def test_friction_of_a_planar_joint_is_none_of_one_engine(tmp_path: Path) -> None:
    path, inertial = (
        tmp_path / "sheet.urdf",
        '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>',
    )
    joint = '<joint name="j" type="planar"><parent link="a"/><child link="b"/><dynamics friction="1"/></joint>'
    path.write_text(f'<robot name="sheet">\n<link name="a"/><link name="b">{inertial}</link>\n{joint}</robot>')
    (found,) = frictions_of(read_robot(path).tree)
    assert found.why_not == "is of a planar joint, which engines make several of" and found.line == 3


def test_what_the_file_switches_off_does_not_act(tmp_path: Path) -> None:
    both = {"a": 'frictionloss="3" range="-40 30"'}
    for flag, left in (("constraint", []), ("limit", ["dry friction"]), ("frictionloss", ["lower limit", "upper limit"])):
        # What stands at a place is kept by the file's name.
        (folder := tmp_path / flag).mkdir()
        robot = read_robot(written(folder, f'<option><flag {flag}="disable"/></option>', **both))
        chosen = [*frictions_of(robot.tree), *limits_of(robot.tree)]
        laws = engine_of("mujoco").laws(element_at(robot.tree.place), robot.format, chosen)
        assert [one.kind for one in chosen if one.name in laws] == left


@pytest.mark.parametrize("format", ["mjcf", "urdf"])
def test_an_engine_is_asked_with_friction_and_limits_of_joints_by_name(format: str, tmp_path: Path) -> None:
    """Those of no other joint act, and none where none is named."""
    path = written(tmp_path, **LIMITED["with friction"])
    if format == "urdf":
        path = Path(__file__).parents[2] / "harness" / "robots" / "arm.urdf"
        text = path.read_text().replace('<dynamics damping="8"/>', '<dynamics damping="8" friction="7"/>')
        path = tmp_path / "arm.urdf"
        path.write_text(text)
    robot = read_by(read_robot(path), "mujoco", engine_of("mujoco"), Stance.PLAIN).robot
    names = [joint.name for joint in robot.tree.joints if joint.kind.is_single]
    for rubbing, limited in ((names, names), (names[:1], ()), ((), names[1:2]), ((), ())):
        tree = replace(robot.tree, bodies=tuple(_with(body, rubbing, limited) for body in robot.tree.bodies))
        own = replace(robot, tree=tree)
        mechanism = documented(own)
        states = states_of(robot, mechanism)
        truth = ReferenceKernel(mechanism).evaluate(states)
        held = Held((), (), SolverSettings("Newton", 100, 0.0), rubbing=owners(rubbing), limited=owners(limited))
        answers = ask_engine("mujoco", question_of(Meant(own, states, truth), Stance.PLAIN, held))
        assert worst(compare(truth, answers.of(robot.joints), factorises=True)) <= AGREEMENT


def owners(names: Sequence[str]) -> tuple[str, ...]:
    return tuple(f"joint {name}" for name in names)


def _with(body: Body, rubbing: Sequence[str], limited: Sequence[str]) -> Body:
    joints = [joint if joint.name in rubbing else replace(joint, friction_loss=Fraction(0)) for joint in body.joints]
    return replace(body, joints=tuple(joint if joint.name in limited else replace(joint, limits=None) for joint in joints))


SUM = '<fixed {}><joint joint="a" coef="1.5"/><joint joint="b" coef="-2"/></fixed>'
ALONG = '<spatial {}><site site="s"/><site site="u"/><site site="t"/></spatial>'
TENDONS = {
    "friction of a sum": (SUM, 'frictionloss="3" solreffriction="0.3 1"'),
    "limits of a sum": (SUM, 'range="-2 1" margin="0.1" solimplimit="0.5 0.9 0.4"'),
    "both of a sum": (SUM, 'name="x" range="-2 1" frictionloss="3"'),
    "friction through sites": (ALONG, 'frictionloss="30000" solimpfriction="0.5 0.9"'),
    "limits through sites": (ALONG, 'range="1.5 2.5" solreflimit="-100 -4"'),
}


@pytest.mark.parametrize("name", TENDONS)
def test_tendons_rub_and_are_limited_as_documented_but_for_their_curvature(name: str, tmp_path: Path) -> None:
    """Through sites MuJoCo leaves J' v out, where it moves; at rest it is as documented."""
    tendon, attributes = TENDONS[name]
    path = written(tmp_path, tendons=tendon.format(attributes))
    robot = read_robot(path)
    curved = [one for one in departures_of("mujoco", "") if one.name == "J' v of tendons and ball joints"]
    assert_departs_where_it_moves(path, robot, curved, departs="sites" in name)


@pytest.mark.parametrize("attributes", ['range="0 60"', 'range="0 170" margin="0.4" solimplimit="0.2 0.9 1.5 0.3 2.5"'])
def test_ball_joints_are_limited_as_documented_but_for_their_curvature(attributes: str, tmp_path: Path) -> None:
    path = written(tmp_path, c=attributes)
    curved = [one for one in departures_of("mujoco", "") if one.name == "J' v of tendons and ball joints"]
    assert_departs_where_it_moves(path, read_robot(path), curved, departs=True)


def assert_departs_where_it_moves(path: Path, robot: Robot, departures: Sequence[Departure], departs: bool) -> None:
    states = sample(documented(robot), STATES, SEED)
    for moving in (True, False):
        at = states if moving else replace(states, v=np.zeros_like(states.v))
        answers = answered(path, at)
        compared = compare(ReferenceKernel(documented(robot)).evaluate(at), answers, factorises=True)
        assert (worst(compared) > 10 * AGREEMENT) == (departs and moving), worst(compared)
        truth = ReferenceKernel(documented(robot, departures)).evaluate(at)
        assert worst(compare(truth, answers, factorises=True)) <= AGREEMENT
        without = compare(ReferenceKernel(mechanism_of(robot)).evaluate(at), answers, factorises=True)
        assert worst(without) > 10 * AGREEMENT


def test_a_tendon_around_something_says_why_it_is_not_read(tmp_path: Path) -> None:
    path = written(
        tmp_path, tendons='<spatial frictionloss="2" range="0 1"><site site="s"/><pulley divisor="2"/><site site="t"/></spatial>'
    )
    tree = read_robot(path).tree
    found = [*frictions_of(tree), *limits_of(tree, of_tendons=True)]
    assert [one.name for one in found] == [
        "dry friction of tendon (tendon 1)",
        "lower limit of tendon (tendon 1)",
        "upper limit of tendon (tendon 1)",
    ]
    assert {one.why_not for one in found} == {"is about a tendon that runs along a path, or about none of this file"}
