"""Dry friction and stops of the catalogue against their closed forms, what declares them, and planted faults in their models."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import flint
import numpy as np
import pytest
import sympy as sp
from catalogue import BUILT_IN, CALLED_HERE
from sympy.physics.mechanics import dynamicsymbols
from wrong_numbers import assert_red_and_named, with_change

import harness
from harness import TIME, System
from harness.arrays import Array
from harness.crosscheck.assignment import Assignment, load_audited
from harness.diagnosis.faults.bench import FaultBench
from harness.engines import Subject
from harness.errors import InvalidModel
from harness.files.model_file import parse_model, read_model
from harness.lagrange.derivation import load_mechanism
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.truth.compare import compare
from harness.truth.quantities.accelerations import AccelerationTruth
from harness.truth.sampling import sample
from harness.verdict import AGREEMENT

MUJOCO, PINOCCHIO = Subject("mujoco", "mjcf"), Subject("pinocchio", "urdf")
# Certified values are known to twice float64's digits.
EXACT = 1e-28


def truth_of_equations(name: str) -> AccelerationTruth:
    found = Assignment.of(BUILT_IN, name, Subject("lagrange", "equations")).truth
    assert isinstance(found, AccelerationTruth)
    return found


@pytest.mark.parametrize("model_format", ["mjcf", "urdf"])
def test_a_solver_that_goes_to_the_end_does_not_drift_from_there(model_format: str) -> None:
    """At a tolerance of 0 Newton's method of MuJoCo 4.0.0 goes on at the optimum, here by an ulp in each iteration the same way."""
    assignment = Assignment.of(BUILT_IN, "dry_pendulum", Subject("mujoco", model_format))
    states = States.at(*([float.fromhex(one)] for one in ("0x1.8a8e0ea2dde80p-6", "-0x1.cc54ee8p-2", "0x1.3a261d478p+3")))
    compared = assignment.judge(states, assignment.truth.evaluate(states))
    assert compared.backward_error.max() < AGREEMENT / 4


def torque(mechanism: Mechanism, state: States) -> tuple[flint.arb, flint.arb]:
    """The smooth torque on the bar and its inertia, by the text's formula."""
    I_O, m, r_G, c, g = (flint.arb({name: value for name, value, _ in mechanism.parameters}[key]) for key in ("I_O", "m", "r_G", "c", "g"))
    theta, rate, applied = (flint.arb(float(part[0, 0])) for part in (state.q, state.v, state.tau))
    return applied - c * rate - m * g * r_G * theta.sin(), I_O


def holds(name: str, states: States, force: Array) -> None:
    """I theta'' is the smooth torque and ``force``, (n,), NaN where it is what leaves no acceleration."""
    truth, mechanism = truth_of_equations(name), load_mechanism(BUILT_IN, name)
    found = truth.evaluate(states)
    assert found.certified.all()
    with flint.ctx.workprec(200):
        for number in range(len(states)):
            smooth, inertia = torque(mechanism, states[[number]])
            wanted = flint.arb(0) if math.isnan(force[number]) else (smooth + flint.arb(float(force[number]))) / inertia
            error = flint.arb(float(found.high[number, 0])) + flint.arb(float(found.low[number, 0])) - wanted
            assert abs(float(error)) <= EXACT * max(1.0, abs(float(wanted)))


def test_the_dry_pendulum_sticks_up_to_its_friction_and_slides_against_its_rate() -> None:
    """At rest it stays while |tau - m g r sin theta| <= tau_c, with m g r = 14.715 N m and tau_c = 6.5 N m: up to 0.4575 rad."""
    angles = np.array([0.0, 0.3, 0.457, -0.457, 0.458, -0.458, 1.5, 3.0, 0.2, 0.2, 0.2])
    rates = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1e-9, -3.0, 0.0])
    applied = np.array([6.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -9.0])
    stays = math.nan
    force = np.array([stays, stays, stays, stays, 6.5, -6.5, 6.5, stays, -6.5, 6.5, 6.5])
    holds("dry_pendulum", States.at(*(part[:, None] for part in (angles, rates, applied))), force)


def test_the_limited_pendulum_is_free_between_its_stops_and_is_kept_by_the_lower_one() -> None:
    angles, rates, applied = np.array(
        [[0.5, 1.0, -2.0], [1.1, 0.0, 40.0], [0.0, 0.0, -3.0], [0.0, 0.0, 3.0], [0.0, 2.0, -3.0], [0.0, -1e-3, -3.0]]
    ).T
    stays = math.nan
    holds(
        "limited_pendulum", States.at(*(part[:, None] for part in (angles, rates, applied))), np.array([0.0, 0.0, stays, 0.0, 0.0, stays])
    )


def test_where_half_an_ulp_of_an_angle_decides_whether_a_stop_pushes_nothing_is_certain() -> None:
    found = truth_of_equations("limited_pendulum").evaluate(States.at([[1.2], [1.2]], [[0.0], [0.0]], [[40.0], [-40.0]]))
    assert found.certified.tolist() == [False, True]


FAULTS = {
    "friction": ("dry_pendulum", MUJOCO, 'frictionloss="6.5"', 'frictionloss="6.4"', "6.5"),
    "friction of a URDF": ("dry_pendulum", Subject("mujoco", "urdf"), 'friction="6.5"', 'friction="6.6"', "6.5"),
    "stop": ("limited_pendulum", MUJOCO, 'range="0 1.2"', 'range="0 1.201"', '"0 1.2"'),
    # Within a step of its derivative some states reach it on one side alone.
    "stop near states": ("limited_pendulum", MUJOCO, 'range="0 1.2"', 'range="0 1.200012"', '"0 1.2"'),
}


@pytest.mark.ci
@pytest.mark.parametrize("name", FAULTS)
def test_a_wrong_number_of_friction_or_of_a_stop_is_red_and_named(name: str) -> None:
    system, subject, old, new, value = FAULTS[name]
    assert_red_and_named(with_change(system, subject, old, new), 32, old.split("=")[0], value)


def test_faults_are_planted_in_a_model_with_dry_friction() -> None:
    bench = FaultBench(CALLED_HERE, "dry_pendulum", "mjcf", 8, 0)
    assert {str(one.subject) for one in bench.readers} == {"mujoco/mjcf", "pinocchio/mjcf"} and bench.others["lagrange"] == "agrees"
    found = bench.ask(bench.model.text.replace('frictionloss="6.5"', 'frictionloss="6.4"'))
    assert found.verdicts == {"mujoco/mjcf": "disagrees", "pinocchio/mjcf": "agrees"}


def test_python_and_show_have_dry_friction_and_limits() -> None:
    dry, limited = harness.load("dry_pendulum"), harness.load("limited_pendulum")
    assert abs(dry.accelerations([0.1], [0.0]).value[0, 0]) < EXACT and dry.accelerations([0.1], [1.0]).value[0, 0] < -4
    assert abs(limited.accelerations([0.0], [0.0], [-1.0]).value[0, 0]) < EXACT
    assert dry.compare([0.1], [0.0], [0.0]).verdicts.tolist() == ["agrees"]
    assert "dry friction of joint pin" in str(dry) and "upper limit of joint pin" in str(limited)


def test_what_an_engine_applies_none_of_is_explained_by_what_it_documents() -> None:
    for name in ("dry_pendulum", "limited_pendulum"):
        assignment = Assignment.of(CALLED_HERE, name, PINOCCHIO)
        rest = States.at([[0.0]], [[0.0]], [[-3.0]])
        assert assignment.judge(rest).verdicts.tolist() == ["explained"]
        free = States.at([[0.5]], [[0.0]], [[20.0]])
        assert assignment.judge(free).verdicts.tolist() == ["explained" if name == "dry_pendulum" else "agrees"]
        wrong = with_change(name, PINOCCHIO, 'mass value="2"', 'mass value="2.00001"')
        model = wrong.model
        assert model is not None
        loaded = load_audited(replace(wrong, mechanism=replace(wrong.mechanism, total_mass=2.00001)))
        truth = assignment.truth
        assert truth.judge(truth.evaluate(free), free, truth.answers(loaded, free), loaded).verdicts.tolist() == ["disagrees"]


def test_other_quantities_are_asked_of_the_smooth_mechanism() -> None:
    for quantity in ("inverse_dynamics", "mass_matrix", "bias"):
        assignment = Assignment.of(CALLED_HERE, "dry_pendulum", MUJOCO).about(quantity)
        states = sample(assignment.mechanism, 4, 0)
        assert set(assignment.judge(states).verdicts.tolist()) == {"agrees"}
    assert load_audited(assignment).forward_dynamics(*([[0.2]] for _ in range(3)))[0, 0] != 0


def test_a_file_has_the_friction_and_the_limits_of_its_system_and_no_other() -> None:
    for name, subject, old, new, problem in (
        ("dry_pendulum", PINOCCHIO, ' friction="6.5"', "", "has no dry friction of joint pin"),
        (
            "bar_pendulum",
            MUJOCO,
            'damping="0.3"',
            'damping="0.3" frictionloss="1"',
            "dry friction of joint pin is none that the system has",
        ),
        ("limited_pendulum", PINOCCHIO, ' lower="0" upper="1.2"', "", "has no lower limit of joint pin"),
        ("bar_pendulum", MUJOCO, 'damping="0.3"', 'damping="0.3" range="0 1"', "lower limit of joint pin is none that the system has"),
    ):
        with pytest.raises(InvalidModel, match=problem):
            load_audited(with_change(name, subject, old, new))


def test_without_a_mechanism_that_has_them_friction_and_limits_of_a_file_do_not_act() -> None:
    path = BUILT_IN.model_path("dry_pendulum", "mjcf")
    file = read_model(path, "mjcf")
    assert [one.name for one in file.bounded] == ["dry friction of joint pin"] and file.acting == ()
    assert parse_model(Path("x.xml"), file.text, "mjcf").acting == ()


x, y = dynamicsymbols("x y")
m, f, low, high = sp.symbols("m f low high")
DECLARED = {
    "no coordinate": ({"dry_friction": {y: f}}, r"y\(t\), which is no coordinate"),
    "no value": ({"dry_friction": {x: sp.Symbol("k")}}, "k bounds a force or a position, and has no value"),
    "no friction": ({"dry_friction": {x: low}}, "dry friction of x.* is -1; expected one above zero"),
    "limits swapped": ({"limits": {x: (high, low)}}, "are 2 and -1; expected the lowest first"),
    "no mapping": ({"limits": (low, high)}, "expected a mapping"),
}


@pytest.mark.parametrize("name", DECLARED)
def test_a_declaration_that_contradicts_itself_says_where(name: str) -> None:
    declared, problem = DECLARED[name]
    used = {"dry_friction": {x: f}, "limits": {x: (low, high)}}
    with pytest.raises(ValueError, match=problem):
        System(
            coordinates={x: "slide"},
            kinetic=m * x.diff(TIME) ** 2 / 2,
            potential=f * x,
            parameters={m: (1.0, "kg"), f: (3.0, "N"), low: (-1.0, "m"), high: (2.0, "m")},
            total_mass=m,
            ranges={x: (-1.0, 2.0)},
            **{**used, **declared},  # type: ignore[arg-type]
        )


def test_rigid_friction_and_soft_friction_differ_at_rest_alone() -> None:
    """Where it slides MuJoCo's friction is its bound, as Coulomb's; where it sticks it creeps."""
    rigid, soft = truth_of_equations("dry_pendulum"), Assignment.of(BUILT_IN, "dry_pendulum", MUJOCO).truth
    states = States.at([[0.2], [0.2]], [[1.0], [0.0]], [[0.0], [0.0]])
    found, of_rigid = soft.evaluate(states), rigid.evaluate(states)
    assert compare(of_rigid[[0]], found.high[[0]]).verdicts.tolist() == ["agrees"]
    assert abs(of_rigid.high[1, 0]) < EXACT and 0.01 < abs(found.high[1, 0]) < 1
