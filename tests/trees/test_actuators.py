"""Actuators of an MJCF: certified forces against MuJoCo's, against an evaluation of their own, and with faults planted."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import flint
import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from harness.arrays import Array
from harness.comparison.robot_library import ask_engine
from harness.engines.request import Held
from harness.explain.meant import Meant, question_of
from harness.files.given import Given
from harness.library import Stance
from harness.programs.states import States
from harness.programs.terms import Vector
from harness.trees.actuators import Driven
from harness.trees.actuators import driven as driven_forces
from harness.trees.mechanism import RobotMechanism, mechanism_of
from harness.trees.robot import Robot, damped_by_ratio, inertia_by_coordinates, read_robot, with_actuators
from harness.truth.compare import Comparison, compare
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import sample
from harness.verdict import AGREEMENT

SEED, STATES = 7, 24
BODIES = """
<body><joint name="a" axis="0 1 0" actuatorfrcrange="-5 5"/><inertial pos=".5 0 0" mass="1" diaginertia=".1 .1 .1"/>
<body pos="1 0 0"><joint name="b" axis="0 1 0" range="-30 40"/><inertial pos=".3 .1 0" mass="2" diaginertia=".1 .12 .1"/>
<site name="s" pos=".2 .1 0" euler="10 20 30"/>
<body pos="0 0 1"><joint name="c" type="ball"/><inertial pos=".3 .1 0" mass="2" diaginertia=".1 .12 .1"/></body></body></body>
<body><freejoint name="f"/><inertial pos=".3 .1 0" mass="2" diaginertia=".1 .12 .1"/></body>"""
TENDON = '<fixed name="t"><joint joint="a" coef="1.5"/><joint joint="b" coef="-2"/></fixed>'
DEFAULTS = '<default class="s"><position kp="12" kv="1.5" forcerange="-3 3" ctrlrange="-1 1"/></default>'
# One of each kind and on each thing that is driven.
EACH = (
    '<position joint="a" kp="7" dampratio="1.3" gear="3"/>',
    '<position tendon="t" kp="7" dampratio="1"/>',
    '<position joint="b" kp="7" kv="2" inheritrange="0.7"/>',
    '<position class="s" joint="b" gear="0.3"/>',
    '<general class="s" joint="b"/>',
    '<velocity class="s" joint="b"/>',
    '<damper class="s" joint="b" ctrlrange="0 1" kv="3"/>',
    '<velocity joint="b" kv="2"/>',
    '<damper joint="b" kv="2" ctrlrange="0 1"/>',
    '<cylinder joint="b" diameter="2" bias="1 2 3"/>',
    '<intvelocity joint="b" kp="4" actrange="-1 1" kv="0.5"/>',
    '<position joint="b" kp="4" timeconst="0.1"/>',
    '<motor jointinparent="c" gear="1 2 3" ctrlrange="-2 1"/>',
    '<motor joint="f" gear="1 2 3 4 5 6"/>',
    '<motor jointinparent="f" gear="1 2 3 4 5 6"/>',
    '<velocity site="s" kv="0.7" gear="1 2 3 0.4 0.5 0.6" forcerange="-1 1"/>',
    '<general joint="a" gaintype="affine" gainprm="1 2 3" biastype="affine" biasprm=".3 .4 -.2" dyntype="filter" dynprm=".3"/>',
    '<motor joint="a" gear="3" armature="0.04" damping="0.2"/>',
    '<position tendon="t" kp="7" dampratio="1" gear="1.5" armature="0.3" damping="0.7" forcerange="-1 1"/>',
    '<motor joint="f"/>',
)


# Of which one joint of three gives the compensation of gravity to actuators, within a range that it reaches.
COMPENSATED = BODIES.replace("<body", '<body gravcomp="0.9"').replace('name="a"', 'name="a" actuatorgravcomp="true"')


def written(folder: Path, *actuators: str, bodies: str = BODIES) -> Path:
    path = folder / "driven.xml"
    path.write_text(
        f"<mujoco><default>{DEFAULTS}</default><worldbody>{bodies}</worldbody><tendon>{TENDON}</tendon>\n<actuator>\n"
        + "\n".join(actuators)
        + "\n</actuator></mujoco>"
    )
    return path


def driven(robot: Robot) -> tuple[Robot, RobotMechanism, States]:
    """The robot with all of its actuators that are read, and states with controls."""
    robot = with_actuators(robot, [one.number for one in robot.actuators if not one.why_not])
    mechanism = mechanism_of(robot)
    states = sample(mechanism, STATES, SEED)
    return robot, mechanism, states if mechanism.actuation is None else mechanism.actuation.controlled(states)


def answered(path: Path, robot: Robot, states: States) -> Array:
    """MuJoCo's accelerations with those actuators alone."""
    model, off = mujoco.MjModel.from_xml_path(str(path)), mujoco.mjtDisableBit
    model.opt.disableflags |= int(off.mjDSBL_CONSTRAINT | off.mjDSBL_CONTACT | off.mjDSBL_AUTORESET | off.mjDSBL_SENSOR)
    model.opt.density = model.opt.viscosity = 0.0
    numbers = [one.number for one in robot.tree.actuators]
    model.actuator_group[:] = 30
    model.actuator_group[numbers], model.opt.disableactuator = 0, 1 << 30
    data, found = mujoco.MjData(model), np.empty_like(states.v)
    for state in range(len(states)):
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = states.q[state], states.v[state], states.tau[state]
        for number in numbers:
            data.ctrl[model.actuator_ctrladr[number]] = states.control[state, number]
            if model.actuator_actadr[number] >= 0:
                data.act[model.actuator_actadr[number]] = states.activation[state, number]
        mujoco.mj_forward(model, data)
        found[state] = data.qacc
    return found


def judged(path: Path, robot: Robot | None = None) -> Comparison:
    own, mechanism, states = driven(robot or read_robot(path))
    return compare(ReferenceKernel(mechanism).evaluate(states), answered(path, own, states), factorises=True)


def worst(compared: Comparison) -> float:
    assert not np.isnan(compared.backward_error).any()
    return float(compared.backward_error.max())


@pytest.mark.parametrize("actuator", EACH)
def test_mujoco_drives_as_it_documents(actuator: str, tmp_path: Path) -> None:
    assert worst(judged(written(tmp_path, actuator))) <= AGREEMENT


def test_all_at_once_reach_their_ranges(tmp_path: Path) -> None:
    path = written(tmp_path, *EACH[:17])
    assert worst(judged(path)) <= AGREEMENT
    _, mechanism, states = driven(read_robot(path))
    assert mechanism.actuation is not None and mechanism.actuation.zones is not None
    parameters = mechanism.parameters_at(states)
    for clamp in mechanism.actuation.zones.clamps:
        assert set(parameters[:, clamp.share].tolist()) == {0.0, 1.0}


def test_actuators_compensate_gravity_within_the_range_of_their_joint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(tmp_path, EACH[0], bodies=COMPENSATED)
    assert worst(judged(path)) <= AGREEMENT
    # Where the range counts less than it carries.
    within = "harness.trees.actuators.driven"
    monkeypatch.setattr(within, lambda nodes, forces, carried: _outside(driven_forces(nodes, forces, 0 * carried), carried))
    assert worst(judged(path)) > 10 * AGREEMENT


def _outside(found: Driven, carried: Vector) -> Driven:
    return replace(found, forces=found.forces + carried)


@pytest.mark.ci
def test_an_engine_is_asked_with_actuators(tmp_path: Path) -> None:
    """With those that are switched on alone, at the controls of the states."""
    path = written(tmp_path, *EACH)
    robot = read_robot(path)
    for numbers in ((), (0, 9, 12), tuple(range(len(EACH)))):
        own = with_actuators(robot, numbers)
        mechanism = mechanism_of(own)
        states = sample(mechanism, STATES, SEED)
        states = states if mechanism.actuation is None else mechanism.actuation.controlled(states)
        truth = ReferenceKernel(mechanism).evaluate(states)
        answers = ask_engine("mujoco", question_of(Meant(own, states, truth), Stance.PLAIN, Held((), (), actuators=numbers)))
        assert worst(compare(truth, answers.of(robot.joints), factorises=True)) <= AGREEMENT


def test_an_engine_that_is_asked_without_actuators_answers_nothing(tmp_path: Path) -> None:
    """Where it is to be driven; an answer without them would be judged as one with them."""
    own, mechanism, states = driven(read_robot(written(tmp_path, EACH[7])))
    found = Meant(own, states, ReferenceKernel(mechanism).evaluate(states))
    asked = question_of(found, Stance.PLAIN, Held((), (), actuators=(0,)))
    answers = ask_engine("pinocchio", asked)
    assert answers.refusal == "the harness does not ask it with actuators" and not answers.accelerations
    assert not ask_engine("pinocchio", replace(asked, request=replace(asked.request, held=None), driving=())).refusal


numbers = st.floats(-20, 20).map(lambda value: round(value, 3))
positive = st.floats(0.01, 20).map(lambda value: round(value, 3))


@st.composite
def actuators(draw: st.DrawFn) -> str:
    """A general actuator, or a servo, with any numbers."""
    target = draw(st.sampled_from(['joint="a"', 'joint="b"', 'tendon="t"', 'site="s"']))
    gear = " ".join(str(draw(numbers)) for _ in range(6))
    low, width = draw(numbers), draw(positive)
    ranges = draw(st.sampled_from(["", f'ctrlrange="{low} {low + width}"', f'forcerange="{low} {low + width}"']))
    if draw(st.booleans()):
        damping = draw(st.sampled_from(["", f'kv="{draw(positive)}"', f'dampratio="{draw(positive)}"']))
        # A force at a site has no length, and a gear of zero no inertia.
        damping = damping if "site" not in target and not gear.startswith(("0.0 ", "-0.0 ")) else ""
        return f'<position {target} gear="{gear}" kp="{draw(positive)}" {damping} {ranges}/>'
    gain, bias = (" ".join(str(draw(numbers)) for _ in range(3)) for _ in range(2))
    kind = draw(st.sampled_from(["fixed", "affine"]))
    dynamics = draw(st.sampled_from(["none", "integrator", "filter", "filterexact"]))
    return f'<general {target} gear="{gear}" gaintype="{kind}" gainprm="{gain}" biastype="affine" biasprm="{bias}" dyntype="{dynamics}" {ranges}/>'  # noqa: E501


@pytest.mark.ci
@settings(max_examples=25, deadline=None)
@given(drawn=st.lists(actuators(), min_size=1, max_size=3))
def test_any_actuators(drawn: list[str], tmp_path_factory: pytest.TempPathFactory) -> None:
    assert worst(judged(written(tmp_path_factory.mktemp("drawn"), *drawn))) <= AGREEMENT


def test_a_force_is_that_of_the_documentation(tmp_path: Path) -> None:
    """clip(kp (clip(u) - g q) - kv g v) g on one hinge of inertia 1, in balls, by hand."""
    path = tmp_path / "one.xml"
    path.write_text(
        '<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="j" axis="0 0 1" armature="0.5" actuatorfrcrange="-4 4"/>'
        '<inertial pos="0 0 0" mass="1" diaginertia=".5 .5 .5"/></body></worldbody><actuator>'
        '<position joint="j" kp="3" kv="0.7" gear="1.1" ctrlrange="-1 1" forcerange="-2.5 4"/>'
        '<motor joint="j" gear="0.3" ctrlrange="-9 9"/></actuator></mujoco>'
    )
    _, mechanism, states = driven(read_robot(path))
    truth = ReferenceKernel(mechanism).evaluate(states)
    kp, kv, gear, motor = (flint.arb(value) for value in (3.0, 0.7, 1.1, 0.3))

    def clip(value: Any, low: float, high: float) -> Any:
        return flint.arb(low) if value < low else flint.arb(high) if value > high else value

    for state in range(len(states)):
        with flint.ctx.workprec(200):
            q, v, tau, u, w = (
                flint.arb(float(one)) for one in (states.q[state, 0], states.v[state, 0], states.tau[state, 0], *states.control[state])
            )
            force = clip(kp * (clip(u, -1, 1) - gear * q) - kv * (gear * v), -2.5, 4)
            total = clip(gear * force + motor * clip(w, -9, 9), -4, 4) + tau
            left = total - flint.arb(truth.high[state, 0]) - flint.arb(truth.low[state, 0])
        assert abs(float(left.mid())) <= 2.0**-90 * max(1.0, abs(float(total.mid())))


def test_a_force_at_its_bound_counts_as_inside(tmp_path: Path) -> None:
    """Half an ulp leads across, so that data roundoff is that of what the force is made of; the force is the bound."""
    path = tmp_path / "one.xml"
    path.write_text(
        '<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="j" axis="0 0 1"/>'
        '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody><actuator>'
        '<position joint="j" kp="1000" forcerange="-1 1"/></actuator></mujoco>'
    )
    _, mechanism, _ = driven(read_robot(path))
    at = States.at([[1.0], [1.0], [1.0]], [[0.0]] * 3, [[0.0]] * 3)
    states = replace(at, control=np.array([[1.001], [math.nextafter(1.001, 2)], [1.1]]), activation=np.zeros((3, 1)))
    truth = ReferenceKernel(mechanism).evaluate(states)
    assert np.abs(truth.high[:, 0] - 1.0).max() <= 1e-12 and truth.high[1:, 0].tolist() == [1.0, 1.0]
    assert min(truth.sensitivity[:2]) > 100 * truth.sensitivity[2]


FAULTS = {
    "gain": (EACH[7], 'kv="2"', 'kv="2.000001"'),
    "bias": (EACH[9], 'bias="1 2 3"', 'bias="1 2 3.00001"'),
    "gear": (EACH[3], 'gear="0.3"', 'gear="0.30001"'),
    "ratio": (EACH[1], 'dampratio="1"', 'dampratio="1.00001"'),
    "range of control": (EACH[8], 'ctrlrange="0 1"', 'ctrlrange="0 1.00001"'),
    "range of force": (EACH[15], 'forcerange="-1 1"', 'forcerange="-1 1.00001"'),
    "armature": (EACH[17], 'armature="0.04"', 'armature="0.0400001"'),
    "armature without its gear": (EACH[17], 'gear="3" armature="0.04"', 'gear="3" armature="0.12"'),
    "damping": (EACH[18], 'damping="0.7"', 'damping="0.7000001"'),
    "frame of the gear": (EACH[12], "jointinparent", "joint"),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_a_planted_fault_is_seen(name: str, tmp_path: Path) -> None:
    actuator, old, new = FAULTS[name]
    assert old in actuator
    right = read_robot(written(tmp_path, actuator))
    assert worst(judged(written(tmp_path, actuator.replace(old, new)), right)) > 10 * AGREEMENT


def test_the_rule_of_damping_ratios_before_3_15_is_seen(tmp_path: Path) -> None:
    """Up to MuJoCo 3.13.0 the damping was 2 z sqrt(k sum_j M_jj / J_j^2), which takes M for the inverse of M^-1."""
    path = written(tmp_path, EACH[1])
    own, _, states = driven(read_robot(path))
    (actuator,) = own.tree.actuators
    sign, damping = actuator.bias[2]
    assert isinstance(damping, Given)
    model = mujoco.MjModel.from_xml_path(str(path))
    data, unit, columns = mujoco.MjData(model), np.eye(model.nv), np.zeros((model.nv, model.nv))
    mujoco.mj_forward(model, data)
    for column, along in zip(columns, unit, strict=True):
        mujoco.mj_mulM(model, data, column, along)
    moment = np.zeros(model.nv)
    moment[:2] = 1.5, -2.0
    of_today = 2 * math.sqrt(7 / (moment @ np.linalg.solve(columns, moment)))
    assert float(damping) == pytest.approx(of_today, rel=1e-12)
    of_old = 2 * math.sqrt(7 * (columns.diagonal()[:2] / moment[:2] ** 2).sum())
    by_coordinates = damped_by_ratio(own.tree, actuator, inertia_by_coordinates).bias[2]
    assert by_coordinates[0] == sign and float(by_coordinates[1]) == pytest.approx(of_old, rel=1e-12)
    old = Given(of_old, damping.place, damping.attribute)
    tree = replace(own.tree, actuators=(replace(actuator, bias=(*actuator.bias[:2], (sign, old))),))
    truth = ReferenceKernel(mechanism_of(replace(own, tree=tree))).evaluate(states)
    assert worst(compare(truth, answered(path, own, states), factorises=True)) > 10 * AGREEMENT


@pytest.mark.parametrize(
    ("actuator", "why"),
    [
        ('<adhesion body="x" ctrlrange="0 1"/>', "is of the kind <adhesion>, which is not read"),
        ('<dcmotor joint="a" motorconst="1"/>', "is of the kind <dcmotor>, which is not read"),
        ('<general joint="a" dyntype="muscle"/>', "has dyntype 'muscle', which is not read"),
        ('<general joint="a" dyntype="filter" actearly="true"/>', "depends on the time step"),
        ('<position joint="c" kp="3"/>', "feels the length of a ball joint"),
        ('<motor site="s" refsite="s"/>', "drives by refsite, which is not read"),
        ('<motor joint="A"/>', 'joint="A"> names nothing in this file'),
        ('<motor joint="a" delay="0.1" nsample="3"/>', "has delay, which is not read"),
        ('<general joint="a" gaintype="muscle"/>', "has gaintype 'muscle' and biastype 'none', which are not read"),
        ('<position joint="a" kp="-3" dampratio="1"/>', "has a damping ratio beside a negative stiffness"),
        ('<position joint="a" inheritrange="1"/>', "has inheritrange, and drives no joint with a range"),
        ('<motor class="m" joint="a"/>', "takes defaults of <muscle>, which is not read"),
        ('<motor tendon="w"/>', "which is not of hinges and slides"),
        ('<motor tendon="l"/>', "whose actuatorfrcrange is not read"),
        ('<motor joint="a" group="3"/>', "is switched off in the file"),
    ],
)  # fmt: skip
def test_what_is_not_read_is_told_with_its_line(actuator: str, why: str, tmp_path: Path) -> None:
    path = written(tmp_path, actuator)
    further = (
        '<fixed name="w"><joint joint="c" coef="1"/></fixed><fixed name="l" actuatorfrcrange="-1 1"><joint joint="b" coef="1"/></fixed>'
    )
    text = path.read_text().replace("</tendon>", f"{further}</tendon>").replace("<mujoco>", '<mujoco><option actuatorgroupdisable="1 3"/>')
    path.write_text(text.replace("</default></default>", '</default><default class="m"><muscle/></default></default>'))
    (found,) = read_robot(path).actuators
    assert why in found.why_not and found.line == 8
