"""Actuators of the catalogue against their closed forms, what declares them, and planted faults in their models."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import flint
import numpy as np
import pytest
import sympy as sp
from catalogue import BUILT_IN, CALLED_HERE, SYSTEM_FEATURES
from sympy.physics.mechanics import dynamicsymbols
from wrong_numbers import assert_red_and_named, with_change

import harness
from harness import TIME, Actuator, System
from harness.crosscheck.assignment import Assignment, load_audited
from harness.diagnosis.faults.bench import FaultBench
from harness.engines import Subject
from harness.errors import InvalidModel
from harness.lagrange.derivation import load_mechanism
from harness.programs.mechanisms.driven import driven
from harness.programs.mechanisms.mechanism import Mechanism, controls_of, smooth
from harness.programs.states import States
from harness.truth.quantities.accelerations import AccelerationTruth
from harness.truth.sampling import sample

EQUATIONS, MUJOCO = Subject("lagrange", "equations"), Subject("mujoco", "mjcf")
# Certified values are known to twice float64's digits.
EXACT = 1e-28


def truth_of(name: str, subject: Subject = EQUATIONS) -> AccelerationTruth:
    found = Assignment.of(BUILT_IN, name, subject).truth
    assert isinstance(found, AccelerationTruth)
    return found


def test_the_geared_motor_moves_as_its_closed_form() -> None:
    """(I_G + m r_G^2 + n^2 J) theta'' = n tau_m - n^2 b theta' - m g r_G sin theta + tau, with tau_m at 0.3 N m at most."""
    states = States.at(
        [[0.3], [-1.2], [2.0], [0.0]], [[0.5], [0.0], [-3.0], [0.0]], [[0.0], [2.0], [-7.0], [0.0]], control=[[0.1], [5.0], [-0.31], [0.3]]
    )
    held = [0.1, 0.3, -0.3, 0.3]
    found, ball = truth_of("geared_motor").evaluate(states), flint.arb
    values = {name: ball(value) for name, value, _ in load_mechanism(BUILT_IN, "geared_motor").parameters}
    m, r, inertia, rotor, n, b, g = (values[name] for name in ("m", "r_G", "I_G", "J", "n", "b", "g"))
    assert found.certified.all()
    with flint.ctx.workprec(200):
        for row, motor in enumerate(held):
            theta, rate, tau = (ball(float(part[row, 0])) for part in (states.q, states.v, states.tau))
            wanted = (n * ball(motor) - n**2 * b * rate - m * g * r * theta.sin() + tau) / (inertia + m * r**2 + n**2 * rotor)
            error = ball(float(found.high[row, 0])) + ball(float(found.low[row, 0])) - wanted
            assert abs(float(error)) <= EXACT * max(1.0, abs(float(wanted)))


def test_the_servos_are_linear_within_their_ranges_and_saturated_beyond() -> None:
    """M qdd + h is (k_p (u - q1) - k_d q1', k_v (w - q2')), with u in -1 to 0.9, w in -4 to 3, and torques of -40 to 50 and -6 to 5 N m."""
    q, v, u = (
        np.array([[0.2, 0.5], [1.0, 0.5], [0.2, -0.4]]),
        np.array([[0.5, 1.0], [2.0, 1.0], [0.0, -1.0]]),
        [[0.4, 2.0], [-3.0, 9.0], [2.0, -9.0]],
    )
    torques = np.array(
        [[60 * (0.4 - 0.2) - 4 * 0.5, 1.5 * (2.0 - 1.0)], [-40.0, 1.5 * (3.0 - 1.0)], [60 * (0.9 - 0.2), 1.5 * (-4.0 + 1.0)]]
    )
    arm = harness.load("servo_arm")
    driven, free = arm.accelerations(q, v, control=u).value, arm.accelerations(q, v, control=np.zeros((3, 2))).value
    of_rest = np.array([[60 * (0 - 0.2) - 4 * 0.5, -1.5], [-40.0, -1.5], [60 * (0 - 0.2), 1.5]])
    moved = np.einsum("nij,nj->ni", arm.mass_matrix(q).value, driven - free)
    assert np.abs(moved - (torques - of_rest)).max() < 1e-12


def test_the_tendon_pulls_by_its_moment_arms_and_never_pushes() -> None:
    q, v = np.tile([0.4, 0.7], (4, 1)), np.tile([1.0, -2.0], (4, 1))
    finger = harness.load("tendon_finger")
    found = finger.accelerations(q, v, control=[[0.0], [5.0], [-3.0], [50.0]]).value
    pulled = np.einsum("nij,nj->ni", finger.mass_matrix(q).value, found - found[0])
    assert np.abs(pulled - np.array([[0.0], [5.0], [0.0], [20.0]]) * [0.012, 0.008]).max() < 1e-14


DRIVEN = [name for name in BUILT_IN.system_names() if "System actuators" in SYSTEM_FEATURES[name]]


def test_the_forces_of_a_text_are_those_of_its_file() -> None:
    """The law of files, which was read off MuJoCo's documentation, has the same accelerations at all controls."""
    from harness.trees.mechanism import mechanism_of
    from harness.trees.robot import read_robot, with_actuators
    from harness.truth.reference import ReferenceKernel

    for name in DRIVEN:
        robot = read_robot(BUILT_IN.model_path(name, "mjcf"))
        of_file = ReferenceKernel(mechanism_of(with_actuators(robot, range(len(robot.actuators)))))
        states = sample(load_mechanism(BUILT_IN, name), 64, 3)
        own, found = truth_of(name).evaluate(states), of_file.evaluate(states)
        assert found.certified.all() and own.certified.all()
        assert (own.lengths(found.high - own.high) <= 4 * own.data_roundoff).all()


def test_states_have_controls_within_their_ranges_and_beyond() -> None:
    for name in DRIVEN:
        mechanism = load_mechanism(BUILT_IN, name)
        states, ranges = sample(mechanism, 256, 1), driven(mechanism).actuation.control_ranges
        assert states.control.shape == (256, controls_of(mechanism))
        for number, bounds in ranges:
            low, high = bounds
            own = states.control[:, number]
            assert all(count > 16 for count in ((own < low).sum(), ((own > low) & (own < high)).sum(), (own > high).sum()))


FAULTS = {
    "gear": ("geared_motor", 'gear="50"', 'gear="49.9"', "50"),
    "rotor": ("geared_motor", 'armature="0.5"', 'armature="0.49"', "0.5"),
    "control range": ("geared_motor", 'ctrlrange="-0.3 0.3"', 'ctrlrange="-0.3 0.31"', "-0.3 0.3"),
    "gain": ("servo_arm", 'kp="60"', 'kp="60.1"', "60"),
    "damping": ("servo_arm", 'kv="4"', 'kv="4.01"', "4"),
    "force range": ("servo_arm", 'forcerange="-6 5"', 'forcerange="-6 5.1"', "-6 5"),
    "moment arm": ("tendon_finger", 'coef="0.012"', 'coef="0.0121"', "0.012"),
}


@pytest.mark.ci
@pytest.mark.parametrize("name", FAULTS)
def test_a_wrong_number_of_an_actuator_is_red_and_named(name: str) -> None:
    system, old, new, value = FAULTS[name]
    assert_red_and_named(with_change(system, MUJOCO, old, new), 64, old.split("=")[0], value)


def test_faults_are_planted_in_a_model_with_actuators() -> None:
    bench = FaultBench(CALLED_HERE, "geared_motor", "mjcf", 16, 0)
    assert {str(one.subject) for one in bench.readers} == {"mujoco/mjcf", "pinocchio/mjcf"} and bench.others["lagrange"] == "agrees"
    found = bench.ask(bench.model.text.replace('gear="50"', 'gear="50.001"'))
    assert found.verdicts == {"mujoco/mjcf": "disagrees", "pinocchio/mjcf": "agrees"}


@pytest.mark.parametrize("subject", [Subject("pinocchio", "mjcf"), Subject("pinocchio", "urdf"), Subject("mujoco", "urdf")])
def test_who_drives_nothing_is_right_about_the_mechanism_without_actuators(subject: Subject) -> None:
    for name in DRIVEN:
        assignment = Assignment.of(CALLED_HERE, name, subject)
        verdicts = assignment.judge(sample(assignment.mechanism, 32, 2)).verdicts.tolist()
        assert "explained" in verdicts and set(verdicts) <= {"explained", "agrees"}


def test_other_quantities_are_asked_without_actuators() -> None:
    for name in DRIVEN:
        for quantity in ("inverse_dynamics", "mass_matrix", "bias"):
            assignment = Assignment.of(CALLED_HERE, name, MUJOCO).about(quantity)
            states = sample(assignment.mechanism, 4, 0)
            assert set(assignment.judge(states).verdicts.tolist()) == {"agrees"} and not states.control.size


def test_a_mechanism_with_actuators_is_kept_as_plain_data() -> None:
    for name in DRIVEN:
        mechanism = load_mechanism(BUILT_IN, name)
        again = Mechanism.from_json(mechanism.to_json())
        assert again == mechanism and again.key == mechanism.key != smooth(mechanism).key


def test_python_and_show_have_actuators() -> None:
    motor = harness.load("geared_motor")
    free, pulled, more = (motor.accelerations([0.0], [0.0], control=one).value[0, 0] for one in (None, [0.3], [9.0]))
    assert free == 0 and pulled == more > 10
    assert motor.compare([0.0], [0.0], [pulled], control=[1.0]).verdicts.tolist() == ["agrees"]
    assert "actuator motor" in str(motor)
    with pytest.raises(ValueError, match="geared_motor has 1 actuators"):
        motor.accelerations([0.0], [0.0], control=[0.1, 0.2])


def test_a_file_has_the_actuators_of_its_system_and_no_other() -> None:
    with pytest.raises(InvalidModel, match="has no actuator 'motor', which the system needs"):
        load_audited(with_change("geared_motor", MUJOCO, 'name="motor"', 'name="engine"'))
    without = Assignment.of(CALLED_HERE, "bar_pendulum", MUJOCO)
    assert without.model is not None
    text = without.model.text.replace(' actuation="disable"', "")
    text = text.replace("</worldbody>", '</worldbody><actuator><motor name="more" joint="pin"/></actuator>')
    with pytest.raises(InvalidModel, match="actuator 'more' is none that the system has"):
        load_audited(replace(without, model=without.model.with_text(text)))
    for old, new, problem in (
        ('sensor="disable"', 'sensor="disable" actuation="disable"', "is switched off"),
        ('joint="shaft" gear', 'joint="shift" gear', "shift"),
    ):
        with pytest.raises(InvalidModel, match=problem):
            with_change("geared_motor", MUJOCO, old, new)


x, y = dynamicsymbols("x y")
m, f, low, high, u = sp.symbols("m f low high u")
SOUND: dict[str, Any] = {"control": u, "force": f * u, "moments": {x: 1}, "control_range": (low, high)}
DECLARED: dict[str, tuple[dict[str, Any], str]] = {
    "no coordinate": ({"moments": {y: 1}}, r"'drive' acts on y\(t\), which is no coordinate"),
    "nothing": ({"moments": {}}, "acts on nothing"),
    "no value": ({"force": u * sp.Symbol("k")}, "contains k, which has no value"),
    "no control": ({"force": f}, "linear in its control u"),
    "square": ({"force": f * u**2}, "linear in its control u"),
    "control that is a parameter": ({"control": m, "force": m}, "has the control m"),
    "range swapped": ({"control_range": (high, low)}, "has the range 2 to -1"),
    "time": ({"force": u + f * TIME}, "depends on time explicitly"),
    "acceleration": ({"force": u + f * x.diff(TIME, 2)}, "first rates"),
}


@pytest.mark.parametrize("name", DECLARED)
def test_a_declaration_that_contradicts_itself_says_where(name: str) -> None:
    declared, problem = DECLARED[name]
    with pytest.raises(ValueError, match=problem):
        System(
            coordinates={x: "slide"},
            kinetic=m * x.diff(TIME) ** 2 / 2,
            potential=f * x,
            parameters={m: (1.0, "kg"), f: (3.0, "N"), low: (-1.0, ""), high: (2.0, "")},
            total_mass=m,
            ranges={x: (-1.0, 2.0)},
            actuators={"drive": Actuator(**{**SOUND, **declared})},
        )
